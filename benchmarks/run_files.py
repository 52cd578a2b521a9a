"""Where things lie in the folder of a benchmark run, beside ``results.csv`` and ``config.toml``.

``steps/<scenario>/<sensor>/<estimator>-<seed>.csv`` holds every answer of a run with the truth, and
``replay/<scenario>/`` what the report shows of the first drive of a scenario (``benchmarks.replay``).
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import PurePosixPath


@dataclass(frozen=True)
class Kept:
    """A file of a run that is to be written: its path in the run's folder, and its text."""

    path: PurePosixPath
    text: str


def steps_path(scenario: str, sensor: str, estimator: str, seed: int) -> PurePosixPath:
    """Of a run's answers."""
    return PurePosixPath("steps", scenario, sensor, f"{estimator}-{seed}.csv")


def drive_path(scenario: str) -> PurePosixPath:
    """Of the drive that is shown of a scenario."""
    return PurePosixPath("replay", scenario, "drive.json")


def looks_path(scenario: str, sensor: str) -> PurePosixPath:
    """Of what a sensor saw on that drive."""
    return PurePosixPath("replay", scenario, "looks", f"{sensor}.json")


def answers_path(scenario: str, sensor: str, estimator: str) -> PurePosixPath:
    """Of what a pair answered on that drive."""
    return PurePosixPath("replay", scenario, "answers", sensor, f"{estimator}.json")
