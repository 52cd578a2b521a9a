"""Two rooms that look the same at the ends of a corridor: only the way that led there tells which is which.

Map frame: x along the corridor, y from its doors into the rooms, metres; the origin is the first room's corner beside
its door.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise

import numpy as np

from benchmarks.worlds.builders import CEILING_M, Builder, Thing
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.furniture import FACES_DOWN, FACES_LEFT, FACES_RIGHT, FACES_UP, workplace
from benchmarks.worlds.light import LitRoom, light_at
from benchmarks.worlds.moment import Moment, as_they_stand, off_the_path
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.rooms import WALL_M, door, door_gap, room, window_gap
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import Place, World
from topoloc.geometry import Floats
from topoloc.types import Ints

APART_M = 12.0
"""From one room to its twin [m]: floors repeat every 2.0 m and ceilings every 2.4 m, so they lie alike in both."""
SIDE_M = 4.9
"""Of the square rooms [m]."""
ROOM_NODES = ((0.85, 1.1), (1.95, 1.1), (3.05, 1.1), (3.05, 2.2), (1.95, 2.2), (0.85, 2.2))
"""Nodes of a room in the order of its round, from its corner [m]; the first is behind the door."""
DOOR_X, DOOR_Y = 0.85, -WALL_M / 2.0
"""Middle of a room's doorway, from its corner [m]."""
CORRIDOR = (-1.1, -2.1, 14.9, -WALL_M)
"""x0, y0, x1, y1 [m]."""
CORRIDOR_Y = -1.1
CORRIDOR_NODES = 8
"""From door to door, 1.71 m apart."""
START = 3
"""Index of the node that the drive starts on: in the corridor, which the robot knows again."""
CHAIR_GAP_M = 0.95
"""Centre of a chair to the lines between the nodes [m]."""
WINDOWS = (1.25, 3.35)
"""Middles of a room's windows, in the wall opposite to the door [m from its corner]."""


@dataclass(frozen=True)
class TwinsSettings(WorldSettings):
    """As in every world, but one lap with the doors open.

    Attributes:
        laps: rounds driven; ``updates`` overrules it.
        doors: how far the doors stand open during the drive, 0 to 1; in the panoramas of the rooms they are closed.
    """

    laps: float = 1.0
    doors: float = 1.0


def _furniture(rng: np.random.Generator) -> list[Thing]:
    """All that stands in a room, from its corner [m]; the generator varies details, not the plan."""
    desks = ((1.2, SIDE_M - 0.45, FACES_DOWN), (3.1, SIDE_M - 0.45, FACES_DOWN), (SIDE_M - 0.45, 2.6, FACES_LEFT))
    things = [thing for number, desk in enumerate(desks) for thing in workplace(desk, number, rng)]
    blinds = rng.choice([0, 0, 25, 40], 2)
    things += [
        Thing("window", (x, SIDE_M, FACES_DOWN), 0.0, int(down)) for x, down in zip(WINDOWS, blinds, strict=True)
    ]
    return [
        *things,
        Thing("shelf", (2.1, 0.18, FACES_UP), 0.0, 0),
        Thing("cupboard", (4.2, 0.26, FACES_UP)),
        Thing("poster", (SIDE_M, 1.0, FACES_LEFT), 1.1, 3),
        Thing("whiteboard", (0.0, 1.75, FACES_RIGHT), 1.0),
        Thing("poster", (0.0, 3.0, FACES_RIGHT), 1.1, int(rng.integers(6))),
        Thing("low_shelf", (0.19, 3.7, FACES_RIGHT), 0.0, 2),
        Thing("plant", (0.22, 3.7, FACES_RIGHT), 1.15, 0),
    ]


def _in_the_corridor(rng: np.random.Generator) -> list[Thing]:
    """Papers and shelves towards the first room, closed doors and a plant towards the second."""
    left, low, right, high = CORRIDOR
    things = [Thing("poster", (x, high, FACES_DOWN), 1.1, n) for n, x in enumerate((2.4, 3.4, 5.6))]
    things += [Thing("poster", (x, low, FACES_UP), 1.1, n + 3) for n, x in enumerate((-0.2, 1.1, 4.7))]
    things += [Thing("door", (x, low, FACES_UP)) for x in (8.3, 11.6)]
    plant = (11.2 + float(rng.uniform(-0.2, 0.2)), high - 0.2, FACES_DOWN)
    return [
        *things,
        Thing("shelf", (2.6, low + 0.18, FACES_UP), 0.0, 1),
        Thing("low_shelf", (6.4, low + 0.18, FACES_UP), 0.0, 3),
        Thing("carton", (4.3, high - 0.2, FACES_DOWN), 0.0, 1),
        Thing("door", (left, CORRIDOR_Y, FACES_RIGHT)),
        Thing("whiteboard", (9.4, high, FACES_DOWN), 1.0),
        Thing("supply", plant),
        Thing("plant", plant, 0.6, 1),
        Thing("poster", (right, CORRIDOR_Y, FACES_LEFT), 1.1, 2),
    ]


