"""What a live run leaves behind: the files of ``topoloc localize``, but for the picture."""

from __future__ import annotations

import csv
from contextlib import ExitStack, suppress
from pathlib import Path
from typing import TextIO

import numpy as np

from topoloc.errors import UserError
from topoloc.files import new_folder, reason
from topoloc.live.report import LiveReport
from topoloc.localizer import Step
from topoloc.steps import STEP_COLUMNS, step_cells
from topoloc.topo_map import TopoMap

OUTPUTS = ("trajectory.txt", "steps.csv")
TRACK_HEADER = "# timestamp tx ty tz qx qy qz qw\n"


class RunLog:
    """Writes each step down as it comes, into a folder beside the one to make; ``close`` gives it its name.

    A run that is killed leaves that folder, ``.NAME.xxxxxxxx``, with every step until then. Reports of silence leave
    nothing. After a clock was set back the times begin again, which a TUM trajectory does not allow but tools bear.

    Args:
        folder: to make: ``trajectory.txt`` and ``steps.csv``; nothing is there before the first step.
        overwrite: replace the files of an earlier log.
        topo_map: whose nodes are named.
    """

    def __init__(self, folder: Path, overwrite: bool, topo_map: TopoMap) -> None:
        self.folder, self._overwrite, self._map = folder, overwrite, topo_map
        self._open_folder = ExitStack()
        self._files: list[TextIO] = []
        self._problem = ""

    def add(self, report: LiveReport) -> None:
        """Write down what a report says of a picture. A disk that is full ends the log, not the robot's run.

        Raises:
            UserError: the folder cannot be made.
        """
        if report.step is None or self._problem:
            return
        self._open()
        track, steps = self._files
        try:
            track.write(_track_line(report.step))
            csv.writer(steps, lineterminator="\n").writerow(step_cells(self._map, report.step))
            track.flush()
            steps.flush()
        except OSError as error:
            self._problem = f"the log ends at {report.timestamp:.3f} s ({reason(error)}); free some room"

    def close(self) -> None:
        """Finish the files, and give the folder its name.

        Raises:
            UserError: the folder cannot be made, or not all could be written.
        """
        self._open()
        for file in self._files:
            with suppress(*[OSError] if self._problem else []):
                file.close()
        self._open_folder.close()
        if self._problem:
            raise UserError(f"{self.folder}: {self._problem}")

    def _open(self) -> None:
        if self._files:
            return
        made = self._open_folder.enter_context(new_folder(self.folder, self._overwrite, owned=OUTPUTS))
        self._files = [(made / name).open("w", encoding="utf-8", newline="") for name in OUTPUTS]
        self._files[0].write(TRACK_HEADER)
        csv.writer(self._files[1], lineterminator="\n").writerow(STEP_COLUMNS)


def _track_line(step: Step) -> str:
    """As ``topoloc.recording.write_track`` writes it."""
    x, y, theta = step.estimate.pose
    return f"{step.timestamp:.6f} {x:.6f} {y:.6f} 0 0 0 {np.sin(theta / 2):.9f} {np.cos(theta / 2):.9f}\n"
