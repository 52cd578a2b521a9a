"""KLD-sampling: no more particles than the spread of the belief asks for.

Fox: Adapting the sample size in particle filters through KLD-sampling, International Journal of Robotics Research 2003.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtri

from topoloc.geometry import Floats
from topoloc.types import Ints


@dataclass(frozen=True)
class KLD:
    """How many particles hold a belief to a stated precision.

    Attributes:
        least: particles that are drawn in any case.
        error: bound on the Kullback-Leibler divergence between the particles, in bins, and what they stand for.
        confidence: probability with which the bound holds.
        bin_m: side of a bin [m].
        bin_deg: heading of a bin [deg].
    """

    least: int = 100
    error: float = 0.05
    confidence: float = 0.99
    bin_m: float = 0.25
    bin_deg: float = 15.0

    def __post_init__(self) -> None:
        if self.least < 2:
            raise ValueError(f"least is {self.least}; it must be at least 2")
        for name in ("error", "bin_m", "bin_deg"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive and finite")
        if not 0.5 <= self.confidence < 1.0:
            raise ValueError(f"confidence is {self.confidence}; it must lie in [0.5, 1)")

    def bound(self, bins: Ints) -> Floats:
        """Particles (...) that are enough when they fall into so many bins (...): Fox's equation (7)."""
        free = np.maximum(np.asarray(bins, dtype=np.float64) - 1.0, 1.0)
        ninth = 2.0 / (9.0 * free)
        return np.asarray(free / (2.0 * self.error) * (1.0 - ninth + np.sqrt(ninth) * ndtri(self.confidence)) ** 3)

    def enough(self, poses: Floats) -> int:
        """How many of poses (N, 3), drawn independently or in an order by lot, are enough: at most all of them."""
        sides = np.array([self.bin_m, self.bin_m, np.deg2rad(self.bin_deg)])
        _, first = np.unique(np.floor(poses / sides).astype(np.int64), axis=0, return_index=True)
        occupied = np.searchsorted(np.sort(first), np.arange(len(poses)), side="right")
        drawn = np.arange(1, len(poses) + 1)
        done = (drawn >= self.least) & (drawn >= self.bound(occupied))
        return int(drawn[done][0]) if done.any() else len(poses)
