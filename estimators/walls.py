"""Walls that a map only implies: two places that are near each other, and a long way from one to the other."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap, inside_polygon
from topoloc.types import Ints

DETOUR = 3.0
"""A way along the edges that is more than this many times as long as the straight one goes around a wall: three sides
of a square lead around nothing but the middle of a room."""
SOURCES_AT_ONCE = 256
"""Nodes whose distances to all others are held in memory at a time."""


class Walls:
    """Which straight steps from cell to cell a wall bars (ours).

    A topological map draws no walls, but its edges tell of them. Each cell has a foot, the nearest point of the edges
    (or of the nodes). From one cell to another is a wall if the way from foot to foot along the edges is more than
    ``DETOUR`` times the straight distance; feet closer than twice the reach count as that far apart, since there the
    surroundings of both overlap. Inside one ``free`` polygon nothing is barred, nor where edges cross. Edges that were
    guessed from the distances of nodes, or none at all, tell of no walls.

    Args:
        topo_map: the map.
        centres: (C, 2) of the free cells [m].
        reach: how far from a node or an edge the robot may be [m].
    """

    def __init__(self, topo_map: TopoMap, centres: Floats, reach: float) -> None:
        self._positions = topo_map.positions
        self._least = 2.0 * reach
        self._ends, self._feet = topo_map.nearest_way(centres)  # (C, 2) nodes that the foot lies between, (C, 2)
        inside = [inside_polygon(centres, polygon) for polygon in topo_map.free]
        self._polygons = np.array(inside, dtype=bool).reshape(len(inside), len(centres))
        count = len(topo_map.nodes)
        edges = np.unique(np.sort(np.asarray(topo_map.edges), axis=1), axis=0)
        self._known = len(edges) > 0 and not topo_map.edges_are_guessed
        lengths = np.linalg.norm(np.diff(self._positions[edges], axis=1)[:, 0], axis=1)
        self._graph = csr_array((np.maximum(lengths, 1e-9), (edges[:, 0], edges[:, 1])), shape=(count, count))

    def between(self, first: Ints, second: Ints) -> np.ndarray:
        """Whether a wall is between two cells, both given by index into ``centres``: (P,) and (P,) -> (P,) bool."""
        barred = np.zeros(len(first), dtype=bool)
        straight = np.linalg.norm(self._feet[first] - self._feet[second], axis=1)
        limit = DETOUR * np.maximum(straight, self._least) * (1.0 + 1e-9)
        apart = (self._ends[first] != self._ends[second]).any(axis=1)
        apart &= ~(self._polygons[:, first] & self._polygons[:, second]).any(axis=0)
        asked = np.flatnonzero(apart) if self._known else np.zeros(0, dtype=np.int64)
        asked = asked[~self._ways_cross(first[asked], second[asked])]
        asked = asked[self._way_by_shared_end(first[asked], second[asked]) > limit[asked]]
        barred[asked] = self._way(first[asked], second[asked], limit[asked].max(initial=0.0)) > limit[asked]
        return barred

    def _ways_cross(self, first: Ints, second: Ints) -> np.ndarray:
        """Whether the edges of two cells' feet cross each other: there one can turn from one into the other."""
        a, b = (self._positions[self._ends[first]][:, end] for end in (0, 1))
        c, d = (self._positions[self._ends[second]][:, end] for end in (0, 1))
        return np.asarray((_side(a, b, c) * _side(a, b, d) < 0.0) & (_side(c, d, a) * _side(c, d, b) < 0.0))

    def _way_by_shared_end(self, first: Ints, second: Ints) -> Floats:
        """(P,) length of the way from foot to foot through an end that both have in common; infinite without one."""
        legs = self._legs(first)[:, :, None] + self._legs(second)[:, None, :]
        shared = self._ends[first][:, :, None] == self._ends[second][:, None, :]
        return np.asarray(np.where(shared, legs, np.inf).min(axis=(1, 2), initial=np.inf))

    def _way(self, first: Ints, second: Ints, limit: float) -> Floats:
        """(P,) length of the shortest way along the edges from foot to foot [m]; infinite beyond ``limit``."""
        way = np.full(len(first), np.inf)
        starts, goals = self._ends[first], self._ends[second]
        legs = self._legs(first)[:, :, None] + self._legs(second)[:, None, :]
        sources = np.unique(starts)
        for some in np.split(sources, np.arange(SOURCES_AT_ONCE, len(sources), SOURCES_AT_ONCE)):
            distances = dijkstra(self._graph, directed=False, indices=some, limit=limit)
            row = np.minimum(np.searchsorted(some, starts), len(some) - 1)
            found = distances[row[:, :, None], goals[:, None, :]] + legs
            way = np.minimum(way, np.where((some[row] == starts)[:, :, None], found, np.inf).min(axis=(1, 2)))
        return way

    def _legs(self, cells: Ints) -> Floats:
        """(P, 2) from a cell's foot to the two nodes that it lies between [m]."""
        return np.asarray(np.linalg.norm(self._feet[cells][:, None] - self._positions[self._ends[cells]], axis=2))


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    """Above 0 where points (P, 2) lie to the left of the way from start (P, 2) to end (P, 2), below 0 to the right."""
    along, off = end - start, point - start
    return np.asarray(along[:, 0] * off[:, 1] - along[:, 1] * off[:, 0])
