"""What the report draws of the answers of each run: how far off they were, and how sure."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from benchmarks.results import OK, Row
from benchmarks.run_files import steps_path
from benchmarks.spread import Group
from topoloc.errors import InputError
from topoloc.geometry import Floats
from topoloc.steps import Steps, read_steps


@dataclass(frozen=True)
class Answers:
    """One run's.

    Attributes:
        errors: (N,) distance from estimated to true position at each frame [m].
        probability, right: (U,) of the updates that name a node: what was stated, and whether the node was right.
    """

    errors: Floats
    probability: Floats
    right: NDArray[np.bool_]

    @classmethod
    def of(cls, steps: Steps) -> Answers:
        """From the rows of a run's steps file."""
        named = steps.updated & (steps.nodes != "")
        errors = np.linalg.norm(steps.poses[:, :2] - steps.truth[:, :2], axis=1)
        return cls(errors, steps.probability[named], steps.right[named])


def read_answers(folder: Path, rows: Iterable[Row]) -> tuple[dict[Group, list[Answers]], tuple[str, ...]]:
    """Those of the runs that came to an end, and why some of these could not be read, a line for each."""
    found: dict[Group, list[Answers]] = {}
    problems = []
    for row in rows:
        if row.status != OK:
            continue
        path = steps_path(*row.key)
        try:
            answers = Answers.of(read_steps(folder / path))
        except InputError as error:
            problems.append(f"{path}: {error.problem}")
        else:
            found.setdefault((row.scenario, row.sensor, row.estimator), []).append(answers)
    return found, tuple(problems)
