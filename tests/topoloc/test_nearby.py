"""Points near places, against all distances; and the likelihood of many hypotheses, against all of them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc import nearby as module
from topoloc.mixture import Mixture
from topoloc.nearby import Nearby
from topoloc.types import Evidence

seeds = st.integers(0, 2**32 - 1)


def found(nearby: Nearby, places: np.ndarray, count: int) -> np.ndarray:
    """(P, M) whether a point is in the tile of a place; each place must be in one tile, at its own coordinates."""
    pairs, times = np.zeros((len(places), count + 1), dtype=bool), np.zeros(len(places), dtype=int)
    for tiles in nearby.tiles(places):
        assert tiles.places.size * (1 + tiles.points.shape[1]) <= 2 * module.TOGETHER
        pairs[tiles.places[:, :, None], tiles.points[:, None, :]] = True
        for members in tiles.places:
            times[np.unique(members)] += 1
            assert (members[len(np.unique(members)) :] == members[-1]).all()
    assert (times == 1).all()
    return pairs[:, :count]


@settings(max_examples=60, deadline=None)
@given(
    seeds,
    st.sampled_from([0.0, 3e6]),
    st.sampled_from([0.3, 2.0, 11.0]),
    st.sampled_from([1, 7, 300]),
    st.sampled_from([0.0, 4.0, 60.0, 1e6]),
)
def test_what_is_in_reach_is_found(seed: int, origin: float, reach: float, count: int, spread: float) -> None:
    rng = np.random.default_rng(seed)
    points = origin + rng.uniform(0.0, [40.0, 15.0], (count, 2))
    places = points[rng.integers(count, size=200)] + spread * rng.normal(size=(200, 2))
    distance = np.linalg.norm(places[:, None] - points, axis=2)
    pairs = found(Nearby(points, reach), places, count)
    assert pairs[distance <= reach * (1.0 - 1e-9)].all()
    assert not pairs[distance > 3.0 * np.sqrt(2.0) * reach].any()  # five cells of half a reach, corner to corner


def test_many_places_of_one_cell_and_single_ones_are_tiled() -> None:
    points = np.column_stack([np.arange(100.0), np.zeros(100)])
    places = np.concatenate([np.full((1000, 2), 50.2), [[3.0, 0.0]], points[::7], [[1e300, -1e300]]])
    pairs = found(Nearby(points, 2.0), places, 100)
    assert not pairs[-1].any()
    assert pairs[1000, [1, 2, 3, 4, 5]].all() and not pairs[1000, 20:].any()


def test_no_places_make_no_tiles() -> None:
    assert list(Nearby(np.zeros((1, 2)), 1.0).tiles(np.zeros((0, 2)))) == []


def test_a_search_is_made_where_it_is_worthwhile() -> None:
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    points = np.column_stack([x.ravel(), y.ravel()])
    assert Nearby.worthwhile(points, 2.0) is not None
    assert Nearby.worthwhile(points[:50], 0.1) is None  # few
    for reach in (8.0, np.inf, np.nan, 0.0, 1e-12):  # most in reach; none known; more cells than can be numbered
        assert Nearby.worthwhile(points, reach) is None


def wide_evidence(seed: int, count: int = 900, **fields: Any) -> Evidence:
    """Hypotheses a metre apart, as a map of many nodes gives them."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(30.0), np.arange(count / 30.0))
    poses = np.column_stack([x.ravel(), y.ravel(), rng.uniform(-np.pi, np.pi, count)])
    values: dict[str, Any] = {
        "poses": poses,
        "nodes": np.arange(count),
        "match": np.full(count, 0.5),
        "distance": np.full(count, 0.5),
        "log_likelihoods": rng.normal(-1.0, 2.0, count),
        "sigma": rng.uniform(0.2, 0.5, count),
        "kappa": rng.choice([0.0, 3.0, 40.0], count),
        "log_floor": -4.0,
    }
    return Evidence(**{**values, **fields})


