"""The benchmark's dated report in ``docs/reports`` and the README's headline table, both from one run.

``python -m benchmarks.publish RUN`` writes them; ``make report`` runs the benchmark first.
"""

from __future__ import annotations

import argparse
import math
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from benchmarks.choice import REMEDY
from benchmarks.report.comparisons import QUESTION
from benchmarks.results import OK, Row, read_results
from benchmarks.spread import (
    FEWEST_PAIRS,
    Best,
    Difference,
    Interval,
    Pair,
    against_best,
    better,
    by_seed,
    paired,
    spreads,
)
from topoloc.errors import InputError
from topoloc.files import read_text, write_text
from topoloc.settings import read_toml

ROOT = Path(__file__).parents[1]
BEGIN, END = "<!-- headline: python -m benchmarks.publish -->", "<!-- end of headline -->"
HEADLINE_SCENARIOS = ("lab-fresh", "lab-people", "lab-kidnapped")
HEADLINE_HEADS = ("fresh", "people in 35 % of the frames", "kidnapped half-way", "position, fresh")
HEADLINE: tuple[Pair, ...] = (
    *(("ima", name) for name in ("grid", "particle", "auxiliary", "multi-gaussian", "sequence", "kalman")),
    ("ima-robust", "activity-offset"),
    *(("ima", name) for name in ("activity-offset", "activity", "best-match", "dead-reckoning")),
    *((sensor, name) for sensor in ("local", "pca") for name in ("particle", "best-match")),
    ("descriptor", "particle"),
    *(("histogram", name) for name in ("grid", "particle", "sequence", "activity", "best-match")),
)
"""The pairs of the README's table."""
QUESTION_METRICS = ("node_accuracy", "position_median_m", "recall_at_p99", "calibration_error", "estimator_ms")
TELLING = (
    "node_accuracy",
    "adjacent_rate",
    "wrong_rate",
    "position_median_m",
    "heading_median_deg",
    "steps_to_localize",
    "recall_at_p99",
    "recovery_steps",
    "calibration_error",
    "nees",
)
"""Columns of the tables of the best pairs."""
SHOWN_BEST = 8
COSTS = ("sensor_ms", "estimator_ms")


@dataclass(frozen=True)
class Published:
    """A run that is written about.

    Attributes:
        folder: of the run.
        config: its ``config.toml``.
        rows: of its ``results.csv``.
    """

    folder: Path
    config: Mapping[str, Any]
    rows: tuple[Row, ...]

    @classmethod
    def of(cls, folder: Path) -> Published:
        """Read a run. Raises ``InputError`` where it is none, or is not finished."""
        config = read_toml(folder / "config.toml", REMEDY)
        rows = tuple(read_results(folder / "results.csv"))
        if len(rows) != config["run"]["rows"]:
            raise InputError(folder, "is not finished", f"continue it: topoloc bench --resume {folder}")
        return cls(folder, config, rows)

    @property
    def date(self) -> str:
        """When it was started: year, month and day."""
        return str(self.config["run"]["started"])[:10]

    @cached_property
    def scenarios(self) -> list[str]:
        """Scenarios in their order."""
        return list(self.config["scenarios"])

    @cached_property
    def best(self) -> Mapping[str, Best]:
        """By scenario, the pair with the best node accuracy, and how the others stand to it."""
        return against_best(self.rows, "node_accuracy")

    def means(self, column: str) -> dict[tuple[str, Pair], tuple[float, ...]]:
        """Values over seeds by scenario and pair, undefined ones left out."""
        known = {
            group: [v for v in seeds.values() if math.isfinite(v)]
            for group, seeds in by_seed(self.rows, column).items()
        }
        return {(group[0], (group[1], group[2])): tuple(values) for group, values in known.items() if values}

    def intervals(self, column: str) -> dict[tuple[str, Pair], Interval | None]:
        """Of the means, by scenario and pair."""
        return {(group[0], (group[1], group[2])): one for group, one in spreads(self.rows, column).items()}


def report_of(run: Published) -> str:
    """The report as Markdown."""
    parts = [
        f"# Benchmark of {run.date}",
        _about(run),
        "## Which pair is right how often",
        _how_to_read(run),
        *(_scenario(run, name) for name in run.scenarios),
        "## IMA with the activity tracker, or PCA with particles?",
        _question(run),
        "## What a step costs",
        _costs(run),
        "## What did not run",
        _missing(run.rows),
    ]
    return "\n\n".join(part for part in parts if part) + "\n"


