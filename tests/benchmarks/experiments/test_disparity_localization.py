"""Disparity beside pictures in other light (second seed, Figure 5)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.disparity_localization import (
    CONDITIONS,
    DISPARITY,
    EXPERIMENT,
    ILLUMINATIONS,
    PICTURES,
    PREPROCESSING,
    WITH_DISPARITY,
    J,
    Replayed,
    located,
    sensor_error,
    sensor_models,
)
from benchmarks.worlds.office import LargeOfficeWorld
from topoloc.geometry import Floats
from topoloc.testing import evidence_for, toy_map
from topoloc.types import Evidence, Frame


def said(poses: Floats) -> Evidence:
    ones = np.ones(len(poses))
    return Evidence(poses, np.zeros(len(poses), dtype=np.int64), ones, ones, ones, ones, ones)


def test_error_by_hand() -> None:
    """30 cm and 10 degrees beat 10 cm and 90 degrees; a frame without points does not count."""
    points = [
        np.array([[0.1, 0.0, np.pi / 2.0], [0.0, 0.3, np.deg2rad(-10.0)], [2.0, 0.0, 0.0]]),
        np.array([[1.0, 1.5, np.deg2rad(179.0)]]),
        np.zeros((0, 3)),
    ]
    found = sensor_error(points, np.array([[0.0, 0.0, 0.0], [1.0, 1.0, np.deg2rad(-179.0)], [5.0, 5.0, 0.0]]))
    assert found["error"] == pytest.approx((30.0 + 50.0) / 2.0)
    assert found["spread"] == pytest.approx(10.0)
    assert found["heading"] == pytest.approx((10.0 + 2.0) / 2.0)


def test_half_of_the_points_are_disparitys() -> None:
    """As many points in both cases; a blind disparity leaves the picture's."""
    intensity, disparity = (said(np.column_stack([np.arange(J), np.full((J, 2), row)])) for row in (0.0, 1.0))
    alone, both = sensor_models([intensity, intensity], [disparity, Evidence.blind()])
    assert [len(points) for points in alone] == [J, J]
    assert [len(points) for points in both] == [J, J // 2]
    np.testing.assert_array_equal(both[0][:, 0], [*range(J // 2)] * 2)
    np.testing.assert_array_equal(both[0][:, 1], [0.0] * (J // 2) + [1.0] * (J // 2))


def test_located_by_hand() -> None:
    found = located(np.concatenate([np.full(10, 9.0), [0.1, 0.3, 0.8, 0.2]]))
    assert found["position"] == pytest.approx(35.0)
    assert found["within"] == pytest.approx(0.75)


def test_what_was_said_is_said_again() -> None:
    evidence = evidence_for(toy_map(), [1.0, 0.0, 0.0])
    sensor = Replayed({2.5: evidence})
    sensor.fit(toy_map())
    assert sensor.observe(Frame(2.5, None, np.zeros(3), {})) is evidence


def test_the_path_is_the_same_under_all_conditions() -> None:
    drives = [LargeOfficeWorld(settings).drive(1000)[1] for settings in CONDITIONS.values()]
    for drive in drives[1:]:
        np.testing.assert_array_equal(drive, drives[0])


def test_both_panels_are_drawn() -> None:
    figure = Figure()
    values = {
        f"{name} {light} {key}": 30.0
        for name in PREPROCESSING
        for light in ILLUMINATIONS
        for key in ("error", "spread")
    }
    EXPERIMENT.draw([{PICTURES: values, WITH_DISPARITY: values}], figure)
    assert [axes.get_title() for axes in figure.axes] == ["plain pictures", "equalised pictures"]


@pytest.mark.slow
def test_the_claims_of_the_seed_hold() -> None:
    """In other light disparity brings the sensor model nearer; with it the robot is located within 50 cm."""
    one = EXPERIMENT.measure(1004)
    keys = {quantity.key for quantity in EXPERIMENT.quantities}
    assert keys <= set(one[PICTURES]) and keys <= set(one[WITH_DISPARITY])
    for name in PREPROCESSING:
        for light in ILLUMINATIONS[1:]:
            key = f"{name} {light} error"
            assert one[WITH_DISPARITY][key] < 0.9 * one[PICTURES][key]
    for condition in ILLUMINATIONS:
        assert one[WITH_DISPARITY][f"{condition} position"] < 50.0
        assert one[DISPARITY][f"{condition} position"] < 50.0
    assert one[WITH_DISPARITY]["bulbs position"] < one[PICTURES]["bulbs position"]
