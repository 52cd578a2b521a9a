"""What chance alone makes of a mean over seeds: bootstrap intervals, of values and of paired differences.

Seeds are few, and there the percentile interval of the bootstrap is too narrow; the expanded one of T. Hesterberg,
"What teachers should know about the bootstrap" (The American Statistician 69, 2015), takes quantiles farther out, as
Student's t lies farther out than the normal distribution. No interval of this kind reaches beyond the values
themselves: of two normal values it covers the mean in 50 % of cases, of three in 75, of four in 87, of six in 93, of
ten in 95. Of skewed values (exponential) it covers less: of six in 88 %, of ten in 91.

A difference is called one where both sides ran on the same drives with the same seeds, the interval of the paired
differences excludes zero, and pairs are at least ``FEWEST_PAIRS``.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cache

import numpy as np
from scipy.special import ndtr, stdtrit

from benchmarks.results import COSTS, Row
from topoloc.errors import UnknownName
from topoloc.geometry import Floats
from topoloc.metrics import METRICS, Better

LEVEL = 0.95
"""That an interval covers the mean."""
FEWEST_PAIRS = 6
"""From here on a difference may be called one: with 5, all have one sign by mere chance in 1 of 16 cases. Of sides that
are equal, 7 % are told apart with 6 pairs, and 5 to 6 % from 7 on (accuracies over 60 updates, simulated)."""
RESAMPLES = 4000
RESAMPLING_SEED = 2015
BATCH = 1024
"""Groups that are resampled together; so many take some 30 MB."""
ROUNDING = 1e-5
"""``results.csv`` keeps six digits: an end of a difference's interval this near to zero, as a share of the larger of
both sides, is zero."""
HONEST_NEES = 3.0
"""What ``near 3`` means: a value is as good as it is near."""

Pair = tuple[str, str]
"""Sensor and estimator."""
Group = tuple[str, str, str]
"""Scenario, sensor and estimator."""
Seeds = Mapping[int, float]
"""Value by seed; NaN where the run has none."""


@dataclass(frozen=True)
class Interval:
    """From ``low`` to ``high``, both included."""

    low: float
    high: float

    @property
    def excludes_zero(self) -> bool:
        """Whether zero lies outside."""
        return self.low > 0.0 or self.high < 0.0


@dataclass(frozen=True)
class Difference:
    """The second side less the first, over the seeds that both have a value for.

    Attributes:
        mean: of the differences; None without a pair.
        interval: of that mean; None with fewer than two pairs.
        pairs: seeds that both sides have a value for.
        left_out: seeds that both ran, and one or both have no value for.
    """

    mean: float | None
    interval: Interval | None
    pairs: int
    left_out: int = 0

    @property
    def called(self) -> bool:
        """Whether it is called a difference."""
        return self.pairs >= FEWEST_PAIRS and self.interval is not None and self.interval.excludes_zero


class Verdict(StrEnum):
    """What the second side is beside the first, or why nothing is told; the values are the words for people."""

    BETTER = "better"
    WORSE = "worse"
    HIGHER = "higher"
    LOWER = "lower"
    NOT_TOLD = "no difference told"
    TOO_FEW = "too few seeds"
    ONE_DRIVE = "one drive: not told"
    OTHER_DRIVES = "other drives"
    NO_VALUE = "no value"


@dataclass(frozen=True)
class Best:
    """The best pair of a scenario, and how the others stand to it.

    Attributes:
        pair: with the best mean.
        others: each other pair less the best one. The interval knows that the best was picked by the same values.
        incomplete: pairs without a value for a seed that most have one for; they take no part.
    """

    pair: Pair
    others: Mapping[Pair, Difference]
    incomplete: tuple[Pair, ...] = ()


def tail(count: int) -> float:
    """Share of the resampled means beyond either end of an interval: alpha' / 2 of Hesterberg, for ``count`` > 1."""
    student = stdtrit(count - 1, 0.5 + LEVEL / 2.0)
    return float(ndtr(-math.sqrt(count / (count - 1)) * student))


