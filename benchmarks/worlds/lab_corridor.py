"""The thesis's laboratory and the corridor beside it (5.2.8, Figure 5.30), simulated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from benchmarks.worlds.drive import Route
from benchmarks.worlds.lab import CORRIDOR, DOOR_Y, DOORS_X, ENTRY, LAB_PLACES, LEFT, LabWorld
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import Place
from topoloc.geometry import Floats
from topoloc.types import Ints

CORRIDOR_PLACES: tuple[Place, ...] = (
    *LAB_PLACES,
    Place("9", "WAY_OUT", -2.0, -1.0),
    Place("10", "ENTRY", (ENTRY[0] + ENTRY[2]) / 2.0, DOOR_Y),
    *(Place(str(11 + k), f"CORRIDOR_{k + 1}", CORRIDOR[2] - 1.0 - 2.0 * k, DOOR_Y) for k in range(5)),
)
"""Those of 9 to 15 are rebuilt: the thesis tells their order and the size of entry and corridor."""
CORRIDOR_TOUR = (*range(15), *range(13, 7, -1), 7)
OPEN_DOORS = 8
"""Index of the node, 9, whose panorama was taken with the doors open."""
CORRIDOR_PACE = 2.6
"""Updates lay this much farther apart outside the laboratory: 21 of them on some 22 m (Table 5.9)."""


@dataclass(frozen=True)
class CorridorSettings(WorldSettings):
    """As in every world, but one lap with the doors open, and fewer frames (Table 5.9: 30 inside, 21 outside).

    Attributes:
        laps: rounds driven; ``updates`` overrules it.
        doors: how far the doors stand open during the drive, 0 to 1; in the map they are closed but for node 9.
        route: how the robot drives around the nodes.
    """

    laps: float = 1.0
    doors: float = 1.0
    route: Route = field(default_factory=lambda: Route(step_m=0.48, turn_step_deg=45.0))


class LabCorridorWorld(LabWorld):
    """The laboratory, a small entry and a corridor of 2 m x 10 m (thesis 5.2.8, Figure 5.30), simulated: 15 nodes."""

    Config = CorridorSettings
    title = "laboratory and corridor"

    @property
    def places(self) -> Sequence[Place]:
        """Nodes 1 to 15."""
        return CORRIDOR_PLACES

    @property
    def tour(self) -> Sequence[int]:
        """Round the laboratory, to the end of the corridor, and back by 9 and 8 to 1."""
        return CORRIDOR_TOUR

    def edges(self) -> Ints:
        """The legs of the tour, and what is less than 1.5 m apart inside the laboratory."""
        lab = self.positions[: len(LAB_PLACES)]
        apart = np.linalg.norm(lab[:, None] - lab, axis=2)
        near = np.argwhere(np.triu(apart < 1.5, 1))
        legs = [sorted(pair) for pair in pairwise((*CORRIDOR_TOUR, 0))]
        return np.unique(np.concatenate([near, legs]), axis=0)

    def pace(self, positions: Floats) -> Floats:
        """Frames lie farther apart outside the laboratory."""
        return np.where(positions[:, 0] < LEFT, CORRIDOR_PACE, 1.0)

    def gates(self) -> Floats:
        """The doorways to the entry and to the corridor."""
        return np.array([(x, DOOR_Y) for x in DOORS_X])

    def mapped_at(self, place: int) -> Moment:
        """Doors closed, but for node 9."""
        return Moment(doors=1.0 if place == OPEN_DOORS else 0.0)