def _about(run: Published) -> str:
    machine, versions, what = run.config["machine"], run.config["versions"], run.config["run"]
    told = ", ".join(f"{name} {version}" for name, version in versions.items())
    cores = f"{machine['cores']} cores"
    memory = f", {machine['memory_gb']:.0f} GB" if "memory_gb" in machine else ""
    return (
        "All drives are **simulated**. "
        f"{what['seeds']} seeds from {what.get('first_seed', 0)} on, {what['updates']} frames a drive"
        f" (twins: twice as many); one thread a process. Settings are the defaults unless told.\n\n"
        f"- Machine: {machine.get('processor') or 'unknown processor'}, {cores}{memory}, {machine['system']}\n"
        f"- Versions: {told}\n"
        f"- The same again: `{what['command']}`, then `python -m benchmarks.publish RUN`\n"
        "- What the words mean: [metrics](../metrics.md), [scenarios and intervals](../benchmark.md)"
    )


def _how_to_read(run: Published) -> str:
    if int(run.config["run"]["seeds"]) < FEWEST_PAIRS:
        return f"Node accuracy in %, mean over the seeds. Fewer than {FEWEST_PAIRS} seeds tell no differences."
    return (
        "Node accuracy in %, mean over the seeds, and its 95 % interval. **Bold**: the highest mean, and what cannot "
        "be told apart from it; the others are worse, by an interval of paired differences that excludes zero."
    )


def _scenario(run: Published, scenario: str) -> str:
    about = run.config["scenarios"][scenario]
    return "\n\n".join(
        part
        for part in (f"### {scenario}", about["description"], _matrix(run, scenario), _leaders(run, scenario))
        if part
    )


def _matrix(run: Published, scenario: str) -> str:
    """Estimators by sensors."""
    means, ends, best = run.means("node_accuracy"), run.intervals("node_accuracy"), run.best.get(scenario)
    pairs = [pair for name, pair in means if name == scenario]
    sensors = list(dict.fromkeys(sensor for sensor in run.config["sensors"] if sensor in {pair[0] for pair in pairs}))
    body, told = [], int(run.config["run"]["seeds"]) >= FEWEST_PAIRS
    for estimator in run.config["estimators"]:
        cells = []
        for sensor in sensors:
            key = (scenario, (sensor, estimator))
            text = _percent(means[key], ends[key]) if key in means else ""
            cells.append(f"**{text}**" if text and told and best and _level(best, key[1]) else text)
        body.append((f"`{estimator}`", *cells))
    return _table(("", *(f"`{sensor}`" for sensor in sensors)), body)


def _level(best: Best, pair: Pair) -> bool:
    """Whether a pair cannot be told apart from the best one."""
    return pair == best.pair or (pair in best.others and not best.others[pair].called)


def _percent(values: Sequence[float], interval: Interval | None) -> str:
    mean = f"{100.0 * statistics.fmean(values):.0f}"
    return mean if interval is None else f"{mean} ({100.0 * interval.low:.0f} to {100.0 * interval.high:.0f})"


def _leaders(run: Published, scenario: str) -> str:
    """All main metrics of the pairs that name the right node most often."""
    accuracy = {
        pair: statistics.fmean(values)
        for (name, pair), values in run.means("node_accuracy").items()
        if name == scenario
    }
    chosen = sorted(accuracy, key=lambda pair: -accuracy[pair])[:SHOWN_BEST]
    columns = {column: run.means(column) for column in TELLING}
    shown = [column for column, means in columns.items() if any((scenario, pair) in means for pair in chosen)]
    body = [(_name(pair), *(_spread(columns[column].get((scenario, pair), ())) for column in shown)) for pair in chosen]
    heads = ("the best pairs, mean ± standard deviation", *(f"`{column}`" for column in shown))
    return _table(heads, body)


