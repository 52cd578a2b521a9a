"""The six grids of omnidirectional images that the third seed maps (omnidirectional mapping and MCL), simulated.

Published: the numbers of points, their spacing, panoramas of 56 x 256 pixels, and the size of the captured area; some
were taken in a structured corridor that repeats itself, some in an unstructured laboratory. Rebuilt: which were taken
where (the largest one here in a hall, the others in a laboratory), all that stands there, and how a grid lies in its
area: "5 x 10" is five rows along y and ten columns along x, in the middle of the area, whose first side is along y.

Pictures are unwrapped omnidirectional ones: full circles, linear in angle, columns clockwise. Map frame: the origin is
the middle of the room, metres.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache, partial
from typing import Any, Literal

import numpy as np

from benchmarks.worlds.builders import CEILING_M, Builder, Thing
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.drive import Route
from benchmarks.worlds.effects import sense
from benchmarks.worlds.furniture import FACES_DOWN, FACES_LEFT, FACES_RIGHT, FACES_UP, Pose, workplace
from benchmarks.worlds.light import LitRoom, light_at, tint_at
from benchmarks.worlds.moment import Moment, as_they_stand, off_the_path
from benchmarks.worlds.renderer import Scene, render_cylinder
from benchmarks.worlds.rooms import door_gap, hall, hall_room, outside, room, window_gap
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.snapshots import Scan
from benchmarks.worlds.world import Place, Shot, World, covered_picture, effects_at
from topoloc.geometry import Floats, compose
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Image, Ints, Pixels

HEADING = 0.0
"""Of the robot, and so of the left edge of every panorama's first column, while the map was made [rad]."""
SEAM = 32
"""Columns of a circle that are repeated on either side while the sensor's errors are added, so that no seam is seen."""
CHAIR_GAP_M = 0.75
"""Middle of a chair to the lines of the grid [m]."""
WINDOW_POWER, WINDOW_POWER_AGED = 0.25, 0.4
"""Light through a window, and when the sun has come round."""


@dataclass(frozen=True)
class Grid:
    """One image set.

    Attributes:
        rows, columns: points along y and along x.
        spacing_m: between neighbours.
        area: captured, along y and along x [m].
        in_hall: it lies in the hall, not in the laboratory.
        middle: of the area [m].
    """

    rows: int
    columns: int
    spacing_m: float
    area: tuple[float, float]
    in_hall: bool = False
    middle: tuple[float, float] = (0.0, 0.0)


GRIDS: dict[str, Grid] = {
    "5x10": Grid(5, 10, 1.0, (6.0, 11.0), in_hall=True),
    "10x15": Grid(10, 15, 0.3, (3.5, 4.5)),
    "6x8": Grid(6, 8, 0.5, (3.5, 4.5)),
    "12x9": Grid(12, 9, 0.1, (1.3, 1.0), middle=(-1.3, 0.8)),
    "11x6": Grid(11, 6, 0.2, (2.4, 1.5), middle=(1.2, -0.3)),
    "35x10": Grid(35, 10, 0.1, (3.6, 1.1), middle=(0.5, 0.0)),
}
"""The sizes and spacings are published; where they lie in the rooms is rebuilt."""
GridName = Literal["5x10", "10x15", "6x8", "12x9", "11x6", "35x10"]


@dataclass(frozen=True)
class Interior:
    """A room that grids lie in.

    Attributes:
        bounds: x0, y0, x1, y1 of the walls [m].
        windows: x of their middles, in the top wall [m].
        door_y: middle of the door in the left wall [m].
        tubes, bulbs: x and y of the lamps [m].
        desks: middles of the desks, turned to who sits there.
        things: what else stands and hangs about.
    """

    bounds: tuple[float, float, float, float]
    windows: tuple[float, ...]
    door_y: float
    tubes: tuple[tuple[float, float], ...]
    bulbs: tuple[tuple[float, float], ...]
    desks: tuple[Pose, ...]
    things: tuple[Thing, ...]


