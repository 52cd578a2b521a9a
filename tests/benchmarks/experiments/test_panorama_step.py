"""Panoramas with snapshots every 15 and 30 degrees (thesis 5.1.2)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from benchmarks.experiments.panorama_step import EXPERIMENT, METHODS, STEPS, seam_gradient, seams
from topoloc.types import Image


def test_seams_lie_where_a_later_snapshot_ends_or_begins() -> None:
    # Four columns each on a circle of ten: 0 0 0 1 1 1 1 . 2 2, and 2 covers columns 8, 9, 0, 1.
    np.testing.assert_array_equal(seams(np.array([0, 3, 8]), 4, 10), [2, 3, 7, 8])


def test_one_snapshot_that_closes_the_circle_has_no_seam() -> None:
    assert len(seams(np.array([0]), 10, 10)) == 0


def test_the_gradient_at_seams_by_hand() -> None:
    image: Image = np.array([[10, 12, 50, 52], [10, 12, 50, 52]], dtype=np.uint8)
    seam, elsewhere, surplus = seam_gradient(image, np.array([0, 2]))
    assert seam == pytest.approx((42.0 + 38.0) / 2.0)
    assert elsewhere == pytest.approx(2.0)
    assert surplus == pytest.approx((40.0 - 2.0) / 2.0)


def test_four_strips_are_drawn() -> None:
    picture = np.zeros((30, 270), dtype=int).tolist()
    figure = Figure()
    EXPERIMENT.draw([{column: {"pictures": dict.fromkeys(STEPS, picture)} for column in METHODS}], figure)
    assert len(figure.axes) == len(STEPS) * len(METHODS)


@pytest.mark.slow
def test_smaller_steps_make_more_noise_and_fading_removes_it() -> None:
    for seed in (10, 11, 12):
        measured = EXPERIMENT.measure(seed)
        assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(measured[AS_PUBLISHED])
        assert measured[AS_PUBLISHED]["noise ratio"] > 1.3
        assert abs(measured[IMPROVED]["noise 15"]) < 0.3 * measured[AS_PUBLISHED]["noise 15"]
