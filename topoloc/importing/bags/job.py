"""What is to be read of a bag, and what all who read it share."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field

from topoloc.importing.bags.bag import Bag, Message
from topoloc.importing.bags.stamps import Clock, TimeSource
from topoloc.importing.bags.topics import Chosen, Told
from topoloc.importing.recording_sink import RecordingSink

Follow = Callable[[Iterable[Message], int, str], Iterator[Message]]
"""Passes messages on, of which there are so many at most, and shows how far it is with what."""


@dataclass(frozen=True)
class BagSettings:
    """What of a bag is to be read.

    Attributes:
        told: topics by name.
        odometry_tf: two frames of ``/tf``, such as ``odom`` and ``base_link``, in place of a topic of odometry.
        truth_tf: the same for the true pose, such as ``map`` and ``base_link``.
        time: of a message: its own stamp (``header``), or when it was ``received``.
        every: seconds from one picture to the next, at least.
        start: of what is read, after the beginning of the bag [s].
        end: the same; None: all.
    """

    told: Told = field(default_factory=Told)
    odometry_tf: tuple[str, str] | None = None
    truth_tf: tuple[str, str] | None = None
    time: TimeSource = "header"
    every: float = 0.0
    start: float = 0.0
    end: float | None = None


@dataclass(frozen=True)
class Job:
    """One import: where from, what, where to; ``notes`` are what a user should know of it."""

    bag: Bag
    settings: BagSettings
    chosen: Chosen
    sink: RecordingSink
    clock: Clock
    follow: Follow
    notes: list[str] = field(default_factory=list)
