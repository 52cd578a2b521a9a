"""Features in other light (second seed, Table 1)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.illumination_ratio import (
    CHANGED,
    EXPERIMENT,
    LIGHTS,
    PAIRS,
    PROCESSES,
    TUBES,
    neighbours,
    pictures,
    ratios,
    sensor_of,
)
from benchmarks.worlds.office import LargeOfficeWorld
from sensors.disparity import Disparity
from sensors.pca import PCAMap


def test_ratio_by_hand() -> None:
    a = np.zeros((2, 2))
    b, c = np.array([[3.0, 4.0], [1.0, 0.0]]), np.array([[0.0, 5.0], [0.0, -4.0]])
    found = ratios(a, b, c)
    assert found["ratio"] == pytest.approx((1.0 + 4.0) / 2.0)
    assert found["of means"] == pytest.approx(9.0 / 6.0)


def test_published_averages_are_those_of_both_lights() -> None:
    for bulbs, daylight, mean in PROCESSES.values():
        assert mean == pytest.approx((bulbs + daylight) / 2.0, abs=0.0051)


def test_neighbours_are_half_a_metre_apart_and_look_the_same_way() -> None:
    world = LargeOfficeWorld(TUBES)
    here, there = (world.view_poses[poses] for poses in neighbours(world, np.random.default_rng(0)))
    assert len(here) == PAIRS
    np.testing.assert_allclose(np.linalg.norm(there[:, :2] - here[:, :2], axis=1), 0.5)
    np.testing.assert_array_equal(there[:, 2], here[:, 2])
    assert len(np.unique(here, axis=0)) > 0.9 * PAIRS


def test_series_of_pictures_have_their_own_noise_and_the_same_scene() -> None:
    world = LargeOfficeWorld(TUBES)
    first, again, other = (next(pictures(world, 1000, np.array([5]), series)) for series in (0, 0, 1))
    for kind in ("rgb", "right"):
        np.testing.assert_array_equal(first[kind], again[kind])
        change = np.abs(first[kind].astype(float) - other[kind]).mean()
        assert 1.0 < change < 20.0


def test_each_row_has_its_sensor() -> None:
    assert {process: type(sensor_of(process)) for process in PROCESSES} == {
        "plain": PCAMap,
        "equalised": PCAMap,
        "gradient": PCAMap,
        "disparity": Disparity,
    }
    assert sensor_of("gradient").config.preprocessing == "gradient"


def test_published_bars_stand_beside_ours() -> None:
    figure = Figure()
    one = {f"{process} mean ratio": 1.0 for process in PROCESSES}
    EXPERIMENT.draw([{AS_PUBLISHED: one}], figure)
    heights = [bar.get_height() for bar in figure.axes[0].patches if isinstance(bar, Rectangle)]
    assert heights[: len(PROCESSES)] == [4.24, 1.67, 1.24, 0.73]


@pytest.mark.slow
def test_the_order_of_table_1_holds() -> None:
    one = EXPERIMENT.measure(1004)[AS_PUBLISHED]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(one)
    for key in ("ratio", "of means"):
        order = [one[f"{process} mean {key}"] for process in PROCESSES]
        assert order == sorted(order, reverse=True)
        assert order[-1] < 1.0
    for process in PROCESSES:
        assert all(one[f"{process} {light} ratio"] > one[f"{process} tubes again ratio"] for light in CHANGED)
    assert set(CHANGED) < set(LIGHTS)
