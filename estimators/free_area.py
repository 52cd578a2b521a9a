"""Where the robot may be: near a node or an edge, or in a polygon that the map calls free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap


@dataclass(frozen=True)
class FreeArea:
    """Where the robot may be, as cells: the same ones as the grid's.

    Attributes:
        corner: (2,) lower corner of the first cell [m].
        resolution: side of a cell [m].
        free: (X, Y) bool.
    """

    corner: Floats
    resolution: float
    free: np.ndarray

    @classmethod
    def of(cls, topo_map: TopoMap, resolution: float, reach: float) -> FreeArea:
        """The free area of a map; see ``TopoMap.free_cells``."""
        xs, ys, free = topo_map.free_cells(resolution, reach)
        return cls(np.array([xs[0], ys[0]]) - resolution / 2.0, resolution, free)

    @property
    def size(self) -> float:
        """Its area [m^2]."""
        return float(self.free.sum()) * self.resolution**2

    def contains(self, positions: Floats) -> np.ndarray:
        """Which of the positions (P, 2) [m] lie in a free cell: (P,) bool."""
        cell = np.floor((positions - self.corner) / self.resolution)
        nearest = np.clip(cell, 0, np.array(self.free.shape) - 1)
        index = nearest.astype(np.int64)
        return np.asarray((cell == nearest).all(axis=1) & self.free[index[:, 0], index[:, 1]])

    def sample(self, n: int, rng: np.random.Generator) -> Floats:
        """Draw n poses (n, 3), uniform over the area and the circle."""
        cells = np.argwhere(self.free)
        chosen = cells[rng.integers(len(cells), size=n)]
        position = self.corner + (chosen + rng.random((n, 2))) * self.resolution
        return np.column_stack([position, rng.uniform(-np.pi, np.pi, size=n)])
