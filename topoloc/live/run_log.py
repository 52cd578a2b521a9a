"""What a live run leaves behind: the files of ``topoloc localize``, but for the picture."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np

from topoloc.files import new_folder
from topoloc.live.report import LiveReport
from topoloc.localizer import Step
from topoloc.recording import write_track
from topoloc.steps import write_steps
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence

OUTPUTS = ("trajectory.txt", "steps.csv")


class RunLog:
    """Remembers each step, about 2 kB of it; reports of silence leave none."""

    def __init__(self, topo_map: TopoMap) -> None:
        self._map = topo_map
        self._steps: list[Step] = []

    def add(self, report: LiveReport) -> None:
        """Remember what a report says of a picture."""
        if report.step is not None:
            self._steps.append(_slim(report.step))

    def write(self, folder: Path, overwrite: bool) -> None:
        """Write ``trajectory.txt`` and ``steps.csv`` into a folder, whole or not at all.

        After a clock was set back the times begin again, which a TUM trajectory does not allow but tools bear.

        Raises:
            UserError: the folder holds something, or cannot be written.
        """
        with new_folder(folder, overwrite, owned=OUTPUTS) as made:
            poses = np.array([step.estimate.pose for step in self._steps]).reshape(-1, 3)
            write_track(made / OUTPUTS[0], [step.timestamp for step in self._steps], poses)
            write_steps(made / OUTPUTS[1], self._map, self._steps)


def _slim(step: Step) -> Step:
    """A step with no more evidence than is written of it: that at the estimated node. A day has a million steps."""
    evidence, node = step.evidence, step.estimate.node
    if evidence is None or node is None:
        return replace(step, evidence=None)
    here = evidence.nodes == node
    parts = {item.name: getattr(evidence, item.name)[here] for item in fields(Evidence) if item.name != "log_floor"}
    return replace(step, evidence=Evidence(**parts, log_floor=evidence.log_floor))