LAB = Interior(
    bounds=(-3.9, -3.5, 3.9, 3.5),
    windows=(-2.3, 0.0, 2.3),
    door_y=-2.2,
    tubes=((-2.0, -1.5), (2.0, -1.5), (-2.0, 1.7), (2.0, 1.7)),
    bulbs=((-3.0, 2.4), (2.8, 0.3), (0.3, -2.6)),
    desks=(
        (-2.4, 3.0, FACES_DOWN),
        (-0.5, 3.0, FACES_DOWN),
        (2.6, 3.0, FACES_DOWN),
        (-3.45, 0.4, FACES_RIGHT),
        (3.45, -0.9, FACES_LEFT),
    ),
    things=(
        Thing("low_shelf", (0.95, 3.3, FACES_DOWN), 0.0, 2),
        Thing("plant", (0.95, 3.3, FACES_DOWN), 1.15, 0),
        Thing("whiteboard", (-3.9, -0.75, FACES_RIGHT), 1.0),
        Thing("poster", (-3.9, 1.7, FACES_RIGHT), 1.1, 1),
        Thing("cupboard", (3.63, 1.2, FACES_LEFT)),
        Thing("carton", (3.63, 1.2, FACES_LEFT), 2.0, 1, True),
        Thing("poster", (3.9, 0.25, FACES_LEFT), 1.2, 4),
        Thing("shelf", (3.7, -2.5, FACES_LEFT), 0.0, 1),
        Thing("shelf", (-2.2, -3.3, FACES_UP), 0.0, 0),
        Thing("shelf", (-1.0, -3.3, FACES_UP), 0.0, 3),
        Thing("supply", (0.1, -3.25, FACES_UP)),
        Thing("printer", (0.1, -3.25, FACES_UP), 0.6, 0, True),
        Thing("poster", (0.9, -3.5, FACES_UP), 1.1, 2),
        Thing("carton", (1.2, -3.25, FACES_UP), 0.0, 0, True),
        Thing("cupboard", (2.3, -3.24, FACES_UP), 0.0, 1),
    ),
)
"""Desks under the windows and at two walls, shelves and cupboards elsewhere: nothing repeats itself."""

_DOORS_X = (-5.0, -1.7, 1.7, 5.0)
HALL = Interior(
    bounds=(-6.7, -3.9, 6.7, 3.9),
    windows=(-3.35, 3.35),
    door_y=0.0,
    tubes=tuple((x, y) for x in (-5.0, -1.7, 1.7, 5.0) for y in (-2.0, 2.0)),
    bulbs=tuple((x, 0.0) for x in (-5.0, -1.7, 1.7, 5.0)),
    desks=(),
    things=(
        *(Thing("door", (x, 3.9, FACES_DOWN)) for x in _DOORS_X),
        *(Thing("door", (x, -3.9, FACES_UP)) for x in _DOORS_X),
        *(Thing("poster", (x, -3.9, FACES_UP), 1.1, number) for number, x in enumerate((-3.35, 0.0, 3.35))),
        *(Thing("low_shelf", (x, -3.7, FACES_UP), 0.0, number) for number, x in enumerate((-4.0, 2.7))),
        Thing("plant", (-4.0, -3.7, FACES_UP), 1.15, 0),
        Thing("poster", (0.0, 3.9, FACES_DOWN), 1.1, 3),
        Thing("whiteboard", (6.7, 0.0, FACES_LEFT), 1.0),
        Thing("supply", (6.45, 2.6, FACES_LEFT)),
        Thing("printer", (6.45, 2.6, FACES_LEFT), 0.6, 0, True),
        Thing("carton", (-6.4, 3.3, 0.3), 0.0, 1, True),
    ),
)
"""A hall like a wide corridor: a door every 3.3 m on both sides, and little else."""


