"""Layouts from distances: exact ones give the shape back, and what each method may know."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from topoloc.geometry import Floats
from topoloc.mapping import LAWS, METHODS, LayoutConfig, batch, chained, incremental, laid_out, shape_error
from topoloc.mapping.picture import draw_layout

PLAIN = LayoutConfig(neighbours=0, tolerance=1e-6, iterations=4000)


def places(count: int, seed: int = 0) -> Floats:
    return np.random.default_rng(seed).uniform(-3.0, 3.0, (count, 2))


def grid(rows: int, columns: int) -> Floats:
    """Back and forth, row by row."""
    y, x = np.mgrid[:rows, :columns].astype(float)
    x[1::2] = x[1::2, ::-1].copy()
    return np.column_stack([x.ravel(), y.ravel()])


def apart(points: Floats) -> Floats:
    return np.asarray(cdist(points, points))


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", LAWS)
def test_exact_distances_give_the_shape_back(method: str, law: Any) -> None:
    truth = grid(4, 5)
    config = replace(PLAIN, stiffness=law, iterations_each=300)
    errors = [
        shape_error(truth, laid_out(method, apart(truth), config, np.random.default_rng(seed)).positions)
        for seed in range(4)
    ]
    assert min(errors) < 1e-6
    if method == "incremental":
        assert max(errors) < 1e-6  # a random start of all images may leave a fold; this one does not


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_motions_and_the_order_of_the_images_leave_the_error(seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = grid(4, 4) + rng.normal(scale=0.1, size=(16, 2))
    angle = rng.uniform(0.0, 6.0)
    turned = truth @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]]) + 5.0
    order = rng.permutation(16)
    for distances, positions in ((apart(turned), truth), (apart(truth[order]), truth[order])):
        last = laid_out("incremental", distances, replace(PLAIN, iterations_each=300), rng)
        assert shape_error(positions, last.positions) < 1e-4


def test_scaled_distances_give_the_scaled_layout() -> None:
    truth, config = places(12), LayoutConfig(stiffness="exponential")
    one, other = (
        laid_out("incremental", scale * apart(truth), config, np.random.default_rng(1)) for scale in (1.0, 250.0)
    )
    assert one.iterations == other.iterations
    np.testing.assert_allclose(other.positions, 250.0 * one.positions, rtol=1e-6, atol=1e-6)


def test_an_image_is_placed_without_knowing_later_ones() -> None:
    distances = apart(places(12))
    changed = distances.copy()
    changed[8:, :] *= 3.0
    changed[:8, 8:] *= 3.0
    one, other = (
        list(incremental(given_, LayoutConfig(iterations=30), np.random.default_rng(3)))
        for given_ in (distances, changed)
    )
    assert [len(step.positions) for step in one] == list(range(1, 13))
    np.testing.assert_array_equal(one[7].positions, other[7].positions)
    assert not np.array_equal(one[8].positions, other[8].positions)


def test_batch_gives_every_iteration_and_says_whether_it_rests() -> None:
    distances = apart(places(12))
    steps = list(batch(distances, LayoutConfig(neighbours=0), np.random.default_rng(0)))
    assert [step.iterations for step in steps] == list(range(len(steps)))
    assert [step.rests for step in steps] == [False] * (len(steps) - 1) + [True]
    moved = np.abs(steps[-1].positions - steps[-2].positions).max()
    assert moved <= LayoutConfig().tolerance * np.median(distances[np.triu_indices(12, 1)])
    *_, cut = batch(distances, LayoutConfig(iterations=3), np.random.default_rng(0))
    assert (cut.iterations, cut.rests) == (3, False)


def test_the_seed_alone_decides() -> None:
    distances = apart(places(9))
    for method in METHODS:
        one, same, other = (
            laid_out(method, distances, LayoutConfig(iterations=20), np.random.default_rng(n)).positions
            for n in (0, 0, 1)
        )
        np.testing.assert_array_equal(one, same)
        assert not np.array_equal(one, other)


def ways_written_out(distances: Floats, neighbours: int) -> Floats:
    """Floyd and Warshall's algorithm over nearest neighbours and spanning tree.

    A pair is in the tree if no way around it has shorter steps only.
    """
    count = len(distances)
    longest_step = distances.copy()
    for k in range(count):
        longest_step = np.minimum(longest_step, np.maximum(longest_step[:, k : k + 1], longest_step[k]))
    ways = np.where(longest_step == distances, distances, np.inf)
    for i in range(count):
        for j in sorted((j for j in range(count) if j != i), key=lambda j: distances[i, j])[:neighbours]:
            ways[i, j] = ways[j, i] = distances[i, j]
    for k in range(count):
        ways = np.minimum(ways, ways[:, k : k + 1] + ways[k])
    return ways


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 6))
def test_chains_are_shortest_ways(seed: int, neighbours: int) -> None:
    distances = apart(places(14, seed))
    chains = chained(distances, neighbours)
    np.testing.assert_allclose(chains, ways_written_out(distances, neighbours))
    np.testing.assert_allclose(chains, chains.T)


@given(st.integers(0, 2**32 - 1))
def test_chains_do_not_depend_on_the_order_of_the_images(seed: int) -> None:
    distances, order = apart(places(14, seed)), np.random.default_rng(seed).permutation(14)
    np.testing.assert_allclose(chained(distances[np.ix_(order, order)], 3), chained(distances, 3)[np.ix_(order, order)])


def test_chains_join_groups_far_from_each_other_by_the_shortest_way_between() -> None:
    points = np.concatenate([places(5), places(5, 1) + np.array([100.0, 0.0])])
    distances = apart(points)
    chains = chained(distances, 2)
    assert np.isfinite(chains).all()
    assert chains[:5, 5:].min() == pytest.approx(distances[:5, 5:].min())


def test_without_chains_distances_stay_as_they_are() -> None:
    distances = apart(places(6))
    np.testing.assert_array_equal(chained(distances, 0), distances)
    np.testing.assert_array_equal(chained(distances, 5), distances)
    equal = chained(np.zeros((4, 4)), 1)
    assert np.isfinite(equal).all() and equal.max() < 1e-300  # four pictures of one place


def test_chains_straighten_distances_that_do_not_grow_any_more() -> None:
    """Distances of pictures behave so: beyond a step or two all places are as different as can be."""
    truth = grid(6, 9)
    saturated = 1.0 - np.exp(-apart(truth))
    plain, chains = (
        shape_error(truth, laid_out("incremental", saturated, config, np.random.default_rng(0)).positions)
        for config in (LayoutConfig(neighbours=0), LayoutConfig())
    )
    assert chains < 0.03 < plain


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("reach", 0.0),
        ("damping", -1.0),
        ("step", 0.6),
        ("step", 0.0),
        ("tolerance", float("nan")),
        ("beside", 0.0),
        ("iterations", 0),
        ("iterations_each", 0),
        ("neighbours", -1),
    ],
)
def test_settings_out_of_range(field: str, value: float) -> None:
    changes: dict[str, Any] = {field: value}
    with pytest.raises(ValueError, match=field):
        LayoutConfig(**changes)


def test_picture_beside_the_truth_and_alone() -> None:
    truth = places(5)
    edges = np.array(list(pairwise(range(5))))
    assert [axes.get_title() for axes in draw_layout(truth + 0.1, truth, edges, "m", "made").axes] == ["truth", "made"]
    alone = draw_layout(truth, None, edges, "m", "made")
    assert len(alone.axes) == 1 and len(alone.axes[0].lines) == len(edges)


def test_most_images_alike_still_have_a_unit() -> None:
    """Nine equal pictures and three others: the median distance is 0, and no length to measure by."""
    spots = np.concatenate([np.zeros((9, 2)), [[1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]])
    distances = np.linalg.norm(spots[:, None] - spots, axis=2)
    last = laid_out("batch", distances, LayoutConfig(neighbours=0), np.random.default_rng(0))
    assert np.isfinite(last.positions).all()
    assert np.ptp(last.positions, axis=0).max() > 0.3


def test_dampers_too_strong_for_the_step_are_refused() -> None:
    with pytest.raises(ValueError, match="fly apart"):
        LayoutConfig(damping=1.2)
    LayoutConfig(damping=1.2, step=0.4)
