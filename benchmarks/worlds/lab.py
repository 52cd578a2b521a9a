"""The thesis's laboratory (5.2), simulated: eight nodes on a grid of one metre, furniture along the walls.

Map frame: node 1 is the origin, x to the right and y up in Figure 5.22, metres. Top and right walls are windows.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache

import numpy as np

from benchmarks.worlds.builders import BUILDERS, CEILING_M, DESK_M, Builder, Light, Thing
from benchmarks.worlds.renderer import Atlas, Faces, Scene
from benchmarks.worlds.textures import KINDS, texture_set
from topoloc.geometry import Floats, compose

NODES: tuple[tuple[str, str, float, float], ...] = (
    ("1", "CHARGER", 0.0, 0.0),
    ("2", "SHELVES", 1.0, 0.0),
    ("3", "CENTRE", 1.0, 1.0),
    ("4", "CUPBOARD", 1.0, 2.0),
    ("5", "DOOR", 0.0, 2.0),
    ("6", "DESK_1", 0.0, 1.0),
    ("7", "DESK_2", -1.0, 1.0),
    ("8", "DESK_3", -1.0, 0.0),
)
"""id, name, x, y [m] of the nodes of Figure 5.22, in the order of the path."""

LEFT, RIGHT, BOTTOM, TOP = -3.3, 3.3, -2.3, 4.3
"""The walls [m]; the bottom one is in part a panel 1.5 m high, with a closed-off area of 2 m behind it."""
BEHIND = -4.3
PANEL_END = 0.9
FACES_DOWN, FACES_LEFT, FACES_UP, FACES_RIGHT = 0.0, -np.pi / 2.0, np.pi, np.pi / 2.0
CHAIR_GAP_M = 1.28
"""Centre of a chair to the lines between the nodes [m]: at least 0.45 m from the chair to the path."""


def daylight(age: float) -> Light:
    """The light when the map was made, and ``age`` (0 to 1) on the way to another time of the day."""
    top_windows = [(x, TOP - 0.2, 1.8) for x in (0.1, 2.1)]
    right_windows = [(RIGHT - 0.2, y, 1.8) for y in (1.6, -0.7)]
    ceiling = [(x, y, CEILING_M - 0.1) for x in (-1.6, 1.6) for y in (-0.8, 2.6)]
    lamps = np.array([*top_windows, *right_windows, *ceiling])
    made = np.array([0.55, 0.35, 0.25, 0.2, 0.35, 0.35, 0.35, 0.35])
    other = np.array([0.15, 0.25, 0.85, 1.1, 0.05, 0.05, 0.05, 0.05])
    return Light(lamps, (1.0 - age) * made + age * other)


DESKS: tuple[tuple[float, float, float], ...] = (
    (LEFT + 0.42, -1.35, FACES_RIGHT),
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


def _desk_things(desk: tuple[float, float, float], number: int, rng: np.random.Generator) -> Iterator[Thing]:
    """A desk with its identical computer, a chair, and what lies about on it."""

    def on(x: float, y: float, yaw: float = 0.0) -> tuple[float, float, float]:
        pose = compose(desk, (x, y, yaw))
        return float(pose[0]), float(pose[1]), float(pose[2])

    side = float(rng.choice([-1.0, 1.0]))
    yield Thing("desk", desk, 0.0, number)
    yield Thing("monitor", on(side * rng.uniform(0.0, 0.25), 0.1, rng.normal(0.0, 0.15)), DESK_M)
    yield Thing("computer", on(side * rng.uniform(0.55, 0.68), 0.1), DESK_M)
    yield Thing("chair", on(rng.normal(0.0, 0.15), -0.4, rng.normal(0.0, 0.5)), 0.0, 0, True)
    clutter = rng.permutation(["papers", "books", "carton", "plant", "lamp", "telephone", "papers"])[:4]
    for kind, x in zip(clutter, (-0.66, -0.45, -0.3, -0.55), strict=True):
        y = float(rng.uniform(-0.25, 0.25))
        yield Thing(str(kind), on(side * x, y, rng.uniform(-0.6, 0.6)), DESK_M, int(rng.integers(8)), True)


def furniture(rng: np.random.Generator) -> list[Thing]:
    """All that stands in the laboratory; the generator varies details, not the plan."""
    things = [thing for number, desk in enumerate(DESKS) for thing in _desk_things(desk, number, rng)]
    things += [Thing("window", pose, 0.0, int(rng.choice([0, 0, 25, 40]))) for pose in WINDOWS]
    things += [
        Thing("door", (-2.1, TOP, FACES_DOWN)),
        Thing("poster", (-1.25, TOP, FACES_DOWN), 0.95, 0),
        Thing("cupboard", (RIGHT - 0.26, 3.45, FACES_LEFT)),
        Thing("carton", (RIGHT - 0.26, 3.3, FACES_LEFT), 2.0, 1, True),
        Thing("shelf", (1.5, BOTTOM + 0.18, FACES_UP), 0.0, 0),
        Thing("shelf", (2.62, BOTTOM + 0.18, FACES_UP), 0.0, 1),
        Thing("low_shelf", (LEFT + 0.19, 3.75, FACES_RIGHT), 0.0, 2),
        Thing("plant", (LEFT + 0.22, 3.75, FACES_RIGHT), 1.15, 0),
        Thing("whiteboard", (LEFT, 1.55, FACES_RIGHT), 1.0),
        Thing("supply", (-0.6, BOTTOM + 0.25, FACES_UP)),
        Thing("supply", (0.0, BOTTOM + 0.25, FACES_UP)),
        Thing("printer", (0.0, BOTTOM + 0.25, FACES_UP), 0.6, 0, True),
        Thing("carton", (-1.5, BOTTOM + 0.25, rng.uniform(2.8, 3.5)), 0.0, 0, True),
        Thing("shelf", (-2.3, BEHIND + 0.2, FACES_UP), 0.0, 3),
        Thing("poster", (-0.6, BEHIND, FACES_UP), 1.25, 5),
    ]
    for number, y in enumerate((-1.9, -0.9, 0.25)):
        shift = float(rng.uniform(-0.12, 0.12))
        things.append(Thing("poster", (LEFT, y + shift, FACES_RIGHT), 1.0 + rng.uniform(0.0, 0.2), number + 1))
    return things


def aged(things: list[Thing], age: float, rng: np.random.Generator) -> list[Thing]:
    """The things as they stand later: ``age`` (0 to 1) is the share of what people move that was moved.

    Chairs go 0.3 m and turn, small things slide 0.15 m, one in five of those moved is gone; blinds go up and down.
    """
    later = []
    for thing in things:
        moved, gone = rng.random() < age, rng.random() < 0.2
        shift, drop = rng.normal(0.0, 1.0, 3), int(rng.choice([0, 20, 45, 60]))
        if thing.kind == "window" and moved:
            later.append(replace(thing, variant=drop))
        elif not (thing.moves and moved):
            later.append(thing)
        elif thing.kind == "chair":
            later.append(replace(thing, pose=_shifted(thing.pose, shift * (0.3, 0.15, 1.0))))
        elif not gone:
            later.append(replace(thing, pose=_shifted(thing.pose, shift * (0.15, 0.05, 0.5))))
    return later


def _shifted(pose: tuple[float, float, float], shift: Floats) -> tuple[float, float, float]:
    """A pose moved in its own frame."""
    x, y, yaw = compose(pose, shift)
    return float(x), float(y), float(yaw)


def _off_the_path(thing: Thing) -> Thing:
    """A chair pushed back where it would stand too near the lines between the nodes."""
    nodes = np.array([node[2:] for node in NODES])
    following = np.roll(nodes, -1, axis=0)
    steps = np.linspace(0.0, 1.0, 21)[:, None, None]
    line = (nodes + steps * (following - nodes)).reshape(-1, 2)
    away = np.array(thing.pose[:2]) - line
    distance = np.linalg.norm(away, axis=1)
    nearest = int(distance.argmin())
    if distance[nearest] >= CHAIR_GAP_M:
        return thing
    x, y = line[nearest] + away[nearest] / max(distance[nearest], 1e-6) * CHAIR_GAP_M
    return replace(thing, pose=(float(x), float(y), thing.pose[2]))


def _shell(b: Builder) -> None:
    """Walls, floor, ceiling, and what the windows look at."""
    corner = {
        name: np.array(at)
        for name, at in {
            "top left": (LEFT, TOP),
            "top right": (RIGHT, TOP),
            "bottom right": (RIGHT, BOTTOM),
            "panel end": (PANEL_END, BOTTOM),
            "behind right": (PANEL_END, BEHIND),
            "behind left": (LEFT, BEHIND),
        }.items()
    }
    b.wall(corner["behind left"], corner["top left"], 0.0, CEILING_M, "plaster")
    b.wall(corner["top left"], np.array([-0.9, TOP]), 0.0, CEILING_M, "plaster")
    b.wall(np.array([1.1, TOP]), np.array([1.2, TOP]), 0.0, CEILING_M, "plaster")
    b.wall(np.array([3.2, TOP]), corner["top right"], 0.0, CEILING_M, "plaster")
    b.wall(corner["top right"], np.array([RIGHT, 2.7]), 0.0, CEILING_M, "plaster")
    b.wall(np.array([RIGHT, 0.7]), np.array([RIGHT, 0.4]), 0.0, CEILING_M, "brick")
    b.wall(np.array([RIGHT, -1.6]), corner["bottom right"], 0.0, CEILING_M, "brick")
    b.wall(corner["bottom right"], corner["panel end"], 0.0, CEILING_M, "plaster")
    b.wall(corner["panel end"], corner["behind right"], 0.0, CEILING_M, "plaster")
    b.wall(corner["behind right"], corner["behind left"], 0.0, CEILING_M, "brick", 2.0)
    b.wall(corner["panel end"], np.array([LEFT, BOTTOM]), 0.0, 1.5, "panel", 0.85)
    middle = np.array([(LEFT + RIGHT) / 2.0, (TOP + BEHIND) / 2.0, 0.0])
    size = (RIGHT - LEFT, TOP - BEHIND)
    b.plane(middle, size, 0.0, "carpet", 2.0)
    b.plane(middle, size, CEILING_M, "ceiling", 2.4)
    for number, shift in enumerate((-22.0, 0.0, 22.0)):
        b.face(np.array([shift - 11.0, TOP + 9.0]), np.array([shift + 11.0, TOP + 9.0]), -9.0, 9.0, "outside", number)
        b.face(
            np.array([RIGHT + 10.0, shift + 11.0]),
            np.array([RIGHT + 10.0, shift - 11.0]),
            -9.0,
            9.0,
            "outside",
            number + 1,
        )


@lru_cache(maxsize=2)
def lab_textures(seed: int) -> tuple[Atlas, dict[str, list[int]]]:
    """The textures of a laboratory, and their indices by kind."""
    images = texture_set(np.random.default_rng([seed, 1]))
    index, count = {}, 0
    for kind in KINDS:
        index[kind] = list(range(count, count + len(images[kind])))
        count += len(images[kind])
    return Atlas.of([image for kind in KINDS for image in images[kind]]), index


def lab_scene(seed: int, age: float = 0.0) -> Scene:
    """The laboratory.

    Args:
        seed: varies textures and the details of the furniture; the same seed is the same room.
        age: 0 as it was when the map was made, up to 1: lit from another side, and all that people move was moved.
    """
    atlas, index = lab_textures(seed)
    things = aged(furniture(np.random.default_rng([seed, 2])), age, np.random.default_rng([seed, 3]))
    builder = Builder(index)
    _shell(builder)
    for thing in things:
        BUILDERS[thing.kind](builder, _off_the_path(thing) if thing.kind == "chair" else thing)
    return builder.scene(atlas, daylight(age))


def person(seed: int, at: Floats, facing: float, variant: int) -> Faces:
    """Someone 1.75 m tall and 0.45 m wide who stands at ``at`` (2,) [m], turned to ``facing`` [rad]."""
    _, index = lab_textures(seed)
    parts = ((0.36, 0.0, 0.85, "trousers"), (0.45, 0.85, 1.45, "shirt"), (0.19, 1.45, 1.75, "head"))
    angles = facing + np.arange(9) * np.pi / 4.0
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) / 2.0
    circles = [np.asarray(at) + width * ring for width, *_ in parts]
    heights = [np.tile((low, high), (8, 1)) for _, low, high, _ in parts]
    texture = [np.full(8, index[kind][variant % len(index[kind])]) for *_, kind in parts]
    shade = np.tile(0.85 + 0.25 * np.cos(angles[:-1] - np.deg2rad(50.0)), len(parts))
    count = len(shade)
    return Faces(
        np.concatenate([np.concatenate([circle[:-1], circle[1:]], axis=1) for circle in circles]),
        np.concatenate(heights),
        np.concatenate(texture),
        np.full(count, 1.0 / 8.0),
        np.tile(np.arange(8) / 8.0, len(parts)),
        np.repeat(shade[:, None], 4, axis=1),
    )
