"""Which of many points in the plane are within reach of a place, for many places at a time."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from topoloc.geometry import Floats

Ints = NDArray[np.int64]
AROUND = 2
"""Cells on either side of a place's own that hold what is within its reach: a cell is so many parts of it wide."""
MANY = 64
"""Points that it takes for a search to be worth its while."""
WIDE = (2.0 * AROUND + 1.0) / AROUND
"""Reaches that those cells are wide together."""
SMALL = 0.3
"""Share of the area of all points below which it pays to look only there."""
OUTSIDE = AROUND + 1
"""So many cells beyond the outermost point nothing is within reach any more, however far away."""
MOST_CELLS = 2**53
"""Cells are numbered in floating point; more could not be told apart."""
WIDEST = 256
"""Places that a tile has at most."""
PREPARED = 16
"""Numbers that are worked out for a point of a tile, besides one for each of its places."""
TOGETHER = 2**18
"""Numbers that are worked on together: enough to be worth the calls, few enough for the cache."""


@dataclass(frozen=True)
class Tiles:
    """Places and the points near them: in a tile all places are in one cell, and all its points may be near to each.

    Attributes:
        centres: (T, 2) of the tiles' cells, seen from ``Nearby.corner`` [m].
        places: (T, n) indices of the places; where a tile has fewer than n the last is repeated.
        points: (T, K) indices of the points; where a tile has fewer than K, their number stands for none.
    """

    centres: Floats
    places: Ints
    points: Ints


class Nearby:
    """Points sorted into square cells, half a reach wide, that are numbered column by column.

    What is within reach of a place lies in the five times five cells around its own, which are five runs of the sorted
    points.

    Args:
        points: (M, 2), M >= 1 [m].
        reach: how far a point may be from a place [m], positive.

    Attributes:
        corner: (2,) the lowest coordinates of the points [m].
    """

    def __init__(self, points: Floats, reach: float) -> None:
        extents = [(axis.min(), axis.max()) for axis in points.T]  # numpy is slow along the first axis
        self.corner: Floats = np.array([least for least, _ in extents])
        self._side = reach / AROUND
        self._outermost = [np.floor((most - least) / self._side) for least, most in extents]
        self._height = int(self._outermost[1]) + 2 * OUTSIDE + 1
        self._none = len(points)
        cells = self._cells(points)
        self._order = _sorting(cells)
        self._sorted = cells[self._order]

    @classmethod
    def worthwhile(cls, points: Floats, reach: float) -> Nearby | None:
        """As the class; None where one may as well look at all: at few points, or where most are within reach."""
        if len(points) < MANY or not 0.0 < reach < np.inf:
            return None
        extent = np.array([np.ptp(axis) for axis in points.T])
        part = np.minimum(1.0, WIDE * reach / np.maximum(extent, 1e-300)).prod()
        cells = ((extent / reach + WIDE + 1.0) * AROUND).prod()
        return cls(points, reach) if part < SMALL and cells < MOST_CELLS else None

    def tiles(self, places: Floats) -> Iterator[Tiles]:
        """All places (P, 2), each in one tile: block by block, small enough for the cache."""
        cells = self._cells(places)
        order = _sorting(cells)
        occupied, first, count = np.unique(cells[order], return_index=True, return_counts=True)
        starts, lengths = self._runs(occupied)
        held = lengths.sum(axis=1)
        parts = -(-count // WIDEST)
        cell = np.repeat(np.arange(len(occupied)), parts)
        begin = first[cell] + WIDEST * _counted(parts)
        last = np.minimum(begin + WIDEST, (first + count)[cell]) - 1
        width = np.exp2(np.ceil(np.log2(last - begin + 1))).astype(np.int64)
        for some in _blocks(width, held[cell]):
            at = cell[some]
            members = np.minimum(begin[some, None] + np.arange(width[some[0]]), last[some, None])
            yield Tiles(self._centres(occupied[at]), order[members], self._listed(starts[at], lengths[at]))

    def _cells(self, places: Floats) -> Ints:
        """(P,) numbers of the cells that places (P, 2) are in; all that are far outside are just outside."""
        column, row = (self._along(places, axis) for axis in (0, 1))
        return np.asarray(column * self._height + row, dtype=np.int64)

    def _along(self, places: Floats, axis: int) -> Floats:
        """(P,) numbers of columns, or of rows."""
        along = places[:, axis] - self.corner[axis]
        along /= self._side
        np.floor(along, out=along)
        np.clip(along, -OUTSIDE, self._outermost[axis] + OUTSIDE, out=along)
        along += OUTSIDE
        return np.asarray(along)

    def _centres(self, cells: Ints) -> Floats:
        """(C, 2) seen from the corner."""
        along = np.stack(np.divmod(cells, self._height), axis=1)
        return np.asarray((along - OUTSIDE + 0.5) * self._side)

    def _runs(self, cells: Ints) -> tuple[Ints, Ints]:
        """Starts and lengths (C, 5) of the runs of sorted points around cells (C,)."""
        steps = np.arange(-AROUND, AROUND + 1)
        middles = cells[:, None] + steps * self._height
        starts = np.searchsorted(self._sorted, middles - AROUND, side="left")
        return starts, np.searchsorted(self._sorted, middles + AROUND, side="right") - starts

    def _listed(self, starts: Ints, lengths: Ints) -> Ints:
        """(C, K) points of runs (C, 5), filled up with their number."""
        held = lengths.sum(axis=1)
        listed = np.full((len(held), int(held.max(initial=0))), self._none)
        runs = lengths.ravel()
        at = np.repeat(starts.ravel(), runs) + _counted(runs)
        listed[np.arange(listed.shape[1]) < held[:, None]] = self._order[at]
        return listed


def _sorting(cells: Ints) -> Ints:
    """Indices (P,) that sort cells (P,); of 16 bits numpy is several times as fast."""
    few = cells.max(initial=0) < 2**16
    return np.argsort(cells.astype(np.uint16) if few else cells, kind="stable")


def _counted(counts: Ints) -> Ints:
    """0, 1, ... for each of the counts (C,), one after the other."""
    ends = np.cumsum(counts)
    return np.arange(int(ends[-1]) if len(ends) else 0) - np.repeat(ends - counts, counts)


def _blocks(width: Ints, held: Ints) -> Iterator[Ints]:
    """Indices of tiles that fit together: of one width (T,), holding nearly as many points (T,)."""
    order = np.lexsort((held, width))
    ends = np.flatnonzero(np.diff(width[order])) + 1
    for same in np.split(order, ends) if len(order) else []:
        step = max(1, TOGETHER // int((PREPARED + width[same[0]]) * (1 + held[same[-1]])))
        for first in range(0, len(same), step):
            yield same[first : first + step]
