"""Whether pictures move as the odometer says: the scene goes to the right while the robot turns to the left (ours)."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from topoloc.checks.finding import Finding
from topoloc.checks.panoramas import reduced
from topoloc.geometry import between, compose
from topoloc.keypoints import LEAST_SUPPORT, Keypoints, pairs_of
from topoloc.recording import Recording
from topoloc.types import Frame

TURN_DEG = (5.0, 30.0)
"""Between two frames the camera turns by so much, or they say nothing about the sense of turning [degrees]."""
NEAR_M = 0.5
"""And it moves by less than this [m]."""
MOST_TURNS = 30
"""So many turns are looked at, evenly picked."""
LEAST_TURNS = 5
MOST_AGAINST = 0.7
"""So many must tell, and this share of them go the wrong way, before it is a finding."""


def sense_findings(recording: Recording) -> Iterator[Finding]:
    """A finding where the pictures go the wrong way round as the camera turns.

    Raises:
        InputError: a picture that cannot be read.
    """
    frames = [recording.frame(picture) for picture in recording.pictures[recording.kind]]
    turns = [pair for pair in pairwise(frames) if TURN_DEG[0] <= abs(_turn(*pair)) <= TURN_DEG[1]]
    if len(turns) < LEAST_TURNS:
        return
    chosen = [turns[i] for i in np.unique(np.linspace(0, len(turns) - 1, MOST_TURNS).round().astype(int))]
    shifts = [_shift(before, after, recording.kind) * np.sign(_turn(before, after)) for before, after in chosen]
    told = [shift for shift in shifts if shift != 0.0]
    against = sum(shift < 0.0 for shift in told)
    if len(told) >= LEAST_TURNS and against >= MOST_AGAINST * len(told):
        what = f"in {against} of {len(told)} turns the pictures move the wrong way"
        remedy = "look whether they are mirror-flipped or upside down, or the odometer's heading grows clockwise"
        yield Finding(str(recording.folder / f"{recording.kind}.txt"), what, remedy, "serious")


def _turn(before: Frame, after: Frame) -> float:
    """How far the camera turned, degrees counter-clockwise; 0 where it also moved far, or nobody knows."""
    if before.odometry is None or after.odometry is None:
        return 0.0
    moved = between(compose(before.odometry, before.camera), compose(after.odometry, after.camera))
    return float(np.rad2deg(moved[2])) if np.hypot(moved[0], moved[1]) <= NEAR_M else 0.0


def _shift(before: Frame, after: Frame, kind: str) -> float:
    """How far to the right things went from one picture to the next, pixels; 0 where too few are found again."""
    first, second = (Keypoints.of(reduced(np.asarray(frame.images[kind]))) for frame in (before, after))
    pairs = pairs_of(first, second)
    if len(pairs.first) < LEAST_SUPPORT:
        return 0.0
    return float(np.median(second.places[pairs.second, 0] - first.places[pairs.first, 0]))
