"""Where the odometer alone says the robot is: dead reckoning from a known pose (thesis 5.2.1, 5.2.8)."""

from __future__ import annotations

import numpy as np

from topoloc.geometry import Floats, between, compose, wrap


def by_odometer(odometry: Floats, start: Floats) -> Floats:
    """The path (N, 3) that raw readings (N, 3) tell, from a true pose (3,) on."""
    return compose(start, between(odometry[0], odometry))


def astray(odometry: Floats, truth: Floats) -> tuple[float, float]:
    """Distance [m] and turn [degrees] between the end of a drive (N, 3) and what the odometer (N, 3) says of it."""
    off = by_odometer(odometry, truth[0])[-1] - truth[-1]
    return float(np.hypot(off[0], off[1])), float(np.rad2deg(abs(wrap(off[2]))))
