"""Which node is nearest to a place, for many places: a table of cells, and a tree where a cell does not tell."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from topoloc.geometry import Floats
from topoloc.types import Ints

CELLS = 1024
"""Of the table, for each node: 32 across the distance between two of a square grid."""
MOST_CELLS = 2**18
"""Of the table, however many nodes there are: two megabytes."""
FEW = 256
"""Places that the tree finds before the table's calls are made."""
DOUBTFUL = -1
"""In the table: the border between two nodes may pass here."""
SAME = 1e-6
"""Two nodes are as near where their distances differ by less than this share of a cell's side."""


class NearestNode:
    """Finds the nearest node as a tree of the nodes does, much faster from the first few thousand places on.

    The places that are nearest to one node are a convex polygon. So a cell whose four corners are nearest to the same
    node is so throughout, and its number is all that a place needs. Where corners differ, two nodes are as near, or the
    table ends, the tree is asked. The table is made once as many places have been asked for as it has cells: so a map
    that is asked for a few places does not pay for it.

    Args:
        tree: of the nodes.
        low, high: (2,) corners of what the table covers [m].
    """

    def __init__(self, tree: cKDTree, low: Floats, high: Floats) -> None:
        self._tree = tree
        extent = np.maximum(high - low, 1e-9)
        self._side = float(np.sqrt(extent.prod() / min(CELLS * tree.n, MOST_CELLS)))
        self._shape = np.minimum(np.ceil(extent / self._side), MOST_CELLS).astype(np.int64)
        self._low = low
        self._asked = 0
        self._table: Ints | None = None  # (X + 2, Y + 2) flat, with a border of doubt for what lies beyond

    def of(self, places: Floats) -> Ints:
        """Index (P,) of the node nearest to each place (P, 2) [m]; of nodes as near, that which the tree names."""
        if len(places) < FEW:
            return self._by_tree(places)
        if self._table is None:
            self._asked += len(places)
            if self._asked < self._shape.prod():
                return self._by_tree(places)
            self._table = self._made()
        at = self._along(places, 0)
        at *= self._shape[1] + 2
        at += self._along(places, 1)
        nodes = self._table.take(at.astype(np.int64))
        doubtful = np.flatnonzero(nodes == DOUBTFUL)
        nodes[doubtful] = self._by_tree(places[doubtful])
        return nodes

    def _by_tree(self, places: Floats) -> Ints:
        return np.asarray(self._tree.query(places)[1], dtype=np.int64)

    def _along(self, places: Floats, axis: int) -> Floats:
        """Cells (P,) along an axis, whole numbers counted from the border, of places (P, 2)."""
        along = places[:, axis] - self._low[axis]
        along /= self._side
        np.floor(along, out=along)
        along += 1.0
        return np.asarray(np.clip(along, 0.0, self._shape[axis] + 1.0, out=along))

    def _made(self) -> Ints:
        """The table: a cell's node, or doubt."""
        lines = (low + self._side * np.arange(count + 1) for low, count in zip(self._low, self._shape, strict=True))
        corners = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1)
        distance, node = self._tree.query(corners, k=2)
        told = node[..., 0]
        told[distance[..., 1] - distance[..., 0] <= SAME * self._side] = DOUBTFUL
        first = told[:-1, :-1]
        alike = (first == told[1:, :-1]) & (first == told[:-1, 1:]) & (first == told[1:, 1:])
        return np.pad(np.where(alike, first, DOUBTFUL), 1, constant_values=DOUBTFUL).ravel()
