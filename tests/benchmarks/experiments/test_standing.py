"""Dips of a curve over time steps (thesis 5.1.1), by hand."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.standing import dips, draw_output, mean_of, output
from benchmarks.worlds import SensorEffects, lab_scene


def test_dips_of_a_curve_by_hand() -> None:
    match = np.array([1.0, 1.0, 0.9, 0.6, 0.8, 1.0])
    event = np.array([False, False, True, True, True, False])
    found = dips(match, event, np.array([0.0, 0.0, 0.1, 0.4, 0.2, 0.0]))
    assert found["free"] == pytest.approx(1.0)
    assert found["drop"] == pytest.approx((0.1 + 0.4 + 0.2) / 3.0)
    assert found["deepest"] == pytest.approx(0.4)
    assert found["inside"] == 1.0  # only 0.6 is below 0.8
    assert found["proportion"] == pytest.approx(1.0)


def test_a_drop_is_a_share_of_the_free_output() -> None:
    found = dips(np.array([0.8, 0.8, 0.6]), np.array([False, False, True]), np.array([0.0, 0.0, 1.0]))
    assert found["drop"] == pytest.approx(0.25)


def test_a_dip_outside_of_the_event_is_counted_as_such() -> None:
    match = np.array([1.0, 0.5, 1.0, 0.5])
    found = dips(match, np.array([False, False, False, True]), np.array([0.0, 0.0, 0.0, 1.0]))
    assert found["inside"] == pytest.approx(0.5)


def test_the_mean_of_rows() -> None:
    assert mean_of([{"a": 1.0, "b": 0.0}, {"a": 3.0, "b": 1.0}]) == {"a": 2.0, "b": 0.5}


def test_nothing_happens_to_a_perfect_camera_before_a_scene_that_stays() -> None:
    pose = np.array([0.0, 1.0, 0.0])
    curve = output([lab_scene(1000)] * 2, pose, SensorEffects.none(), np.random.default_rng(1))
    np.testing.assert_allclose(curve, 1.0)


def test_all_seeds_and_views_are_drawn() -> None:
    measured = [{AS_PUBLISHED: {"curves": [[1.0, 0.8, 1.0], [1.0, 0.7, 1.0]]}} for _ in range(2)]
    axes = Figure().add_subplot()
    draw_output(axes, measured)
    assert len(axes.lines) == 4 + 2
    np.testing.assert_allclose(np.asarray(axes.lines[4].get_ydata(), dtype=float), [1.0, 0.75, 1.0])
