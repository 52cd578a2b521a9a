"""Procrustes: scipy's value, what it must not depend on, and the similarity that goes with it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial import procrustes

from topoloc.geometry import Floats, rotate
from topoloc.mapping import onto, shape_error

seeds = st.integers(0, 2**32 - 1)


def two_shapes(seed: int, count: int) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=(count, 2))
    return truth, truth + rng.uniform(0.0, 1.0) * rng.normal(size=(count, 2))


def moved(points: Floats, seed: int) -> Floats:
    """Turned, mirrored or not, scaled and shifted."""
    rng = np.random.default_rng(seed)
    mirrored = points * [1.0, rng.choice([-1.0, 1.0])]
    return np.asarray(rng.uniform(0.1, 9.0) * rotate(mirrored, rng.uniform(-4.0, 4.0)) + rng.normal(size=2))


@given(seeds, st.integers(3, 40))
def test_it_is_that_of_scipy(seed: int, count: int) -> None:
    truth, layout = two_shapes(seed, count)
    assert shape_error(truth, layout) == pytest.approx(procrustes(truth, layout)[2], abs=1e-10)


@given(seeds, st.integers(3, 40))
def test_place_size_turn_reflection_and_order_do_not_count(seed: int, count: int) -> None:
    truth, layout = two_shapes(seed, count)
    error, order = shape_error(truth, layout), np.random.default_rng(seed).permutation(count)
    assert 0.0 <= error <= 1.0
    assert shape_error(truth, moved(layout, seed)) == pytest.approx(error, abs=1e-9)
    assert shape_error(moved(truth, seed), layout) == pytest.approx(error, abs=1e-9)
    assert shape_error(truth[order], layout[order]) == pytest.approx(error, abs=1e-9)
    assert shape_error(layout, truth) == pytest.approx(error, abs=1e-9)


@given(seeds, st.integers(3, 40))
def test_the_similarity_undoes_a_motion(seed: int, count: int) -> None:
    truth, _ = two_shapes(seed, count)
    other = moved(truth, seed + 1)
    np.testing.assert_allclose(onto(truth, other).apply(other), truth, atol=1e-8)


@given(seeds, st.integers(3, 40))
def test_what_it_leaves_is_mu(seed: int, count: int) -> None:
    """And no other similarity leaves less."""
    truth, layout = two_shapes(seed, count)
    best = onto(truth, layout)
    left = ((best.apply(layout) - truth) ** 2).sum()
    assert left / ((truth - truth.mean(axis=0)) ** 2).sum() == pytest.approx(shape_error(truth, layout), abs=1e-9)
    np.testing.assert_allclose(best.turn @ best.turn.T, np.eye(2), atol=1e-12)
    rng = np.random.default_rng(seed)
    nearby = best.scale * rng.uniform(0.9, 1.1) * rotate(layout @ best.turn, rng.normal(scale=0.1)) + best.shift
    assert ((nearby - truth) ** 2).sum() >= left - 1e-9


def test_points_on_one_spot_have_no_shape() -> None:
    shape = np.random.default_rng(0).normal(size=(4, 2))
    for pair in ((np.ones((4, 2)), shape), (shape, np.ones((4, 2)))):
        with pytest.raises(ValueError, match="one spot"):
            shape_error(*pair)
        with pytest.raises(ValueError, match="one spot"):
            onto(*pair)
