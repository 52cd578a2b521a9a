"""How far one view lies beside another: shifts that are known, and views that share nothing."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc.behaviours.closing import LEAST_OVERLAP, edges_of, likeness
from topoloc.types import Image

BLOCKS = np.random.default_rng(1).integers(0, 256, (12, 120, 3)).astype(np.uint8)
SCENE: Image = BLOCKS.repeat(8, axis=0).repeat(4, axis=1)
WIDTH = 192


def view(left: int, colour: bool = True) -> Image:
    window: Image = SCENE[:, left : left + WIDTH]
    return window if colour else window.mean(axis=2).astype(np.uint8)


@settings(deadline=None)
@given(shift=st.integers(-140, 140), colour=st.booleans())
def test_a_shift_is_found(shift: int, colour: bool) -> None:
    """Positive where the second was taken farther to the right, clockwise."""
    shifts, alike = likeness(edges_of(view(140)), edges_of(view(140 + shift, colour)))
    assert shifts[alike.argmax()] * (WIDTH - 1) == pytest.approx(shift, abs=1e-9)
    assert alike.max() > 0.9
    assert np.abs(alike).max() <= 1.0 + 1e-9 and np.abs(shifts).max() <= 1.0 - LEAST_OVERLAP


def test_matches_the_sum_written_out() -> None:
    first, second = edges_of(view(100)), edges_of(view(160))
    shifts, alike = likeness(first, second)
    columns = first.shape[1]
    for share, value in zip(shifts, alike, strict=True):
        s = round(share * columns)
        a, b = first[:, max(0, s) : columns + min(0, s)], second[:, max(0, -s) : columns - max(0, s)]
        assert value == pytest.approx((a * b).sum() / np.sqrt((a**2).sum() * (b**2).sum()), abs=1e-9)


def test_brightness_and_contrast_do_not_matter() -> None:
    first, second = view(100), view(120)
    darker = (second * 0.5 + 20.0).astype(np.uint8)
    plain, dark = (likeness(edges_of(first), edges_of(other))[1] for other in (second, darker))
    assert dark == pytest.approx(plain, abs=0.02)


def test_views_that_share_nothing_are_not_alike() -> None:
    other = np.random.default_rng(2).integers(0, 256, (12, 48, 3)).astype(np.uint8).repeat(8, axis=0).repeat(4, axis=1)
    assert likeness(edges_of(view(0)), edges_of(other))[1].max() < 0.3


def test_a_flat_view_is_like_nothing() -> None:
    flat = np.full((96, WIDTH, 3), 90, dtype=np.uint8)
    assert not likeness(edges_of(flat), edges_of(view(0)))[1].any()
    assert not likeness(edges_of(flat), edges_of(flat))[1].any()
