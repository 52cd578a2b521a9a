"""Every sensor with every estimator on every drive of every scenario.

The work is cut into tasks: one sensor on the drives of one site with one seed. A drive is made once in a process, a
sensor is fitted to its map once and looks at each frame once, and what it saw is shared by all estimators. Workers
hand rows and files to the parent, which alone writes, a row after the files that belong to it. In one process rows
arrive one by one, from several those of a task together.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from itertools import groupby
from uuid import uuid4

from benchmarks.results import Key, ResultsFile, Row
from benchmarks.run_files import Kept
from benchmarks.scenarios import Scenario
from topoloc.files import write_text
from topoloc.interfaces import Estimator, Sensor

Outcome = Row | Kept


@dataclass(frozen=True)
class Suite:
    """What is compared: every sensor with every estimator on every scenario with every seed.

    Attributes:
        scenarios: the scenarios.
        sensors, estimators: by name, how to build a fresh one.
        seeds: of the drives.
        token: tells suites apart in a process that remembers the drives it made.
    """

    scenarios: tuple[Scenario, ...]
    sensors: Mapping[str, Callable[[], Sensor]]
    estimators: Mapping[str, Callable[[], Estimator]]
    seeds: tuple[int, ...]
    token: str = field(default_factory=lambda: uuid4().hex)

    def keys(self) -> list[Key]:
        """All of its runs."""
        return [
            (scenario.name, sensor, estimator, seed)
            for scenario in self.scenarios
            for seed in self.seeds
            for sensor in self.sensors
            for estimator in self.estimators
        ]


@dataclass(frozen=True)
class Drive:
    """One drive that a sensor still has work on.

    Attributes:
        scenario: of the drive.
        seed: that it is made from.
        pairs: (estimator, seed) of the runs that are missing; the seed is another than the drive's only where there is
            one drive for all.
        shown: whether the report's replay shows it.
        pictured: whether its pictures have to be kept for that, too.
    """

    scenario: Scenario
    seed: int
    pairs: tuple[tuple[str, int], ...]
    shown: bool
    pictured: bool


@dataclass(frozen=True)
class Task:
    """The work of one process at a time: one sensor on the drives of one site with one seed."""

    sensor: str
    drives: tuple[Drive, ...]


def run_suite(
    suite: Suite,
    results: ResultsFile,
    work: Callable[[Suite, Sequence[Task]], Generator[Outcome]],
    on_row: Callable[[Row], None] = lambda row: None,
) -> None:
    """Run what is not in ``results`` yet, and append it there.

    Args:
        suite: what to compare.
        results: where rows go; the other files are kept beside it.
        work: does tasks, in whatever order; see ``benchmarks.workers``.
        on_row: told of each row once it is written.
    """
    with closing(work(suite, tasks(suite, {row.key for row in results.rows}))) as outcomes:  # workers end with an error
        for outcome in outcomes:
            if isinstance(outcome, Row):
                results.append(outcome)
                on_row(outcome)
            else:
                write_text(results.path.parent / outcome.path, outcome.text)


def tasks(suite: Suite, done: set[Key]) -> list[Task]:
    """What is still to do, seed by seed and site by site, so that a process meets the same drives again and again."""
    chosen = []
    for seed in suite.seeds:
        sites = groupby(suite.scenarios, key=lambda scenario: scenario.site or scenario.name)
        for scenarios in [tuple(group) for _, group in sites]:
            for sensor in suite.sensors:
                drives = (_drive(suite, scenario, sensor, seed, done) for scenario in scenarios)
                missing = tuple(drive for drive in drives if drive.pairs)
                if missing:
                    chosen.append(Task(sensor, missing))
    return chosen


def _drive(suite: Suite, scenario: Scenario, sensor: str, seed: int, done: set[Key]) -> Drive:
    """A drive with what is missing there; one that was recorded comes once, with all seeds."""
    first = seed == suite.seeds[0]
    seeds = (seed,) if not scenario.recorded else suite.seeds if first else ()
    pairs = tuple(
        (estimator, one)
        for one in seeds
        for estimator in suite.estimators
        if (scenario.name, sensor, estimator, one) not in done
    )
    return Drive(scenario, seed, pairs, first, first and sensor == next(iter(suite.sensors)))
