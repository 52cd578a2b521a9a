"""What a camera and an odometer send, from files: in order of time, at its own pace or as fast as it is worked on."""

from __future__ import annotations

import time as clocks
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from math import inf
from threading import Event
from typing import Protocol

from topoloc.geometry import Floats
from topoloc.live.engine import LiveLocalizer
from topoloc.live.mailbox import ImageData
from topoloc.live.report import LiveReport
from topoloc.recording import Recording, Track


class Message(Protocol):
    """Something that arrives at a live localizer."""

    @property
    def time(self) -> float:
        """Its stamp [s]."""

    def deliver(self, live: LiveLocalizer) -> None:
        """Hand it over."""


@dataclass(frozen=True)
class Odometry:
    """A reading of the odometer: raw pose (3,) at a time [s]."""

    time: float
    pose: Floats

    def deliver(self, live: LiveLocalizer) -> None:
        """Hand it over."""
        live.on_odometry(self.time, self.pose)


@dataclass(frozen=True)
class Picture:
    """A picture that was taken at a time [s]; camera_pose (3,) where a pan head turned the camera."""

    time: float
    data: ImageData
    camera_pose: Floats | None = None

    def deliver(self, live: LiveLocalizer) -> None:
        """Hand it over."""
        live.on_image(self.time, self.data, self.camera_pose)


def recorded(recording: Recording) -> Iterator[Message]:
    """The messages of a recording."""
    frames = (recording.frame(picture) for picture in recording.pictures[recording.kind])
    pictures = (Picture(frame.timestamp, frame.images, frame.camera) for frame in frames)
    return beside(pictures, recording.odometry)


def beside(pictures: Iterable[Picture], track: Track | None, reach_s: float = inf) -> Iterator[Message]:
    """Pictures in time, and between them the readings of a track.

    Before each picture comes the track's own pose at its time, so that the localizer need not wait for the next reading
    and gets the odometry that ``Recording`` would give.

    Args:
        pictures: in time.
        track: of the odometer, or None.
        reach_s: pictures farther than this before its first or after its last reading get no pose [s].
    """
    times = [] if track is None else track.times.tolist()
    at = 0
    for picture in pictures:
        while track is not None and at < len(times) and times[at] <= picture.time:
            if times[at] < picture.time:
                yield Odometry(times[at], track.poses[at])
            at += 1
        if track is not None and times[0] - reach_s <= picture.time <= times[-1] + reach_s:
            yield Odometry(picture.time, track.at(picture.time))
        yield picture


def play(
    messages: Iterable[Message],
    live: LiveLocalizer,
    stop: Event,
    clock: Callable[[], float] = clocks.monotonic,
    wait: Callable[[float], bool] | None = None,
) -> None:
    """Deliver messages at the pace of their stamps, as a robot would send them.

    Args:
        messages: in time.
        live: works on them in another thread.
        stop: ends it early.
        clock: that the stamps are held against [s].
        wait: so many seconds; returns whether to stop. By default waits for ``stop``.
    """
    pause, lead = wait or stop.wait, None
    for message in messages:
        lead = message.time - clock() if lead is None else lead
        early = message.time - lead - clock()
        if stop.is_set() or (early > 0.0 and pause(early)):
            return
        message.deliver(live)


def replay(messages: Iterable[Message], live: LiveLocalizer, report: Callable[[LiveReport], None]) -> None:
    """Deliver messages as fast as they are worked on, none dropped, in this thread; then save the belief."""
    skipped = 0.0  # time that a picture would have waited for odometry which does not come
    try:
        for message in messages:
            message.deliver(live)
            while not live.is_idle:
                said = live.work(live.clock() + skipped)
                if said is None:
                    skipped += live.config.odometry_wait_s
                else:
                    report(said)
    finally:
        live.save_state()
