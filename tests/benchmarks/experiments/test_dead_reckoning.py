"""Three rounds by the odometer alone (thesis 5.2.1)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.dead_reckoning import EXPERIMENT, _is_between
from benchmarks.experiments.experiment import AS_PUBLISHED, SEEDS
from benchmarks.experiments.odometer_path import astray, by_odometer
from topoloc.geometry import compose


def test_an_odometer_without_errors_tells_the_path_whatever_its_own_frame() -> None:
    truth = np.array([[0.0, 0.0, 0.5], [1.0, 0.2, 0.7], [1.5, -1.0, -2.0]])
    odometry = compose(np.array([4.0, -3.0, 2.0]), truth)
    np.testing.assert_allclose(by_odometer(odometry, truth[0]), truth)
    assert astray(odometry, truth) == pytest.approx((0.0, 0.0))


def test_astray_by_hand() -> None:
    truth = np.zeros((2, 3))
    assert astray(np.array([[0.0, 0.0, 0.0], [3.0, 4.0, -0.5 * np.pi]]), truth) == pytest.approx((5.0, 90.0))


@pytest.mark.parametrize(
    ("place", "between"), [((1.0, 1.5), True), ((1.2, 1.1), True), ((0.4, 1.1), False), ((-1.3, 1.2), False)]
)
def test_between_3_and_4(place: tuple[float, float], between: bool) -> None:
    assert _is_between(np.array(place)) == between


def test_the_claims_of_the_thesis_over_the_seeds() -> None:
    """Off by more than a node's distance after three rounds, hardly between 1 and 4 in the first."""
    measured = [EXPERIMENT.measure(seed) for seed in SEEDS]
    ours = [one[AS_PUBLISHED] for one in measured]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours[0])
    assert 1.0 <= np.mean([one["off 3"] for one in ours]) <= 2.5
    for one in ours:
        assert one["off at 4"] < 0.4
        assert one["right to 4"] >= 0.8 > one["right in all"]
    figure = Figure()
    EXPERIMENT.draw(measured, figure)
    assert len(figure.axes) == 2
