"""Where drives are cut: at the ends of laps, into stretches of equal length, without gaps."""

from __future__ import annotations

import numpy as np
import pytest

from topoloc.tuning.laps import laps_of, stretches_of


def round_and_round(laps: float, frames_a_lap: int = 40) -> np.ndarray:
    """A circle of radius 2 m, driven off its line by up to 0.2 m."""
    count = round(laps * frames_a_lap)
    angle = 2.0 * np.pi * np.arange(count) / frames_a_lap
    radius = 2.0 + np.random.default_rng(5).uniform(-0.2, 0.2, count)
    return np.column_stack([radius * np.cos(angle), radius * np.sin(angle)])


def lengths(parts: list[slice]) -> list[int]:
    return [part.stop - part.start for part in parts]


class TestLaps:
    @pytest.mark.parametrize("laps", [2, 3, 7])
    def test_each_ends_near_the_start(self, laps: int) -> None:
        path = round_and_round(laps)
        parts = laps_of(path)
        assert len(parts) == laps
        assert all(np.linalg.norm(path[part.start] - path[0]) < 0.5 for part in parts)
        assert lengths(parts) == pytest.approx([40] * laps, abs=3)

    def test_nothing_is_lost_or_counted_twice(self) -> None:
        parts = laps_of(round_and_round(3.4))
        assert [index for part in parts for index in range(part.start, part.stop)] == list(range(136))

    def test_a_short_rest_belongs_to_the_last_lap_a_long_one_to_none(self) -> None:
        assert len(laps_of(round_and_round(3.3))) == 3
        assert len(laps_of(round_and_round(3.8))) == 4

    def test_there_and_back_is_a_lap(self) -> None:
        along = np.concatenate([np.linspace(0.0, 10.0, 30), np.linspace(10.0, 0.0, 30)] * 2)
        assert lengths(laps_of(np.column_stack([along, np.zeros(120)]))) == pytest.approx([60, 60], abs=2)

    def test_a_way_without_return_is_one(self) -> None:
        assert laps_of(np.column_stack([np.arange(20.0), np.zeros(20)])) == [slice(0, 20)]

    def test_a_robot_that_stands_still_has_one(self) -> None:
        assert laps_of(np.zeros((5, 2))) == [slice(0, 5)]


class TestStretches:
    def test_as_long_as_each_other_whatever_the_frames(self) -> None:
        steps = np.concatenate([np.full(100, 0.1), np.full(20, 0.5)])  # slow, then fast: 10 m each
        path = np.column_stack([np.concatenate([[0.0], np.cumsum(steps)]), np.zeros(121)])
        assert lengths(stretches_of(path, 2)) == pytest.approx([100, 21], abs=1)

    def test_nothing_is_lost_or_counted_twice(self) -> None:
        parts = stretches_of(round_and_round(2.0), 7)
        assert [index for part in parts for index in range(part.start, part.stop)] == list(range(80))

    def test_a_robot_that_only_turns_is_cut_by_frames(self) -> None:
        assert lengths(stretches_of(np.zeros((40, 2)), 4)) == pytest.approx([10] * 4, abs=1)