def _lights() -> list[LitRoom]:
    """The lamps of both rooms, alike, and of the corridor."""
    spots = (1.3, SIDE_M - 1.3)
    rooms = [
        LitRoom(
            (x, 0.0, x + SIDE_M, SIDE_M),
            tubes=[(x + across, y, CEILING_M - 0.1) for across in spots for y in spots],
            bulbs=[(x + 0.6, SIDE_M - 0.8), (x + SIDE_M - 0.6, 1.6)],
            windows=[(x + WINDOWS[0], SIDE_M - 0.2, 1.8, 0.55, 0.15), (x + WINDOWS[1], SIDE_M - 0.2, 1.8, 0.35, 0.25)],
        )
        for x in (0.0, APART_M)
    ]
    lamps = np.linspace(CORRIDOR[0] + 1.2, CORRIDOR[2] - 1.2, 6)
    tubes = [(float(x), CORRIDOR_Y, CEILING_M - 0.1) for x in lamps]
    return [*rooms, LitRoom(CORRIDOR, tubes, [(float(x) + 0.8, CORRIDOR_Y + 0.6) for x in lamps])]


@lru_cache(maxsize=8)
def twins_scene(seed: int, moment: Moment) -> Scene:
    """Both rooms and the corridor.

    Args:
        seed: varies textures and the details of the furniture; the same seed is the same building.
        moment: when. Time changes each room in its own way.
    """
    b = Builder(seed)
    gaps = [door_gap(x + DOOR_X, y) for x in (0.0, APART_M) for y in (0.0, -WALL_M)]
    room(b, CORRIDOR, ("brick", "plaster", "plaster", "plaster"), gaps)
    for number, x in enumerate((0.0, APART_M)):
        b.repeat_walls()
        windows = [window_gap(x + across, SIDE_M) for across in WINDOWS]
        room(b, (x, 0.0, x + SIDE_M, SIDE_M), ("plaster", "plaster", "brick", "plaster"), [*gaps, *windows])
        door(b, (x + DOOR_X, DOOR_Y, FACES_UP), moment.doors)
        later = generator(seed, Stream.LATER, number)
        things = as_they_stand(_furniture(generator(seed, Stream.FURNITURE)), moment, later)
        for thing in off_the_path(things, _legs(), CHAIR_GAP_M):
            at = thing.pose
            b.thing(replace(thing, pose=(at[0] + x, *at[1:])))
    for thing in _in_the_corridor(generator(seed, Stream.FURNITURE, 0)):
        b.thing(thing)
    for x in np.arange(-3.0, 5.0) * APART_M:  # boards repeat as the rooms do: both look at the same
        y = SIDE_M + 9.0
        b.glowing(np.array([x, y]), np.array([x + APART_M, y]), -9.0, 9.0, "outside")
    return b.scene(light_at(_lights(), moment, seed))


def _legs() -> Floats:
    """Lines (L, 4) between the nodes of a room, one after the other, from its corner [m]."""
    nodes = np.array(ROOM_NODES)
    return np.concatenate([nodes, np.roll(nodes, -1, axis=0)], axis=1)


def _places() -> tuple[Place, ...]:
    """The corridor's nodes, then those of each room."""
    step = APART_M / (CORRIDOR_NODES - 1)
    corridor = [Place(f"C{n + 1}", f"CORRIDOR_{n + 1}", DOOR_X + n * step, CORRIDOR_Y) for n in range(CORRIDOR_NODES)]
    rooms = [
        Place(f"{letter}{n}", f"ROOM_{letter}{n}", x + at[0], at[1])
        for letter, x in (("A", 0.0), ("B", APART_M))
        for n, at in enumerate(ROOM_NODES, 1)
    ]
    return (*corridor, *rooms)


TWINS_PLACES = _places()
FIRST_ROOM = range(CORRIDOR_NODES, CORRIDOR_NODES + len(ROOM_NODES))
SECOND_ROOM = range(FIRST_ROOM.stop, FIRST_ROOM.stop + len(ROOM_NODES))
"""Indices of the places in the rooms."""
TWINS_TOUR = (
    *range(START, -1, -1),
    *FIRST_ROOM,
    FIRST_ROOM[0],
    *range(CORRIDOR_NODES),
    *SECOND_ROOM,
    SECOND_ROOM[0],
    *range(CORRIDOR_NODES - 1, START, -1),
)


class TwinsWorld(World):
    """Two identical rooms at the ends of a corridor: 20 nodes, of which six are like six others; only history helps."""

    Config = TwinsSettings
    title = "twin rooms"

    @property
    def places(self) -> Sequence[Place]:
        """C1 to C8 in the corridor, A1 to A6 and B1 to B6 in the rooms."""
        return TWINS_PLACES

    @property
    def tour(self) -> Sequence[int]:
        """From the corridor round the first room, round the second, and back."""
        return TWINS_TOUR

    def edges(self) -> Ints:
        """The legs of the tour, and what is side by side in the rooms."""
        legs = [sorted(pair) for pair in pairwise((*TWINS_TOUR, TWINS_TOUR[0]))]
        across = [(nodes[1], nodes[4]) for nodes in (FIRST_ROOM, SECOND_ROOM)]
        return np.unique(np.array([*legs, *across]), axis=0)

    def gates(self) -> Floats:
        """The doorways of both rooms."""
        return np.array([(x + DOOR_X, DOOR_Y) for x in (0.0, APART_M)])

    def mapped_at(self, place: int) -> Moment:
        """Doors closed for the panoramas of the rooms: what the corridor looks like would tell them apart."""
        return Moment(doors=0.0 if place >= FIRST_ROOM.start else 1.0)

    def scene(self, seed: int, moment: Moment) -> Scene:
        """Both rooms and the corridor."""
        return twins_scene(seed, moment)
