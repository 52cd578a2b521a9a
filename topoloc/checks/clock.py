"""Whether pictures and odometer have one clock: pictures turn when the odometer turns, not seconds before or after."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from topoloc.checks.finding import Finding
from topoloc.checks.shifts import Shift
from topoloc.geometry import Floats
from topoloc.recording import Recording
from topoloc.recording import Track as Poses

REACH_S = 20.0
"""Clocks are tried so far apart [s]."""
STEPS_A_FRAME = 4
"""So many lags in one median frame interval."""
LEAST_PAIRS = 20
"""So many pairs of pictures must tell at a lag."""
LEAST_EVENTS = 6.0
"""And the best correlation must come of so many of them: one turn alone fits any other."""
HIGH, OVER_NONE, OVER_OTHERS = 0.75, 0.2, 0.2
"""A lag is believed whose correlation is this high, and above that of no lag and of any far one by so much."""
FAR_FRAMES, FAR_S = 3.0, 2.0
"""A lag is far from another by so many frame intervals, and by so many seconds."""
LEAST_LAG_S = 0.3
"""Smaller lags, and those below one frame interval, are not told [s]."""
NO_RELATION, MANY_PAIRS, MANY_TURNS = 0.5, 40, 10
"""Below this at every lag, with so many pairs and turns among them, chance is all there is; mirrored pictures have a
relation, below zero."""


@dataclass(frozen=True)
class _Fits:
    """How well the odometer, so much later, fits the pictures.

    Attributes:
        lags: (L,) [s], the middle one 0.
        correlations: (L,) -1 to 1; NaN where too few pairs have an odometer.
        events: (L,) of how many pairs they come, those that turn little counting little.
    """

    lags: Floats
    correlations: Floats
    events: Floats

    @property
    def at_none(self) -> float:
        """The correlation of one clock; NaN where it cannot be told."""
        return float(self.correlations[len(self.lags) // 2])


def clock_findings(recording: Recording, shifts: Sequence[Shift]) -> Iterator[Finding]:
    """A finding where the pictures fit the odometer better some time later, or at no time.

    Where turns are few, alike, or come back in step, nothing can be said, and nothing is.

    Args:
        recording: which.
        shifts: of its pictures.
    """
    told = [shift for shift in shifts if not np.isnan(shift.right_px)]
    if recording.odometry is None or len(told) < LEAST_PAIRS:
        return
    frame_s = float(np.median(np.diff([picture.time for picture in recording.pictures[recording.kind]])))
    fits = _fits(recording, recording.odometry, told, frame_s)
    if np.isnan(fits.correlations).all():
        return
    where = str(recording.folder / f"{recording.kind}.txt")
    lag = _lag(fits, frame_s)
    if lag is not None:
        best = np.nanmax(fits.correlations)
        when = f"{abs(lag):.1f} s {'later' if lag > 0.0 else 'earlier'}"
        what = f"the pictures fit the odometer best {when} (correlation {best:.2f}, as they are {fits.at_none:.2f})"
        remedy = f"record both with one clock, or import again with an --offset-s {abs(lag):.1f} s "
        remedy += "larger" if lag > 0.0 else "smaller"
        yield Finding(where, what, remedy, "serious")
    elif _much_turned(told) and np.nanmax(np.abs(fits.correlations)) < NO_RELATION:
        what = "pictures and odometer do not turn together, nor would they with another clock"
        yield Finding(where, what, "look whether both are of the same drive, and the times of both", "warning")


def _much_turned(told: Sequence[Shift]) -> bool:
    return len(told) >= MANY_PAIRS and sum(shift.turned_deg != 0.0 for shift in told) >= MANY_TURNS


def _lag(fits: _Fits, frame_s: float) -> float | None:
    """By how much the clocks differ [s]; None where they do not, or where that cannot be told."""
    best = int(np.nanargmax(fits.correlations))
    if fits.events[best] < LEAST_EVENTS:
        return None
    lag, height = float(fits.lags[best]), fits.correlations[best]
    far = np.abs(fits.lags - lag) > max(FAR_FRAMES * frame_s, FAR_S)
    others = np.append(fits.correlations[far & ~np.isnan(fits.correlations)], -1.0)
    believed = height > HIGH and height - fits.at_none > OVER_NONE and height - others.max() > OVER_OTHERS
    # Pictures that go the wrong way round fit some lag, too, but another one still better with their sign changed.
    mirrored = -np.nanmin(fits.correlations) > height
    return lag if believed and not mirrored and abs(lag) > max(LEAST_LAG_S, frame_s) * (1.0 - 1e-9) else None


def _fits(recording: Recording, odometry: Poses, shifts: Sequence[Shift], frame_s: float) -> _Fits:
    """Correlations of how far pictures turned with how far the odometer and the pan head turned some time later."""
    starts, ends, right = np.array([(shift.start, shift.end, shift.right_px) for shift in shifts]).T
    steps = int(REACH_S * STEPS_A_FRAME / frame_s)
    lags = np.arange(-steps, steps + 1) * frame_s / STEPS_A_FRAME
    fits = _Fits(lags, np.full(len(lags), np.nan), np.zeros(len(lags)))
    tracks = [track for track in (odometry, recording.pan) if track is not None]
    turning = [(track.times, np.unwrap(track.poses[:, 2])) for track in tracks]
    for i, lag in enumerate(lags):
        known = (starts + lag >= odometry.times[0]) & (ends + lag <= odometry.times[-1])
        if known.sum() >= max(LEAST_PAIRS, 0.5 * len(shifts)):
            turned = sum(np.interp(ends[known] + lag, *one) - np.interp(starts[known] + lag, *one) for one in turning)
            fits.correlations[i], fits.events[i] = _correlation(np.asarray(turned), right[known])
    return fits


def _correlation(first: Floats, second: Floats) -> tuple[float, float]:
    """Of two series (N,), and of how many of their values it comes."""
    first, second = first - first.mean(), second - second.mean()
    products = np.abs(first * second)
    if not products.any():
        return 0.0, 0.0
    correlation = first @ second / np.sqrt((first @ first) * (second @ second))
    return float(correlation), float(products.sum() ** 2 / (products**2).sum())
