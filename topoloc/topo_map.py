"""The topological map: nodes with panoramas, edges, free area and training views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from topoloc.errors import UserError
from topoloc.geometry import Floats, nearest_on_segment
from topoloc.nearest_node import NearestNode
from topoloc.pictures import held_in, lazy_pictures
from topoloc.types import Image, Ints

MOST_CELLS = 4_000_000
"""More cells than this are a stray node or a resolution in the wrong unit, not a building."""
WAY_POINT_M = 0.05
"""Between the points of an edge that a position's nearest edge is looked for by [m]."""
MOST_WAY_POINTS = 1_000_000
"""Where there would be more of them, they are farther apart."""
AROUND_M = 1.0
"""Around the nodes and the free area, that robots are looked for in as fast as between the nodes [m]."""
EDGE_REACH = 1.5
"""Without a list of edges, nodes closer than this many times the median nearest spacing are joined."""


class Shaped(Protocol):
    """An image, or a picture that is still on the disk."""

    @property
    def shape(self) -> tuple[int, ...]:
        """(rows, cols[, 3])."""


@dataclass(frozen=True)
class Camera:
    """The camera that a map's pictures were taken with.

    Attributes:
        hfov_deg: horizontal field of view, degrees.
        width: columns of a frame, pixels.
        height: rows of a frame, pixels.
    """

    hfov_deg: float = 40.0
    width: int = 384
    height: int = 288

    def __post_init__(self) -> None:
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {self.hfov_deg}; it must lie between 0 and 180")
        if self.width < 1 or self.height < 1:
            raise ValueError(f"a frame of {self.width}x{self.height} pixels has no picture in it")

    def panorama_columns(self, frame_width: int | None = None) -> int:
        """Columns of a full circle at the scale of a frame ``frame_width`` columns wide: (2.1), rounded."""
        return round((self.width if frame_width is None else frame_width) * 360.0 / self.hfov_deg)

    def fits(self, image: Shaped) -> bool:
        """Whether an image has this camera's aspect ratio, to a pixel of rounding."""
        rows, columns = image.shape[:2]
        return bool(abs(columns * self.height - rows * self.width) <= max(self.width, self.height))

    def fits_panorama(self, image: Shaped) -> bool:
        """Whether an image has the aspect ratio of this camera's panoramas, to 2 %."""
        rows, columns = image.shape[:2]
        expected = self.panorama_columns() * rows / self.height
        return bool(abs(columns - expected) <= 0.02 * expected)


@lazy_pictures("panorama")
@dataclass(frozen=True)
class Node:
    """A place of the map.

    Attributes:
        id: unique, as ``steps.csv`` names it.
        name: for people.
        x, y: [m], map frame.
        heading: of the left edge of the panorama's first column [rad, ccw]; columns run clockwise.
        panorama: uint8 (rows, cols[, 3]), a full circle linear in angle, or None. A map that was read from a folder
            decodes it when it is asked for, which raises ``InputError`` where it is broken.
    """

    id: str
    name: str
    x: float
    y: float
    heading: float = 0.0
    panorama: Image | None = field(default=None, repr=False, compare=False)

    @property
    def has_panorama(self) -> bool:
        """Whether there is a panorama; it is not decoded."""
        return held_in(self, "panorama") is not None


@lazy_pictures("image", "right")
@dataclass(frozen=True)
class View:
    """A training view; its pictures are decoded when they are asked for, as ``Node.panorama`` is.

    Attributes:
        pose: (3,) of the camera it was taken from; heading = optical axis.
        image: uint8 (rows, cols[, 3]).
        right: the other picture of a stereo pair, from ``TopoMap.baseline_m`` to the right of ``pose``, or None.
    """

    pose: Floats
    image: Image = field(repr=False, compare=False)
    right: Image | None = field(default=None, repr=False, compare=False)

    @property
    def has_right(self) -> bool:
        """Whether it is a stereo pair; nothing is decoded."""
        return held_in(self, "right") is not None


