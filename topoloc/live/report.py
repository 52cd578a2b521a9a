"""What goes into a live localizer besides the messages, and what comes out of it."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, fields
from functools import cached_property
from threading import Lock

import numpy as np

from topoloc.geometry import Floats, compose
from topoloc.localizer import Step
from topoloc.types import Estimate, Status, WeightedPoses


@dataclass(frozen=True)
class LiveConfig:
    """How patient a live localizer is. Times of messages are their stamps [s].

    Attributes:
        camera_silent_s: without a new picture for so long, the status is LOST [s].
        tell_silence_every_s: while the camera is silent, a report so often [s].
        odometry_wait_s: a picture waits so long for a reading of the odometer that is younger than it; after that, the
            odometer's motion is extrapolated, no farther than this [s].
        odometry_silent_s: where pictures had no odometry for longer than this, what the odometer says of the motion
            meanwhile is not used: the pictures have told it [s].
        odometry_keep_s: readings are kept for so long [s].
        clock_back_s: stamps that are older than the newest by more than this, three in a row, are a clock that was set
            back; the localizer starts anew from its belief [s].
        most_hz: pictures that come faster than this are passed over; 0: none.
        save_every_s: the belief is saved so often [s].
    """

    camera_silent_s: float = 2.0
    tell_silence_every_s: float = 1.0
    odometry_wait_s: float = 0.2
    odometry_silent_s: float = 2.0
    odometry_keep_s: float = 30.0
    clock_back_s: float = 2.0
    most_hz: float = 0.0
    save_every_s: float = 5.0

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if not 0.0 <= value < np.inf:
                raise ValueError(f"{item.name} is {value}; it must be 0 or more")


@dataclass(frozen=True)
class LiveCounts:
    """What became of the messages since the start.

    Attributes:
        frames: pictures that came.
        used: pictures that were worked on, those within the motion gate among them.
        dropped: pictures that a younger one overtook while the localizer was at work.
        skipped: pictures that came sooner than ``LiveConfig.most_hz`` allows.
        late: pictures not younger than the last one used.
        unreadable: used pictures that did not decode.
        odometry: readings that came.
        odometry_late: readings that came after a younger one; they are sorted in, unless they are too old for that.
        odometry_repeated: readings with the time of another.
        bad: messages whose numbers are not finite.
        jumps: breaks of the odometry: readings that no robot can have moved between, or a new start of its clock.
        restarts: new starts of the localizer because the pictures' clock was set back.
        unsaved: times that the belief could not be saved.
    """

    frames: int = 0
    used: int = 0
    dropped: int = 0
    skipped: int = 0
    late: int = 0
    unreadable: int = 0
    odometry: int = 0
    odometry_late: int = 0
    odometry_repeated: int = 0
    bad: int = 0
    jumps: int = 0
    restarts: int = 0
    unsaved: int = 0


class Tally:
    """``LiveCounts`` in the making; any thread may count."""

    def __init__(self) -> None:
        self._lock, self._counts = Lock(), Counter[str]()

    def add(self, *names: str) -> None:
        """Count one more of each; the names are fields of ``LiveCounts``."""
        with self._lock:
            self._counts.update(names)

    def counts(self) -> LiveCounts:
        """As they stand now."""
        with self._lock:
            return LiveCounts(**self._counts)


@dataclass(frozen=True)
class LiveReport:
    """Where the robot is now.

    Attributes:
        timestamp: of the picture; while the camera is silent, of the newest reading of the odometer. It never
            decreases, unless the pictures' clock was set back [s].
        estimate: of the pose at that time; while the camera is silent it rides on the odometry.
        status: of the estimate; LOST while the camera is silent.
        why: what is not as it should be, in words; empty where nothing is.
        looked: the belief after the last look.
        since: (3,) motion of the robot since then, by the odometry.
        node_id: id of the estimate's node; None where it names none.
        counts: of messages.
        latency_s: from the picture's arrival to this report, on the localizer's clock; for silence, how long [s].
        step: what the localizer made of the picture; None in a report of silence.
    """

    timestamp: float
    estimate: Estimate
    status: Status
    why: str
    looked: WeightedPoses
    since: Floats
    node_id: str | None
    counts: LiveCounts
    latency_s: float
    step: Step | None = None

    @cached_property
    def belief(self) -> WeightedPoses:
        """Where the robot could be at ``timestamp``: the belief after the last look, moved by the odometry since."""
        if not self.since.any():
            return self.looked
        return WeightedPoses(compose(self.looked.poses, self.since), self.looked.log_weights, self.looked.spread)
