"""The first table: sensors by estimators, node accuracy over all scenarios, and which cells differ from the best."""

from __future__ import annotations

import math
import statistics
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

from benchmarks.report.markup import number, pair_name, plural, span
from benchmarks.report.run_read import RunRead
from benchmarks.results import Row
from benchmarks.spread import FEWEST_PAIRS, Best, Interval, Pair, against_best, by_seed, spreads

METRIC = "node_accuracy"
ALL = "all scenarios"

BEST, LEVEL, WORSE, ELSEWHERE, OPEN = "best", "level", "worse", "elsewhere", "open"
MARKS = {BEST: "★", LEVEL: "≈", WORSE: "▽", ELSEWHERE: "†", OPEN: ""}
"""A sign for each verdict, so that colour alone tells nothing."""


@dataclass(frozen=True)
class Cell:
    """A pair's node accuracy.

    Attributes:
        mean: over the scenarios that it ran on, with equal weights, and over the seeds that all of these have.
        interval: of that mean over the seeds.
        scenarios: that it ran on.
        verdict: how it stands to the best pair.
    """

    mean: float
    interval: Interval | None
    scenarios: int
    verdict: str


@dataclass(frozen=True)
class Headline:
    """The table.

    Attributes:
        cells: by pair; one without a value is not among them.
        best: pair with the highest mean, among those that ran on the scenarios that most ran on.
        compared: these scenarios.
        seeds: that the mean of the best is over.
    """

    cells: Mapping[Pair, Cell]
    best: Pair | None
    compared: frozenset[str]
    seeds: int

    @property
    def ranked(self) -> list[Pair]:
        """Pairs from the highest mean down; last those that ran on other scenarios than most."""
        return sorted(self.cells, key=lambda pair: (self.cells[pair].verdict == ELSEWHERE, -self.cells[pair].mean))


def headline_of(rows: Sequence[Row]) -> Headline:
    """The table from the rows of a run."""
    where, averaged = _averaged(rows)
    if not averaged:
        return Headline({}, None, frozenset(), 0)
    usual = max(Counter(where.values()).items(), key=lambda item: (item[1], len(item[0])))[0]
    found = against_best([row for row in averaged if where[row.sensor, row.estimator] == usual], METRIC).get(ALL)
    groups, ends = by_seed(averaged, METRIC), spreads(averaged, METRIC)
    cells = {
        pair: Cell(
            statistics.fmean(groups[ALL, *pair].values()),
            ends[ALL, *pair],
            len(scenarios),
            verdict_of(pair, found) if scenarios == usual else ELSEWHERE,
        )
        for pair, scenarios in where.items()
        if (ALL, *pair) in groups
    }
    best = found.pair if found else None
    return Headline(cells, best, usual, len(groups[ALL, *best]) if best else 0)


def _averaged(rows: Sequence[Row]) -> tuple[dict[Pair, frozenset[str]], list[Row]]:
    """Where each pair ran, and a row for each of its seeds that all of these scenarios have a value for."""
    pairs: dict[Pair, dict[str, dict[int, float]]] = {}
    for (scenario, sensor, estimator), seeds in by_seed(rows, METRIC).items():
        known = {seed: value for seed, value in seeds.items() if math.isfinite(value)}
        if known:
            pairs.setdefault((sensor, estimator), {})[scenario] = known
    averaged = []
    for pair, values in pairs.items():
        for seed in sorted(set.intersection(*(set(one) for one in values.values()))):
            mean = statistics.fmean(one[seed] for one in values.values())
            averaged.append(Row(ALL, *pair, seed, values={METRIC: mean}))
    return {pair: frozenset(values) for pair, values in pairs.items()}, averaged


def verdict_of(pair: Pair, best: Best | None) -> str:
    """How a pair stands to the best one; a pair with the very same mean is best, too."""
    if best is None or pair in best.incomplete:
        return OPEN
    if pair == best.pair or best.others[pair].mean == 0.0:
        return BEST
    if best.others[pair].pairs < FEWEST_PAIRS:
        return OPEN
    return WORSE if best.others[pair].called else LEVEL


