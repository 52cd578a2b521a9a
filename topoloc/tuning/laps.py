"""Where a drive is cut so that one part can be held out: at the end of each lap, or into equal stretches."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from topoloc.geometry import Floats

NEAR, FAR = 0.25, 0.5
"""A lap ends where the robot is back within ``NEAR`` of its start after it was beyond ``FAR``, both as shares of how
far from the start it ever gets."""
SHORTEST = 0.5
"""What follows the last lap is one of its own from this share of a usual lap on."""


def laps_of(path: Floats) -> list[slice]:
    """The laps of a path (N, 2) [m], in order and without gaps; the whole of it where it never comes back."""
    away = np.linalg.norm(path - path[0], axis=1)
    near, far = away <= NEAR * away.max(), away > FAR * away.max()
    telling = np.flatnonzero(near | far)
    visits = np.split(telling, np.flatnonzero(np.diff(far[telling])) + 1)
    ends = [int(visit[np.argmin(away[visit])]) for visit in visits[1:] if near[visit[0]]]
    bounds = [0, *ends, len(path)]
    if len(bounds) > 2 and bounds[-1] - bounds[-2] < SHORTEST * float(np.median(np.diff(bounds[:-1]))):
        del bounds[-2]
    return [slice(*part) for part in pairwise(bounds)]


def stretches_of(path: Floats, count: int) -> list[slice]:
    """So many stretches of a path (N, 2) [m] that are as long as each other; some may be empty."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    length = np.concatenate([[0.0], np.cumsum(steps + 1e-9)])  # a robot that only turns is cut by frames
    bounds = np.searchsorted(length, np.linspace(0.0, length[-1], count + 1))
    bounds[-1] = len(path)
    return [slice(int(start), int(end)) for start, end in pairwise(bounds)]
