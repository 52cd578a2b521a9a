"""The robot is carried on, camera covered, and the odometer knows nothing (5.2.2): when, and how looks count."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.worlds.settings import WorldSettings
from topoloc.metrics import Bools

KIDNAPPINGS = ((16, 0.5), (20, 0.3), (24, 0.7), (28, 0.4))
"""At which frame, and how many laps further."""
KIDNAPPED_LAPS = 2.0
LOOKS = 3
"""Updates with a match within which a kidnapped robot should be found (thesis 5.2.2)."""


def kidnapped(settings: WorldSettings, at: int, laps: float) -> WorldSettings:
    """The same world with one kidnapping, and some rounds driven in all."""
    return replace(settings, laps=KIDNAPPED_LAPS, kidnap_at=at, kidnap_laps=laps)


def looks_until_right(matched: Bools, right: Bools) -> float:
    """Updates with a match up to the first that names a right node, infinite if none does.

    An update without a match that comes to be right counts like the next one with a match: the looks before are spent.

    Args:
        matched: (U,) whether any node's match is above the threshold.
        right: (U,) whether the node named is right.
    """
    found = np.flatnonzero(right)
    return float(matched[: found[0]].sum() + 1) if len(found) else np.inf