def headline_section(run: RunRead, headline: Headline) -> str:
    """The table, what its marks mean, and what cannot be said."""
    if not headline.cells:
        return "<p>No run has come to an end, so there is nothing to compare yet.</p>"
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in run.estimators)
    body = "".join(
        f'<tr><th scope="row">{escape(sensor)}</th>'
        + "".join(_cell(run, headline, (sensor, estimator)) for estimator in run.estimators)
        + "</tr>"
        for sensor in run.sensors
    )
    return (
        f"{_finding(run, headline)}"
        f'<p class="note">Node accuracy, mean over the scenarios that a pair ran on and '
        f"{plural(headline.seeds, 'seed')} [95 % interval over seeds]; 1 is best.</p>"
        '<div class="wide" tabindex="0" role="region" aria-label="Node accuracy, sensors by estimators">'
        f'<table class="matrix"><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody></table></div>'
        f"{_legend(headline)}"
    )


def _finding(run: RunRead, headline: Headline) -> str:
    """What the table says, in a sentence."""
    if headline.best is None:
        return ""
    cell = headline.cells[headline.best]
    names = [pair_name(pair) for pair, one in headline.cells.items() if one.verdict == BEST]
    best = ", ".join(f"<b>{escape(name)}</b>" for name in names or [pair_name(headline.best)])
    value = f"{number(cell.mean)} {span(cell.interval)}".strip()
    among = ""
    if len(headline.compared) < len(run.scenarios):
        among = f" among the pairs that ran on {escape(', '.join(sorted(headline.compared)))}"
    if headline.seeds < FEWEST_PAIRS:
        return (
            f"<p>Highest so far{among}: {best} with {value}. With {plural(headline.seeds, 'seed')} no difference can "
            f"be called one yet: that takes at least {FEWEST_PAIRS}. Run <code>topoloc bench --seeds 10</code> to tell "
            "pairs apart.</p>"
        )
    counts = Counter(cell.verdict for cell in headline.cells.values())
    return (
        f"<p>Highest{among}: {best} with {value}. Not told apart from it: {plural(counts[LEVEL], 'other pair')}; "
        f"worse: {counts[WORSE]}.</p>"
    )


def _cell(run: RunRead, headline: Headline, pair: Pair) -> str:
    cell = headline.cells.get(pair)
    if cell is None:
        rows = [row for row in run.rows if (row.sensor, row.estimator) == pair]
        return f'<td class="none">{escape(rows[0].status if rows else "not run")}</td>'
    mark = f' <span class="mark">{MARKS[cell.verdict]}</span>' if MARKS[cell.verdict] else ""
    partly = f"<small>{cell.scenarios} of {len(run.scenarios)} scenarios</small>" * (cell.verdict == ELSEWHERE)
    return (
        f'<td class="{cell.verdict}" style="--share:{100.0 * cell.mean**2:.0f}%">'
        f"<b>{number(cell.mean)}</b>{mark}<small>{span(cell.interval)}</small>{partly}</td>"
    )


def _legend(headline: Headline) -> str:
    """The marks that occur, and what they mean."""
    called = headline.seeds >= FEWEST_PAIRS
    meanings = {
        BEST: "highest mean" if called else "highest mean so far",
        LEVEL: "not told apart from the best: the interval of the paired differences holds zero",
        WORSE: "worse than the best: the interval of the paired differences excludes zero",
        ELSEWHERE: "ran on other scenarios than most, so its mean is not held against the best",
    }
    present = {cell.verdict for cell in headline.cells.values()}
    told = [f"<li><span>{MARKS[key]}</span> {text}</li>" for key, text in meanings.items() if key in present]
    shade = "<li>A stronger colour is a higher value.</li>"
    return f'<ul class="legend">{"".join(told)}{shade}</ul>'
