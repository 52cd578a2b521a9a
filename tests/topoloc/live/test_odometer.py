"""The odometer's buffer: in any order the same poses; what is missing, jumps or begins again is said, and cut out."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc.geometry import Floats, between, compose
from topoloc.live.odometer import Odometer
from topoloc.live.report import LiveConfig, Tally
from topoloc.recording import Track

CONFIG = LiveConfig(odometry_wait_s=0.2, odometry_silent_s=2.0, odometry_keep_s=30.0, clock_back_s=2.0)


def made(*readings: Sequence[float], config: LiveConfig = CONFIG) -> tuple[Odometer, Tally]:
    tally = Tally()
    odometer = Odometer(config, tally)
    for time, *pose in readings:
        odometer.add(time, np.array(pose))
    return odometer, tally


def pose_at(odometer: Odometer, time: float) -> Floats:
    reading = odometer.at(time)
    assert reading.pose is not None, reading.why
    return reading.pose


class TestBetweenReadings:
    def test_interpolates_as_a_recordings_track_does(self) -> None:
        times = np.array([0.0, 0.1, 0.25, 0.4])
        poses = np.array([[0, 0, 3.0], [0.1, 0.0, 3.1], [0.2, 0.1, -3.0], [0.2, 0.2, -2.9]])
        odometer, _ = made(*np.column_stack([times, poses]).tolist())
        track = Track(times, poses)
        for time in (0.0, 0.03, 0.1, 0.2, 0.39, 0.4):
            assert pose_at(odometer, time) == pytest.approx(track.at(time), abs=1e-12)

    def test_at_a_readings_own_time_it_is_that_reading_to_the_bit(self) -> None:
        reading = (0.3, 0.1 + 0.2, 1.0 / 3.0, -2.0 / 7.0)
        odometer, _ = made((0.1, 0, 0, 0), reading, (0.5, 1, 1, 1))
        assert pose_at(odometer, 0.3).tolist() == list(reading[1:])

    @given(st.permutations(range(12)), st.lists(st.integers(0, 11), max_size=5))
    @settings(max_examples=20, deadline=None)
    def test_the_order_of_arrival_and_repetitions_change_nothing(self, order: list[int], again: list[int]) -> None:
        readings = [(0.1 * i, 0.02 * i * i, 0.1 * i, 0.3 * i) for i in range(12)]
        in_order, _ = made(*readings)
        shuffled, tally = made(*(readings[i] for i in (*order, *again)))
        for time in (0.0, 0.55, 0.83, 1.1):
            assert np.array_equal(pose_at(in_order, time), pose_at(shuffled, time))
        assert tally.counts().odometry_repeated == len(again) and tally.counts().jumps == 0


class TestBeyondTheReadings:
    def test_goes_on_as_before_but_not_far(self) -> None:
        odometer, _ = made(*[(0.1 * i, 0.05 * i, 0.0, 0.0) for i in range(5)])
        assert pose_at(odometer, 0.5) == pytest.approx([0.25, 0.0, 0.0])
        reading = odometer.at(0.65)
        assert reading.pose is None and "0.2 s older" in reading.why

    def test_a_turn_is_extrapolated_along_its_arc(self) -> None:
        turn = np.array([0.02, 0.0, 0.1])
        poses = [np.zeros(3)]
        for _ in range(6):
            poses.append(compose(poses[-1], turn))
        odometer, _ = made(*[(0.1 * i, *pose) for i, pose in enumerate(poses[:5])])
        assert pose_at(odometer, 0.5) == pytest.approx(poses[5], abs=1e-9)

    def test_a_single_reading_stands_still(self) -> None:
        odometer, _ = made((1.0, 2.0, 3.0, 0.5))
        assert pose_at(odometer, 1.1).tolist() == [2.0, 3.0, 0.5]
        assert pose_at(made((1.0, 2.0, 3.0, 0.5))[0], 0.9).tolist() == [2.0, 3.0, 0.5]

    def test_without_any_reading_there_is_nothing_to_complain_of(self) -> None:
        odometer, _ = made()
        reading = odometer.at(5.0)
        assert (reading.pose, reading.raw, reading.why) == (None, None, "")

    def test_another_clock_is_guessed_at(self) -> None:
        odometer, _ = made((12.0, 0, 0, 0))
        assert "are both on one clock?" in odometer.at(1.7e9).why


class TestBreaks:
    def test_a_reset_is_cut_out_and_said_once(self) -> None:
        odometer, tally = made((0.0, 8.0, 5.0, 1.0), (0.1, 8.1, 5.0, 1.0), (0.2, 0.0, 0.0, 0.0), (0.3, 0.1, 0.0, 0.0))
        before = pose_at(odometer, 0.1)
        broken = odometer.at(0.2)
        assert broken.pose is None and "jumped by 9.5 m" in broken.why
        assert broken.raw is not None and broken.raw.tolist() == [0.0, 0.0, 0.0]
        after = odometer.at(0.3)
        assert after.pose is not None and after.why == ""
        assert between(before, after.pose) == pytest.approx([0.1, 0.0, 0.0])
        assert tally.counts().jumps == 1

    def test_a_turn_on_the_spot_that_no_robot_makes_is_one_too(self) -> None:
        odometer, tally = made((0.0, 1.0, 0.0, 0.0), (0.1, 1.0, 0.0, 2.0))
        pose_at(odometer, 0.0)
        assert odometer.at(0.1).pose is None and tally.counts().jumps == 1

    def test_between_the_two_sides_it_stays_on_the_first(self) -> None:
        odometer, _ = made((0.0, 8.0, 0.0, 0.0), (0.1, 0.0, 0.0, 0.0))
        assert pose_at(odometer, 0.06).tolist() == [8.0, 0.0, 0.0]

    def test_stamps_that_nearly_coincide_are_no_jump(self) -> None:
        odometer, tally = made((0.0, 0.0, 0.0, 0.0), (0.1, 0.1, 0.0, 0.0), (0.1001, 0.2, 0.0, 0.0))
        for time in (0.0, 0.1, 0.1001):
            pose_at(odometer, time)
        assert tally.counts().jumps == 0

    def test_a_late_reading_from_behind_a_jump_does_not_hide_it(self) -> None:
        odometer, tally = made((0.0, 8.0, 0.0, 0.0))
        assert pose_at(odometer, 0.1).tolist() == [8.0, 0.0, 0.0]
        for time in (0.2, 0.05):
            odometer.add(time, np.array([0.0, 0.0, 0.0]))
        assert odometer.at(0.2).pose is None and tally.counts().jumps == 1

    def test_a_short_silence_loses_no_motion_and_a_long_one_does_not_count_it_twice(self) -> None:
        short, _ = made((0.0, 0.0, 0.0, 0.0))
        pose_at(short, 0.0)
        assert short.at(1.0).pose is None
        short.add(1.5, np.array([1.0, 0.0, 0.0]))
        assert pose_at(short, 1.5).tolist() == [1.0, 0.0, 0.0]
        long, _ = made((0.0, 0.0, 0.0, 0.0))
        pose_at(long, 0.0)
        assert long.at(1.0).pose is None
        long.add(9.0, np.array([6.0, 0.0, 0.0]))
        back = long.at(9.0)
        assert back.pose is None and "was silent for 8.0 s" in back.why
        long.add(9.1, np.array([6.1, 0.0, 0.0]))
        assert pose_at(long, 9.1) == pytest.approx([0.1, 0.0, 0.0])

    def test_a_break_while_the_camera_was_silent_is_told_with_the_next_picture(self) -> None:
        odometer, _ = made((0.0, 8.0, 0.0, 0.0))
        pose_at(odometer, 0.0)
        odometer.add(0.1, np.zeros(3))
        newest = odometer.newest()
        assert newest is not None and newest[1].pose == pytest.approx([8.0, 0.0, 0.0])
        odometer.add(0.2, np.array([0.1, 0.0, 0.0]))
        assert "jumped by 8.0 m" in odometer.at(0.2).why


class TestClock:
    def test_three_readings_in_order_from_before_are_a_clock_that_was_set_back(self) -> None:
        odometer, tally = made(*[(100.0 + 0.1 * i, 5.0 + 0.1 * i, 0.0, 0.0) for i in range(5)])
        pose_at(odometer, 100.4)
        for i in range(4):
            odometer.add(0.1 * i, np.array([0.1 * i, 0.0, 0.0]))
        told = odometer.at(0.2)
        assert told.pose is None and "clock was set back" in told.why
        assert pose_at(odometer, 0.3) == pytest.approx([5.4 + 0.3, 0.0, 0.0])
        assert tally.counts().jumps == 1

    def test_late_readings_are_not(self) -> None:
        odometer, tally = made((10.0, 0, 0, 0))
        for late in (5.0, 4.0, 3.0):
            odometer.add(late, np.zeros(3))
        for i in range(1, 4):
            odometer.add(5.0 + i, np.zeros(3))
            odometer.add(10.0 + i, np.zeros(3))
        assert tally.counts().jumps == 0 and tally.counts().odometry_late == 6
        assert odometer.at(13.0).pose is not None

    def test_a_stamp_that_sticks_fills_no_memory(self) -> None:
        odometer, tally = made((100.0, 0, 0, 0), *[(50.0, 0, 0, 0)] * 50)
        assert len(odometer._behind) <= 3 and tally.counts().odometry_late == 50

    def test_one_stamp_from_the_future_is_got_over(self) -> None:
        odometer, _ = made((0.0, 0, 0, 0), (1e9, 0.1, 0, 0), *[(0.1 * i, 0.1 * i, 0, 0) for i in range(1, 6)])
        assert odometer.at(0.5).raw is not None


@pytest.mark.parametrize(
    "wrong",
    [(np.nan, 0, 0, 0), (1.0, np.inf, 0, 0), (1.0, 0, 0), (np.inf, 0, 0, 0), (1.0, "x", 0, 0), (1.0, None, 0, 0)],
)
def test_what_is_no_reading_is_counted(wrong: Sequence[float]) -> None:
    tally = Tally()
    odometer = Odometer(CONFIG, tally)
    odometer.add(wrong[0], wrong[1:])
    assert (tally.counts().bad, odometer.newest()) == (1, None)


def test_old_readings_are_forgotten() -> None:
    odometer, _ = made(*[(float(i), 0.0, 0.0, 0.0) for i in range(100)])
    assert odometer.at(60.0).pose is None and odometer.at(75.0).pose is not None
