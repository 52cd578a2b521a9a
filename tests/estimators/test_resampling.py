from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.monte_carlo import resampling as filterpy_resampling
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta, kstest

from estimators import resampling as ours
from estimators.resampling import RESAMPLERS, multinomial, residual, stratified, systematic

WEIGHTS = np.array([0.0, 0.05, 0.3, 0.0, 0.45, 0.2, 0.0])
weight_lists = st.lists(st.floats(0.0, 1e6), min_size=1, max_size=30).filter(lambda w: sum(w) > 0.0)
seeds = st.integers(0, 2**32 - 1)


def counts(name: str, n: int, seed: int) -> np.ndarray:
    return np.bincount(RESAMPLERS[name](WEIGHTS, n, np.random.default_rng(seed)), minlength=len(WEIGHTS))


@pytest.mark.parametrize("name", RESAMPLERS)
def test_expected_counts_are_n_times_the_weight(name: str) -> None:
    drawn = np.array([counts(name, 13, seed) for seed in range(3000)])
    # the multinomial's count, the widest, deviates by sqrt(13 / 4); 5 standard errors over 3000 draws are 0.17
    assert np.abs(drawn.mean(axis=0) - 13 * WEIGHTS).max() < 0.17


def test_systematic_strays_less_than_multinomial() -> None:
    spread = {name: np.var([counts(name, 13, seed) for seed in range(500)], axis=0).sum() for name in RESAMPLERS}
    assert spread["systematic"] < spread["stratified"] < spread["multinomial"]
    assert spread["residual"] < spread["multinomial"]


@given(weight_lists, seeds)
def test_systematic_counts_are_the_expected_ones_rounded(weights: list[float], seed: int) -> None:
    share = np.array(weights) / np.sum(weights)
    drawn = np.bincount(systematic(weights, 50, np.random.default_rng(seed)), minlength=len(weights))
    assert (np.abs(drawn - 50 * share) < 1.0 + 1e-9).all()


@given(weight_lists, seeds)
def test_residual_keeps_the_whole_part_for_certain(weights: list[float], seed: int) -> None:
    share = np.array(weights) / np.sum(weights)
    drawn = np.bincount(residual(weights, 50, np.random.default_rng(seed)), minlength=len(weights))
    assert (drawn >= np.floor(50 * share - 1e-9)).all()


@pytest.mark.parametrize("name", RESAMPLERS)
@given(weight_lists, seeds, st.integers(1, 60))
def test_indices_are_n_and_never_of_weight_zero(name: str, weights: list[float], seed: int, n: int) -> None:
    chosen = RESAMPLERS[name](weights, n, np.random.default_rng(seed))
    assert chosen.shape == (n,)
    assert (np.array(weights)[chosen] > 0.0).all()


class Same(np.random.Generator):
    """Gives one number, whatever is asked for."""

    def __init__(self, number: float) -> None:
        super().__init__(np.random.PCG64(0))
        self.number = number

    def random(self, *args: int) -> Any:  # type: ignore[override]
        return np.full(args, self.number) if args else self.number


def searched(weights: np.ndarray, points: np.ndarray) -> np.ndarray:
    """The same literally: each point's place in the cumulated weights; none lies at one or above."""
    cumulated = np.cumsum(weights) / np.cumsum(weights)[-1]
    return np.asarray(np.searchsorted(cumulated, np.minimum(points, np.nextafter(1.0, 0.0)), side="right"))


even_and_awkward = st.lists(st.sampled_from([0.0, 1.0, 2.0, 1.0 / 3.0, 0.1, 1e-12, 1e6]), min_size=1, max_size=40)


@given(
    weight_lists | even_and_awkward.filter(any),
    st.integers(1, 70),
    st.sampled_from([0.0, 5e-324, 0.5, float(np.nextafter(1.0, 0.0))]) | st.floats(0.0, 1.0, exclude_max=True),
)
def test_counting_gives_the_indices_of_a_search(weights: list[float], n: int, number: float) -> None:
    """Where points fall on the ends of shares, too: equal weights, and numbers that round."""
    expected = searched(np.array(weights), (np.arange(n) + number) / n)
    assert np.array_equal(systematic(weights, n, Same(number)), expected)
    assert np.array_equal(stratified(weights, n, Same(number)), expected)


@given(weight_lists | even_and_awkward.filter(any), st.integers(1, 70), seeds)
def test_stratified_gives_the_indices_of_a_search(weights: list[float], n: int, seed: int) -> None:
    points = (np.arange(n) + np.random.default_rng(seed).random(n)) / n
    drawn = stratified(weights, n, np.random.default_rng(seed))
    assert np.array_equal(drawn, searched(np.array(weights), points))


