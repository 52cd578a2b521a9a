"""What of a grid of cells is looked at at a time, so that what cannot be reached costs nothing."""

from __future__ import annotations

from itertools import product

import numpy as np

TILE = 64
"""Side of a tile [cells]: a layer of it is 32 kB."""

Window = tuple[slice, slice]
"""Columns and rows of cells; start and end are numbers."""


def whole(free: np.ndarray) -> list[Window]:
    """All cells (X, Y) as one window."""
    return [(slice(0, free.shape[0]), slice(0, free.shape[1]))]


def tiles(free: np.ndarray) -> list[Window]:
    """Windows that together cover the free cells (X, Y), those without any left out."""
    corners = product(*(range(0, count, TILE) for count in free.shape))
    ends = ((x, min(x + TILE, free.shape[0]), y, min(y + TILE, free.shape[1])) for x, y in corners)
    windows = [(slice(left, right), slice(low, high)) for left, right, low, high in ends]
    return [window for window in windows if free[window].any()]


def reachable(free: np.ndarray) -> list[Window]:
    """The tiles, if they leave out half of the cells (X, Y) or more; otherwise the whole, which is quicker."""
    windows = tiles(free)
    covered = sum(free[window].size for window in windows)
    return windows if 2 * covered <= free.size else whole(free)
