"""An office floor with more than 300 nodes, for scale: a corridor with rooms on both sides, many of them alike.

Map frame: the corridor runs along x, its middle is y = 0 and its left end x = 0, metres. A room's own frame has its
origin in the left corner of its corridor wall, as seen from the corridor, x along that wall and y into the room.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np

from benchmarks.worlds.builders import CEILING_M, Builder, Thing
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.drive import Route
from benchmarks.worlds.furniture import FACES_DOWN, FACES_LEFT, FACES_RIGHT, FACES_UP, workplace
from benchmarks.worlds.light import LitRoom, light_at
from benchmarks.worlds.moment import Moment, as_they_stand, off_the_path
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.rooms import WALL_M, door, door_gap, room, window_gap
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import Place, World
from topoloc.geometry import Floats, compose
from topoloc.types import Ints

MOST_ROOMS = 100
"""More would not fit into memory: nine panoramas of 3 MB a room."""
WIDTH_M, DEPTH_M = 4.8, 5.7
"""Of a room, along the corridor and away from it [m]."""
PITCH_M = WIDTH_M + WALL_M
HALF_CORRIDOR_M = 1.1
COLUMNS_X, ROWS_Y = (1.2, 2.4, 3.6), (1.6, 2.8, 4.0)
"""Nodes of a room, in its own frame [m]: the first row leaves room for the open door."""
DOOR_X = 2.4
WINDOWS_X = (1.25, 3.55)
BETWEEN_DOORS = 3
"""Corridor nodes from one door to the next."""
RING = (1, 2, 5, 8, 7, 6, 3, 0, 1)
"""Nodes of a room, row by row from 0 to 8, in the order of a round from the door."""
CHAIR_GAP_M = 1.05
"""Centre of a chair to the lines between the nodes [m]."""


@dataclass(frozen=True)
class BuildingSettings(WorldSettings):
    """As in every world, but at random for 120 frames, with the doors open.

    Attributes:
        rooms: number of rooms, even; nine nodes each and three in the corridor for every two.
        updates: number of frames; 0 takes ``laps``.
        doors: how far the doors stand open during the drive, 0 to 1; in the map they are open.
        route: how the robot drives around the nodes.
    """

    rooms: int = 30
    updates: int = 120
    doors: float = 1.0
    route: Route = field(default_factory=lambda: Route(random=True))

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rooms < 4 or self.rooms % 2 or self.rooms > MOST_ROOMS:
            raise ValueError(f"rooms is {self.rooms}; write an even number from 4 to {MOST_ROOMS}")


def _office(rng: np.random.Generator) -> Iterator[Thing]:
    """Two workplaces under the windows, shelves beside the door."""
    for number, x in enumerate((1.15, 3.65)):
        yield from workplace((x, DEPTH_M - 0.45, FACES_DOWN), number, rng)
    yield Thing("shelf", (0.7, 0.18, FACES_UP), 0.0, int(rng.integers(4)))
    yield Thing("cupboard", (4.1, 0.26, FACES_UP), 0.0, int(rng.integers(2)))
    yield Thing("poster", (0.0, float(rng.uniform(1.5, 4.5)), FACES_RIGHT), 1.1, int(rng.integers(6)))


def _meeting(rng: np.random.Generator) -> Iterator[Thing]:
    """A whiteboard, chairs along the walls, a low shelf."""
    yield Thing("whiteboard", (WIDTH_M, float(rng.uniform(2.0, 3.6)), FACES_LEFT), 1.0)
    yield Thing("low_shelf", (WIDTH_M / 2.0, DEPTH_M - 0.25, FACES_DOWN), 0.0, int(rng.integers(4)))
    for x in (0.7, 1.5, 3.3, 4.1):
        yield Thing("chair", (x, DEPTH_M - 0.45, FACES_UP + float(rng.normal(0.0, 0.4))), 0.0, 0, True)
    yield Thing("plant", (WIDTH_M / 2.0, DEPTH_M - 0.25, FACES_DOWN), 1.15, int(rng.integers(2)))
    yield Thing("poster", (0.0, float(rng.uniform(1.5, 4.5)), FACES_RIGHT), 1.1, int(rng.integers(6)))


def _store(rng: np.random.Generator) -> Iterator[Thing]:
    """Shelves along the walls, cartons on the floor."""
    for y in (1.0, 2.2, 3.4, 4.6):
        yield Thing("shelf", (0.19, y, FACES_RIGHT), 0.0, int(rng.integers(4)))
    for y in rng.uniform((0.6, 2.4, 4.2), (1.8, 3.6, 5.2)):
        yield Thing("carton", (WIDTH_M - 0.2, float(y), FACES_LEFT), 0.0, int(rng.integers(2)), True)
    yield Thing("supply", (4.1, 0.25, FACES_UP))


def _kitchen(rng: np.random.Generator) -> Iterator[Thing]:
    """Cupboards side by side, a machine on a low one."""
    yield Thing("cupboard", (0.7, 0.26, FACES_UP), 0.0, 0)
    yield Thing("cupboard", (4.1, 0.26, FACES_UP), 0.0, 1)
    yield Thing("supply", (WIDTH_M - 0.25, 3.0, FACES_LEFT))
    yield Thing("printer", (WIDTH_M - 0.25, 3.0, FACES_LEFT), 0.6, 0, True)
    yield Thing("plant", (WIDTH_M - 0.25, float(rng.uniform(4.0, 5.0)), FACES_LEFT), 0.0, int(rng.integers(2)))


def _bare(rng: np.random.Generator) -> Iterator[Thing]:
    """Blank walls, and at most a notice."""
    if rng.random() < 0.5:
        yield Thing("poster", (WIDTH_M, float(rng.uniform(1.5, 4.5)), FACES_LEFT), 1.1, int(rng.integers(6)))


KINDS: tuple[Callable[[np.random.Generator], Iterator[Thing]], ...] = (
    _office,
    _office,
    _office,
    _meeting,
    _store,
    _kitchen,
    _bare,
)
"""What rooms are drawn from: most are offices, so that many look alike."""


def _frame(number: int) -> Floats:
    """Pose (3,) of a room's own frame: even numbers lie above the corridor, odd ones below [m, m, rad]."""
    x, out = (number // 2) * PITCH_M, HALF_CORRIDOR_M + WALL_M
    return np.array([x, out, 0.0]) if number % 2 == 0 else np.array([x + WIDTH_M, -out, np.pi])


def _there(frame: Floats, x: float, y: float) -> tuple[float, float]:
    """A point of a room's own frame in the map frame [m]."""
    at = compose(frame, (x, y, 0.0))
    return float(at[0]), float(at[1])


def _things(number: int, seed: int, moment: Moment) -> Iterator[Thing]:
    """What stands in a room, in the map frame."""
    rng, frame = generator(seed, Stream.FURNITURE, number), _frame(number)
    things = [*KINDS[int(rng.integers(len(KINDS)))](rng)]
    things += [Thing("window", (x, DEPTH_M, FACES_DOWN), 0.0, int(rng.choice([0, 0, 25, 40]))) for x in WINDOWS_X]
    later = as_they_stand(things, moment, generator(seed, Stream.LATER, number))
    for thing in off_the_path(later, _legs(), CHAIR_GAP_M):
        x, y, yaw = compose(frame, np.array(thing.pose))
        yield replace(thing, pose=(float(x), float(y), float(yaw)))


def _legs() -> Floats:
    """Lines (L, 4) of a room's nodes, row by row and column by column, in its own frame."""
    rows = [(COLUMNS_X[0], y, COLUMNS_X[-1], y) for y in ROWS_Y]
    return np.array([*rows, *((x, ROWS_Y[0], x, ROWS_Y[-1]) for x in COLUMNS_X)])


def _bounds(number: int) -> tuple[float, float, float, float]:
    """x0, y0, x1, y1 of a room [m]."""
    corners = np.array([_there(_frame(number), 0.0, 0.0), _there(_frame(number), WIDTH_M, DEPTH_M)])
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _corridor(rooms: int) -> tuple[float, float, float, float]:
    return 0.0, -HALF_CORRIDOR_M, rooms // 2 * PITCH_M - WALL_M, HALF_CORRIDOR_M


def _lit(number: int) -> LitRoom:
    """The lamps and windows of a room."""
    frame = _frame(number)
    tubes = [(*_there(frame, WIDTH_M / 2.0, y), CEILING_M - 0.1) for y in (1.5, 4.2)]
    windows = [(*_there(frame, x, DEPTH_M - 0.2), 1.8, 0.45, 0.2) for x in WINDOWS_X]
    return LitRoom(_bounds(number), tubes, [_there(frame, 1.0, 3.0)], windows)


def _lit_corridor(rooms: int) -> LitRoom:
    spots = np.arange(PITCH_M / 2.0, _corridor(rooms)[2], PITCH_M / 2.0)
    tubes = [(float(x), 0.0, CEILING_M - 0.1) for x in spots]
    return LitRoom(_corridor(rooms), tubes, [(float(x) + 0.6, 0.5) for x in spots])


def _doorway(number: int) -> tuple[float, float]:
    """Middle of a room's doorway [m]."""
    return _there(_frame(number), DOOR_X, -WALL_M / 2.0)


@lru_cache(maxsize=4)
def building_scene(rooms: int, seed: int, moment: Moment) -> Scene:
    """The whole floor.

    Args:
        rooms: number of rooms.
        seed: draws what the rooms are for and what stands in them; the plan is the same.
        moment: when.
    """
    b = Builder(seed)
    gaps = []
    for number in range(rooms):
        frame = _frame(number)
        inner = [door_gap(*_there(frame, DOOR_X, 0.0))]
        gaps.append(door_gap(*_there(frame, DOOR_X, -WALL_M)))
        room(b, _bounds(number), openings=[*inner, *(window_gap(*_there(frame, x, DEPTH_M)) for x in WINDOWS_X)])
        x, y = _doorway(number)
        door(b, (x, y, float(frame[2]) + np.pi), moment.doors, number)
        for thing in _things(number, seed, moment):
            b.thing(thing)
    bounds = _corridor(rooms)
    room(b, bounds, ("brick", "plaster", "brick", "plaster"), gaps)
    for thing in _in_the_corridor(rooms, generator(seed, Stream.FURNITURE)):
        b.thing(thing)
    _outside(b, bounds[2])
    lamps = [*(_lit(number) for number in range(rooms)), _lit_corridor(rooms)]
    return b.scene(light_at(lamps, moment, seed))


def _in_the_corridor(rooms: int, rng: np.random.Generator) -> Iterator[Thing]:
    """Notices between the doors, a shelf or a plant here and there, a door at either end."""
    length = _corridor(rooms)[2]
    for x in np.arange(PITCH_M - WALL_M / 2.0, length - 1.0, PITCH_M):
        for y, facing in ((HALF_CORRIDOR_M, FACES_DOWN), (-HALF_CORRIDOR_M, FACES_UP)):
            if rng.random() < 0.6:
                yield Thing("poster", (float(x + rng.uniform(-0.7, 0.7)), y, facing), 1.1, int(rng.integers(6)))
        if rng.random() < 0.3:
            yield Thing("supply", (float(x), HALF_CORRIDOR_M - 0.21, FACES_DOWN))
            yield Thing("plant", (float(x), HALF_CORRIDOR_M - 0.21, FACES_DOWN), 0.6, int(rng.integers(2)))
    yield Thing("door", (0.0, 0.0, FACES_RIGHT))
    yield Thing("door", (length, 0.0, FACES_LEFT))


def _outside(b: Builder, length: float) -> None:
    """What the windows on both sides look at."""
    away = HALF_CORRIDOR_M + WALL_M + DEPTH_M + 9.0
    edges = np.arange(-44.0, length + 66.0, 22.0)
    for number, (start, end) in enumerate(pairwise(edges)):
        b.glowing(np.array([start, away]), np.array([end, away]), -9.0, 9.0, "outside", number)
        b.glowing(np.array([end, -away]), np.array([start, -away]), -9.0, 9.0, "outside", number + 1)


class BuildingWorld(World):
    """An office floor of our own: 30 rooms along a corridor of 73 m, 313 nodes, many rooms alike."""

    Config = BuildingSettings
    title = "office floor"

    @cached_property
    def places(self) -> Sequence[Place]:
        """The corridor's nodes from left to right, then nine of each room."""
        corridor = [
            Place(f"C{n + 1}", f"CORRIDOR_{n + 1}", DOOR_X + n * PITCH_M / BETWEEN_DOORS, 0.0)
            for n in range(self._in_corridor)
        ]
        rooms = [
            Place(f"{number + 1}.{n + 1}", f"ROOM_{number + 1}", *_there(_frame(number), x, y))
            for number in range(self.config.rooms)
            for n, (y, x) in enumerate((y, x) for y in ROWS_Y for x in COLUMNS_X)
        ]
        return (*corridor, *rooms)

    @property
    def _in_corridor(self) -> int:
        """Number of nodes in the corridor."""
        return int((self.config.rooms // 2 - 1) * BETWEEN_DOORS + 1)

    def _node(self, number: int, n: int) -> int:
        """Index of node ``n`` of a room."""
        return self._in_corridor + 9 * number + n

    @cached_property
    def tour(self) -> Sequence[int]:
        """Along the corridor, round every room on the way, and straight back."""
        order: list[int] = []
        for node in range(self._in_corridor):
            order.append(node)
            if node % BETWEEN_DOORS == 0:
                for number in (2 * node // BETWEEN_DOORS, 2 * node // BETWEEN_DOORS + 1):
                    order += [*(self._node(number, n) for n in RING), node]
        return (*order, *range(self._in_corridor - 2, 0, -1))

    def edges(self) -> Ints:
        """Neighbours in the corridor and in the rooms, and through the doors."""
        grid = np.arange(9).reshape(3, 3)
        inside = np.concatenate(
            [
                np.column_stack([grid[:, :-1].ravel(), grid[:, 1:].ravel()]),
                np.column_stack([grid[:-1].ravel(), grid[1:].ravel()]),
            ]
        )
        rooms = range(self.config.rooms)
        doors = [(number // 2 * BETWEEN_DOORS, self._node(number, 1)) for number in rooms]
        pairs = [inside + self._node(number, 0) for number in rooms]
        return np.concatenate([np.array([*pairwise(range(self._in_corridor)), *doors]), *pairs])

    def gates(self) -> Floats:
        """The doorways of all rooms."""
        return np.array([_doorway(number) for number in range(self.config.rooms)])

    def mapped_at(self, place: int) -> Moment:
        """All doors open."""
        return Moment(doors=1.0)

    def scene(self, seed: int, moment: Moment) -> Scene:
        """The whole floor."""
        return building_scene(self.config.rooms, seed, moment)
