"""The thesis's laboratory with its entry and corridor (5.2, Figures 5.22 and 5.30), simulated.

Map frame: node 1 is the origin, x to the right and y up in Figure 5.22, metres. Top and right walls are windows. The
coordinates of nodes 9 to 15, the doors and all furniture are rebuilt: the thesis gives sizes, not places.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from benchmarks.worlds.builders import CEILING_M, Builder, Thing
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.furniture import FACES_DOWN, FACES_LEFT, FACES_RIGHT, FACES_UP, workplace
from benchmarks.worlds.light import LitRoom, light_at
from benchmarks.worlds.moment import Moment, as_they_stand, off_the_path
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.rooms import Opening, door, door_gap, room, sky, wall, window_gap
from benchmarks.worlds.world import Place, World

LAB_PLACES: tuple[Place, ...] = (
    Place("1", "CHARGER", 0.0, 0.0),
    Place("2", "SHELVES", 1.0, 0.0),
    Place("3", "CENTRE", 1.0, 1.0),
    Place("4", "CUPBOARD", 1.0, 2.0),
    Place("5", "DOOR", 0.0, 2.0),
    Place("6", "DESK_1", 0.0, 1.0),
    Place("7", "DESK_2", -1.0, 1.0),
    Place("8", "DESK_3", -1.0, 0.0),
)
"""The nodes of Figure 5.22 in the order of the path."""

LEFT, RIGHT, BOTTOM, TOP = -3.3, 3.3, -2.3, 4.3
"""The walls [m]; the bottom one is in part a panel 1.5 m high, with a closed-off area of 2 m behind it."""
BEHIND = -4.3
PANEL_END = 0.9
DOOR_Y = -1.45
ENTRY = (LEFT - 2.1, DOOR_Y - 1.0, LEFT - 0.1, DOOR_Y + 1.0)
CORRIDOR = (ENTRY[0] - 10.1, DOOR_Y - 1.0, ENTRY[0] - 0.1, DOOR_Y + 1.0)
"""x0, y0, x1, y1 [m]: 2 m x 2 m and 10 m x 2 m, behind a door each."""
DOORS_X = (LEFT - 0.05, ENTRY[0] - 0.05)
"""Middles of the two doorways [m]."""
CHAIR_GAP_M = 1.28
"""Centre of a chair to the lines between the nodes [m]: at least 0.45 m from the chair to the path."""

_LAB_ROOM = LitRoom(
    (LEFT, BEHIND, RIGHT, TOP),
    tubes=[(x, y, CEILING_M - 0.1) for x in (-1.6, 1.6) for y in (-0.8, 2.6)],
    bulbs=[(-2.6, 3.6), (2.7, 0.6), (0.2, -1.6)],
    windows=[
        (0.1, TOP - 0.2, 1.8, 0.55, 0.15),
        (2.1, TOP - 0.2, 1.8, 0.35, 0.25),
        (RIGHT - 0.2, 1.6, 1.8, 0.25, 0.85),
        (RIGHT - 0.2, -0.7, 1.8, 0.2, 1.1),
    ],
)
_ENTRY_ROOM = LitRoom(ENTRY, [((ENTRY[0] + ENTRY[2]) / 2.0, DOOR_Y, CEILING_M - 0.1)], [(ENTRY[0] + 0.4, DOOR_Y)])
_CORRIDOR_LAMPS = np.linspace(CORRIDOR[0] + 1.2, CORRIDOR[2] - 1.2, 4)
_CORRIDOR_ROOM = LitRoom(
    CORRIDOR,
    [(float(x), DOOR_Y, CEILING_M - 0.1) for x in _CORRIDOR_LAMPS],
    [(float(x) + 0.8, DOOR_Y + 0.6) for x in _CORRIDOR_LAMPS],
)

DESKS: tuple[tuple[float, float, float], ...] = (
    (-2.2, TOP - 0.45, FACES_DOWN),
    (LEFT + 0.42, 0.6, FACES_RIGHT),
    (LEFT + 0.42, 2.5, FACES_RIGHT),
    (0.1, TOP - 0.45, FACES_DOWN),
    (1.85, TOP - 0.45, FACES_DOWN),
    (RIGHT - 0.45, 1.6, FACES_LEFT),
    (RIGHT - 0.45, -0.6, FACES_LEFT),
)
"""Middles of the similar desks, turned to the room."""

WINDOWS: tuple[tuple[float, float, float], ...] = (
    (0.1, TOP, FACES_DOWN),
    (2.2, TOP, FACES_DOWN),
    (RIGHT, 1.7, FACES_LEFT),
    (RIGHT, -0.6, FACES_LEFT),
)
"""Middles of the windows, turned to the room."""


def furniture(rng: np.random.Generator) -> list[Thing]:
    """All that stands in the laboratory; the generator varies details, not the plan."""
    things = [thing for number, desk in enumerate(DESKS) for thing in workplace(desk, number, rng)]
    things += [Thing("window", pose, 0.0, int(rng.choice([0, 0, 25, 40]))) for pose in WINDOWS]
    things += [
        Thing("poster", (-1.25, TOP, FACES_DOWN), 1.25, 0),
        Thing("cupboard", (RIGHT - 0.26, 3.45, FACES_LEFT)),
        Thing("carton", (RIGHT - 0.26, 3.3, FACES_LEFT), 2.0, 1, True),
        Thing("shelf", (1.5, BOTTOM + 0.18, FACES_UP), 0.0, 0),
        Thing("shelf", (2.62, BOTTOM + 0.18, FACES_UP), 0.0, 1),
        Thing("low_shelf", (LEFT + 0.19, 3.75, FACES_RIGHT), 0.0, 2),
        Thing("plant", (LEFT + 0.22, 3.75, FACES_RIGHT), 1.15, 0),
        Thing("whiteboard", (LEFT, 1.75, FACES_RIGHT), 1.0),
        Thing("supply", (-0.6, BOTTOM + 0.25, FACES_UP)),
        Thing("supply", (0.0, BOTTOM + 0.25, FACES_UP)),
        Thing("printer", (0.0, BOTTOM + 0.25, FACES_UP), 0.6, 0, True),
        Thing("carton", (-1.5, BOTTOM + 0.25, rng.uniform(2.8, 3.5)), 0.0, 0, True),
        Thing("shelf", (-2.3, BEHIND + 0.2, FACES_UP), 0.0, 3),
        Thing("poster", (-0.6, BEHIND, FACES_UP), 1.25, 5),
    ]
    for number, y in enumerate((-0.55, 0.4, 3.1)):
        shift = float(rng.uniform(-0.12, 0.12))
        things.append(Thing("poster", (LEFT, y + shift, FACES_RIGHT), 1.0 + rng.uniform(0.0, 0.2), number + 1))
    return things


def beyond(rng: np.random.Generator) -> list[Thing]:
    """What hangs and stands in the entry and the corridor: closed doors, a few notices, hardly anything else."""
    low, high = CORRIDOR[1], CORRIDOR[3]
    things = [
        Thing("poster", (ENTRY[0] + 1.3, ENTRY[3], FACES_DOWN), 1.1, 4),
        Thing("carton", (ENTRY[0] + 0.35, ENTRY[1] + 0.25, FACES_UP), 0.0, 1),
    ]
    things += [Thing("door", (CORRIDOR[0] + x, high, FACES_DOWN), 0.0) for x in (1.5, 4.7, 8.2)]
    things += [Thing("door", (CORRIDOR[0] + x, low, FACES_UP), 0.0) for x in (2.6, 6.9)]
    for x, wall_y, facing in ((3.2, high, FACES_DOWN), (4.6, low, FACES_UP), (6.4, high, FACES_DOWN)):
        at = CORRIDOR[0] + x + float(rng.uniform(-0.3, 0.3))
        things.append(Thing("poster", (at, wall_y, facing), 1.1, int(rng.integers(6))))
    things.append(Thing("low_shelf", (CORRIDOR[0] + 0.2, DOOR_Y + 0.4, FACES_RIGHT), 0.0, 1))
    return things


def _laboratory(b: Builder) -> None:
    """Walls, floor and ceiling of the laboratory, and what its windows look at."""
    top = [window_gap(x, y) for x, y, _ in WINDOWS[:2]]
    right = [window_gap(x, y) for x, y, _ in WINDOWS[2:]]
    high = np.array([RIGHT, 0.55])  # brick below, plaster above
    wall(b, np.array([LEFT, BEHIND]), np.array([LEFT, TOP]), "plaster", [door_gap(LEFT, DOOR_Y)])
    wall(b, np.array([LEFT, TOP]), np.array([RIGHT, TOP]), "plaster", top)
    wall(b, np.array([RIGHT, TOP]), high, "plaster", right)
    wall(b, high, np.array([RIGHT, BOTTOM]), "brick", right)
    wall(b, np.array([RIGHT, BOTTOM]), np.array([PANEL_END, BOTTOM]), "plaster")
    wall(b, np.array([PANEL_END, BOTTOM]), np.array([PANEL_END, BEHIND]), "plaster")
    b.wall(np.array([PANEL_END, BEHIND]), np.array([LEFT, BEHIND]), 0.0, CEILING_M, "brick", 2.0)
    b.wall(np.array([PANEL_END, BOTTOM]), np.array([LEFT, BOTTOM]), 0.0, 1.5, "panel", 0.85)
    middle = np.array([(LEFT + RIGHT) / 2.0, (TOP + BEHIND) / 2.0, 0.0])
    size = (RIGHT - LEFT, TOP - BEHIND)
    b.plane(middle, size, 0.0, "carpet", 2.0)
    b.plane(middle, size, CEILING_M, "ceiling", 2.4)
    sky(b, (0.0, TOP + 9.0), FACES_DOWN, 0)
    sky(b, (RIGHT + 10.0, 0.0), FACES_LEFT, 1)


@lru_cache(maxsize=8)
def lab_scene(seed: int, moment: Moment | None = None) -> Scene:
    """The laboratory, its entry and the corridor.

    Args:
        seed: varies textures and the details of the furniture; the same seed is the same building.
        moment: when; None is when the map was made, with the doors closed.
    """
    moment = moment or Moment()
    things = as_they_stand(furniture(generator(seed, Stream.FURNITURE)), moment, generator(seed, Stream.LATER))
    b = Builder(seed)
    _laboratory(b)
    doors: list[Opening] = [door_gap(x, DOOR_Y) for x in (ENTRY[2], ENTRY[0], CORRIDOR[2])]
    room(b, ENTRY, ("plaster",) * 4, doors)
    room(b, CORRIDOR, ("plaster", "brick", "plaster", "plaster"), doors)
    for number, x in enumerate(DOORS_X):
        door(b, (x, DOOR_Y, FACES_LEFT), moment.doors, number)
    for thing in [*off_the_path(things, _legs(), CHAIR_GAP_M), *beyond(generator(seed, Stream.FURNITURE, 0))]:
        b.thing(thing)
    return b.scene(light_at((_LAB_ROOM, _ENTRY_ROOM, _CORRIDOR_ROOM), moment, seed))


def _legs() -> np.ndarray:
    """Lines (L, 4) between the nodes of the laboratory, one after the other."""
    nodes = np.array([(place.x, place.y) for place in LAB_PLACES])
    return np.concatenate([nodes, np.roll(nodes, -1, axis=0)], axis=1)


class LabWorld(World):
    """The thesis's laboratory (5.2, Figure 5.22), simulated: eight nodes on a 1 m grid in a room of 6.6 m x 6.6 m."""

    title = "laboratory"

    @property
    def places(self) -> Sequence[Place]:
        """Nodes 1 to 8."""
        return LAB_PLACES

    @property
    def tour(self) -> Sequence[int]:
        """From 1 to 8 and back to 1."""
        return range(8)

    def scene(self, seed: int, moment: Moment) -> Scene:
        """The laboratory, its entry and the corridor."""
        return lab_scene(seed, moment)
