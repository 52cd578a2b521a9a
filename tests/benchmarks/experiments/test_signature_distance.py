"""Distances of Fourier signatures against metres (third seed)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.signature_distance import (
    CONFIGS,
    EXPERIMENT,
    FILTERED,
    LIGHTS,
    PLACES,
    PLAIN,
    compared,
    fitted,
    median_curve,
    pictures_at,
    poses_on,
    summary,
)
from benchmarks.worlds.image_grid import GRIDS, ImageGridSettings, ImageGridWorld, points_of
from sensors.fourier import FourierSignatureConfig
from topoloc.geometry import Floats, wrap

GRID = GRIDS["6x8"]


def on_grid(headings: float = 0.3) -> tuple[Floats, Floats]:
    """Poses on a grid, and the metres between them."""
    points = points_of(GRID)
    poses = np.column_stack([points, np.full(len(points), headings)])
    return poses, np.linalg.norm(points[:, None] - points[None], axis=2)


def test_a_distance_that_saturates_is_described_so() -> None:
    poses, metres = on_grid()
    headings = np.full(metres.shape, 0.3)
    told = summary(0.1 + np.minimum(metres, 1.5), headings, poses, GRID.spacing_m)
    assert told["same"] == pytest.approx(0.1)
    assert told["far"] == pytest.approx(1.6)
    assert told["reach"] == pytest.approx(1.5)
    assert (told["found"], told["beside"], told["heading"]) == (1.0, 1.0, 0.0)
    straight = summary(metres, headings, poses, GRID.spacing_m)
    assert straight["correlation"] == pytest.approx(1.0)
    assert told["correlation"] < straight["correlation"]


def test_the_nearest_of_another_point_is_not_found() -> None:
    poses, metres = on_grid()
    misled = metres.copy()
    misled[0] = metres[1]  # the first picture looks like its neighbour's
    misled[9] = metres[-1]
    told = summary(misled, np.zeros(metres.shape), poses, GRID.spacing_m)
    assert told["found"] == pytest.approx(1.0 - 2 / len(poses))
    assert told["beside"] == pytest.approx(1.0 - 1 / len(poses))
    assert told["heading"] == pytest.approx(np.rad2deg(0.3))


def test_the_curve_is_the_median_at_each_step() -> None:
    metres = np.array([[0.0, 0.5, 0.6], [1.0, 0.4, 0.0]])
    at, curve = median_curve(metres, np.array([[0.0, 1.0, 2.0], [7.0, 9.0, 0.2]]), 0.5)
    np.testing.assert_allclose(at, [0.0, 0.5, 1.0])
    np.testing.assert_allclose(curve, [0.1, 2.0, 7.0])


def test_a_picture_on_a_point_is_told_by_its_panorama_with_its_heading() -> None:
    world = ImageGridWorld(ImageGridSettings(grid="6x8"))
    sensor = fitted(FourierSignatureConfig(neighbours=0), world.topo_map(1000))
    chosen = [3, 20, 41]
    poses = poses_on(world, 1000)
    distance, heading = compared(sensor, pictures_at(world, poses[chosen], 1000))
    assert distance.shape == heading.shape == (3, 48)
    assert distance.argmin(axis=1).tolist() == chosen
    off = wrap(heading[np.arange(3), chosen] - poses[chosen, 2])
    assert np.rad2deg(np.abs(off)).max() < 2.0


def test_every_panel_is_drawn() -> None:
    values = {f"{place} curve {light}": [[0.0, 1.0], [0.1, 1.0]] for place in PLACES for light in LIGHTS}
    figure = Figure()
    EXPERIMENT.draw([dict.fromkeys(CONFIGS, values)], figure)
    assert len(figure.axes) == 4
    assert all(len(axes.lines) == len(LIGHTS) for axes in figure.axes)


@pytest.mark.slow
def test_signatures_tell_near_places_and_the_filter_makes_them_last() -> None:
    """The distance rises with the metres and then tells little; the filter finds more points again, in any light."""
    measured = EXPERIMENT.measure(1002)
    for column in CONFIGS:
        assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(measured[column])
    for place in PLACES:
        for light in LIGHTS:
            with_filter, without = (measured[column][f"{place} found {light}"] for column in (FILTERED, PLAIN))
            assert with_filter > 0.85
            assert with_filter > without + 0.1
        assert measured[FILTERED][f"{place} same usual"] < 0.3
        assert measured[FILTERED][f"{place} reach usual"] <= 2.0
        assert measured[FILTERED][f"{place} heading usual"] < 1.0
