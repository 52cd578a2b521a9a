"""Units of time: by name, and by size where a clock that counts since 1970 is not named."""

from __future__ import annotations

TIME_UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
"""How long each is [s]."""
COUNTED_FROM = {"ns": 1e17, "us": 1e14, "ms": 1e11, "s": 0.0}
"""A clock that counts in the unit since 1970 shows at least so much, whenever after 1973 it is read."""
EPOCH_S = 1e9
"""A count of seconds above this is one since 1970 (since 2001), not of pictures."""


def unit_by_size(value: float) -> str:
    """The unit that a time of this size is counted in, if since 1970; ``s`` for a smaller one."""
    return next(unit for unit, least in COUNTED_FROM.items() if abs(value) >= least)
