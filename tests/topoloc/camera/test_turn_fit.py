"""The view that fits points before and after turns: focal length and tilt come back, outliers and all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from topoloc.camera.level import View, turned
from topoloc.camera.turn_fit import NOISE, TurnedPoints, fitted, searched, spread

PAIRS, EACH = 12, 40


def seen(view: View, ahead_m: float = 0.0, outliers: float = 0.2, seed: int = 0) -> TurnedPoints:
    """Things 2 to 8 m away seen by a camera so far ahead of the axis, before and after turns of 5 to 20 degrees."""
    rng = np.random.default_rng(seed)
    turn = np.repeat(np.deg2rad(rng.uniform(5.0, 20.0, PAIRS) * rng.choice([-1, 1], PAIRS)), EACH)
    before = rng.uniform((-1.0, -0.7), (1.0, 0.7), (len(turn), 2))
    moved = ahead_m * np.column_stack([-np.sin(turn), np.zeros(len(turn)), np.cos(turn) - 1.0])
    inverse = rng.uniform(1.0 / 8.0, 1.0 / 2.0, (len(turn), 1))
    after = view.points(turned(view.rays(before) - inverse * moved, turn))
    after += rng.normal(0.0, 0.3 * NOISE, after.shape)
    wrong = rng.random(len(turn)) < outliers
    after[wrong] = rng.uniform(-1.0, 1.0, (int(wrong.sum()), 2))
    return TurnedPoints(before, after, turn, moved, np.repeat(np.arange(PAIRS), EACH))


@pytest.mark.parametrize("hfov_deg", [40.0, 62.0, 90.0, 120.0])
@pytest.mark.parametrize(("pitch_deg", "roll_deg"), [(0.0, 0.0), (12.0, -3.0)])
def test_view_comes_back(hfov_deg: float, pitch_deg: float, roll_deg: float) -> None:
    true = replace(View.of(hfov_deg), pitch=np.deg2rad(pitch_deg), roll=np.deg2rad(roll_deg))
    points = seen(true)
    found = fitted(points, searched(points))
    assert found.hfov_deg == pytest.approx(hfov_deg, rel=0.004)
    assert np.rad2deg([found.pitch, found.roll]) == pytest.approx([pitch_deg, roll_deg], abs=1.0)
    assert points.agreeing(found) == pytest.approx(0.8, abs=0.06)


def test_camera_ahead_of_the_axis() -> None:
    """Without its place the field of view is some 5 % too narrow; with it, right to what distances leave open."""
    points = seen(View.of(62.0), ahead_m=0.2)
    told = fitted(points, searched(points))
    blind = replace(points, moved=np.zeros_like(points.moved))
    assert told.hfov_deg == pytest.approx(62.0, rel=0.02)
    assert fitted(blind, searched(blind)).hfov_deg < 0.96 * 62.0
    assert spread(points, told) > 4.0 * spread(blind, told)


def test_spread_is_that_of_repetitions() -> None:
    """Of 20 fits to other points of the same kind, within a factor of two."""
    fits = [fitted(seen(View.of(62.0), seed=seed), View.of(62.0)) for seed in range(20)]
    told = np.median([spread(seen(View.of(62.0), seed=seed), fits[seed]) for seed in range(5)])
    actual = np.std([fit.hfov_deg for fit in fits])
    assert 0.5 < told / actual < 2.0