@lru_cache(maxsize=4)
def grid_scene(grid: Grid, seed: int, moment: Moment | None = None) -> Scene:
    """The room that a grid lies in, and the small hall behind its door.

    Args:
        grid: which; chairs are kept off its lines.
        seed: varies textures and the details of the furniture; the same seed is the same building.
        moment: when; None is when the map was made.
    """
    moment, inside = moment or Moment(), HALL if grid.in_hall else LAB
    x0, _, _, y1 = inside.bounds
    rng = generator(seed, Stream.FURNITURE)
    things = [thing for number, desk in enumerate(inside.desks) for thing in workplace(desk, number, rng)]
    things += [*inside.things, *(Thing("window", (x, y1, FACES_DOWN), 0.0, 0) for x in inside.windows)]
    b = Builder(seed)
    room(b, inside.bounds, openings=[door_gap(x0, inside.door_y), *(window_gap(x, y1) for x in inside.windows)])
    outside(b, inside.windows, y1)
    hall(b, x0, inside.door_y, moment.doors)
    lines = points_of(grid)[neighbours_of(grid)].reshape(-1, 4)
    later = as_they_stand(things, moment, generator(seed, Stream.LATER))
    for thing in off_the_path(later, lines, CHAIR_GAP_M):
        b.thing(thing)
    return b.scene(light_at((_lamps(inside), hall_room(x0, inside.door_y)), moment, seed))


def _lamps(inside: Interior) -> LitRoom:
    """The lamps and windows of a room."""
    wall_y = inside.bounds[3]
    tubes = [(x, y, CEILING_M - 0.1) for x, y in inside.tubes]
    windows = [(x, wall_y - 0.2, 1.8, WINDOW_POWER, WINDOW_POWER_AGED) for x in inside.windows]
    return LitRoom(inside.bounds, tubes, inside.bulbs, windows)


def points_of(grid: Grid) -> Floats:
    """(rows * columns, 2) positions, row by row [m]."""
    x = grid.middle[0] + grid.spacing_m * (np.arange(grid.columns) - (grid.columns - 1) / 2.0)
    y = grid.middle[1] + grid.spacing_m * (np.arange(grid.rows) - (grid.rows - 1) / 2.0)
    return np.column_stack([np.tile(x, grid.rows), np.repeat(y, grid.columns)])


def neighbours_of(grid: Grid) -> Ints:
    """Pairs (E, 2) of points next to each other in a row or a column."""
    number = np.arange(grid.rows * grid.columns).reshape(grid.rows, grid.columns)
    beside = np.column_stack([number[:, :-1].ravel(), number[:, 1:].ravel()])
    above = np.column_stack([number[:-1].ravel(), number[1:].ravel()])
    return np.concatenate([beside, above])


@dataclass(frozen=True)
class GridRoute(Route):
    """How the robot drives, at random, on a grid of 1 m; on a finer one all lengths are shorter by its spacing.

    Attributes:
        nearest_m, farthest_m: range of the distance to each point, drawn anew at every pass, metres on a grid of 1 m.
        step_m: length of path between two frames, metres on a grid of 1 m.
        step_spread_m: half the range that the step varies in, metres on a grid of 1 m.
    """

    nearest_m: float = 0.2
    farthest_m: float = 0.3
    step_m: float = 0.4
    step_spread_m: float = 0.03
    random: bool = True

    def scaled(self, spacing_m: float) -> GridRoute:
        """The same on a grid of this spacing."""
        names = ("nearest_m", "farthest_m", "step_m", "step_spread_m")
        return replace(self, **{name: getattr(self, name) * spacing_m for name in names})


@dataclass(frozen=True)
class ImageGridSettings(WorldSettings):
    """As in every world, but for what full circles do not have; of the sensor's errors, vignette is left out.

    Attributes:
        grid: image set: 5x10 (1 m, in a hall), 10x15 (0.3 m), 6x8 (0.5 m), 12x9 (0.1 m), 11x6 (0.2 m), 35x10 (0.1 m).
        shake_px, turning_shake_px, grille_shake_px: not for full circles, rows: leave it at 0.
        camera_ahead_m: middle of the mirror ahead of the axis of rotation, metres.
        stereo_baseline_m: not for full circles, metres: leave it at 0.
        depth: not for full circles, true or false: leave it at false.
        scan: not for full circles, which are taken at once.
        route: how the robot drives around the points.
    """

    grid: GridName = "10x15"
    shake_px: float = 0.0
    turning_shake_px: float = 0.0
    grille_shake_px: float = 0.0
    camera_ahead_m: float = 0.0
    route: GridRoute = field(default_factory=GridRoute)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.scan != Scan():
            raise ValueError("scan is set; full circles are taken at once: leave all of scan out")
        unused: dict[str, Any] = {"stereo_baseline_m": 0.0, "depth": False}
        unused |= dict.fromkeys(("shake_px", "turning_shake_px", "grille_shake_px"), 0.0)
        for name, value in unused.items():
            if getattr(self, name) != value:
                raise ValueError(
                    f"{name} is {getattr(self, name)}; an image grid's full circles have none: leave it out"
                )
        if self.grid not in GRIDS:
            raise ValueError(f"grid is {self.grid!r}; choose from: {', '.join(GRIDS)}")


