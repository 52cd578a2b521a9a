"""What a run's folder holds beside the replay: its settings, rows and answers."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.choice import Choice, read_choice
from benchmarks.report.answers import Answers, read_answers
from benchmarks.report.markup import plural
from benchmarks.results import FAILED, OK, UNAVAILABLE, Row, read_results
from benchmarks.spread import Group, Pair
from topoloc.settings import read_toml


@dataclass(frozen=True)
class RunRead:
    """A run as it lies in its folder, finished or not.

    Attributes:
        folder: of the run.
        choice: what it was started with.
        config: ``config.toml`` as it stands.
        rows: of ``results.csv``.
        answers: of the runs that came to an end, seed by seed.
        unreadable: why answers of runs that came to an end are not among them, a line for each.
    """

    folder: Path
    choice: Choice
    config: Mapping[str, Any]
    rows: tuple[Row, ...]
    answers: Mapping[Group, list[Answers]]
    unreadable: tuple[str, ...]

    @classmethod
    def of(cls, folder: Path) -> RunRead:
        """Read a run's folder. Raises ``InputError`` where it is none."""
        config = read_toml(folder / "config.toml", "restore it; a benchmark writes it before it starts")
        rows = tuple(read_results(folder / "results.csv"))
        return cls(folder, read_choice(folder), config, rows, *read_answers(folder, rows))

    @cached_property
    def scenarios(self) -> list[str]:
        """Their names, as they were asked for; one that is a folder goes by the folder's name."""
        return _ordered(self.config.get("scenarios", {}), (row.scenario for row in self.rows))

    @cached_property
    def sensors(self) -> list[str]:
        """Their names, as they were asked for."""
        return _ordered(self.choice.sensors, (row.sensor for row in self.rows))

    @cached_property
    def estimators(self) -> list[str]:
        """Their names, as they were asked for."""
        return _ordered(self.choice.estimators, (row.estimator for row in self.rows))

    @cached_property
    def pairs(self) -> list[Pair]:
        """Sensors and estimators that have a row, sensor by sensor."""
        known = {(row.sensor, row.estimator) for row in self.rows}
        return [(sensor, name) for sensor in self.sensors for name in self.estimators if (sensor, name) in known]

    @property
    def expected(self) -> int:
        """How many rows the finished run has."""
        return int(self.config.get("run", {}).get("rows", len(self.rows)))

    @property
    def missing(self) -> int:
        """Rows that are still to be run."""
        return max(0, self.expected - len(self.rows))

    @property
    def state(self) -> str:
        """How many runs came to an end, how many did not, how many are missing."""
        counts = {status: sum(row.status == status for row in self.rows) for status in (OK, FAILED, UNAVAILABLE)}
        told = ", ".join(f"{count} {status}" for status, count in counts.items() if count or status == OK)
        left = f"; unfinished: {self.missing} of {self.expected} are still to run" if self.missing else ""
        return f"{plural(len(self.rows), 'run')}: {told}{left}"

    def about(self, scenario: str) -> Mapping[str, Any]:
        """The settings of a scenario."""
        return dict(self.config.get("scenarios", {}).get(scenario, {}))

    def recorded(self, scenario: str) -> bool:
        """Whether it is somebody's folder: one drive, whatever the seed."""
        return bool(self.about(scenario).get("recorded", False))

    def command(self, scenario: str, pair: Pair) -> str:
        """The command line that runs one pair on one scenario again, with all seeds."""
        sensor, estimator = pair
        own = (f"scenarios.{scenario}.", f"sensors.{sensor}.", f"estimators.{estimator}.")
        settings = tuple(word for word in self.choice.settings if word.startswith(own))
        where = scenario if scenario in self.choice.scenarios else str(self.about(scenario).get("folder", scenario))
        one = replace(self.choice, scenarios=(where,), sensors=(sensor,), estimators=(estimator,), settings=settings)
        return one.command


def _ordered(wanted: Iterable[str], found: Iterable[str]) -> list[str]:
    """The wanted names that were found, then whatever else was."""
    known = dict.fromkeys(found)
    return [name for name in wanted if name in known] + sorted(known.keys() - set(wanted))
