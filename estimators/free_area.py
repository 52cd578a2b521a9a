"""Where the robot may be: near a node or an edge, or in a polygon that the map calls free; and what is in the way."""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise

import numpy as np

from estimators.walls import Walls
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Ints

WALLS_LOOKED_FOR = (1, 2, 3, 4, 6, 8, 12)
"""Steps in cells that are tried on all cells to see whether there are walls at all."""
MOST_LEGS = 12
"""A longer step is tested at so many places on the way."""


class FreeArea:
    """Where the robot may be, as cells, with the walls between them.

    Args:
        topo_map: the map; see ``TopoMap.free_cells``.
        resolution: side of a cell [m].
        reach: how far from a node or an edge the robot may be [m].

    Attributes:
        resolution: side of a cell [m].
        xs, ys: (X,) and (Y,) centres of the cells [m].
        free: (X, Y) bool.
        centres: (C, 2) of the free cells [m].
    """

    def __init__(self, topo_map: TopoMap, resolution: float, reach: float) -> None:
        self.resolution = resolution
        self.xs, self.ys, self.free = topo_map.free_cells(resolution, reach)
        self.centres: Floats = np.stack(np.meshgrid(self.xs, self.ys, indexing="ij"), axis=-1)[self.free]
        self._corner = np.array([self.xs[0], self.ys[0]]) - resolution / 2.0
        self._walls = Walls(topo_map, self.centres, reach)
        self._number = np.where(self.free, np.cumsum(self.free).reshape(self.free.shape) - 1, -1)  # into centres
        self._bordered = np.pad(self.free, 1)
        self._passages = dict[tuple[int, int], np.ndarray]()

    @property
    def size(self) -> float:
        """Its area [m^2]."""
        return len(self.centres) * self.resolution**2

    def contains(self, positions: Floats) -> np.ndarray:
        """Which of the positions (P, 2) [m] lie in a free cell: (P,) bool."""
        at = self._along(positions, 0)
        at *= self._bordered.shape[1]
        at += self._along(positions, 1)
        at += self._bordered.shape[1] + 1.0  # past the border's first column, and the first of a column
        return np.asarray(self._bordered.take(at.astype(np.int64)))

    def barred(self, start: Floats, end: Floats) -> np.ndarray:
        """Whether a wall is in the way of straight steps (P, 2) -> (P, 2) [m]: (P,) bool.

        Only cells that are free tell of walls: those of the start and the end, and those on the way.
        """
        if not self.has_walls:
            return np.zeros(len(start), dtype=bool)
        return self._cross_walls(self._cells(start), self._cells(end))

    def passage(self, columns: int, rows: int) -> np.ndarray:
        """Which cells (X, Y) can be reached by a straight step of so many cells along x and y; remembered."""
        if (columns, rows) not in self._passages:
            reached = self.free.copy()
            if self.has_walls:
                end = np.argwhere(self.free)
                reached[self.free] = ~self._cross_walls(end - np.array([columns, rows]), end)
            self._passages[columns, rows] = reached
        return self._passages[columns, rows]

    def sample(self, n: int, rng: np.random.Generator) -> Floats:
        """Draw n poses (n, 3), uniform over the area and the circle."""
        centres = self.centres[rng.integers(len(self.centres), size=n)]
        position = centres + (rng.random((n, 2)) - 0.5) * self.resolution
        return np.column_stack([position, rng.uniform(-np.pi, np.pi, size=n)])

    @cached_property
    def has_walls(self) -> bool:
        """Whether there is a wall between any two cells up to a dozen cells apart: else nobody needs to ask again."""
        cells = np.argwhere(self.free)
        directions = np.array([(1, 0), (0, 1), (1, 1), (1, -1)])
        return any(
            self._walls_between(cells, cells + length * direction).any()
            for length in WALLS_LOOKED_FOR
            for direction in directions
        )

    def _cross_walls(self, start: Ints, end: Ints) -> np.ndarray:
        """Whether straight steps between cells (P, 2) cross a wall, at once or from one to the next on the way."""
        crossed = self._walls_between(start, end)
        legs = int(np.clip(np.abs(end - start).max(initial=0), 1, MOST_LEGS))
        on_the_way = (np.floor(start + (end - start) * leg / legs + 0.5).astype(np.int64) for leg in range(legs + 1))
        for before, after in pairwise(on_the_way):
            crossed |= self._walls_between(before, after)
        return crossed

    def _walls_between(self, first: Ints, second: Ints) -> np.ndarray:
        """Whether there is a wall between cells (P, 2); not where one is not free."""
        one, other = self._numbers(first), self._numbers(second)
        known = (one >= 0) & (other >= 0) & (one != other)
        barred = np.zeros(len(first), dtype=bool)
        barred[known] = self._walls.between(one[known], other[known])
        return barred

    def _along(self, positions: Floats, axis: int) -> Floats:
        """Cells (P,) along an axis, whole numbers, of positions (P, 2) [m]; far outside just outside."""
        along = positions[:, axis] - self._corner[axis]
        along /= self.resolution
        np.floor(along, out=along)
        return np.asarray(np.clip(along, -1.0, self.free.shape[axis], out=along))

    def _cells(self, positions: Floats) -> Ints:
        """Cells (P, 2) of positions (P, 2) [m]; far outside just outside."""
        return np.stack([self._along(positions, axis) for axis in (0, 1)], axis=1).astype(np.int64)

    def _numbers(self, cells: Ints) -> Ints:
        """Index (P,) into ``centres`` of cells (P, 2); -1 where a cell is not free."""
        columns, rows = (np.clip(cells[:, axis], 0, count - 1) for axis, count in enumerate(self.free.shape))
        inside = (columns == cells[:, 0]) & (rows == cells[:, 1])
        return np.where(inside, self._number[columns, rows], -1)
