"""Units of time: by name, and by size where a clock that counts since 1970 is not named."""

from __future__ import annotations

import numpy as np

from topoloc.geometry import Floats

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""How long each is [s]."""
COUNTED_FROM = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 0.0}
"""A clock that counts in the unit since 1970 shows at least so much, whenever after 1973 it is read."""
EPOCH_S = 1e9
"""A count of seconds above this is one since 1970 (since 2001), not of pictures."""
LONGEST_STEP_S = 5.0
"""A clock without a unit that steps more counts something else than seconds [s]."""
NAME_THE_UNIT = "name it time_ms, time_us or time_ns; time_s if seconds are meant"


def unit_by_size(value: float) -> str:
    """The unit that a time of this size is counted in, if since 1970; ``s`` for a smaller one."""
    return next(unit for unit, least in COUNTED_FROM.items() if abs(value) >= least)


def unclear_step(counts: Floats) -> float | None:
    """The usual step of times without a unit, where they could count something else than seconds; None: they do not.

    They could where they are whole numbers and too small for a clock since 1970, since milliseconds and microseconds
    are mostly written so, and where they step by more than ``LONGEST_STEP_S``.

    Args:
        counts: (N,) finite, in any order.
    """
    scale = TIME_UNITS[unit_by_size(float(counts[0]))]
    steps = np.diff(np.unique(counts)) * scale
    if not steps.size:
        return None
    step = float(np.median(steps))
    whole = bool((counts == np.round(counts)).all() and np.abs(counts).max() < EPOCH_S)
    return step if whole or step > LONGEST_STEP_S else None
