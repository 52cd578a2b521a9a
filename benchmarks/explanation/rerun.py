"""One run of a benchmark done again, up to the frame that is asked about."""

from __future__ import annotations

import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from benchmarks.drives import ESTIMATOR_STREAM, one_thread
from benchmarks.results import OK, Key, read_results
from benchmarks.run_files import steps_path
from benchmarks.runner import Suite
from benchmarks.scenarios import Case
from topoloc.cli.progress import track
from topoloc.errors import UnknownName, UserError
from topoloc.geometry import wrap
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import Localizer, Step
from topoloc.steps import Steps, read_steps

SAME_M, SAME_DEG, SAME_PROBABILITY = 0.001, 0.1, 0.001
"""Two answers that differ by no more are the same: ``steps.csv`` is rounded, and so are sums, on another machine."""

Part = TypeVar("Part", str, int)


@dataclass(frozen=True)
class Rerun:
    """A run up to one frame, and what it was made with.

    Attributes:
        key: scenario, sensor, estimator, seed.
        recorded: the drive is a recording, not simulated.
        case: the drive, whole.
        steps: of the frames up to the one that is asked about.
        sensor, estimator: as they are after the last of the steps.
    """

    key: Key
    recorded: bool
    case: Case
    steps: list[Step]
    sensor: Sensor
    estimator: Estimator

    @property
    def number(self) -> int:
        """Of the frame that is asked about, from 0."""
        return len(self.steps) - 1


def choose_key(suite: Suite, scenario: str | None, sensor: str | None, estimator: str | None, seed: int | None) -> Key:
    """Which of a suite's runs is meant; what is not named is the suite's first.

    Raises:
        UnknownName: the suite has no such scenario, sensor, estimator or seed.
    """
    return (
        _part("scenario", scenario, [one.name for one in suite.scenarios]),
        _part("sensor", sensor, list(suite.sensors)),
        _part("estimator", estimator, list(suite.estimators)),
        _part("seed", seed, suite.seeds),
    )


def _part(what: str, wanted: Part | None, known: Sequence[Part]) -> Part:
    if wanted is None:
        return known[0]
    if wanted not in known:
        raise UnknownName(f"{what} of this run", str(wanted), [str(one) for one in known])
    return wanted


def refuse_without_result(folder: Path, key: Key) -> None:
    """Raise ``UserError``, with the reason, for a run that failed, could not be fed, or was not done yet.

    Args:
        folder: of the benchmark run.
        key: of the run in it.
    """
    row = next((row for row in read_results(folder / "results.csv") if row.key == key), None)
    name = "{} with {} and {}, seed {}".format(*key)
    if row is None:
        resume = shlex.quote(str(folder))
        raise UserError(f"{folder}: {name} was not run yet; continue with: topoloc bench --resume {resume}")
    if row.status != OK:
        raise UserError(f"{folder}: {name} is {row.status} ({row.reason}); explain another run")


def run_again(suite: Suite, key: Key, number: int) -> Rerun:
    """Make the drive again from its seed, fit the sensor, and run the estimator up to a frame, as the benchmark does.

    Args:
        suite: of the benchmark run.
        key: one of its runs.
        number: of the frame, from 0.

    Raises:
        UserError: the drive has no such frame.
    """
    name, sensor_name, estimator_name, seed = key
    scenario = next(one for one in suite.scenarios if one.name == name)
    steps: list[Step] = []
    with one_thread():
        case = scenario.make(seed)
        if not 0 <= number < len(case.frames):
            raise UserError(f"--step is {number}; the drive of {name} has the frames 0 to {len(case.frames) - 1}")
        sensor, estimator = suite.sensors[sensor_name](), suite.estimators[estimator_name]()
        rng = np.random.default_rng([seed, ESTIMATOR_STREAM])
        localizer = Localizer(case.topo_map, sensor, estimator, rng=rng)
        for index in track(range(number + 1), "driving"):
            localizer.step(case.frames[index])
            assert localizer.last is not None  # a step was just made
            steps.append(localizer.last)
    return Rerun(key, scenario.recorded, case, steps, sensor, estimator)


def difference(folder: Path, again: Rerun) -> str:
    """How the answer differs from the one in the run's folder, in words; empty where it is the same.

    Raises:
        InputError: the run's ``steps`` file is missing, or is no such table.
    """
    stored, number = read_steps(folder / steps_path(*again.key)), again.number
    if number >= len(stored.kind):
        return f"no answer there, its last frame is {len(stored.kind) - 1}"
    pairs = _told(again, stored)
    return ", ".join(f"{what} {there} there, {here} here" for what, there, here in pairs)


def _told(again: Rerun, stored: Steps) -> list[tuple[str, str, str]]:
    """What differs: its name, the stored value, the value of now."""
    step, number = again.steps[-1], again.number
    node = "" if step.estimate.node is None else again.case.topo_map.nodes[step.estimate.node].id
    words = [
        ("kind", str(stored.kind[number]), step.kind),
        ("status", str(stored.status[number]), step.estimate.status.value),
        ("node", str(stored.nodes[number]) or "none", node or "none"),
    ]
    told = [word for word in words if word[1] != word[2]]
    pose, then = step.estimate.pose, stored.poses[number]
    numbers = [
        ("x", then[0], pose[0], SAME_M),
        ("y", then[1], pose[1], SAME_M),
        ("probability", stored.probability[number], step.estimate.probability, SAME_PROBABILITY),
    ]
    told += [(what, f"{was:.3f}", f"{now:.3f}") for what, was, now, same in numbers if abs(was - now) > same]
    if abs(np.rad2deg(wrap(then[2] - pose[2]))) > SAME_DEG:
        told.append(("heading", f"{np.rad2deg(then[2]):.1f}°", f"{np.rad2deg(pose[2]):.1f}°"))
    return told
