"""One comparison with a peer: whether both give the same answer, and how long each takes in the same run."""

from __future__ import annotations

import timeit
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec

import numpy as np
from threadpoolctl import threadpool_limits

SHORTEST_S = 0.01
"""A sample makes so many calls that it takes at least this long [s]: a clock's grain and a stray pause drown in it."""


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
        ours_ms, peer_ms: median over the repeats of the time for the work once [ms].
        ratio: median over the repeats of the peer's time by ours: above 1 ours is faster.
        ratio_low, ratio_high: lower and upper quartile of the same.
        agree: whether both gave the same answer.
    """

    case: Case
    ours_ms: float
    peer_ms: float
    ratio: float
    ratio_low: float
    ratio_high: float
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


def measure(case: Case, repeats: int) -> Result:
    """Check a case, then time it on one thread, a sample of ours and one of the peer's by turns."""
    pair = case.prepare()
    with threadpool_limits(1):  # after the imports: it limits the libraries that are loaded by now
        agree = pair.agree()
        ours, peers = _samples(pair, repeats)
    low, ratio, high = np.percentile(peers / ours, [25.0, 50.0, 75.0])
    ours_ms, peer_ms = (1e3 * float(np.median(seconds)) for seconds in (ours, peers))
    return Result(case, ours_ms, peer_ms, float(ratio), float(low), float(high), agree)


def _samples(pair: Pair, repeats: int) -> tuple[np.ndarray, np.ndarray]:
    """Seconds a call (repeats,) of ours and of the peer's. Who comes first changes, lest it matter."""
    calls = (pair.ours, pair.peers)
    numbers = [_enough(call) for call in calls]
    seconds = np.empty((2, repeats))
    for repeat in range(repeats):
        for which in (0, 1) if repeat % 2 == 0 else (1, 0):
            seconds[which, repeat] = timeit.timeit(calls[which], number=numbers[which]) / numbers[which]
    return seconds[0], seconds[1]


def _enough(call: Callable[[], object]) -> int:
    """How many calls a sample needs. The first call warms up: caches, and compilers that translate at need."""
    call()
    return int(np.ceil(SHORTEST_S / min(timeit.repeat(call, number=1, repeat=3)))) or 1
