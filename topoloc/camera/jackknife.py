"""Standard deviations of estimates from pairs of frames, of which neighbouring ones err alike."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

BLOCKS = 10
"""Pairs are left out in so many blocks, one after the other."""


def jackknife(pairs: int, estimate: Callable[[NDArray[np.bool_]], float]) -> float:
    """Standard deviation of an estimate by leaving out blocks of neighbouring pairs (the delete-a-group jackknife).

    Args:
        pairs: how many there are, 2 or more.
        estimate: of the pairs (pairs,) that are kept.
    """
    blocks = min(BLOCKS, pairs)
    block = np.arange(pairs) * blocks // pairs
    estimates = np.array([estimate(block != left_out) for left_out in range(blocks)])
    return float(np.sqrt((blocks - 1) / blocks * ((estimates - estimates.mean()) ** 2).sum()))