def _question(run: Published) -> str:
    """Both pairs on every scenario, and whether they differ."""
    body = []
    for metric in QUESTION_METRICS:
        means, apart = run.means(metric), paired(run.rows, metric, *QUESTION)
        for scenario in run.scenarios:
            if scenario in apart:
                values = [_spread(means.get((scenario, pair), ())) for pair in QUESTION]
                body.append((f"`{metric}`", scenario, *values, *_verdict(apart[scenario], metric)))
    first, second = map(_name, QUESTION)
    table = _table(("metric", "scenario", first, second, "the second less the first", "better"), body)
    text = (
        "Paired over the seeds, drive by drive. A difference is called one where the 95 % interval excludes zero, from "
        f"{FEWEST_PAIRS} seeds on."
    )
    return f"{text}\n\n{table}"


def _verdict(difference: Difference, metric: str) -> tuple[str, str]:
    """The difference with its interval, and which pair is better by it."""
    if difference.mean is None or difference.interval is None:
        return "-", "-"
    ends = f"{difference.mean:+.3f} ({difference.interval.low:+.3f} to {difference.interval.high:+.3f})"
    if difference.pairs < FEWEST_PAIRS:
        return ends, "too few seeds"
    if not difference.called:
        return ends, "no difference told"
    return ends, _name(QUESTION[(difference.mean > 0.0) == (better(metric) == "higher")])


def _costs(run: Published) -> str:
    """Of each sensor, and of each estimator with the drawn sensor, in the first scenario that it ran on."""
    parts = []
    for column, key, what in ((COSTS[0], 0, "sensor"), (COSTS[1], 1, "estimator")):
        means = run.means(column)
        names = list(dict.fromkeys(pair[key] for _, pair in means))
        scenarios = [name for name in run.scenarios if any(scenario == name for scenario, _ in means)]
        body = []
        for name in names:
            own = [
                [
                    v
                    for (scenario, pair), values in means.items()
                    if scenario == one and pair[key] == name
                    for v in values
                ]
                for one in scenarios
            ]
            body.append((f"`{name}`", *(f"{statistics.median(values):.2f}" if values else "" for values in own)))
        parts.append(_table((f"{what}, `{column}`, median", *scenarios), body))
    return "\n\n".join(parts)


def _missing(rows: Iterable[Row]) -> str:
    """Each reason once, with what it held up."""
    reasons: dict[tuple[str, str], set[str]] = {}
    for row in rows:
        if row.status != OK:
            reasons.setdefault((row.status, row.reason), set()).add(f"`{row.sensor}` on {row.scenario}")
    lines = [f"- {status}: {reason} ({', '.join(sorted(who))})" for (status, reason), who in reasons.items()]
    return "\n".join(lines) or "Everything ran."


def headline_of(run: Published) -> str:
    """The README's table."""
    accuracy, position = run.means("node_accuracy"), run.means("position_median_m")
    body = []
    for pair in HEADLINE:
        cells = [_two(accuracy[scenario, pair]) for scenario in HEADLINE_SCENARIOS]
        body.append((f"`{pair[0]}`", f"`{pair[1]}`", *cells, f"{_two(position[HEADLINE_SCENARIOS[0], pair])} m"))
    return _table(("sensor", "estimator", *HEADLINE_HEADS), body)


def _two(values: Sequence[float]) -> str:
    return f"{statistics.fmean(values):.2f} ± {statistics.stdev(values):.2f}"


def _spread(values: Sequence[float]) -> str:
    if not values:
        return "-"
    spread = f" ± {statistics.stdev(values):.2g}" if len(values) > 1 else ""
    return f"{statistics.fmean(values):.3g}{spread}"


def _name(pair: Pair) -> str:
    return f"`{pair[0]}` with `{pair[1]}`"


def _table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def publish(folder: Path, root: Path = ROOT) -> list[Path]:
    """Write both from a run; returns what was written.

    Args:
        folder: of a finished run of all scenarios of the headline.
        root: of the project.

    Raises:
        InputError: the run is not finished, or the README has no place for the table.
    """
    run = Published.of(folder)
    report, readme = root / "docs" / "reports" / f"{run.date}.md", root / "README.md"
    text = read_text(readme, "run this in the project")
    before, begin, rest = text.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise InputError(readme, "has no place for the headline table", f"put {BEGIN} and {END} around it")
    write_text(report, report_of(run))
    write_text(readme, f"{before}{BEGIN}\n\n{headline_of(run)}\n\n{END}{after}")
    return [report, readme]


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path, help="of a finished benchmark run")
    for path in publish(parser.parse_args().folder):
        print(path)


if __name__ == "__main__":
    main()
