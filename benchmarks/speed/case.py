"""One comparison with a peer: whether both give the same answer, and how long each takes in the same run."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from time import process_time

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

SHORTEST_S = 0.01
"""A sample makes so many calls that it takes at least this long [s]: a clock's grain and a stray pause drown in it."""
LEAST_S = 1e-7
"""No call takes less [s], whatever the clock says."""
LONGEST_S = 15.0
"""The samples of a comparison take hardly longer than this together [s]: there are fewer where the work is long."""
FEWEST = 5
"""Samples that there are however long they take, unless fewer are asked for."""


@dataclass(frozen=True)
class Pair:
    """Two ways to do the same work, set up and ready to be called as often as one likes.

    Attributes:
        ours, peers: do the work once; what they return is not looked at.
        agree: whether both give the same answer, within what chance or rounding allows.
    """

    ours: Callable[[], object]
    peers: Callable[[], object]
    agree: Callable[[], bool]


@dataclass(frozen=True)
class Case:
    """A comparison that can be asked for.

    Attributes:
        group: what it belongs to, ``estimators`` say; this, too, can be asked for.
        what: the work, as it is asked for.
        size: how much of it, for people.
        peer: what ours is compared with, for people.
        packages: that the peer needs besides what topoloc needs itself, by the names they are imported by.
        prepare: sets both up; only here such packages are imported, for they need not be installed.
    """

    group: str
    what: str
    size: str
    peer: str
    packages: tuple[str, ...]
    prepare: Callable[[], Pair]

    @property
    def missing(self) -> tuple[str, ...]:
        """Packages that are not installed."""
        return tuple(package for package in self.packages if find_spec(package) is None)


@dataclass(frozen=True)
class Result:
    """What a comparison came to.

    Attributes:
        case: that was measured.
        ours_ms, peer_ms: median over the repeats of the processor time for the work once [ms].
        ratio: median over the repeats of the peer's time by ours: above 1 ours is faster.
        ratio_low, ratio_high: lower and upper quartile of the same.
        samples: repeats that these are over.
        agree: whether both gave the same answer.
    """

    case: Case
    ours_ms: float
    peer_ms: float
    ratio: float
    ratio_low: float
    ratio_high: float
    samples: int
    agree: bool

    def row(self) -> dict[str, str | float | bool]:
        """The result as ``topoloc speed --json`` prints it."""
        return {
            "what": self.case.what,
            "size": self.case.size,
            "peer": self.case.peer,
            "ours_ms": round(self.ours_ms, 4),
            "peer_ms": round(self.peer_ms, 4),
            "ratio": round(self.ratio, 4),
            "agree": self.agree,
        }


def choose(cases: Sequence[Case], what: str) -> list[Case]:
    """The cases of that name or group."""
    return [case for case in cases if what in (case.group, case.what)]


def names(cases: Sequence[Case]) -> list[str]:
    """What can be asked for: groups first, then single kinds of work."""
    return list(dict.fromkeys([case.group for case in cases] + [case.what for case in cases]))


@contextmanager
def one_thread() -> Iterator[None]:
    """Keep libraries to one thread: those that are loaded by now, and OpenCV, whose threads are its own."""
    before = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(before)


def measure(case: Case, repeats: int) -> Result:
    """Check a case, then time it on one thread, a sample of ours and one of the peer's by turns.

    Args:
        case: to be measured.
        repeats: samples of each; fewer where they would take longer than ``LONGEST_S``.
    """
    pair = case.prepare()
    with one_thread():  # after the imports
        agree = pair.agree()
        ours, peers = _samples(pair, repeats)
    low, ratio, high = np.percentile(peers / ours, [25.0, 50.0, 75.0])
    ours_ms, peer_ms = (1e3 * float(np.median(seconds)) for seconds in (ours, peers))
    return Result(case, ours_ms, peer_ms, float(ratio), float(low), float(high), len(ours), agree)


def _samples(pair: Pair, repeats: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds a call (N,) of ours and of the peer's, N <= repeats. Who comes first changes, lest it matter."""
    calls = (pair.ours, pair.peers)
    numbers, lengths = zip(*(enough(call) for call in calls), strict=True)
    seconds = np.empty((2, min(repeats, max(FEWEST, int(LONGEST_S / sum(lengths))))))
    for repeat in range(seconds.shape[1]):
        for which in (0, 1) if repeat % 2 == 0 else (1, 0):
            seconds[which, repeat] = seconds_of(calls[which], numbers[which]) / numbers[which]
    return seconds[0], seconds[1]


def enough(call: Callable[[], object]) -> tuple[int, float]:
    """How many calls a sample needs, and how long it will take [s].

    The first call warms up: caches, and compilers that translate at need. Where it took long, warming up was little
    of it, and it tells enough.
    """
    took = seconds_of(call)
    if took < 100.0 * SHORTEST_S:
        took = min(seconds_of(call) for _ in range(3))
    took = max(took, LEAST_S)
    number = int(np.ceil(SHORTEST_S / took)) or 1
    return number, number * took


def seconds_of(call: Callable[[], object], number: int = 1) -> float:
    """Processor time of so many calls [s]: what else the machine does at the time does not count."""
    return timeit.timeit(call, timer=process_time, number=number)