@dataclass(frozen=True)
class TopoMap:
    """A topological map.

    Attributes:
        name: for people.
        camera: of the panoramas and views.
        nodes: at least one.
        edges: (E, 2) indices into ``nodes``; None joins near nodes (see ``EDGE_REACH``).
        free: polygons, each (V, 2) [m], that the robot may be in besides the surroundings of nodes and edges.
        views: training views.
        filtered: the panoramas were built from snapshots filtered with CLAHE: a sensor must not filter again.
        baseline_m: distance of the right camera from the main one in the views' stereo pairs [m], or None.
    """

    name: str
    camera: Camera
    nodes: tuple[Node, ...]
    edges: Ints | None = None
    free: tuple[Floats, ...] = ()
    views: tuple[View, ...] = ()
    filtered: bool = False
    baseline_m: float | None = None

    def __post_init__(self) -> None:
        if not self.nodes:
            raise ValueError("a map needs at least one node")
        ids = [node.id for node in self.nodes]
        if len(set(ids)) != len(ids):
            raise ValueError("the ids of a map's nodes must differ")
        if not np.isfinite(self.positions).all():
            raise ValueError("the positions of a map's nodes must be finite")
        if self.baseline_m is not None and not self.baseline_m > 0.0:
            raise ValueError(f"baseline_m is {self.baseline_m}; it must be above 0")
        edges = _near_pairs(self.positions) if self.edges is None else np.asarray(self.edges, dtype=np.int64)
        edges = edges.reshape(-1, 2)
        if len(edges) and not (edges.min() >= 0 and edges.max() < len(self.nodes)):
            raise ValueError(
                f"edges join nodes by index, 0 to {len(self.nodes) - 1}; there is {edges.min()} or {edges.max()}"
            )
        object.__setattr__(self, "edges", edges)

    @classmethod
    def load(cls, folder: Path | str) -> TopoMap:
        """Read a map folder or a text map (DESIGN.md, "On disk"). Raises ``InputError`` naming file and line."""
        from topoloc.map_folder import load_map

        return load_map(Path(folder))

    def save(self, folder: Path | str, overwrite: bool = False) -> None:
        """Write a map folder, whole or not at all. Raises ``OutputExists`` unless told to overwrite."""
        from topoloc.map_folder import save_map

        save_map(self, Path(folder), overwrite)

    @cached_property
    def edges_are_guessed(self) -> bool:
        """Whether the edges are those that join near nodes, as where none were given: they tell nothing of walls."""
        return np.array_equal(np.asarray(self.edges), _near_pairs(self.positions))

    @cached_property
    def positions(self) -> Floats:
        """(K, 2) positions of the nodes [m]."""
        return np.array([(node.x, node.y) for node in self.nodes], dtype=np.float64)

    @cached_property
    def _tree(self) -> cKDTree:
        return cKDTree(self.positions)

    def nearest_node(self, positions: ArrayLike) -> Ints:
        """Index (P,) of the node nearest to each position (P, 2) [m]."""
        return self._nearest.of(np.asarray(positions, dtype=np.float64))

    @cached_property
    def _nearest(self) -> NearestNode:
        corners = np.concatenate([self.positions - AROUND_M, self.positions + AROUND_M, *self.free])
        return NearestNode(self._tree, corners.min(axis=0), corners.max(axis=0))

    def distance_to_nearest(self, positions: ArrayLike) -> Floats:
        """Distance (P,) from each position (P, 2) to the node nearest to it [m]."""
        return np.asarray(self._tree.query(np.asarray(positions, dtype=np.float64))[0], dtype=np.float64)

    def adjacent(self, first: int, second: int) -> bool:
        """Whether an edge joins two nodes, given by index."""
        return (first, second) in self._joined

    @cached_property
    def _joined(self) -> frozenset[tuple[int, int]]:
        pairs = np.asarray(self.edges)
        return frozenset((int(a), int(b)) for a, b in np.concatenate([pairs, pairs[:, ::-1]]))

    def nearest_way(self, positions: ArrayLike) -> tuple[Ints, Floats]:
        """The edge or node nearest to each position (P, 2) [m].

        Returns:
            The two nodes (P, 2) that the edge joins, twice the same for a node, and its nearest point (P, 2) [m]. Of
            ways that are as near, but for ``WAY_POINT_M`` / 2, either.
        """
        points = np.asarray(positions, dtype=np.float64)
        tree, ends, _ = self._way_points
        nearest = ends[tree.query(points)[1]]
        return nearest, nearest_on_segment(points, self.positions[nearest[:, 0]], self.positions[nearest[:, 1]])

    @cached_property
    def _way_points(self) -> tuple[cKDTree, Ints, float]:
        """Points of all edges and nodes, which two nodes each lies between (N, 2), and how far apart they are [m]."""
        nodes = np.arange(len(self.nodes))
        ways = np.concatenate([np.asarray(self.edges), np.column_stack([nodes, nodes])])
        start, end = self.positions[ways[:, 0]], self.positions[ways[:, 1]]
        lengths = np.linalg.norm(end - start, axis=1)
        spacing = max(WAY_POINT_M, float(lengths.sum()) / MOST_WAY_POINTS)
        parts = np.ceil(lengths / spacing).astype(np.int64) + 1
        way = np.repeat(np.arange(len(ways)), parts)
        number = np.arange(len(way)) - np.repeat(np.cumsum(parts) - parts, parts)
        share = number / np.maximum(parts - 1, 1)[way]
        return cKDTree(start[way] + share[:, None] * (end - start)[way]), ways[way], spacing

    def is_free(self, positions: ArrayLike, reach: float) -> np.ndarray:
        """Whether the robot may be at positions (P, 2): within ``reach`` [m] of a node or an edge, or in ``free``."""
        points = np.asarray(positions, dtype=np.float64)
        tree, _, spacing = self._way_points
        farthest = float(np.hypot(reach, spacing / 2.0)) + 1e-9  # from a point of the ways, with the ways in reach
        distance = tree.query(points, distance_upper_bound=farthest)[0]
        inside = np.asarray(distance <= reach)
        doubtful = np.flatnonzero(~inside & np.isfinite(distance))
        for a, b in np.asarray(self.edges) if len(doubtful) else ():
            foot = nearest_on_segment(points[doubtful], self.positions[a], self.positions[b])
            inside[doubtful] |= np.linalg.norm(points[doubtful] - foot, axis=1) <= reach
        for polygon in self.free:
            inside |= inside_polygon(points, polygon)
        return inside

    def free_cells(self, resolution: float, reach: float) -> tuple[Floats, Floats, np.ndarray]:
        """A regular grid over the free area.

        Args:
            resolution: side of a cell [m].
            reach: see ``is_free`` [m].

        Returns:
            Cell centres along x (X,) and along y (Y,) [m], and which cells are free (X, Y).

        Raises:
            UserError: the map is too large for such cells.
        """
        corners = np.concatenate([self.positions - reach, self.positions + reach, *self.free])
        low = np.floor(corners.min(axis=0) / resolution).astype(int)
        high = np.ceil(corners.max(axis=0) / resolution).astype(int)
        if np.prod((high - low).astype(np.float64)) > MOST_CELLS:
            sides = " x ".join(f"{side * resolution:.4g} m" for side in high - low)
            raise UserError(
                f"map {self.name!r} spans {sides}, too much for cells of {resolution} m; "
                "look for a node far from all others, or take an estimator without cells"
            )
        xs, ys = ((np.arange(a, b) + 0.5) * resolution for a, b in zip(low, high, strict=True))
        centres = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
        return xs, ys, self.is_free(centres.reshape(-1, 2), reach).reshape(len(xs), len(ys))


def _near_pairs(positions: Floats) -> Ints:
    """Pairs (E, 2) of nodes closer than ``EDGE_REACH`` times the median distance to the nearest neighbour."""
    if len(positions) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    tree = cKDTree(positions)
    spacing = float(np.median(tree.query(positions, k=2)[0][:, 1]))
    pairs = tree.query_pairs(EDGE_REACH * spacing * (1.0 - 1e-9), output_type="ndarray")
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))], dtype=np.int64)


def inside_polygon(points: Floats, polygon: Sequence[Sequence[float]] | Floats) -> np.ndarray:
    """Even-odd rule: which points (P, 2) lie inside the polygon (V, 2)."""
    corner = np.asarray(polygon, dtype=np.float64)
    inside = np.zeros(len(points), dtype=bool)
    near = np.flatnonzero(((points >= corner.min(axis=0)) & (points <= corner.max(axis=0))).all(axis=1))
    x, y = points[near].T
    for (x0, y0), (x1, y1) in zip(corner, np.roll(corner, -1, axis=0), strict=True):
        if y0 != y1:
            inside[near] ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return inside
