"""What feeds a live localizer: files at their pace or as fast as they are worked on, a camera, lines of odometry."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from typing import Any, cast

import numpy as np
import pytest

from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.live.camera import PATIENCE, CameraFeed, open_camera
from topoloc.live.engine import LiveLocalizer
from topoloc.live.feeds import run_fed
from topoloc.live.messages import Odometry, Picture, beside, play
from topoloc.live.odometry_lines import LineFeed
from topoloc.live.report import LiveReport
from topoloc.recording import Track

PICTURE = np.zeros((2, 2, 3), np.uint8)
PATIENCE_S = 10.0
"""Nothing here takes that long: a test that waits so long has failed."""


class Listener:
    """Writes down what it is handed, and stands in for a live localizer."""

    def __init__(self, on_picture: Callable[[int], object] = lambda count: None) -> None:
        self.readings: list[tuple[float, ...]] = []
        self.pictures: list[tuple[float, Any]] = []
        self.is_idle, self.worked = True, threading.Event()
        self._on_picture = on_picture

    def on_odometry(self, time: float, pose: Floats) -> None:
        self.readings.append((time, *pose))

    def on_image(self, time: float, data: object, camera_pose: Floats | None = None) -> None:
        self.pictures.append((time, data))
        self._on_picture(len(self.pictures))

    def run(self, report: Callable[[LiveReport], None], stop: threading.Event) -> None:
        assert stop.wait(PATIENCE_S)

    @property
    def live(self) -> LiveLocalizer:
        return cast(LiveLocalizer, self)


class TestBeside:
    def test_each_picture_comes_after_the_readings_before_it_and_its_own(self) -> None:
        track = Track(np.array([0.0, 0.4, 1.0, 1.5, 3.0]), np.zeros((5, 3)) + np.array([[0.0], [4], [10], [15], [30]]))
        messages = list(beside([Picture(0.5, b""), Picture(1.0, b""), Picture(2.0, b"")], track))
        kinds = ["picture" if isinstance(message, Picture) else "odometry" for message in messages]
        times = [message.time for message in messages]
        assert times == [0.0, 0.4, 0.5, 0.5, 1.0, 1.0, 1.5, 2.0, 2.0]
        assert [time for time, kind in zip(times, kinds, strict=True) if kind == "picture"] == [0.5, 1.0, 2.0]
        assert isinstance(messages[2], Odometry) and messages[2].pose[0] == pytest.approx(5.0)

    def test_without_a_track(self) -> None:
        assert [message.time for message in beside([Picture(0.5, b"")], None)] == [0.5]


class TestPlay:
    def test_at_the_pace_of_the_stamps(self) -> None:
        listener, now, waits = Listener(), [1000.0], []

        def wait(seconds: float) -> bool:
            waits.append(seconds)
            now[0] += seconds
            return False

        def slow_reader() -> Iterator[Picture]:
            for time in (5.0, 5.5, 7.0):
                now[0] += 0.1
                yield Picture(time, b"")

        play(slow_reader(), listener.live, threading.Event(), lambda: now[0], wait)
        assert waits == pytest.approx([0.4, 1.4])
        assert [time for time, _ in listener.pictures] == [5.0, 5.5, 7.0]

    def test_stops_when_told(self) -> None:
        listener = Listener()
        play([Picture(0.0, b""), Picture(1.0, b"")], listener.live, threading.Event(), lambda: 0.0, lambda _: True)
        assert len(listener.pictures) == 1


class FakeCapture:
    """Gives a picture for each True."""

    def __init__(self, script: Sequence[bool]) -> None:
        self.script, self.released = list(script), False

    def isOpened(self) -> bool:
        return True

    def read(self) -> tuple[bool, Any]:
        done = self.script.pop(0) if self.script else False
        return done, np.array([[[1, 2, 3]]], np.uint8) if done else None

    def release(self) -> None:
        self.released = True


class TestCamera:
    def test_pictures_are_rgb_and_stamped(self) -> None:
        stop = threading.Event()
        listener = Listener(lambda count: stop.set() if count == 2 else None)
        capture, times = FakeCapture([True, True, True]), iter([10.0, 10.1, 10.2])
        CameraFeed(capture, lambda: capture, lambda: next(times))(listener.live, stop)
        assert [time for time, _ in listener.pictures] == [10.0, 10.1]
        assert listener.pictures[0][1].tolist() == [[[3, 2, 1]]] and capture.released

    def test_one_that_was_unplugged_is_opened_again(self) -> None:
        stop, waits = threading.Event(), 0
        listener = Listener(lambda count: stop.set() if count == 2 else None)
        first, second = FakeCapture([True]), FakeCapture([True])
        tries: list[str] = []

        def reopen() -> FakeCapture:
            tries.append("")
            if len(tries) == 1:
                raise UserError("not there")
            return second

        def wait(_: float) -> bool:
            nonlocal waits
            waits += 1
            return waits > 100

        CameraFeed(first, reopen, lambda: float(waits), wait)(listener.live, stop)
        assert len(listener.pictures) == 2 and len(tries) == 2 and waits == 2 * PATIENCE
        assert first.released and second.released

    def test_one_that_is_not_there(self) -> None:
        with pytest.raises(UserError, match=r"camera /no/such/video: cannot be opened; .* or name another"):
            open_camera("/no/such/video")


class TestLines:
    @pytest.mark.parametrize(
        "lines",
        [
            ["1.5 2 3 0.5", "2.5 2 3 -1"],
            ["1.5, 2, 3, 0.5\n", "\n", "# comment", "2.5,2,3,-1\n"],
            ["time_ms,x_mm,y_m,heading_rad", "1500,2000,3,0.5", "2500,2000,3,-1"],
            [
                "y_m heading_deg x_cm battery_v time_s",
                "3 28.64788975654116 200 12 1.5",
                "3 -57.29577951308232 200 12 2.5",
            ],
            ["Time (s);x [m];y [m];heading [rad]", "1.5;2;3;0.5", "2.5;2;3;-1"],
            ["t_s,battery_v,x,y,theta_rad", "1.5,,2,3,0.5", "2.5,,2,3,-1"],
            ["# my driver", "# time_ms,x_mm,y_m,heading_rad", "1500,2000,3,0.5", "2500,2000,3,-1"],
            ["# my driver, in metres", "1.5 2 3 0.5", "2.5 2 3 -1"],
        ],
        ids=[
            "blanks",
            "commas",
            "names",
            "names in another order",
            "brackets",
            "an empty cell, and units by default",
            "names in a comment",
            "a comment without names",
        ],
    )
    def test_ways_to_write_them(self, lines: list[str]) -> None:
        listener = Listener()
        LineFeed(lines)(listener.live, threading.Event())
        assert np.array(listener.readings) == pytest.approx(np.array([[1.5, 2, 3, 0.5], [2.5, 2, 3, -1]]))

    def test_a_clock_without_a_unit_shows_it_by_its_size(self) -> None:
        listener = Listener()
        lines = ["time,x_m,y_m,heading_rad", "nan,0,0,0", "1700000000500,1,0,0", "1700000001000,1,0,0"]
        LineFeed(lines)(listener.live, threading.Event())
        assert [reading[0] for reading in listener.readings[1:]] == [1_700_000_000.5, 1_700_000_001.0]

    def test_decimal_commas_are_no_readings(self) -> None:
        listener = Listener()
        LineFeed(["time_s,x_m,y_m,heading_rad", "1,5,2,3,0,5"])(listener.live, threading.Event())
        assert np.isnan(listener.readings[0]).all()

    @pytest.mark.parametrize(
        ("line", "says"),
        [
            ("1.5 2 3", "first line is '1.5 2 3'; write 'time x y theta'"),
            ("1.5 2 3 north", "write 'time x y theta'"),
            ("time_s,x_m,y_m,theta", "names no heading with a unit"),
            ("hello", "names no time, x, y, heading with a unit; write"),
        ],
    )
    def test_a_first_line_that_is_neither(self, line: str, says: str) -> None:
        with pytest.raises(UserError, match=says):
            LineFeed([line])(Listener().live, threading.Event())

    def test_a_later_one_is_a_bad_reading(self) -> None:
        listener = Listener()
        LineFeed(["0 0 0 0", "garbage", "1 2", "nan nan 0 0", "1 1 1 1"])(listener.live, threading.Event())
        assert len(listener.readings) == 5 and listener.readings[-1] == (1.0, 1.0, 1.0, 1.0)
        assert [np.isfinite(reading).all() and len(reading) == 4 for reading in listener.readings[1:4]] == [False] * 3


class TestRun:
    def test_ends_when_the_pictures_do_and_all_threads_with_it(self) -> None:
        listener, before = Listener(), threading.active_count()

        def pictures(live: LiveLocalizer, stop: threading.Event) -> None:
            live.on_image(0.0, PICTURE)

        def odometry(live: LiveLocalizer, stop: threading.Event) -> None:
            assert stop.wait(PATIENCE_S)

        run_fed(listener.live, pictures, [odometry], lambda report: None, threading.Event())
        assert len(listener.pictures) == 1 and threading.active_count() == before

    @pytest.mark.parametrize("which", [0, 1])
    def test_what_a_feed_raises_is_raised(self, which: int) -> None:
        def broken(live: LiveLocalizer, stop: threading.Event) -> None:
            raise UserError("in the feed")

        def fine(live: LiveLocalizer, stop: threading.Event) -> None:
            assert stop.wait(PATIENCE_S)

        feeds = [broken, fine] if which == 0 else [fine, broken]
        with pytest.raises(UserError, match="in the feed"):
            run_fed(Listener().live, feeds[0], [feeds[1]], lambda report: None, threading.Event())
