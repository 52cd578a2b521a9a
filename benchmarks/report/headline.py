"""The first table: sensors by estimators, node accuracy over all scenarios, and which cells differ from the best."""

from __future__ import annotations

import math
import statistics
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

from benchmarks.results import Row
from benchmarks.spread import Best, Interval, Pair, Verdict, against_best, by_seed, spreads, verdict

METRIC = "node_accuracy"
ALL = "all scenarios"

BEST, LEVEL, WORSE, PARTLY, OPEN = "best", "level", "worse", "partly", "open"
MARKS = {BEST: "★", LEVEL: "≈", WORSE: "▽", PARTLY: "†", OPEN: ""}
"""A sign for each standing, so that colour alone tells nothing."""

Known = Mapping[Pair, Mapping[str, Mapping[int, float]]]
"""Values by pair, scenario and seed; a pair without any is not among them."""


@dataclass(frozen=True)
class Cell:
    """A pair's node accuracy.

    Attributes:
        mean: over the compared scenarios or, where it lacks one of them, over those that it ran on; with equal
            weights, over the seeds that all of these have.
        interval: of that mean over the seeds.
        scenarios: how many the mean is over.
        standing: beside the best pair.
    """

    mean: float
    interval: Interval | None
    scenarios: int
    standing: str


@dataclass(frozen=True)
class Headline:
    """The table.

    Attributes:
        cells: by pair; one without a value is not among them.
        best: pair with the highest mean, among those that ran on all of the compared scenarios.
        compared: the scenarios that pairs are compared over.
        seeds: that the mean of the best is over.
        one_drive: nothing but recorded scenarios has a value, and so no difference is called.
    """

    cells: Mapping[Pair, Cell]
    best: Pair | None
    compared: frozenset[str]
    seeds: int
    one_drive: bool = False

    @property
    def ranked(self) -> list[Pair]:
        """Pairs from the highest mean down; last those that lack one of the compared scenarios."""
        return sorted(self.cells, key=lambda pair: (self.cells[pair].standing == PARTLY, -self.cells[pair].mean))


def headline_of(rows: Sequence[Row], recorded: Collection[str] = ()) -> Headline:
    """The table from the rows of a run.

    Args:
        rows: of the run.
        recorded: scenarios of one drive. They are left out, unless there is nothing else: their seeds are the
            estimator's alone, and an interval over them tells of no other drive.
    """
    simulated = known_of(row for row in rows if row.scenario not in recorded)
    known = simulated or known_of(rows)
    if not known:
        return Headline({}, None, frozenset(), 0)
    compared = largest_block([frozenset(own) for own in known.values()])
    whole = {pair for pair, own in known.items() if compared <= own.keys()}
    over = {pair: compared if pair in whole else own.keys() for pair, own in known.items()}
    averaged = [row for pair, own in known.items() for row in _averaged(pair, [own[name] for name in over[pair]])]
    found = against_best([row for row in averaged if (row.sensor, row.estimator) in whole], METRIC).get(ALL)
    groups, ends = by_seed(averaged, METRIC), spreads(averaged, METRIC)
    cells = {
        pair: Cell(
            statistics.fmean(groups[ALL, *pair].values()),
            ends[ALL, *pair],
            len(over[pair]),
            standing_of(pair, found, one_drive=not simulated) if pair in whole else PARTLY,
        )
        for pair in known
        if (ALL, *pair) in groups
    }
    best = found.pair if found else None
    return Headline(cells, best, compared, len(groups[ALL, *best]) if best else 0, one_drive=not simulated)


def known_of(rows: Iterable[Row]) -> Known:
    """The values of a run's rows."""
    pairs: dict[Pair, dict[str, dict[int, float]]] = {}
    for (scenario, sensor, estimator), seeds in by_seed(rows, METRIC).items():
        values = {seed: value for seed, value in seeds.items() if math.isfinite(value)}
        if values:
            pairs.setdefault((sensor, estimator), {})[scenario] = values
    return pairs


def largest_block(sets: Collection[frozenset[str]]) -> frozenset[str]:
    """One of the pairs' own sets of scenarios: that with most pairs on all of it, times its size.

    So sensors that run on nearly everything are compared with each other, and one scenario more or less of some of
    them does not part the others. Of equals the larger set wins.
    """

    def size(one: frozenset[str]) -> tuple[int, int, list[str]]:
        return sum(one <= other for other in sets) * len(one), len(one), sorted(one)

    return max(set(sets), key=size)


def _averaged(pair: Pair, scenarios: Sequence[Mapping[int, float]]) -> list[Row]:
    """A row for each seed that all of the scenarios have a value for, with the mean over them."""
    seeds = sorted(set.intersection(*map(set, scenarios)))
    return [Row(ALL, *pair, seed, values={METRIC: statistics.fmean(own[seed] for own in scenarios)}) for seed in seeds]


def standing_of(pair: Pair, best: Best | None, one_drive: bool = False) -> str:
    """How a pair stands to the best one; a pair with the very same mean is best, too."""
    if best is None or pair in best.incomplete:
        return OPEN
    if pair == best.pair or best.others[pair].mean == 0.0:
        return BEST
    told = verdict(best.others[pair], METRIC, one_drive)
    return {Verdict.NOT_TOLD: LEVEL, Verdict.WORSE: WORSE}.get(told, OPEN)
