"""The digital zoom (thesis 5.1.5)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.zoom import EXPERIMENT, MIDDLE, POSITIONS, ZOOMS, displacement, peaks
from topoloc.geometry import Floats


def hill(place: float, height: float) -> Floats:
    return np.asarray(height * np.exp(-0.5 * ((POSITIONS - place) / 0.15) ** 2))


def test_the_middle_is_at_zero() -> None:
    assert POSITIONS[MIDDLE] == pytest.approx(0.0)


def test_the_displacement_is_that_of_the_thesis() -> None:
    assert displacement(4.0, 1.2) == pytest.approx(0.67, abs=0.005)  # 5.1.5


def test_peaks_of_three_gaussians() -> None:
    plain = hill(0.0, 1.0)
    output = np.maximum.reduce([plain, hill(-0.625, 0.9), hill(0.5, 0.7)])
    found = peaks(output, plain)
    assert found["place"] == pytest.approx((0.625 + 0.5) / 2.0)
    assert found["height"] == pytest.approx(0.8)
    behind, ahead = (output[(POSITIONS * side > 0.0) & (POSITIONS * side < 0.5)].min() for side in (-1.0, 1.0))
    assert found["gap"] == pytest.approx((behind + ahead) / 2.0)


def test_where_zoom_wins_nowhere_there_is_no_peak() -> None:
    plain = hill(0.0, 1.0)
    assert np.isnan(peaks(plain, plain)["place"])
    one_side = np.maximum(plain, hill(0.5, 0.7))
    assert np.isnan(peaks(one_side, plain)["height"])


def test_a_curve_that_still_rises_at_the_end_has_no_peak() -> None:
    plain = hill(0.0, 1.0)
    assert np.isnan(peaks(np.maximum.reduce([plain, hill(-0.5, 0.8), hill(1.1, 0.9)]), plain)["place"])


def test_a_panel_for_each_factor_and_scene_is_drawn() -> None:
    curves = [hill(0.0, 1.0).tolist()] * (1 + len(ZOOMS))
    figure = Figure()
    EXPERIMENT.draw([{AS_PUBLISHED: {"far curves": curves, "close curves": curves}}], figure)
    assert len(figure.axes) == 2 * len(ZOOMS)


@pytest.mark.slow
def test_the_claims_of_the_thesis_hold() -> None:
    """Peaks of a far scene lie farther out, more zoom moves them out and lowers them, and (2.5) is about right."""
    for seed in (10, 11, 12):
        one = EXPERIMENT.measure(seed)[AS_PUBLISHED]
        assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(one)
        for zoom in (1.1, 1.2, 1.3):
            assert one[f"far place {zoom}"] > 2.0 * one[f"close place {zoom}"]
            assert one[f"far place {zoom}"] == pytest.approx(displacement(4.0, zoom), abs=0.15)
            assert one[f"close place {zoom}"] <= 0.5
        assert one["far place 1.1"] < one["far place 1.2"] < one["far place 1.3"]
        assert one["far gap 1.1"] > one["far gap 1.2"] > one["far gap 1.3"]
        assert one["far fall"] > 0.0
