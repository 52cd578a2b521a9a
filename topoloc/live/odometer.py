"""Readings of an odometer as they arrive, late, twice or not at all -> its pose at the time of a picture."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections import deque
from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike

from topoloc.checks.of_recording import JUMP_DEG_PER_S, JUMP_M_PER_S
from topoloc.geometry import Floats, between, compose, inverse, wrap
from topoloc.live.clock import SetBack
from topoloc.live.report import LiveConfig, Tally

LEAST_JUMP_S = 0.1
"""Stamps are not good to less: two readings are taken to be so far apart at least, where a jump is looked for [s]."""


@dataclass(frozen=True)
class Reading:
    """The odometer at one time.

    Attributes:
        pose: (3,) as the localizer takes it: goes on where the odometer broke off. None where it is not known, or
            where the motion since the picture before is not.
        raw: (3,) as the odometer says it, or None.
        why: what is wrong, in words; empty where nothing is.
    """

    pose: Floats | None
    raw: Floats | None
    why: str = ""


class Odometer:
    """A buffer of readings, sorted by time. Any thread may add; one thread asks.

    A jump that no robot makes (``topoloc check`` calls the same a jump), such as an odometer's reset, is cut out: the
    poses go on from before it, and the motion meanwhile is said to be unknown, once.
    """

    def __init__(self, config: LiveConfig, tally: Tally) -> None:
        self._config, self._tally = config, tally
        self._lock = Lock()
        self._times: list[float] = []
        self._poses: list[Floats] = []
        self._set_back = SetBack(config.clock_back_s)
        self._behind: deque[tuple[float, Floats]] = deque(maxlen=self._set_back.needed)
        self._offset = np.zeros(3)  # leads from the odometer's frame to that of the poses handed out
        self._followed: tuple[float, Floats] | None = None  # the last reading whose jump, if any, is in ``_offset``
        self._cut_at = -np.inf  # time of the last break
        self._cut = ""  # what it was, until it was told
        self._without_since: float | None = (
            None  # time of the first picture that had no reading, since the last that had
        )
        self.alive = True

    def add(self, time: float, pose: ArrayLike) -> None:
        """Take in a raw pose (3,) of the odometer; whatever is wrong with it is counted."""
        self._tally.add("odometry")
        try:
            values = np.array(pose, dtype=np.float64)
        except (TypeError, ValueError):
            values = np.full(3, np.nan)
        if values.shape != (3,) or not (np.isfinite(values).all() and np.isfinite(time)):
            self._tally.add("bad")
            return
        values[2] = wrap(values[2])
        with self._lock:
            self.alive = True
            self._insert(float(time), values)

    def _insert(self, time: float, pose: Floats) -> None:
        newest = self._times[-1] if self._times else -np.inf
        if time < newest:
            self._tally.add("odometry_late")
        if time < newest - self._config.clock_back_s:
            self._behind.append((time, pose))
            if self._set_back.says(time):
                self._begin_again()
            return
        if time > newest:
            self._set_back.forget()
            self._behind.clear()
        at = bisect_left(self._times, time)
        if at < len(self._times) and self._times[at] == time:
            self._tally.add("odometry_repeated")
            return
        self._times.insert(at, time)
        self._poses.insert(at, pose)
        stale = bisect_left(self._times, self._times[-1] - self._config.odometry_keep_s)
        del self._times[:stale], self._poses[:stale]

    def _begin_again(self) -> None:
        """The odometer's clock was set back: what came since takes the place of all before."""
        kept = dict(sorted(self._behind))
        self._times, self._poses = list(kept), list(kept.values())
        self._behind.clear()
        self._set_back.forget()
        if self._followed is not None:
            self._break(self._times[0], self._followed[1], self._poses[0], "the odometer's clock was set back")
        self._followed, self._without_since, self._cut_at = (self._times[0], self._poses[0]), None, -np.inf

    def is_worth_waiting_for(self, time: float) -> bool:
        """Whether there is no reading at this time or later, but may be soon.

        Readings flow as time does: one that lags by more than pictures wait will not be there in time.
        """
        with self._lock:
            lag = time - self._times[-1] if self._times else 0.0
            return self.alive and (not self._times or 0.0 < lag <= self._config.odometry_wait_s)

    def newest(self) -> tuple[float, Reading] | None:
        """Time and reading of the youngest one; a break before it stays to be told by ``at``."""
        with self._lock:
            if not self._times:
                return None
            time, raw = self._times[-1], self._poses[-1]
            self._follow(time)
            return time, Reading(compose(self._offset, raw), raw)

    def between(self, start: float, end: float) -> Floats:
        """Motion (3,) from one time to another; none where it is not known."""
        with self._lock:
            first, last = self._raw_at(start), self._raw_at(end)
            return np.zeros(3) if first is None or last is None or self._cut_at > start else between(first, last)

    def at(self, time: float) -> Reading:
        """The reading at the time of a picture."""
        with self._lock:
            raw = self._raw_at(time)
            if raw is None:
                self._without_since = time if self._without_since is None else self._without_since
                return Reading(None, None, self._absence(time))
            absent = 0.0 if self._without_since is None else time - self._without_since
            self._without_since = None
            if absent > self._config.odometry_silent_s and self._followed is not None:
                self._break(time, self._followed[1], raw, f"the odometer was silent for {absent:.1f} s")
                self._followed = self._reading_by(time)
            self._follow(time)
            if self._cut or time < self._cut_at:
                why, self._cut = self._cut or "the odometer broke off", ""
                return Reading(None, raw, f"{why}: the motion meanwhile is unknown")
            return Reading(compose(self._offset, raw), raw)

    def _reading_by(self, time: float) -> tuple[float, Floats]:
        """Time and raw pose of the last reading that is not younger, or else of the first."""
        at = max(bisect_right(self._times, time) - 1, 0)
        return self._times[at], self._poses[at]

    def _follow(self, time: float) -> None:
        """Follow the readings up to a time, and cut out their jumps."""
        until, raw = self._reading_by(time)
        since, before = self._followed or (until, raw)
        if until < since:
            return
        span = slice(bisect_right(self._times, since), bisect_right(self._times, until))
        times, poses = np.array([since, *self._times[span]]), np.array([before, *self._poses[span]])
        for i in np.flatnonzero(_jumps(times, poses)).tolist():
            moved = float(np.hypot(*(poses[i + 1] - poses[i])[:2]))
            self._break(float(times[i + 1]), poses[i], poses[i + 1], f"the odometer jumped by {moved:.1f} m")
        self._followed = until, raw

    def _break(self, time: float, before: Floats, after: Floats, why: str) -> None:
        """From ``after`` (3,) on, raw, the poses go on where they were at ``before`` (3,), raw."""
        self._offset = compose(compose(self._offset, before), inverse(after))
        self._cut_at, self._cut = time, why
        self._tally.add("jumps")

    def _raw_at(self, time: float) -> Floats | None:
        """The raw pose (3,): interpolated, or extrapolated no farther than the configuration allows."""
        after = bisect_right(self._times, time)
        if after == 0:
            near = bool(self._times) and self._times[0] - time <= self._config.odometry_wait_s
            return self._poses[0] if near else None
        last = self._times[after - 1]
        if last == time:
            return self._poses[after - 1]
        if after == len(self._times):
            return self._extrapolated(time - last) if time - last <= self._config.odometry_wait_s else None
        start, end = self._poses[after - 1], self._poses[after]
        if _jumps(np.array([last, self._times[after]]), np.array([start, end])).any():
            return start
        share = (time - last) / (self._times[after] - last)
        x, y = start[:2] + share * (end - start)[:2]
        return np.array([x, y, float(wrap(start[2] + share * float(wrap(end[2] - start[2]))))])

    def _extrapolated(self, ahead: float) -> Floats:
        """Where the robot is so long after the last reading [s], if it goes on as it did for as long before."""
        last = self._times[-1]
        first = bisect_left(self._times, last - ahead)
        times, poses = np.array(self._times[first:]), np.array(self._poses[first:])
        if self._times[0] > last - ahead or _jumps(times, poses).any():
            return self._poses[-1]
        before = self._raw_at(last - ahead)
        return self._poses[-1] if before is None else compose(self._poses[-1], between(before, self._poses[-1]))

    def _absence(self, time: float) -> str:
        """Why there is no reading; no word of a robot that has no odometer."""
        if not self._times:
            return ""
        gap = min(abs(time - self._times[0]), abs(time - self._times[-1]))
        side = "older" if self._times[-1] < time else "younger"
        hint = "; are both on one clock?" if gap > 60.0 else ""
        wait = f" (live.odometry_wait_s is {self._config.odometry_wait_s:g})" if side == "older" and not hint else ""
        return f"no odometry: the nearest reading is {gap:.1f} s {side} than the picture{wait}{hint}"


def _jumps(times: Floats, poses: Floats) -> np.ndarray[tuple[int], np.dtype[np.bool_]]:
    """(N - 1,) between which of N readings no robot can have moved; times (N,), poses (N, 3)."""
    seconds = np.maximum(np.diff(times), LEAST_JUMP_S)
    steps = np.diff(poses, axis=0)
    far = np.hypot(steps[:, 0], steps[:, 1]) > JUMP_M_PER_S * seconds
    turned = np.rad2deg(np.abs(wrap(steps[:, 2])))
    return np.asarray(far | (turned > JUMP_DEG_PER_S * seconds))
