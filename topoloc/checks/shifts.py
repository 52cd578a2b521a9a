"""How far things move sideways from one picture to the next, beside how far the odometer turned: measured once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from topoloc.checks.panoramas import reduced
from topoloc.geometry import Floats, between, compose
from topoloc.going_through import Track, in_silence
from topoloc.keypoints import LEAST_SUPPORT, Keypoints, pairs_of
from topoloc.recording import LazyImages, Recording
from topoloc.types import Frame

TURN_DEG = (5.0, 30.0)
"""Between two frames the camera turns by so much, or they say nothing about the sense of turning [degrees]."""
NEAR_M = 0.5
"""And it moves by less than this [m]."""
MOST_TURNS = 30
"""So many turns are looked at, evenly picked."""
MOST_OTHERS = 90
"""And so many other pairs: what the odometer calls no turn may be one where its clock is another."""


@dataclass(frozen=True)
class Shift:
    """Two successive pictures.

    Attributes:
        start: time of the first [s].
        end: time of the second [s].
        turned_deg: by how much the camera turned by the odometer, counter-clockwise, where that is a ``TURN_DEG`` of
            nearly one place; else 0.
        right_px: how far to the right things went, pixels of reduced pictures; NaN where too few are found again.
    """

    start: float
    end: float
    turned_deg: float
    right_px: float


def shifts_of(recording: Recording, track: Track = in_silence) -> list[Shift]:
    """Shifts of successive pictures: of up to ``MOST_TURNS`` turns and ``MOST_OTHERS`` other pairs, in time.

    Args:
        recording: with odometry.
        track: goes through the pairs.

    Raises:
        InputError: a picture that cannot be read.
    """
    frames = [recording.frame(picture) for picture in recording.pictures[recording.kind]]
    turned = np.array([_turned(*pair) for pair in pairwise(frames)])
    chosen = {*_evenly(np.flatnonzero(turned), MOST_TURNS), *_evenly(np.flatnonzero(turned == 0.0), MOST_OTHERS)}
    found: list[Shift] = []
    known: dict[int, Keypoints] = {}
    for i in track(sorted(chosen), "comparing pictures in time"):
        known = {at: known[at] if at in known else _keypoints(frames[at], recording.kind) for at in (i, i + 1)}
        right = _right(known[i], known[i + 1])
        found.append(Shift(frames[i].timestamp, frames[i + 1].timestamp, float(turned[i]), right))
    return found


def _evenly(numbers: np.ndarray, most: int) -> Sequence[int]:
    picked = np.unique(np.linspace(0, len(numbers) - 1, most).round().astype(int)) if len(numbers) else numbers
    return [int(number) for number in numbers[picked]]


def _turned(before: Frame, after: Frame) -> float:
    """By how much the camera turned in a turn that tells, degrees counter-clockwise; 0 where it is none."""
    if before.odometry is None or after.odometry is None:
        return 0.0
    moved: Floats = between(compose(before.odometry, before.camera), compose(after.odometry, after.camera))
    turned = float(np.rad2deg(moved[2]))
    tells = TURN_DEG[0] <= abs(turned) <= TURN_DEG[1] and np.hypot(moved[0], moved[1]) <= NEAR_M
    return turned if tells else 0.0


def _keypoints(frame: Frame, kind: str) -> Keypoints:
    found = Keypoints.of(reduced(np.asarray(frame.images[kind])))
    if isinstance(frame.images, LazyImages):
        frame.images.forget()  # or a long recording would fill memory
    return found


def _right(first: Keypoints, second: Keypoints) -> float:
    pairs = pairs_of(first, second)
    if len(pairs.first) < LEAST_SUPPORT:
        return float("nan")
    return float(np.median(second.places[pairs.second, 0] - first.places[pairs.first, 0]))