class ImageGridWorld(World):
    """Grids of omnidirectional images (third seed), simulated: 48 to 350 panoramas of 56 x 256, 0.1 to 1 m apart.

    Frames are full circles as well, of the kind ``omni``; the left edge of their first column looks ahead.
    """

    Config = ImageGridSettings
    title = "image grid"
    camera = Camera(45.0, 32, 56)
    """Not a camera of its own: it gives the full circles 256 columns, and rows as far apart as these in angle."""

    def __init__(self, config: Any = None) -> None:
        self.grid = GRIDS[(config or ImageGridSettings()).grid]
        super().__init__(config)

    @property
    def route(self) -> Route:
        """The route of the settings, scaled from a grid of 1 m to this one."""
        return GridRoute.scaled(self.config.route, self.grid.spacing_m)

    @property
    def view_rad(self) -> float:
        """People are seen all around."""
        return 2.0 * np.pi

    @property
    def places(self) -> Sequence[Place]:
        """The points of the grid, row by row."""
        columns = self.grid.columns
        return tuple(
            Place(str(number + 1), f"ROW_{number // columns + 1}_COLUMN_{number % columns + 1}", float(x), float(y))
            for number, (x, y) in enumerate(points_of(self.grid))
        )

    @property
    def tour(self) -> Sequence[int]:
        """Round the edge of the grid, counter-clockwise."""
        number = np.arange(self.grid.rows * self.grid.columns).reshape(self.grid.rows, self.grid.columns)
        sides = (number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0])
        return [int(index) for index in np.concatenate(sides)]

    def edges(self) -> Ints:
        """Neighbours in rows and columns."""
        return neighbours_of(self.grid)

    def scene(self, seed: int, moment: Moment) -> Scene:
        """The hall or the laboratory."""
        return grid_scene(self.grid, seed, moment)

    def topo_map(self, seed: int) -> TopoMap:
        """The map that was made before the drive: a panorama on every point."""
        nodes, moment = [], Moment()
        scene = self.scene(seed, moment)
        for number, place in enumerate(self.places):
            camera = compose((place.x, place.y, HEADING), self.mount)
            rng = generator(seed, Stream.MAP, number)
            nodes.append(Node(*place, HEADING, self._circle(scene, camera, moment, rng, still=True)))
        name = f"{self.title} {self.config.grid}, {len(nodes)} panoramas (simulated)"
        return TopoMap(name, self.camera, tuple(nodes), self.edges())

    def readers(self, shot: Shot) -> Mapping[str, Callable[[], Pixels]]:
        """What makes a frame's full circle."""
        return {"omni": partial(self._omni, shot)}

    def _omni(self, shot: Shot) -> Image:
        """A frame's full circle, (56, 256, 3); column 0's left edge looks along the camera's heading."""
        rng = generator(shot.seed, Stream.FRAME, shot.number)
        if shot.covered:
            image = covered_picture((self.camera.height, self.camera.panorama_columns()), rng)
            image.setflags(write=False)
            return image
        return self._circle(shot.view(), shot.pose, self.config.now(), rng, shot.still)

    def _circle(self, scene: Scene, pose: Floats, moment: Moment, rng: np.random.Generator, still: bool) -> Image:
        """A full circle as the sensor delivers it, without a seam."""
        circle = render_cylinder(scene, pose[:2], float(pose[2]), self.camera)
        wide = np.concatenate([circle[:, -SEAM:], circle, circle[:, :SEAM]], axis=1)
        effects = replace(effects_at(self.config.effects, moment), vignette=0.0)  # a circle has no corners
        image = np.ascontiguousarray(sense(wide, effects, rng, tint_at(moment), still)[:, SEAM:-SEAM])
        image.setflags(write=False)
        return image
