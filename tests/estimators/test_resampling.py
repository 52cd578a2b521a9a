from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators.resampling import RESAMPLERS, multinomial, residual, systematic

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


@pytest.mark.parametrize("name", RESAMPLERS)
def test_only_the_ratios_of_weights_count(name: str) -> None:
    whole, scaled = (RESAMPLERS[name](w, 20, np.random.default_rng(3)) for w in (WEIGHTS, WEIGHTS * 2.0**60))
    assert np.array_equal(whole, scaled)


def test_the_last_point_may_round_up_to_one() -> None:
    class Highest(np.random.Generator):
        def random(self, *args: object, **kwargs: object) -> float:  # type: ignore[override]
            return float(np.nextafter(1.0, 0.0))

    chosen = systematic([1.0, 1.0, 0.0], 10**6, Highest(np.random.PCG64(0)))
    assert chosen.max() == 1


@pytest.mark.parametrize("weights", [[], [0.0, 0.0], [1.0, -1.0, 2.0], [np.nan, 1.0], [np.inf, 1.0]])
def test_weights_that_mean_nothing_are_refused(weights: list[float]) -> None:
    with pytest.raises(ValueError, match="weights"):
        multinomial(weights, 3, np.random.default_rng(0))
