"""Two mapped offices of Porta & Kroese (appearance-based localization with an active head, section 6), simulated.

Published: areas of 8 m x 2.5 m and 9 m x 5 m; images every 75 cm and 15 degrees, about 400, and every 50 cm and 10
degrees, about 4000; 22 orientations of the camera; tube lights, bulbs, and daylight through windows along one wall.
Rebuilt: all rooms and furniture, the field of view, and how these numbers go together. A full grid of positions with
full circles would give 1056 and 7524 images, so furniture stands on some positions and the head's turn ends 157.5
degrees to either side: 22 headings of 15 degrees, 32 of 10.

Map frame: the corner of the area is the origin, windows along the far wall, metres.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import ClassVar

import numpy as np

from benchmarks.worlds.builders import CEILING_M, Builder, Thing
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.drive import Route
from benchmarks.worlds.furniture import FACES_DOWN, FACES_LEFT, FACES_RIGHT, FACES_UP, Pose, workplace
from benchmarks.worlds.light import LitRoom, light_at
from benchmarks.worlds.moment import Moment, as_they_stand, off_the_path
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.rooms import door_gap, hall, hall_room, outside, room, window_gap
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.snapshots import Scan
from benchmarks.worlds.world import Place, Shot, World
from topoloc.geometry import Floats, between, compose
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Ints

MAP_VIEWS = 1_000_000
"""Number of the map's first view: none of a drive's frames shares its chances."""
CLEAR_M = 0.35
"""A position, or a way between two, is free at this distance from all furniture and walls [m]."""
PAN_REACH_DEG = 157.5
"""How far the head turns to either side, so that 22 headings are 15 degrees apart [degrees]; rebuilt."""
MAPPED_HEADING = np.pi / 2.0
"""The robot looked to the windows wherever its head turned for the map [rad]; rebuilt."""
PAN_FRAMES = 8
"""Frames of one sweep of the head, there and back."""
CHAIR_GAP_M = CLEAR_M + 0.45
"""Middle of a chair, however it is turned, to the ways between positions [m]."""
MOST_DRAWN, LEAST_DRAWN = 0.95, 0.65
"""Share of a window behind the curtains while the lamps are on."""
WINDOW_POWER, WINDOW_POWER_AGED = 0.12, 0.3
"""Light through drawn curtains, and when the sun has come round."""

FOOTPRINTS: dict[str, tuple[float, float, float]] = {
    "desk": (1.7, 1.18, -0.19),
    "cupboard": (1.2, 0.5, 0.0),
    "shelf": (1.1, 0.35, 0.0),
    "low_shelf": (0.8, 0.35, 0.0),
    "supply": (0.4, 0.4, 0.0),
}
"""Width and depth of what stands on the floor, and how far its middle lies behind its pose [m]; desks with chairs."""


@dataclass(frozen=True)
class Plan:
    """A mapped area and the room around it.

    Attributes:
        area: its sides [m].
        spacing_m: between two positions.
        step_deg: between two headings.
        room: x0, y0, x1, y1 of the walls [m].
        windows: x of their middles, in the top wall [m].
        door_y: middle of the door in the left wall [m].
        desks: middles of the desks, turned to who sits there.
        things: what else stands about, none of it moved by people.
        round: columns and rows of the positions at which the usual round turns; it closes with the first.
    """

    area: tuple[float, float]
    spacing_m: float
    step_deg: float
    room: tuple[float, float, float, float]
    windows: tuple[float, ...]
    door_y: float
    desks: tuple[Pose, ...]
    things: tuple[Thing, ...]
    round: tuple[tuple[int, int], ...]


SMALL = Plan(
    area=(8.0, 2.5),
    spacing_m=0.75,
    step_deg=15.0,
    room=(-0.5, -0.5, 8.5, 3.35),
    windows=(0.66, 2.9, 5.14, 7.38),
    door_y=0.875,
    desks=((1.8, 2.5, FACES_LEFT), (2.6, 2.5, FACES_RIGHT), (6.0, 2.5, FACES_RIGHT)),
    things=(
        Thing("shelf", (5.42, 2.6, FACES_LEFT), 0.0, 1),
        Thing("cupboard", (0.3, -0.24, FACES_UP)),
        Thing("shelf", (1.55, -0.31, FACES_UP), 0.0, 0),
        Thing("shelf", (2.7, -0.31, FACES_UP), 0.0, 2),
        Thing("supply", (3.6, -0.25, FACES_UP)),
        Thing("cupboard", (4.5, -0.24, FACES_UP), 0.0, 1),
        Thing("low_shelf", (5.6, -0.31, FACES_UP), 0.0, 3),
        Thing("shelf", (6.65, -0.31, FACES_UP), 0.0, 1),
        Thing("cupboard", (7.85, -0.24, FACES_UP)),
        Thing("supply", (7.95, 2.6, FACES_DOWN)),
        Thing("printer", (3.6, -0.25, FACES_UP), 0.6),
        Thing("plant", (5.6, -0.31, FACES_UP), 1.15, 0),
        Thing("plant", (7.95, 2.6, FACES_DOWN), 0.6, 1),
        Thing("carton", (4.5, -0.24, FACES_UP), 2.0, 1),
    ),
    round=((0, 1), (5, 1), (5, 3), (6, 3), (6, 1), (10, 1)),
)
"""About 400 images: an aisle along cupboards, and bays between the desks."""

LARGE = Plan(
    area=(9.0, 5.0),
    spacing_m=0.5,
    step_deg=10.0,
    room=(-0.6, -0.55, 9.8, 5.7),
    windows=(0.9, 3.3, 5.7, 8.1),
    door_y=1.0,
    desks=(
        (1.5, 4.8, FACES_LEFT),
        (2.3, 4.8, FACES_RIGHT),
        (1.5, 3.15, FACES_LEFT),
        (2.3, 3.15, FACES_RIGHT),
        (5.9, 3.25, FACES_LEFT),
        (6.7, 3.25, FACES_RIGHT),
    ),
    things=(
        Thing("cupboard", (1.2, -0.29, FACES_UP)),
        Thing("cupboard", (2.45, -0.29, FACES_UP), 0.0, 1),
        Thing("shelf", (3.75, -0.37, FACES_UP), 0.0, 0),
        Thing("shelf", (4.9, -0.37, FACES_UP), 0.0, 2),
        Thing("cupboard", (7.6, -0.29, FACES_UP), 0.0, 1),
        Thing("low_shelf", (8.7, -0.37, FACES_UP), 0.0, 3),
        Thing("shelf", (9.62, 2.0, FACES_LEFT), 0.0, 1),
        Thing("shelf", (9.62, 3.2, FACES_LEFT), 0.0, 3),
        Thing("low_shelf", (9.1, 5.5, FACES_DOWN), 0.0, 0),
        Thing("supply", (4.1, 5.2, FACES_DOWN)),
        Thing("supply", (-0.3, 5.3, FACES_DOWN)),
        Thing("printer", (4.1, 5.2, FACES_DOWN), 0.6),
        Thing("plant", (8.7, -0.37, FACES_UP), 1.15, 1),
        Thing("plant", (9.1, 5.5, FACES_DOWN), 1.15, 0),
        Thing("plant", (-0.3, 5.3, FACES_DOWN), 0.6, 1),
        Thing("carton", (1.2, -0.29, FACES_UP), 2.0, 1),
    ),
    round=((0, 1), (9, 1), (9, 3), (17, 3), (17, 9), (8, 9), (8, 2), (0, 2)),
)
"""About 4000 images: two groups of desks, and a way round one of them."""


def clearance(plan: Plan, points: Floats) -> Floats:
    """Distance (N,) from points (N, 2) to the nearest furniture or wall [m]; chairs count where they usually stand."""
    x0, y0, x1, y1 = plan.room
    nearest = np.concatenate([points - (x0, y0), (x1, y1) - points], axis=1).min(axis=1)
    standing = [("desk", desk) for desk in plan.desks]
    standing += [(thing.kind, thing.pose) for thing in plan.things if thing.base == 0.0]
    poses = np.column_stack([points, np.zeros(len(points))])
    for kind, pose in standing:
        width, depth, behind = FOOTPRINTS[kind]
        local = between(np.array(pose), poses)[:, :2] - (0.0, behind)
        beyond = np.maximum(np.abs(local) - (width / 2.0, depth / 2.0), 0.0)
        nearest = np.minimum(nearest, np.hypot(*beyond.T))
    return np.asarray(nearest)


@lru_cache(maxsize=2)
def free_positions(plan: Plan) -> dict[tuple[int, int], Place]:
    """The positions that no furniture stands on, by column and row of the grid."""
    counts = [int(side / plan.spacing_m + 1e-9) + 1 for side in plan.area]
    margin = [(side - (count - 1) * plan.spacing_m) / 2.0 for side, count in zip(plan.area, counts, strict=True)]
    grid = [(column, row) for row in range(counts[1]) for column in range(counts[0])]
    points = np.array(margin) + plan.spacing_m * np.array(grid)
    free = np.flatnonzero(clearance(plan, points) >= CLEAR_M)
    return {
        grid[index]: Place(str(number), "POSITION_{}_{}".format(*grid[index]), *map(float, points[index]))
        for number, index in enumerate(free, start=1)
    }


@lru_cache(maxsize=2)
def free_ways(plan: Plan) -> Ints:
    """Pairs (E, 2) of neighbouring free positions between which nothing stands."""
    free = free_positions(plan)
    number = {cell: index for index, cell in enumerate(free)}
    pairs = []
    for (column, row), place in free.items():
        for other in ((column + 1, row), (column, row + 1)):
            if other in free:
                way = np.linspace((place.x, place.y), (free[other].x, free[other].y), 9)
                if clearance(plan, way).min() >= CLEAR_M:
                    pairs.append((number[column, row], number[other]))
    return np.array(pairs)


def headings(plan: Plan) -> Floats:
    """How far the head is turned for the images of one position (H,) [rad]."""
    count = int(2.0 * PAN_REACH_DEG / plan.step_deg + 1e-9) + 1
    return np.asarray(np.deg2rad((np.arange(count) - (count - 1) / 2.0) * plan.step_deg))


def furniture(plan: Plan, rng: np.random.Generator) -> list[Thing]:
    """All that stands and hangs in an office; the generator varies details, not the plan."""
    x0, y0, x1, y1 = plan.room
    things = [thing for number, desk in enumerate(plan.desks) for thing in workplace(desk, number, rng)]
    things += plan.things
    things += [Thing("window", (x, y1, FACES_DOWN)) for x in plan.windows]
    near, far = y0 + 0.22 * (y1 - y0), y0 + 0.8 * (y1 - y0)
    things += [
        Thing("whiteboard", (x0, plan.door_y + 1.5, FACES_RIGHT), 0.95),
        Thing("poster", (x1, far, FACES_LEFT), 1.1, 0),
        Thing("poster", (x1, near + rng.uniform(-0.1, 0.1), FACES_LEFT), 1.1, int(rng.integers(1, 6))),
    ]
    return things


def _curtains(b: Builder, x: float, wall_y: float, drawn: float) -> None:
    """Two curtains before a window, each drawn over a share of its half."""
    for side, start in enumerate((-1.1, 1.1 - 1.1 * drawn)):
        left, right = np.array([x + start, wall_y - 0.2]), np.array([x + start + 1.1 * drawn, wall_y - 0.2])
        b.face(left, right, 0.6, 2.5, "curtain", side)


def _rooms(plan: Plan) -> tuple[LitRoom, LitRoom]:
    """The lamps of the office and of the hall."""
    x0, y0, x1, y1 = plan.room
    rows = (0.3, 0.75) if y1 - y0 > 5.0 else (0.5,)
    tubes = [
        (x0 + across * (x1 - x0), y0 + along * (y1 - y0), CEILING_M - 0.1)
        for across in (1 / 6, 1 / 2, 5 / 6)
        for along in rows
    ]
    windows = [(x, y1 - 0.2, 1.8, WINDOW_POWER, WINDOW_POWER_AGED) for x in plan.windows]
    return LitRoom(plan.room, tubes, _bulbs(plan), windows), hall_room(x0, plan.door_y)


def _bulbs(plan: Plan) -> list[tuple[float, float]]:
    """One at every second desk, and one at the door."""
    return [(x, y) for x, y, _ in plan.desks[::2]] + [(plan.room[0] + 0.5, plan.door_y)]


@lru_cache(maxsize=4)
def office_scene(plan: Plan, seed: int, moment: Moment | None = None) -> Scene:
    """An office and the hall behind its door.

    Args:
        plan: which.
        seed: varies textures and the details of the furniture; the same seed is the same building.
        moment: when; None is when the map was made, the door closed and the curtains drawn.
    """
    moment, rng = moment or Moment(), generator(seed, Stream.FURNITURE)
    things = as_they_stand(furniture(plan, rng), moment, generator(seed, Stream.LATER))
    drawn = rng.uniform(LEAST_DRAWN, MOST_DRAWN, len(plan.windows)) * (1.0 - moment.daylight)
    b, left, top = Builder(seed), plan.room[0], plan.room[3]
    room(b, plan.room, openings=[door_gap(left, plan.door_y), *(window_gap(x, top) for x in plan.windows)])
    outside(b, plan.windows, top)
    hall(b, left, plan.door_y, moment.doors)
    for thing in off_the_path(things, _ways(plan), CHAIR_GAP_M):
        b.thing(thing)
    for x, share in zip(plan.windows, drawn, strict=True):
        if share > 0.0:
            _curtains(b, x, top, share)
    return b.scene(light_at(_rooms(plan), moment, seed))


def _ways(plan: Plan) -> Floats:
    """Lines (L, 4) between neighbouring free positions."""
    points = np.array([(place.x, place.y) for place in free_positions(plan).values()])
    return points[free_ways(plan)].reshape(-1, 4)


@dataclass(frozen=True)
class OfficeRoute(Route):
    """As in every world, but at random, and nearer to the positions of the map: furniture stands close to them."""

    nearest_m: float = 0.05
    farthest_m: float = 0.15
    random: bool = True


@dataclass(frozen=True)
class OfficeSettings(WorldSettings):
    """As in every world; the camera stands on the robot's axis, on a head that turns.

    Attributes:
        daylight: share of the light that comes through the windows, lamps off and curtains open, 0 to 1.
        camera_ahead_m: camera ahead of the axis of rotation, metres, in the map's images too.
        stereo_baseline_m: distance of a second camera to the right of the first, metres, in the map's images too; 0:
            none.
        scan: not for offices, whose maps have no panoramas.
        route: how the robot drives around the positions.
        pan_deg: how far the head turns to either side while the robot drives, degrees; 0: it looks ahead.
    """

    camera_ahead_m: float = 0.0
    route: OfficeRoute = field(default_factory=OfficeRoute)
    pan_deg: float = 60.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0.0 <= self.pan_deg <= PAN_REACH_DEG:
            raise ValueError(f"pan_deg is {self.pan_deg}; the head turns 0 to {PAN_REACH_DEG} degrees to either side")
        if self.scan != Scan():
            raise ValueError("scan is set; an office's map has no panoramas to turn for: leave all of scan out")


class OfficeWorld(World):
    """Porta & Kroese's office of 8 m x 2.5 m, simulated: 396 training images, every 75 cm and 15 degrees."""

    Config = OfficeSettings
    title = "office"
    camera = Camera(60.0, 160, 120)
    """The field of view is not published; small, so that 4000 images fit into memory."""
    plan: ClassVar[Plan] = SMALL

    @property
    def places(self) -> Sequence[Place]:
        """The positions that the images were taken at."""
        return tuple(free_positions(self.plan).values())

    @property
    def tour(self) -> Sequence[int]:
        """Along the aisle and through the bays, in steps of one position."""
        number = {cell: index for index, cell in enumerate(free_positions(self.plan))}
        corners = (*self.plan.round, self.plan.round[0])
        return [number[cell] for start, end in pairwise(corners) for cell in _cells_before(start, end)]

    def edges(self) -> Ints:
        """Neighbouring positions with nothing between them."""
        return free_ways(self.plan)

    def scene(self, seed: int, moment: Moment) -> Scene:
        """The office and the hall behind its door."""
        return office_scene(self.plan, seed, moment)

    def pans(self, frames: int) -> Floats:
        """Angle (N,) of the head, which sweeps from side to side [rad, ccw]."""
        sweep = np.sin(2.0 * np.pi * np.arange(frames) / PAN_FRAMES)
        return np.asarray(np.deg2rad(self.config.pan_deg) * sweep)

    @cached_property
    def view_poses(self) -> Floats:
        """(V, 3) of the camera for the map's images, position by position [m, m, rad]."""
        turns = headings(self.plan)
        robots = np.column_stack([self.positions, np.full(len(self.positions), MAPPED_HEADING)])
        mounts = np.column_stack([np.tile(self.mount[:2], (len(turns), 1)), turns])
        return np.asarray(compose(np.repeat(robots, len(turns), axis=0), np.tile(mounts, (len(robots), 1))))

    @property
    def image_count(self) -> int:
        """How many images the map has, whatever the seed."""
        return len(self.places) * len(headings(self.plan))

    def topo_map(self, seed: int) -> TopoMap:
        """The map that was made before the drive: images at every position and heading, and no panoramas."""
        nodes = tuple(Node(*place) for place in self.places)
        views = tuple(self._views(seed))
        name = f"{self.title}, {len(views)} images (simulated)"
        baseline = self.config.stereo_baseline_m or None
        return TopoMap(name, self.camera, nodes, self.edges(), views=views, baseline_m=baseline)

    def _views(self, seed: int) -> Iterator[View]:
        """The map's images: taken as those of the drive are, but earlier and by a robot that stands."""
        earlier = type(self)(replace(self.config, age=0.0, bulbs=0.0, daylight=0.0))  # what pictures take from config
        scene = self.scene(seed, Moment())
        for number, pose in enumerate(self.view_poses):
            shot = Shot(scene, (), pose, self.config.turning_shake_px, False, True, seed, MAP_VIEWS + number)
            readers = earlier.readers(shot)
            yield View(pose, readers["rgb"](), readers["right"]() if "right" in readers else None)


class LargeOfficeWorld(OfficeWorld):
    """Porta & Kroese's office of 9 m x 5 m, simulated: 3968 training images, every 50 cm and 10 degrees."""

    title = "large office"
    plan = LARGE


def _cells_before(start: tuple[int, int], end: tuple[int, int]) -> list[tuple[int, int]]:
    """Columns and rows from ``start`` until before ``end``, which lies in the same column or row."""
    steps = max(abs(end[0] - start[0]), abs(end[1] - start[1]))
    return [
        (start[0] + (end[0] - start[0]) * step // steps, start[1] + (end[1] - start[1]) * step // steps)
        for step in range(steps)
    ]