def mixture_of(evidence: Evidence) -> Mixture:
    return Mixture(evidence.poses, evidence.log_likelihoods, evidence.sigma, evidence.kappa, evidence.log_floor)


def poses_on(evidence: Evidence, seed: int, count: int) -> tuple[np.ndarray, np.ndarray]:
    """A cloud at one place, poses all over, some beside the map and far from it."""
    rng = np.random.default_rng(seed)
    low, high = evidence.poses[:, :2].min(axis=0) - 6.0, evidence.poses[:, :2].max(axis=0) + 6.0
    cloud = evidence.poses[rng.integers(len(evidence.poses)), :2] + 0.3 * rng.normal(size=(count // 2, 2))
    places = np.concatenate([cloud, rng.uniform(low, high, (count - len(cloud), 2)), [[1e5, 0.0], low - 1e3]])
    return places, rng.uniform(-np.pi, np.pi, len(places))


CASES: dict[str, dict[str, Any]] = {
    "as it comes": {},
    "no heading": {"kappa": np.zeros(900)},
    "sure": {"kappa": np.full(900, 1e4)},
    "low floor": {"log_floor": -30.0},
    "high floor": {"log_floor": 3.0},
    "hopeless ones": {"log_likelihoods": np.where(np.arange(900) % 3 == 0, -np.inf, -1.0)},
    "one alone": {"log_likelihoods": np.where(np.arange(900) == 451, 2.0, -np.inf)},
}


@pytest.mark.parametrize("name", CASES)
def test_the_sum_of_those_in_reach_is_the_sum_of_all(name: str) -> None:
    for seed in range(3):
        evidence = wide_evidence(seed, **CASES[name])
        places, headings = poses_on(evidence, seed, 1500)
        assert mixture_of(evidence)._in_reach is not None
        got = evidence.log_likelihood(places, headings[:, None])[:, 0]
        rounding = 1e-12 + 1e-15 * evidence.kappa.max()  # cosines are multiplied out, whether all are looked at or not
        np.testing.assert_allclose(got, mixture_of(evidence)._exactly(places, headings), rtol=1e-12, atol=rounding)


@pytest.mark.parametrize("origin", [1e4, 3e6])
def test_as_exact_far_from_the_origin(origin: float) -> None:
    """Where a double resolves 5e-10 m; the middle of a tile is subtracted without any loss."""
    evidence = wide_evidence(5)
    evidence = replace(evidence, poses=evidence.poses + np.array([origin, -origin, 0.0]))
    places, headings = poses_on(evidence, 6, 1500)
    got = evidence.log_likelihood(places, headings[:, None])[:, 0]
    np.testing.assert_allclose(got, mixture_of(evidence)._exactly(places, headings), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("fields", [{"log_floor": -np.inf}, {"sigma": np.full(900, 3.0)}, {"kappa": np.full(900, 1e9)}])
def test_where_nothing_can_be_left_out_all_are_summed(fields: dict[str, Any]) -> None:
    evidence = wide_evidence(1, **fields)
    places, headings = poses_on(evidence, 2, 400)
    assert mixture_of(evidence)._in_reach is None
    got = evidence.log_likelihood(places, headings[:, None])[:, 0]
    np.testing.assert_allclose(got, mixture_of(evidence)._exactly(places, headings), rtol=1e-9, atol=2e-7)


@settings(max_examples=25, deadline=None)
@given(seeds, st.sampled_from([-2.0, -12.0]), st.sampled_from([0.05, 0.4]))
def test_in_any_order_of_poses(seed: int, floor: float, sigma: float) -> None:
    evidence = wide_evidence(seed, log_floor=floor, sigma=np.full(900, sigma))
    places, headings = poses_on(evidence, seed, 600)
    order = np.random.default_rng(seed).permutation(len(places))
    got = evidence.log_likelihood(places, headings[:, None])
    other = evidence.log_likelihood(places[order], headings[order, None])
    np.testing.assert_allclose(other, got[order], rtol=1e-13, atol=1e-13)
