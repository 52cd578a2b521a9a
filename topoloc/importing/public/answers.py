"""A run held against the pictures of the recording that was localized."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.map_folder import number, rows_of
from topoloc.recording import Recording

SAME_S = 1e-3
"""A step, a label and a picture belong together within this [s]."""
COLUMNS = ("timestamp", "x", "y", "heading_deg", "node")
AGAIN = "name the run of this recording, or run 'topoloc localize' again"


@dataclass(frozen=True)
class Answers:
    """What a run says of each picture of a recording.

    Attributes:
        path: of its ``steps.csv``.
        recording: that was localized.
        steps: one for each picture of the recording: the line in the file and its columns; None where it has no step.
    """

    path: Path
    recording: Recording
    steps: Sequence[tuple[int, Mapping[str, str]] | None]

    @classmethod
    def read(cls, path: Path, recording: Path) -> Answers:
        """A ``steps.csv`` of ``topoloc localize`` or of a benchmark.

        Raises:
            InputError: a file cannot be read, there is no step, or a step is at no picture's time.
        """
        drive = Recording.load(recording)
        times = np.array([picture.time for picture in drive.pictures[drive.kind]])
        found: list[tuple[int, Mapping[str, str]] | None] = [None] * len(times)
        strays, steps = 0, 0
        for line, row in rows_of(path, COLUMNS, AGAIN):
            apart = np.abs(times - number(row["timestamp"], "timestamp", path, line))
            steps += 1
            if apart.min() > SAME_S:
                strays += 1
            else:
                found[int(apart.argmin())] = line, row
        if strays or not steps:
            listed = recording / f"{drive.kind}.txt"
            problem = f"{strays} of {steps} steps are at no time of {listed}" if steps else "holds no steps"
            raise InputError(path, problem, AGAIN)
        return cls(path, drive, found)

    @property
    def missing(self) -> int:
        """Pictures without a step."""
        return sum(step is None for step in self.steps)
