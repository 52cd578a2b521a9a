"""Parallax of the matched heading: the formula, its sign, and the fitted distance."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.experiments.parallax import (
    FITTED_SEEDS,
    SCENE_M,
    fitted_scene_m,
    parallax_corrected,
    scene_distance,
    sideways,
)
from topoloc.geometry import wrap


@given(st.floats(-3.1, 3.1), st.floats(-0.4, 0.4), st.floats(2.0, 8.0))
def test_a_point_ahead_of_a_robot_beside_the_node_is_put_right(heading: float, offset: float, distance: float) -> None:
    """Geometry as an oracle: what lies straight ahead, seen from the node; right to the third order of the angle."""
    left = np.array([-np.sin(heading), np.cos(heading)])
    point = offset * left + distance * np.array([np.cos(heading), np.sin(heading)])
    matched = np.arctan2(point[1], point[0])
    corrected = parallax_corrected(np.array([matched]), np.array([offset]), distance)
    assert abs(float(wrap(corrected - heading)[0])) <= (abs(offset) / distance) ** 3 / 3.0 + 1e-9


def test_sideways_is_to_the_left_of_the_heading() -> None:
    found = sideways(
        np.array([[1.0, 0.3], [1.0, 0.3]]), np.array([[1.0, 0.0], [1.0, 0.0]]), np.array([0.0, np.pi / 2.0])
    )
    np.testing.assert_allclose(found, [0.3, 0.0], atol=1e-12)


def test_the_distance_is_found_from_exact_errors() -> None:
    offset = np.array([-0.3, -0.1, 0.2, 0.3])
    assert scene_distance(offset / 2.5, offset) == pytest.approx(2.5)


@pytest.mark.slow
def test_the_distance_in_use_is_the_one_that_the_fitted_seeds_give() -> None:
    assert min(FITTED_SEEDS) >= 1000
    assert fitted_scene_m() == pytest.approx(SCENE_M, abs=0.05)
