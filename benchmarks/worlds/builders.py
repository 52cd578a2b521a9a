"""How furniture is built from faces and planes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.renderer import Atlas, Faces, Planes, Scene
from benchmarks.worlds.textures import KINDS, texture_set
from topoloc.geometry import Floats, compose

if TYPE_CHECKING:
    from benchmarks.worlds.light import Light

CEILING_M = 2.7
DESK_M = 0.75


@dataclass(frozen=True)
class Thing:
    """A piece of furniture: what it is, where it stands and which of its kind.

    Attributes:
        kind: key of ``BUILDERS``.
        pose: (x, y, yaw) of its middle [m, m, rad]; yaw 0 faces down the map.
        base: height it stands on [m].
        variant: number of the texture, and for blinds how far they are down, per cent.
        moves: people move it about.
    """

    kind: str
    pose: tuple[float, float, float]
    base: float = 0.0
    variant: int = 0
    moves: bool = False


@lru_cache(maxsize=2)
def world_atlas(seed: int) -> tuple[Atlas, dict[str, list[int]]]:
    """All textures of a seed, and their indices in the atlas by kind."""
    images = texture_set(generator(seed, Stream.TEXTURES))
    index, count = {}, 0
    for kind in KINDS:
        index[kind] = list(range(count, count + len(images[kind])))
        count += len(images[kind])
    return Atlas.of([image for kind in KINDS for image in images[kind]]), index


class Builder:
    """Collects faces and planes, and lights them at the end.

    Args:
        seed: of the textures.
    """

    def __init__(self, seed: int) -> None:
        self._atlas, self._index = world_atlas(seed)
        self._faces: list[tuple[float, ...]] = []
        self._planes: list[tuple[float, ...]] = []
        self._glowing: list[int] = []
        self._pieces = 0

    def texture(self, kind: str, variant: int = 0) -> int:
        """Index in the atlas of one texture of a kind."""
        numbers = self._index[kind]
        return numbers[variant % len(numbers)]

    def face(self, start: Floats, end: Floats, low: float, high: float, kind: str, variant: int = 0) -> None:
        """A vertical rectangle from ``start`` to ``end`` (2,), seen from the right of that line."""
        self._faces.append((*start[:2], *end[:2], low, high, self.texture(kind, variant)))

    def glowing(self, start: Floats, end: Floats, low: float, high: float, kind: str, variant: int = 0) -> None:
        """A face out of doors, which has the brightness of the sky."""
        self._glowing.append(len(self._faces))
        self.face(start, end, low, high, kind, variant)

    def thing(self, thing: Thing) -> None:
        """A piece of furniture."""
        BUILDERS[thing.kind](self, thing)

    def wall(self, start: Floats, end: Floats, low: float, high: float, kind: str, width: float = 1.1) -> None:
        """A long face in pieces about ``width`` [m] wide, so that light and stains vary along it and between walls."""
        pieces = max(1, round(float(np.hypot(*(end - start))) / width))
        corners = start + np.linspace(0.0, 1.0, pieces + 1)[:, None] * (end - start)
        for a, b in pairwise(corners):
            self.face(a, b, low, high, kind, self._pieces)
            self._pieces += 1

    def repeat_walls(self) -> None:
        """Let the next walls have the stains of the first ones again."""
        self._pieces = 0

    def box(
        self,
        pose: Floats,
        size: tuple[float, float],
        low: float,
        high: float,
        front: str,
        sides: str,
        top: str = "plaster",
        variant: int = 0,
    ) -> None:
        """A box of ``size`` width x depth [m] around ``pose`` (3,); its front faces local -y."""
        x, y = size[0] / 2.0, size[1] / 2.0
        local = np.array([(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)])
        corners = compose(pose, local)
        for number in range(4):
            kind = front if number == 0 else sides
            self.face(corners[number], corners[(number + 1) % 4], low, high, kind, variant)
        self.plane(pose, size, high, top)

    def plane(self, pose: Floats, size: tuple[float, float], height: float, kind: str, tile: float = 1.6) -> None:
        """A horizontal rectangle of ``size`` [m] around ``pose`` (3,)."""
        half = (size[0] / 2.0, size[1] / 2.0)
        self._planes.append((pose[0], pose[1], *half, pose[2], height, self.texture(kind), tile))

    def scene(self, light: Light) -> Scene:
        """Everything collected, lit."""
        face, plane = np.array(self._faces), np.array(self._planes)
        ends, heights = face[:, :4], face[:, 4:6]
        whole, none = np.ones(len(face)), np.zeros(len(face))
        brightness = light.on_faces(ends, heights)
        brightness[self._glowing] = light.sky
        faces = Faces(ends, heights, face[:, 6].astype(np.int64), whole, none, brightness)
        above = np.column_stack([plane[:, :2], plane[:, 5]])
        shade = light.at(above, np.tile((0.0, 0.0, 1.0), (len(above), 1)))
        texture = plane[:, 6].astype(np.int64)
        planes = Planes(plane[:, :2], plane[:, 2:4], plane[:, 4], plane[:, 5], texture, plane[:, 7], shade)
        for part in (faces, planes):
            for values in vars(part).values():
                values.setflags(write=False)  # scenes are kept and shared
        return Scene(self._atlas, faces, planes)


def _desk(b: Builder, thing: Thing) -> None:
    """A table top on a drawer unit, a back panel and a leg."""
    pose = np.array(thing.pose)
    side = 1.0 if thing.variant % 2 else -1.0
    b.box(pose, (1.6, 0.8), DESK_M - 0.04, DESK_M, "wood", "wood", "wood")
    b.box(compose(pose, (side * 0.55, -0.05, 0.0)), (0.42, 0.6), 0.05, DESK_M - 0.05, "drawers", "casing")
    b.box(compose(pose, (-side * 0.76, 0.0, 0.0)), (0.04, 0.7), 0.0, DESK_M - 0.04, "plastic", "plastic")
    b.box(compose(pose, (0.0, 0.3, 0.0)), (1.5, 0.03), 0.25, DESK_M - 0.04, "desk_front", "desk_front")


def _monitor(b: Builder, thing: Thing) -> None:
    """A deep monitor of the time on its foot, and the keyboard in front of it."""
    pose, base = np.array(thing.pose), thing.base
    b.box(pose, (0.2, 0.2), base, base + 0.08, "plastic", "plastic")
    b.box(pose, (0.42, 0.06), base + 0.07, base + 0.42, "screen", "casing", "casing")
    b.box(compose(pose, (0.0, 0.13, 0.0)), (0.34, 0.2), base + 0.09, base + 0.38, "casing", "casing", "casing")
    b.box(compose(pose, (0.0, -0.3, 0.0)), (0.44, 0.15), base, base + 0.03, "casing", "casing", "casing")


def _chair(b: Builder, thing: Thing) -> None:
    """An office chair: its back stands at local -y, so that a chair at a desk shows its back to the room."""
    pose = np.array(thing.pose)
    b.box(pose, (0.07, 0.07), 0.08, 0.42, "plastic", "plastic")
    b.box(pose, (0.5, 0.5), 0.03, 0.08, "plastic", "plastic", "plastic")
    b.box(pose, (0.47, 0.45), 0.42, 0.5, "cloth", "cloth", "cloth")
    b.box(compose(pose, (0.0, -0.22, 0.0)), (0.08, 0.04), 0.45, 0.65, "plastic", "plastic")
    b.box(compose(pose, (0.0, -0.22, 0.0)), (0.43, 0.07), 0.62, 1.04, "cloth", "cloth", "cloth")


def _taken_chair(b: Builder, thing: Thing) -> None:
    """A chair with someone on it: trunk and head above its seat, turned as the chair is."""
    _chair(b, thing)
    pose = compose(np.array(thing.pose), (0.0, 0.02, np.pi))
    b.box(pose, (0.42, 0.24), 0.5, 1.06, "shirt", "shirt", "shirt", thing.variant)
    b.box(pose, (0.18, 0.19), 1.06, 1.32, "head", "head", "head", thing.variant)


def _window(b: Builder, thing: Thing) -> None:
    """An opening 2 m wide with posts, a transom, a sill, curtains, and a blind ``variant`` per cent down."""
    pose, sill, lintel = np.array(thing.pose), 0.95, 2.4
    for x in (-0.96, -0.32, 0.32, 0.96):
        b.box(compose(pose, (x, 0.0, 0.0)), (0.07, 0.05), sill, lintel, "aluminium", "aluminium")
    b.box(pose, (2.0, 0.05), 1.62, 1.67, "aluminium", "aluminium")
    b.box(compose(pose, (0.0, -0.08, 0.0)), (2.0, 0.2), sill - 0.04, sill, "plaster", "plaster")
    drop = lintel - thing.variant / 100.0 * (lintel - sill)
    left, middle, right = (compose(pose, (x, -0.04, 0.0)) for x in (-1.0, 0.0, 1.0))
    if thing.variant:
        b.face(left, right, drop, lintel, "blinds")
    for edge, (start, end) in enumerate((((-1.12, -0.06), (-0.84, -0.06)), ((0.84, -0.06), (1.12, -0.06)))):
        b.face(compose(pose, (*start, 0.0)), compose(pose, (*end, 0.0)), 0.6, lintel + 0.1, "curtain", edge)
    wall_left, wall_right = compose(pose, (-1.0, 0.02, 0.0)), compose(pose, (1.0, 0.02, 0.0))
    b.face(wall_left, wall_right, 0.0, sill, "radiator")
    b.face(wall_left, compose(pose, (0.0, 0.02, 0.0)), lintel, CEILING_M, "plaster")
    b.face(middle, right, lintel, CEILING_M, "plaster", 1)


def _flat(kind: str, width: float, height: float) -> Callable[[Builder, Thing], None]:
    """A builder of something that hangs flat on a wall."""

    def build(b: Builder, thing: Thing) -> None:
        ends = compose(np.array(thing.pose), np.array([(-width / 2.0, -0.02, 0.0), (width / 2.0, -0.02, 0.0)]))
        b.face(ends[0], ends[1], thing.base, thing.base + height, kind, thing.variant)

    return build


def _solid(
    kind: str, size: tuple[float, float, float], sides: str | None = None, top: str = "plaster"
) -> Callable[[Builder, Thing], None]:
    """A builder of a box of width, depth, height ``size`` [m]."""

    def build(b: Builder, thing: Thing) -> None:
        high = thing.base + size[2]
        b.box(np.array(thing.pose), size[:2], thing.base, high, kind, sides or kind, top, thing.variant)

    return build


def _plant(b: Builder, thing: Thing) -> None:
    """Leaves over a pot."""
    pose, base, kind = np.array(thing.pose), thing.base, "plant"
    b.box(pose, (0.18, 0.18), base, base + 0.14, "cardboard", "cardboard", "plastic")
    for turned, size, low, high in ((0.0, 0.3, 0.12, 0.26), (0.7, 0.24, 0.22, 0.38), (0.3, 0.13, 0.36, 0.47)):
        b.box(compose(pose, (0.0, 0.0, turned)), (size, size), base + low, base + high, kind, kind, kind, thing.variant)


BUILDERS: dict[str, Callable[[Builder, Thing], None]] = {
    "desk": _desk,
    "monitor": _monitor,
    "chair": _chair,
    "taken_chair": _taken_chair,
    "window": _window,
    "poster": _flat("poster", 0.6, 0.85),
    "whiteboard": _flat("whiteboard", 1.5, 1.0),
    "door": _flat("door", 0.95, 2.08),
    "cupboard": _solid("cupboard", (1.2, 0.5, 2.0), "wood"),
    "shelf": _solid("bookshelf", (1.1, 0.35, 1.9), "wood"),
    "low_shelf": _solid("bookshelf", (0.8, 0.35, 1.15), "wood", "wood"),
    "computer": _solid("computer", (0.2, 0.42, 0.42), "casing", "casing"),
    "printer": _solid("casing", (0.45, 0.4, 0.3), "casing", "casing"),
    "carton": _solid("cardboard", (0.34, 0.3, 0.3), None, "cardboard"),
    "papers": _solid("paper", (0.31, 0.24, 0.12), None, "paper"),
    "books": _solid("paper", (0.26, 0.2, 0.22), None, "paper"),
    "plant": _plant,
    "lamp": _solid("plastic", (0.12, 0.12, 0.4)),
    "telephone": _solid("plastic", (0.2, 0.2, 0.07), None, "plastic"),
    "supply": _solid("computer", (0.4, 0.4, 0.6), "casing", "casing"),
}
"""How every kind of thing is built."""
