"""Which buildings stand on a large map: office floors, laboratories and single offices, each of its own seed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from benchmarks.worlds.building import BuildingWorld
from benchmarks.worlds.lab_corridor import LabCorridorWorld
from benchmarks.worlds.office import LargeOfficeWorld, OfficeWorld
from benchmarks.worlds.world import World
from topoloc.geometry import Floats
from topoloc.topo_map import Camera
from topoloc.types import Ints

SITE_SEEDS = 10_000
"""Buildings of map seed S have seeds from S times this on: none is a seed of the benchmark or of its calibration."""
FEWEST_ROOMS, MOST_ROOMS = 8, 24
"""Of an office floor: 82 to 249 nodes."""
APART_M = 20.0
"""Free ground between two buildings [m]."""
CAMERA_AHEAD_M = 0.1
"""The camera on the robot, the same in all buildings [m]."""


class PanoramaOffice(OfficeWorld):
    """The small office, seen by the camera of all other buildings."""

    camera = Camera()


class LargePanoramaOffice(LargeOfficeWorld):
    """The large office, seen by that camera."""

    camera = Camera()


@dataclass(frozen=True)
class Site:
    """A building on the map.

    Attributes:
        number: of the building, from 0 on.
        seed: of the building.
        kind: its world.
        settings: of that world.
        count: how many of its nodes are on the map, the first ones.
        corner: (2,) its lowest x and y on the map [m].
    """

    number: int
    seed: int
    kind: type[World]
    settings: Mapping[str, Any]
    count: int
    corner: Floats

    def world(self, changes: Mapping[str, Any] | None = None) -> World:
        """The building, with what has changed in it since the map was made."""
        common = {"updates": 1, "camera_ahead_m": CAMERA_AHEAD_M}
        return self.kind(self.kind.Config(**{**common, **self.settings, **(changes or {})}))

    @cached_property
    def places(self) -> Floats:
        """(count, 2) of its nodes in the building's own frame [m]."""
        return self.world().positions[: self.count]

    @property
    def shift(self) -> Floats:
        """(2,) from the building's own frame to the map's [m]."""
        return np.asarray(self.corner - self.world().positions.min(axis=0))

    def edges(self) -> Ints:
        """(E, 2) pairs of its nodes that are joined, both on the map."""
        pairs = np.asarray(self.world().layout().edges)
        return np.asarray(pairs[(pairs < self.count).all(axis=1)])


def sites_of(nodes: int, seed: int) -> Iterator[Site]:
    """Buildings in a column along y, until there are so many nodes; of the last one only as many as are missing.

    Every second is an office floor of 8 to 24 rooms, the others are laboratories with their corridor and offices,
    small and large by turns. A smaller map of the same seed is the beginning of a larger one.
    """
    y, number = 0.0, 0
    while nodes > 0:
        kind, settings = _drawn(number, np.random.default_rng([seed, number]))
        site = Site(number, seed * SITE_SEEDS + number, kind, settings, 0, np.array([0.0, y]))
        positions = site.world().positions
        count = min(nodes, len(positions))
        yield Site(number, site.seed, kind, settings, count, site.corner)
        y += float(np.ptp(positions[:, 1])) + APART_M
        nodes, number = nodes - count, number + 1


def _drawn(number: int, rng: np.random.Generator) -> tuple[type[World], dict[str, Any]]:
    """World and settings of a building."""
    if number % 2:
        return BuildingWorld, {"rooms": 2 * int(rng.integers(FEWEST_ROOMS // 2, MOST_ROOMS // 2 + 1))}
    if number % 4 == 0:
        return LabCorridorWorld, {}
    return (PanoramaOffice if number % 8 == 2 else LargePanoramaOffice), {}
