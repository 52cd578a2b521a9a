"""Bootstrap intervals: against scipy's, by their laws, and by how often they hold what they promise."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from benchmarks import spread
from benchmarks.results import Row
from benchmarks.spread import (
    Difference,
    Interval,
    Verdict,
    against_best,
    better,
    differences,
    intervals,
    paired,
    spreads,
    tail,
    verdict,
)
from topoloc.errors import UnknownName
from topoloc.geometry import Floats

SEED = 20
GROUPS = 4000
"""Groups of a statistical test: a share near 5 % is off by 0.35 % (one standard deviation)."""
SAMPLES = st.lists(st.integers(-1000, 1000).map(lambda value: value / 100.0), min_size=2, max_size=12)
IMA, PCA = ("ima", "activity"), ("pca", "particle")


def rows_of(values: Mapping[tuple[str, str], Sequence[float | None]], column: str = "node_accuracy") -> list[Row]:
    return [
        Row("lab", *pair, seed, values={column: value})
        for pair, seeds in values.items()
        for seed, value in enumerate(seeds)
    ]


def difference(first: list[float], second: list[float]) -> Difference:
    return differences([(dict(enumerate(first)), dict(enumerate(second)))])[0]


def covering(values: Floats, mean: float) -> float:
    low, high = intervals(values).T
    return float(np.mean((low <= mean) & (mean <= high)))


# --- intervals ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [6, 10])
def test_agrees_with_the_percentile_bootstrap_of_scipy_at_the_expanded_level(count: int) -> None:
    sample = np.random.default_rng(SEED).gamma(2.0, size=count)
    theirs = stats.bootstrap(
        (sample,),
        np.mean,
        n_resamples=100_000,
        confidence_level=1.0 - 2.0 * tail(count),
        method="percentile",
        rng=np.random.default_rng(SEED),
    ).confidence_interval
    error = sample.std() / math.sqrt(count)
    assert intervals(sample[None])[0] == pytest.approx(theirs, abs=0.15 * error)  # ours has 4000 resamples


def test_the_level_is_that_of_the_formula() -> None:
    """By hand for n = 10: t = 2.2622, times sqrt(10 / 9) is 2.3845, and the normal tail beyond that is 0.00855."""
    assert tail(10) == pytest.approx(0.00855, abs=1e-5)
    assert tail(100_000) == pytest.approx(0.025, abs=1e-5)


@given(sample=SAMPLES, shift=st.floats(-5.0, 5.0), scale=st.floats(0.1, 5.0), order=st.randoms(use_true_random=False))
@settings(max_examples=60, deadline=None)
def test_laws(sample: list[float], shift: float, scale: float, order: object) -> None:
    values = np.array(sample)
    low, high = intervals(values[None])[0]
    near = pytest.approx
    assert values.min() - 1e-9 <= low <= values.mean() + 1e-9
    assert values.mean() - 1e-9 <= high <= values.max() + 1e-9
    assert intervals(values[None] + shift)[0] == near([low + shift, high + shift], abs=1e-9)
    assert intervals(values[None] * scale)[0] == near([low * scale, high * scale], abs=1e-9)
    assert intervals(-values[None])[0] == near([-high, -low], abs=1e-9)
    order.shuffle(sample)  # type: ignore[attr-defined]
    assert intervals(np.array([sample]))[0].tolist() == [low, high]


def test_groups_do_not_depend_on_each_other_and_values_may_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(SEED)
    values = rng.normal(size=(7, 8))
    values[1, 2:5] = np.nan
    values[2, 1:] = np.nan
    values[3] = np.nan
    values[4, 0] = -np.inf
    monkeypatch.setattr(spread, "BATCH", 2)
    together = intervals(values)
    for row, found in zip(values, together, strict=True):
        known = row[np.isfinite(row)]
        alone = intervals(known[None])[0]
        assert found == pytest.approx(alone, abs=1e-12, nan_ok=True)
        assert np.isnan(found).all() == (len(known) < 2)
    assert intervals(np.zeros((0, 3))).shape == (0, 2)


def test_of_two_values_the_interval_is_from_one_to_the_other() -> None:
    assert intervals(np.array([[3.0, 1.0]]))[0].tolist() == [1.0, 3.0]


@pytest.mark.parametrize(
    ("count", "law", "expanded", "plain"),
    [
        (6, "normal", 0.926, 0.86),
        (10, "normal", 0.945, 0.90),
        (6, "exponential", 0.88, 0.80),
        (10, "exponential", 0.91, 0.86),
    ],
)
def test_how_often_the_mean_is_covered(
    count: int, law: str, expanded: float, plain: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """95 % is promised, and nearly kept for normal values alone; the plain percentile interval is worse everywhere."""
    rng = np.random.default_rng([SEED, count])
    values = rng.normal(size=(GROUPS, count)) if law == "normal" else rng.exponential(size=(GROUPS, count)) - 1.0
    ours = covering(values, 0.0)
    assert ours == pytest.approx(expanded, abs=0.02)
    monkeypatch.setattr(spread, "tail", lambda count: 0.025)
    theirs = covering(values, 0.0)
    assert theirs == pytest.approx(plain, abs=0.02)
    assert theirs < ours - 0.03


# --- differences ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("pairs", "most"), [(6, 0.08), (7, 0.065), (8, 0.065), (10, 0.06)])
def test_how_often_equal_sides_are_told_apart(pairs: int, most: float) -> None:
    """Two estimators that are right in 90 % of 60 updates, in drives that are easier or harder for both."""
    rng = np.random.default_rng([SEED, pairs])
    rate = rng.uniform(0.8, 1.0, (GROUPS, pairs))
    sides = [rng.binomial(60, rate) / 60.0 for _ in range(2)]
    found = differences([tuple(dict(enumerate(side)) for side in both) for both in zip(*sides, strict=True)])  # type: ignore[misc]
    called = np.mean([one.called for one in found])
    assert 0.02 < called < most


def test_a_difference_by_hand() -> None:
    found = difference([0.5, 0.6, 0.7], [0.6, 0.8, 0.7])
    assert found.mean == pytest.approx(0.1)
    assert found.interval is not None
    assert (found.interval.low, found.interval.high) == pytest.approx((0.0, 0.2))  # of three: from least to most
    assert (found.pairs, found.left_out, found.called) == (3, 0, False)


@pytest.mark.parametrize(("pairs", "called"), [(5, False), (6, True)])
def test_a_plain_difference_is_called_one_from_six_pairs_on(pairs: int, called: bool) -> None:
    found = difference([0.5] * pairs, [0.7, 0.8] * 2 + [0.75] * (pairs - 4))
    assert found.interval is not None and found.interval.excludes_zero
    assert found.called is called


def test_equal_values_make_no_difference() -> None:
    assert difference([0.3, 0.7] * 5, [0.3, 0.7] * 5) == Difference(0.0, Interval(0.0, 0.0), 10)


def test_a_rest_of_rounding_is_no_difference() -> None:
    """Six digits of thirds: what is the same difference in 60 updates differs in the sixth."""
    first, second = [0.666667, 0.333333] * 5, [0.333334, 0.000001] * 5
    shifted = [value + 0.333332 for value in second]
    assert difference(first, second).called
    assert not difference(first, shifted).called


@given(pairs=st.lists(st.tuples(*[st.integers(0, 60)] * 2), min_size=2, max_size=10))
@settings(max_examples=40, deadline=None)
def test_swapping_the_sides_mirrors_the_difference(pairs: list[tuple[int, int]]) -> None:
    first, second = ([value / 60.0 for value in side] for side in zip(*pairs, strict=True))
    there, back = difference(first, second), difference(second, first)
    assert there.interval is not None and back.interval is not None and there.mean is not None
    assert (back.mean, back.interval.low, back.interval.high) == pytest.approx(
        (-there.mean, -there.interval.high, -there.interval.low), abs=1e-9
    )
    assert there.called == back.called


def test_only_seeds_of_both_are_pairs_and_missing_values_are_counted() -> None:
    first = {0: 0.5, 1: 0.25, 2: math.nan, 3: 0.1}
    second = {1: 0.75, 2: 0.9, 3: math.nan, 4: 0.2}
    nothing = ({0: 1.0}, {1: 1.0})
    assert differences([(first, second), nothing, ({}, {})]) == [
        Difference(0.5, None, 1, 2),
        Difference(None, None, 0),
        Difference(None, None, 0),
    ]
    assert differences([]) == []


# --- the word for it ------------------------------------------------------------------------------------------------

MORE, LESS = Difference(0.1, Interval(0.05, 0.2), 6), Difference(-0.1, Interval(-0.2, -0.05), 6)


@pytest.mark.parametrize(
    ("column", "of_more", "of_less"),
    [
        ("node_accuracy", Verdict.BETTER, Verdict.WORSE),
        ("position_median_m", Verdict.WORSE, Verdict.BETTER),
        ("nees", Verdict.WORSE, Verdict.BETTER),  # farther from 3
        ("estimator_ms", Verdict.WORSE, Verdict.BETTER),
        ("steps", Verdict.HIGHER, Verdict.LOWER),
    ],
)
def test_the_word_knows_which_way_is_better(column: str, of_more: Verdict, of_less: Verdict) -> None:
    assert (verdict(MORE, column), verdict(LESS, column)) == (of_more, of_less)


@pytest.mark.parametrize(
    ("found", "word"),
    [
        (Difference(0.1, Interval(-0.05, 0.2), 6), "no difference told"),
        (Difference(0.1, Interval(0.0, 0.2), 6), "no difference told"),
        (Difference(0.1, Interval(0.05, 0.2), 5), "too few seeds"),
        (Difference(0.1, None, 1, 9), "too few seeds"),
        (Difference(None, None, 0), "too few seeds"),  # no seed of both
        (Difference(None, None, 0, 6), "no value"),
    ],
)
def test_why_nothing_is_told(found: Difference, word: str) -> None:
    assert verdict(found, "node_accuracy") == word


def test_of_one_drive_nothing_is_told() -> None:
    for found in (MORE, LESS, Difference(0.1, Interval(0.1, 0.1), 6), Difference(0.1, Interval(0.1, 0.1), 2)):
        assert verdict(found, "node_accuracy", one_drive=True) == "one drive: not told"
    assert verdict(Difference(None, None, 0, 6), "node_accuracy", one_drive=True) == "no value"


def test_the_word_needs_a_metric() -> None:
    with pytest.raises(UnknownName, match="no metric is called 'speed'"):
        verdict(MORE, "speed")


# --- of rows --------------------------------------------------------------------------------------------------------


def test_each_group_has_its_interval() -> None:
    found = spreads(rows_of({IMA: [0.5, 0.7], PCA: [0.4, None]}), "node_accuracy")
    assert found == {("lab", *IMA): Interval(0.5, 0.7), ("lab", *PCA): None}
    assert spreads([], "nees") == {}


def test_pairs_of_one_scenario() -> None:
    rows = [*rows_of({IMA: [0.5, 0.7, None], PCA: [0.4, 0.4, 0.4]}), Row("hall", *IMA, 0, values={})]
    found = paired(rows, "node_accuracy", IMA, PCA)
    assert list(found) == ["lab"]
    assert found["lab"].mean == pytest.approx(-0.2)
    assert (found["lab"].pairs, found["lab"].left_out) == (2, 1)


def test_what_should_be_near_three_is_judged_by_its_distance_from_three() -> None:
    found = paired(rows_of({IMA: [1.0, 2.0], PCA: [5.0, 4.0]}, "nees"), "nees", IMA, PCA)
    assert found["lab"].mean == pytest.approx(0.0)


def test_which_way_is_better() -> None:
    assert [better(name) for name in ("node_accuracy", "sensor_ms", "nees", "steps")] == [
        "higher",
        "lower",
        "near 3",
        "neither",
    ]
    with pytest.raises(UnknownName, match="no metric is called 'speed'; choose from: steps, node_accuracy"):
        better("speed")


# --- against the best -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("column", "mean"), [("node_accuracy", -0.4), ("position_median_m", 0.4)])
def test_the_best_pair_and_the_others(column: str, mean: float) -> None:
    good, bad = [0.9, 0.8, 0.9, 0.8, 0.9, 0.8], [0.5, 0.4] * 3
    if column == "position_median_m":
        good, bad = bad, good
    other = ("pca", "grid")
    found = against_best(rows_of({PCA: bad, IMA: good, other: [*bad[:5], None]}, column), column)["lab"]
    assert (found.pair, list(found.others), found.incomplete) == (IMA, [PCA], (other,))
    lag = found.others[PCA]
    assert lag.mean == pytest.approx(mean)
    assert lag.called and lag.interval is not None
    assert lag.interval.low - 1e-9 <= mean <= lag.interval.high + 1e-9


def test_one_pair_that_ran_on_alone_rules_out_no_other() -> None:
    found = against_best(rows_of({IMA: [0.5, 0.5, 0.9], PCA: [0.6, 0.6], ("pca", "grid"): [0.1, 0.1]}), "node_accuracy")
    assert (found["lab"].pair, found["lab"].incomplete) == (PCA, ())


def test_of_one_seed_there_is_a_best_without_an_interval() -> None:
    found = against_best(rows_of({IMA: [0.5], PCA: [0.75]}), "node_accuracy")["lab"]
    assert found.others == {IMA: Difference(-0.25, None, 1)}


def test_nothing_is_best_without_values_or_without_a_better_way() -> None:
    assert against_best(rows_of({IMA: [None]}), "node_accuracy") == {}
    with pytest.raises(ValueError, match="neither way is better"):
        against_best([], "steps")


def test_the_best_of_many_equal_ones_is_not_taken_for_better() -> None:
    """Of 20 equal pairs in 10 seeds, plain intervals tell more than a tenth of the others apart from the best."""
    rng, scenarios, pairs, seeds = np.random.default_rng(SEED), 60, 20, 10
    rows = [
        Row(f"lab{drive}", "ima", f"{pair}", seed, values={"node_accuracy": value})
        for drive in range(scenarios)
        for (pair, seed), value in np.ndenumerate(rng.normal(0.8, 0.05, (pairs, seeds)))
    ]
    found = against_best(rows, "node_accuracy")
    plain = [
        paired([row for row in rows if row.scenario == name], "node_accuracy", best.pair, other)[name].called
        for name, best in list(found.items())[:10]
        for other in best.others
    ]
    assert np.mean(plain) > 0.1
    assert np.mean([lag.called for best in found.values() for lag in best.others.values()]) < 0.05


def test_a_bad_pair_that_scatters_hides_no_difference() -> None:
    rng = np.random.default_rng(SEED)
    wild = {("wild", f"{k}"): rng.normal(-15.0, 5.0, 10).tolist() for k in range(5)}
    values = {IMA: rng.normal(3.0, 1.0, 10).tolist(), PCA: rng.normal(0.0, 1.0, 10).tolist(), **wild}
    found = against_best(rows_of(values), "node_accuracy")["lab"]
    assert found.pair == IMA and found.others[PCA].called
