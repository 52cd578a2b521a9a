"""Two benchmark runs, or two pairs of sensor and estimator, side by side: means, paired differences, and a word each.

What was run under unlike settings is told: a difference may come from there.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.choice import REMEDY
from benchmarks.results import COSTS, FAILED, UNAVAILABLE, Row, read_results
from benchmarks.spread import Difference, Group, Pair, Seeds, Verdict, by_seed, differences, judged, verdict
from topoloc.errors import InputError, UnknownName, UserError
from topoloc.sensor_names import parse
from topoloc.settings import read_toml

NAMED = 3
"""Of several failed runs, so many are named."""


@dataclass(frozen=True)
class BenchRun:
    """What a benchmark left in its folder.

    Attributes:
        folder: of the run.
        config: its ``config.toml``.
        rows: its ``results.csv``.
    """

    folder: Path
    config: Mapping[str, Any]
    rows: tuple[Row, ...]

    @property
    def missing(self) -> int:
        """Rows that are still to be run."""
        expected = self.table("run").get("rows")
        return max(0, expected - len(self.rows)) if isinstance(expected, int) else 0

    def table(self, *path: str) -> Mapping[str, Any]:
        """A table of the config by its names from outside in; empty where there is none."""
        table: Any = self.config
        for name in path:
            table = table.get(name) if isinstance(table, Mapping) else None
        return table if isinstance(table, Mapping) else {}

    def recorded(self, scenario: str) -> bool:
        """Whether it is somebody's folder: one drive, in which a seed is the estimator's alone."""
        return self.table("scenarios", scenario).get("recorded") is True

    def names(self, what: str) -> list[Any]:
        """Each ``scenario``, ``sensor``, ``estimator`` or ``seed`` of its rows, once."""
        return list(dict.fromkeys(getattr(row, what) for row in self.rows))


@dataclass(frozen=True)
class Line:
    """One comparison: B held against A in one metric on one scenario.

    Attributes:
        metric, scenario: what is compared where.
        a, b: pair of sensor and estimator on each side.
        mean_a, mean_b: over the seeds that both have a value for; without any, each over its own. None: no value.
        difference: B less A; for ``near 3`` of their distances from 3. Of one recorded drive without an interval.
        verdict: what B is beside A, or why nothing is told.
    """

    metric: str
    scenario: str
    a: Pair
    b: Pair
    mean_a: float | None
    mean_b: float | None
    difference: Difference
    verdict: Verdict

    def row(self) -> dict[str, Any]:
        """As JSON has it."""
        interval = self.difference.interval
        return {
            "metric": self.metric,
            "scenario": self.scenario,
            "a": "/".join(self.a),
            "b": "/".join(self.b),
            "mean_a": self.mean_a,
            "mean_b": self.mean_b,
            "difference": self.difference.mean,
            "low": None if interval is None else interval.low,
            "high": None if interval is None else interval.high,
            "pairs": self.difference.pairs,
            "left_out": self.difference.left_out,
            "verdict": self.verdict,
        }


def read_run(folder: Path) -> BenchRun:
    """What lies in a run's folder.

    Raises:
        InputError: it is no run's folder, or holds no rows.
    """
    if not folder.is_dir():
        raise InputError(folder, "no such folder", REMEDY)
    path = folder / "results.csv"
    rows = tuple(read_results(path))
    if not rows:
        remedy = f"run it with topoloc bench --resume {folder}, or {REMEDY}"
        raise InputError(path, "holds no rows yet", remedy)
    return BenchRun(folder, read_toml(folder / "config.toml", REMEDY), rows)


def pair_of(word: str) -> Pair:
    """A pair as it is typed, ``ima+histogram/grid``. Raises ``UserError``."""
    sensor, estimator = (part.strip() for part in word.rpartition("/")[::2])
    if not (sensor and estimator):
        raise UserError(f"{word!r} is no pair; write SENSOR/ESTIMATOR, ima/activity say")
    return str(parse(sensor)), estimator


def only(run: BenchRun, pair: Pair) -> BenchRun:
    """The run with the rows and the settings of one pair alone.

    Raises:
        UnknownName: the run has no such sensor or estimator.
        InputError: it has both, but not together.
    """
    for what, name in zip(("sensor", "estimator"), pair, strict=True):
        if name not in run.names(what):
            raise UnknownName(f"{what} in {run.folder}", name, run.names(what))
    rows = tuple(row for row in run.rows if (row.sensor, row.estimator) == pair)
    if not rows:
        raise InputError(
            run.folder, f"has no row of {'/'.join(pair)} yet", f"finish it: topoloc bench --resume {run.folder}"
        )
    tables = {
        what: {name: table for name, table in run.table(what).items() if name == one}
        for what, one in zip(("sensors", "estimators"), pair, strict=True)
    }
    return replace(run, config={**run.config, **tables}, rows=rows)


def compare_runs(a: BenchRun, b: BenchRun, metric: str) -> list[Line]:
    """Each group that both runs have, B held against A.

    Raises:
        UnknownName: no such metric.
        UserError: the runs have nothing in common.
    """
    known = set(by_seed(b.rows, metric))
    shared = [(group, group) for group in by_seed(a.rows, metric) if group in known]
    if not shared:
        raise UserError(
            f"{a.folder} and {b.folder} share no scenario with the same sensor and estimator; "
            "compare pairs: --pairs ima/activity pca/particle, say"
        )
    return _lines(a, b, metric, shared)


def compare_pairs(a: BenchRun, b: BenchRun, metric: str, pairs: tuple[Pair, Pair]) -> list[Line]:
    """The second pair, of run B, held against the first, of run A, on each scenario that both ran.

    Raises:
        UnknownName: no such metric, sensor or estimator.
        UserError: the pairs share no scenario.
    """
    first, second = (only(run, pair) for run, pair in zip((a, b), pairs, strict=True))
    theirs = second.names("scenario")
    shared = [((name, *pairs[0]), (name, *pairs[1])) for name in first.names("scenario") if name in theirs]
    if not shared:
        words = " and ".join("/".join(pair) for pair in pairs)
        raise UserError(f"{words} share no scenario in {a.folder} and {b.folder}; compare runs of the same scenarios")
    return _lines(first, second, metric, shared)


def _lines(a: BenchRun, b: BenchRun, metric: str, sides: Sequence[tuple[Group, Group]]) -> list[Line]:
    groups_a, groups_b = by_seed(a.rows, metric), by_seed(b.rows, metric)
    alike = {name for name in a.names("scenario") if drives_alike(a, b, name)}
    paired = [
        (judged(groups_a[one], metric), judged(groups_b[other], metric)) if one[0] in alike else ({}, {})
        for one, other in sides
    ]
    lines = []
    for (one, other), difference in zip(sides, differences(paired), strict=True):
        scenario, means, one_drive = one[0], _means(groups_a[one], groups_b[other]), a.recorded(one[0])
        told = verdict(difference, metric, one_drive) if scenario in alike else Verdict.OTHER_DRIVES
        shown = replace(difference, interval=None) if one_drive else difference
        lines.append(Line(metric, scenario, one[1:], other[1:], *means, shown, told))
    return lines


def _means(a: Seeds, b: Seeds) -> tuple[float | None, float | None]:
    """Over the seeds that both have a value for; without any, each over its own."""
    both = [seed for seed in a if np.isfinite(a[seed]) and np.isfinite(b.get(seed, np.nan))]
    if not both:
        return _mean(a.values()), _mean(b.values())
    return _mean(a[seed] for seed in both), _mean(b[seed] for seed in both)


def _mean(values: Iterable[float]) -> float | None:
    known = [value for value in values if np.isfinite(value)]
    return float(np.mean(known)) if known else None


def drives_alike(a: BenchRun, b: BenchRun, scenario: str) -> bool:
    """Whether a seed makes the same drive of a scenario in both runs, as far as its settings tell."""
    return _drive_settings(a, scenario) == _drive_settings(b, scenario)


def _drive_settings(run: BenchRun, scenario: str) -> dict[str, Any]:
    settings = dict(run.table("scenarios", scenario))
    settings.pop("description", None)  # words for people
    if "digest" in settings:  # of a recording's files: they may lie elsewhere by now
        settings.pop("folder", None)
    return settings


def warnings(a: BenchRun, b: BenchRun, metrics: Sequence[str], pairs: tuple[Pair, Pair] | None = None) -> list[str]:
    """What a reader of the comparison should know, a line each, what weighs most first.

    Args:
        a: the run of the first side.
        b: the run of the second side; may be the same.
        metrics: that are compared.
        pairs: of A and of B, where only these are compared.
    """
    runs = {"A": a} if a is b else {"A": a, "B": b}
    found = [
        f"{letter} is unfinished: {run.missing} rows are missing; go on with topoloc bench --resume {run.folder}"
        for letter, run in runs.items()
        if run.missing
    ]
    whats = ["scenario", "sensor", "estimator", "seed"]
    if pairs is not None:
        a, b, whats = only(a, pairs[0]), only(b, pairs[1]), ["scenario", "seed"]
    sides = {"A": a, "B": b} if pairs is not None or a is not b else {"A": a}
    found += [line for letter, run in sides.items() for line in _without_result(letter, run)]
    found += [line for what in whats for line in _only_one_has(a, b, what)]
    return [*found, *unlike_settings(a, b, with_machine=any(metric in COSTS for metric in metrics))]


def notes(a: BenchRun, b: BenchRun, lines: Iterable[Line]) -> list[str]:
    """On which scenarios no difference can be told, a line each."""
    return [
        f"{name} is one recorded drive: its seeds tell of the estimators' chance only, not of other drives"
        for name in dict.fromkeys(line.scenario for line in lines)
        if a.recorded(name) or b.recorded(name)
    ]


def _without_result(letter: str, run: BenchRun) -> Iterator[str]:
    for status in (FAILED, UNAVAILABLE):
        bad = [row for row in run.rows if row.status == status]
        if bad:
            named = [f"{row.sensor}/{row.estimator} on {row.scenario}, seed {row.seed}" for row in bad[:NAMED]]
            more = f"; and {len(bad) - NAMED} more" if len(bad) > NAMED else ""
            yield f"{letter}: {len(bad)} of {len(run.rows)} runs {status} ({bad[0].reason}): {'; '.join(named)}{more}"


def _only_one_has(a: BenchRun, b: BenchRun, what: str) -> Iterator[str]:
    of_a, of_b = a.names(what), b.names(what)
    for letter, own, others in (("A", of_a, of_b), ("B", of_b, of_a)):
        alone = [str(name) for name in own if name not in others]
        if alone:
            yield f"only {letter} has the {what}{'s' * (len(alone) > 1)} {', '.join(alone)}"


def unlike_settings(a: BenchRun, b: BenchRun, with_machine: bool) -> list[str]:
    """``sensors.ima.slots: 8 against 4`` for each setting of what both ran, of updates, versions and the machine."""
    one, other = (_settings(run, with_machine) for run in (a, b))
    told = []
    for owner in [name for name in one if name in other]:
        ours, theirs = dict(_flat(one[owner], owner)), dict(_flat(other[owner], owner))
        told += [
            f"{key}: {_word(ours.get(key))} against {_word(theirs.get(key))}"
            for key in dict.fromkeys([*ours, *theirs])
            if ours.get(key) != theirs.get(key)
        ]
    return told


def _settings(run: BenchRun, with_machine: bool) -> dict[str, Mapping[str, Any]]:
    """What a result may depend on, a table for each part of the run, by its name in the config."""
    tables: dict[str, Mapping[str, Any]] = {"run": {"updates": run.table("run").get("updates")}}
    tables |= {f"scenarios.{name}": _drive_settings(run, name) for name in run.table("scenarios")}
    for what in ("sensors", "estimators"):
        tables |= {f"{what}.{name}": run.table(what, name) for name in run.table(what)}
    return tables | {what: run.table(what) for what in ("versions", *(["machine"] * with_machine))}


def _flat(table: Mapping[str, Any], name: str) -> Iterator[tuple[str, Any]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{name}.{key}")
        else:
            yield f"{name}.{key}", value


def _word(value: Any) -> str:
    return "nothing" if value is None else str(value)