@cache
def _weights(count: int) -> Floats:
    """(RESAMPLES, count) share of each value in each resample; the second half is the first one mirrored.

    So the interval of negated values, sorted, is exactly the negated interval.
    """
    rng = np.random.default_rng([RESAMPLING_SEED, count])
    drawn = rng.multinomial(count, np.full(count, 1.0 / count), RESAMPLES // 2)
    return np.concatenate([drawn, drawn[:, ::-1]]) / count


def intervals(values: Floats) -> Floats:
    """Expanded percentile intervals of the means of many groups.

    Args:
        values: (G, n) a group's in each row, in any order; what is not finite is no value.

    Returns:
        (G, 2) low and high end; NaN where a group has fewer than two values.
    """
    ordered = np.sort(np.where(np.isfinite(values), values, np.nan), axis=1)  # NaN goes last
    counts = np.isfinite(ordered).sum(axis=1)
    found = np.full((len(ordered), 2), np.nan)
    for count in np.unique(counts[counts > 1]):
        alike = np.flatnonzero(counts == count)
        for batch in np.array_split(alike, math.ceil(len(alike) / BATCH)):
            sample = ordered[batch, :count]
            mean = sample.mean(axis=1, keepdims=True)
            resampled = _weights(int(count)) @ (sample - mean).T
            found[batch] = mean + np.quantile(resampled, [tail(count), 1.0 - tail(count)], axis=0).T
    return found


def differences(sides: Sequence[tuple[Seeds, Seeds]]) -> list[Difference]:
    """Paired differences, second side less first; each with the interval of its mean.

    Seeds that one side did not run are no pairs and are not counted.
    """
    shared = [sorted(first.keys() & second.keys()) for first, second in sides]
    table = np.full((2, len(sides), max(map(len, shared), default=0)), np.nan)
    for row, (seeds, both) in enumerate(zip(shared, sides, strict=True)):
        table[:, row, : len(seeds)] = [[one[seed] for seed in seeds] for one in both]
    apart = table[1] - table[0]
    sizes = np.abs(np.where(np.isfinite(apart), table, 0.0)).max(axis=(0, 2), initial=0.0)
    ends = _settled(intervals(apart), sizes)
    found = []
    for row, end, seeds in zip(apart, ends, shared, strict=True):
        known = row[np.isfinite(row)]
        mean = float(known.mean()) if len(known) else None
        found.append(Difference(mean, _interval(end), len(known), len(seeds) - len(known)))
    return found


def _settled(ends: Floats, sizes: Floats) -> Floats:
    """Ends (G, 2) of differences of values as large as (G,): those that are zero but for rounding are zero."""
    return np.where(np.abs(ends) <= ROUNDING * sizes[:, None], 0.0, ends)


def _interval(ends: Floats) -> Interval | None:
    return Interval(float(ends[0]), float(ends[1])) if np.isfinite(ends).all() else None


def better(column: str) -> Better:
    """Which way a column of ``results.csv`` is better. Raises ``UnknownName``."""
    ways: dict[str, Better] = {metric.name: metric.better for metric in METRICS}
    ways.update(dict.fromkeys(COSTS, "lower"))
    if column not in ways:
        raise UnknownName("metric", column, list(ways))
    return ways[column]


def verdict(difference: Difference, column: str, one_drive: bool = False) -> Verdict:
    """What the second side of a difference is beside the first.

    Args:
        difference: second side less first.
        column: of ``results.csv`` that it was taken in. Where neither way is better, a side is higher or lower.
        one_drive: all pairs are of one recorded drive: their interval tells of the estimators' chance alone, so that
            nothing is told.

    Raises:
        UnknownName: there is no such column.
    """
    way = better(column)
    if difference.mean is None and difference.left_out:
        return Verdict.NO_VALUE
    if one_drive:
        return Verdict.ONE_DRIVE
    if difference.mean is None or difference.pairs < FEWEST_PAIRS:
        return Verdict.TOO_FEW
    if not difference.called:
        return Verdict.NOT_TOLD
    more = difference.mean > 0.0
    if way == "neither":
        return Verdict.HIGHER if more else Verdict.LOWER
    return Verdict.BETTER if more == (way == "higher") else Verdict.WORSE


def by_seed(rows: Iterable[Row], column: str) -> dict[Group, dict[int, float]]:
    """One column by group and seed; NaN where a run has no value."""
    groups: dict[Group, dict[int, float]] = {}
    for row in rows:
        value = row.values.get(column)
        known = math.nan if value is None or math.isinf(value) else value
        groups.setdefault((row.scenario, row.sensor, row.estimator), {})[row.seed] = known
    return groups


def judged(seeds: Seeds, column: str) -> Seeds:
    """The values that differences are taken of: as they are, or their distances from what the column should be near."""
    if better(column) != "near 3":
        return seeds
    return {seed: abs(value - HONEST_NEES) for seed, value in seeds.items()}


def spreads(rows: Iterable[Row], column: str) -> dict[Group, Interval | None]:
    """The interval of each group's mean over seeds; None where fewer than two runs have a value."""
    groups = by_seed(rows, column)
    table = np.full((len(groups), max(map(len, groups.values()), default=0)), np.nan)
    for row, seeds in enumerate(groups.values()):
        table[row, : len(seeds)] = list(seeds.values())
    return {group: _interval(ends) for group, ends in zip(groups, intervals(table), strict=True)}


def paired(rows: Iterable[Row], column: str, first: Pair, second: Pair) -> dict[str, Difference]:
    """By scenario that both pairs ran, the second pair less the first."""
    groups = by_seed(rows, column)
    names = [group[0] for group in groups if group[1:] == first and (group[0], *second) in groups]
    sides = [(judged(groups[name, *first], column), judged(groups[name, *second], column)) for name in names]
    return dict(zip(names, differences(sides), strict=True))


def against_best(rows: Iterable[Row], column: str) -> dict[str, Best]:
    """By scenario, the best pair in a column and how far all others are from it.

    The best pair was picked because it looked best, so a plain interval of the difference to it is too sure: of 20
    equal pairs it tells 18 % apart from the best. Here a pair's lag behind the best is held against the lag that
    resampling gives it behind whichever rival happens to be best then: multiple comparisons with the best (J. Hsu, The
    Annals of Statistics 12, 1984), bootstrapped by us. Rivals are those that a plain interval does not tell apart.

    Raises:
        ValueError: no way of the column is better.
    """
    way = better(column)
    if way == "neither":
        raise ValueError(f"no pair is best in {column}: neither way is better")
    by_scenario: dict[str, dict[Pair, Seeds]] = {}
    for (scenario, sensor, estimator), seeds in by_seed(rows, column).items():
        by_scenario.setdefault(scenario, {})[sensor, estimator] = judged(seeds, column)
    sign = 1.0 if way == "higher" else -1.0
    found = {scenario: _best_of(pairs, sign) for scenario, pairs in by_scenario.items()}
    return {scenario: best for scenario, best in found.items() if best is not None}


def _best_of(pairs: Mapping[Pair, Seeds], sign: float) -> Best | None:
    """The best pair, where more (times ``sign``) is better; None where no pair has a value."""
    seeds = _usual_seeds(pairs.values())
    whole = [pair for pair, one in pairs.items() if seeds and all(math.isfinite(one.get(s, math.nan)) for s in seeds)]
    if not whole:
        return None
    values = sign * np.array([[pairs[pair][seed] for seed in seeds] for pair in whole])
    means = values.mean(axis=1)
    best = int(means.argmax())
    sizes = np.maximum(np.abs(values).max(axis=1), np.abs(values[best]).max())
    ends = _settled(np.sort(-sign * _lags_behind(values, best), axis=1), sizes)
    others = {
        pair: Difference(float(sign * (mean - means[best])), _interval(end), len(seeds))
        for pair, mean, end in zip(whole, means, ends, strict=True)
        if pair != whole[best]
    }
    return Best(whole[best], others, tuple(pair for pair in pairs if pair not in whole))


def _usual_seeds(pairs: Iterable[Seeds]) -> list[int]:
    """Seeds that at least half of the pairs with any value have one for: one that goes on alone rules out no other."""
    known = [{seed for seed, value in one.items() if math.isfinite(value)} for one in pairs]
    counts = Counter(seed for seeds in known for seed in seeds)
    return sorted(seed for seed, count in counts.items() if 2 * count >= sum(map(bool, known)))


def _lags_behind(values: Floats, best: int) -> Floats:
    """(K, 2) intervals of how far each pair (K, n) lies behind the best; NaN with one seed."""
    count = values.shape[1]
    if count < 2:
        return np.full((len(values), 2), np.nan)
    means = values.mean(axis=1, keepdims=True)
    astray = _weights(count) @ (values - means).T  # (RESAMPLES, K)
    lags, share = means[best] - means[:, 0], tail(count)
    low, high = lags - np.quantile(astray[:, best, None] - astray, [1.0 - share, share], axis=0)
    rivals = low <= 0.0  # that might be the best as well; a bad one that scatters widely would hide all the others
    low = lags - np.quantile(astray[:, rivals].max(axis=1, keepdims=True) - astray, 1.0 - share, axis=0)
    return np.column_stack([low, high])
