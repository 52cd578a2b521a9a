"""Ten turns on a node (thesis 5.1.4, Figure 5.19)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.heading import EXPERIMENT, READINGS, TURNS, odometer_error, summary

COUNT = TURNS * READINGS


def test_shares_and_drift_by_hand() -> None:
    odometry = np.linspace(0.0, -79.0, COUNT)[None]  # one degree a reading
    vision = np.zeros(COUNT)
    vision[:3] = (12.0, -9.0, 10.0)
    right = np.ones(COUNT, dtype=bool)
    right[0] = False
    found = summary(odometry, vision, right)
    assert found["odometer last"] == pytest.approx(-79.0)
    assert found["odometer seventh"] == pytest.approx(-56.0)
    assert found["vision largest"] == 12.0
    assert found["vision within"] == pytest.approx(79.0 / 80.0)
    assert found["right within"] == 1.0
    assert found["right node"] == pytest.approx(79.0 / 80.0)


def test_the_odometer_drifts_by_its_scale() -> None:
    errors = np.array([odometer_error(np.random.default_rng(seed)) for seed in range(20)])
    assert errors.shape == (20, COUNT)
    assert (errors[:, 0] == 0.0).all()
    turned = 360.0 * 56.0 / READINGS  # after seven turns
    assert errors[:, 56].mean() == pytest.approx(-0.018 * turned, abs=4.0)


def test_it_is_drawn() -> None:
    measured = [{AS_PUBLISHED: {"odometry": [[0.0] * COUNT], "vision": [[1.0] * COUNT]}} for _ in range(2)]
    figure = Figure()
    EXPERIMENT.draw(measured, figure)
    assert len(figure.axes) == 2


@pytest.mark.slow
def test_vision_is_always_within_ten_degrees() -> None:
    """And the goal: 99 % of right updates on the node."""
    for seed in (10, 11, 12):
        one = EXPERIMENT.measure(seed)[AS_PUBLISHED]
        assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(one)
        assert one["vision largest"] <= 10.0
        assert one["right within"] >= 0.99
        assert one["odometer seventh"] == pytest.approx(-45.0, abs=15.0)
        assert abs(one["vision grows"]) < 1.0
