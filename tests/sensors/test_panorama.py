"""What the methods share: bending, pasting and fading pictures on a circle, gaps, and what is refused."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors.panorama import (
    GapTooWide,
    Panorama,
    PanoramaConfig,
    covering,
    feathered,
    filled_columns,
    gaps_between,
    on_cylinder,
)
from topoloc.geometry import wrap

NOISE = [*np.random.default_rng(3).integers(0, 256, (4, 6, 20, 3)).astype(np.uint8)]
"""Four pictures, 20 columns wide."""
LEFTS = np.array([0, 13, 27, 52])
"""On 60 columns: overlaps of 7, 6 and 12, and a gap from 47 to 51."""


def test_covering_shows_the_last_picture() -> None:
    image = covering(NOISE, LEFTS, 60)
    np.testing.assert_array_equal(image[:, 13:27], NOISE[1][:, :14])
    np.testing.assert_array_equal(image[:, np.arange(52, 72) % 60], NOISE[3])
    assert not image[:, 47:52].any()


def test_feathering_fades_linearly_across_the_overlap() -> None:
    """White beside black: 7 columns of overlap fall from 13/14 to 1/14 of white; beyond them all is one or other."""
    white, black = np.full((2, 20), 255, np.uint8), np.zeros((2, 20), np.uint8)
    image = feathered([white, black], np.array([0, 13]), 60)
    np.testing.assert_array_equal(image[0, :13], 255)
    np.testing.assert_array_equal(image[0, 13:20], np.rint(255 * (1.0 - (np.arange(7) + 0.5) / 7.0)))
    assert not image[:, 20:].any()


@given(st.integers(0, 59))
def test_feathering_turns_with_the_circle(turn: int) -> None:
    turned = feathered(NOISE, (LEFTS + turn) % 60, 60)
    np.testing.assert_array_equal(turned, np.roll(feathered(NOISE, LEFTS, 60), turn, axis=1))


def test_feathering_stays_between_the_pictures_and_leaves_gaps_black() -> None:
    image = feathered(NOISE, LEFTS, 60)
    filled = filled_columns(LEFTS, 20, 60)
    np.testing.assert_array_equal(np.flatnonzero(~filled), np.arange(47, 52))
    assert not image[:, ~filled].any()
    np.testing.assert_array_equal(image[:, 20:27], NOISE[1][:, 7:14])  # seen once: as it was


@pytest.mark.parametrize("hfov_deg", [40.0, 65.0, 100.0])
def test_columns_of_the_cylinder_are_linear_in_angle(hfov_deg: float) -> None:
    """A pinhole camera shows an upright line at angle a in column f tan a; on the cylinder it stands at a itself."""
    columns, per_rad = 400, 400 / np.deg2rad(hfov_deg)
    focal = 200.0 / np.tan(np.deg2rad(hfov_deg) / 2.0)
    for share in (-0.8, -0.4, 0.0, 0.3, 0.9):
        angle = share * np.deg2rad(hfov_deg) / 2.0
        x = np.arange(columns) + 0.5 - 200.0 - focal * np.tan(angle)
        line = np.tile(255.0 * np.exp(-0.5 * (x / 3.0) ** 2), (60, 1)).astype(np.float32)
        bent = on_cylinder(line, hfov_deg, (60, columns), (per_rad, per_rad))[30]
        middle = (bent * (np.arange(columns) + 0.5)).sum() / bent.sum()
        assert (middle - 200.0) / per_rad == pytest.approx(angle, abs=np.deg2rad(0.03))


def test_a_level_line_below_the_horizon_bends_up_to_the_sides() -> None:
    """At the angle a it stands cos a as far below the horizon as in the middle."""
    picture = np.zeros((300, 400), np.float32)
    picture[250:253] = 255.0
    bent = on_cylinder(picture, 60.0, (300, 400), (400 / np.deg2rad(60.0), 400 / np.deg2rad(60.0)))
    below = (bent * (np.arange(300) + 0.5)[:, None]).sum(axis=0) / bent.sum(axis=0) - 150.0
    angle = np.deg2rad((np.arange(400) + 0.5 - 200.0) * 60.0 / 400.0)
    np.testing.assert_allclose(below, below[200] * np.cos(angle), atol=0.6)


@given(st.lists(st.floats(-3.14, 3.14), min_size=1, max_size=9), st.floats(5.0, 170.0))
def test_gaps_are_what_no_snapshot_sees(headings: list[float], hfov_deg: float) -> None:
    """Their widths add up to the share of 7200 directions that lie in no view."""
    axes = np.array(headings)
    gaps = gaps_between(axes, hfov_deg)
    directions = np.deg2rad(np.arange(7200) / 20.0)
    unseen = np.abs(wrap(directions[:, None] - axes)).min(axis=1) > np.deg2rad(hfov_deg) / 2.0
    assert sum(gap for _, _, gap in gaps) == pytest.approx(unseen.sum() / 20.0, abs=0.06 * (len(gaps) + 1))
    for first, second, gap in gaps:
        assert wrap(axes[first] - axes[second] - np.deg2rad(gap + hfov_deg)) == pytest.approx(0.0, abs=1e-9)


def test_the_error_names_the_pair_and_survives_another_process() -> None:
    panorama = Panorama(NOISE[0], LEFTS, np.zeros(4), 0.0, 0.5, ((2, 3, 31.0),))
    error = pickle.loads(pickle.dumps(GapTooWide((2, 3), ["a.jpg", "b.jpg", "c.jpg", "d.jpg"], panorama)))
    assert isinstance(error, GapTooWide)
    assert error.pair == (2, 3)
    assert str(error).startswith("c.jpg and d.jpg leave 31 degrees between them unseen")


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        ({"hfov_deg": 0.0}, "hfov_deg is 0.0"),
        ({"hfov_deg": 180.0}, "hfov_deg is 180.0"),
        ({"hfov_deg": float("nan")}, "hfov_deg is nan"),
        ({"start_deg": float("inf")}, "start_deg is inf"),
        ({"clahe_tiles": 0}, "clahe_tiles"),
    ],
)
def test_settings_that_mean_nothing(settings: dict[str, float], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        PanoramaConfig(**settings)  # type: ignore[arg-type]