@pytest.mark.parametrize("name", RESAMPLERS)
def test_only_the_ratios_of_weights_count(name: str) -> None:
    whole, scaled = (RESAMPLERS[name](w, 20, np.random.default_rng(3)) for w in (WEIGHTS, WEIGHTS * 2.0**60))
    assert np.array_equal(whole, scaled)


def test_the_last_point_may_round_up_to_one() -> None:
    chosen = systematic([1.0, 1.0, 0.0], 10**6, Same(float(np.nextafter(1.0, 0.0))))
    assert chosen.max() == 1


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [1.0, -1.0, 2.0], [np.nan, 1.0], [np.inf, 1.0]])
def test_weights_that_mean_nothing_are_refused(weights: list[float]) -> None:
    with pytest.raises(ValueError, match="weights"):
        multinomial(weights, 3, np.random.default_rng(0))


@pytest.mark.parametrize("name", ["systematic", "stratified"])
@given(weight_lists, seeds)
def test_indices_are_filterpys_for_the_same_random_numbers(name: str, weights: list[float], seed: int) -> None:
    share = np.array(weights) / np.sum(weights)
    count = len(share)  # filterpy draws as many as there are weights
    drawn = np.random.default_rng(seed).random(1 if name == "systematic" else count)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(filterpy_resampling, "random", lambda *shape: drawn if shape else float(drawn[0]))
        theirs = getattr(filterpy_resampling, f"{name}_resample")(share)
    ours = RESAMPLERS[name](share, count, np.random.default_rng(seed))
    points = (np.arange(count) + drawn) / count
    clear = np.abs(points[:, None] - np.cumsum(share)).min(axis=1) > 1e-9  # on a border rounding decides
    assert np.array_equal(np.sort(theirs)[clear], np.sort(ours)[clear])


@pytest.mark.parametrize("name", RESAMPLERS)
def test_none_can_be_asked_for(name: str) -> None:
    assert RESAMPLERS[name](WEIGHTS, 0, np.random.default_rng(0)).shape == (0,)


@pytest.mark.parametrize("name", RESAMPLERS)
def test_indices_are_ascending_where_the_certain_ones_do_not_come_first(name: str) -> None:
    chosen = RESAMPLERS[name](np.arange(1.0, 51.0), 40, np.random.default_rng(4))
    copies = 40 * np.arange(1.0, 51.0) // (50 * 51 / 2) if name == "residual" else np.zeros(50)
    assert (np.diff(chosen[int(copies.sum()) :]) >= 0).all()


def test_more_weights_than_are_worked_on_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    weights = np.random.default_rng(5).exponential(size=1000) ** 4
    for name in ("systematic", "stratified"):
        whole = RESAMPLERS[name](weights, 700, np.random.default_rng(6))
        with monkeypatch.context() as patch:
            patch.setattr(ours, "CACHED", 64)
            assert np.array_equal(RESAMPLERS[name](weights, 700, np.random.default_rng(6)), whole)


def test_the_multinomials_points_are_uniform_and_independent() -> None:
    """Sorted uniform numbers: the k-th of n is Beta(k, n + 1 - k), and the gaps between them forget each other."""
    points = np.array([ours._ordered_points(9, np.random.default_rng(seed)) for seed in range(4000)])
    assert (np.diff(points, axis=1) >= 0.0).all() and (points < 1.0).all()
    for k in range(9):
        assert kstest(points[:, k], beta(k + 1, 9 - k).cdf).pvalue > 1e-4
    gaps = np.diff(points, axis=1)
    # gaps of uniform points are correlated by -1 / n; 5 standard errors of a correlation are 0.08
    assert np.abs(np.corrcoef(gaps.T)[np.triu_indices(8, 1)] + 1.0 / 9.0).max() < 0.08


def test_residual_copies_are_those_of_the_definition() -> None:
    """floor(n w) copies of each, then a draw by n w - floor(n w): the literal algorithm with the same numbers."""
    weights = np.array([0.37, 0.05, 0.33, 0.25])
    for seed in range(20):
        expected = [index for index, weight in enumerate(weights) for _ in range(int(17 * weight))]
        left = 17 * weights - np.floor(17 * weights)
        border = np.cumsum(left) / left.sum()
        points = ours._ordered_points(17 - len(expected), np.random.default_rng(seed))
        expected += [int(np.flatnonzero(point < border)[0]) for point in points]
        assert sorted(residual(weights, 17, np.random.default_rng(seed))) == sorted(expected)
