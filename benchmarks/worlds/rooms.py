"""Walls with openings, doors and windows: what all simulated buildings are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from benchmarks.worlds.builders import CEILING_M, Builder
from benchmarks.worlds.furniture import FACES_LEFT
from benchmarks.worlds.light import LitRoom
from topoloc.geometry import Floats, compose

DOOR_WIDTH_M, DOOR_HEIGHT_M, WINDOW_WIDTH_M = 0.95, 2.08, 2.0
HALL_M = 1.8
"""Depth of the hall behind the door [m]."""
WALL_M = 0.1
"""Thickness of the walls between rooms."""
WIDE_OPEN = np.deg2rad(105.0)
"""Turn of a door that stands wide open [rad]: out of the way of who drives through."""
_LEAF_M, _LEAF_THICK_M = 0.88, 0.04


@dataclass(frozen=True)
class Opening:
    """A gap in a wall.

    Attributes:
        x, y: its middle, on the wall [m].
        width: along the wall [m].
        lintel: height from which the wall goes on above it [m]; None: a window fills it whole.
    """

    x: float
    y: float
    width: float
    lintel: float | None = None


def door_gap(x: float, y: float) -> Opening:
    """The gap of a door."""
    return Opening(x, y, DOOR_WIDTH_M, DOOR_HEIGHT_M)


def window_gap(x: float, y: float) -> Opening:
    """The gap of a window: the thing that stands there closes it."""
    return Opening(x, y, WINDOW_WIDTH_M)


def wall(
    b: Builder, start: Floats, end: Floats, kind: str, openings: Sequence[Opening] = (), high: float = CEILING_M
) -> None:
    """A wall from ``start`` to ``end`` (2,), seen from the right of that line, with those openings that lie on it."""
    length = float(np.hypot(*(end - start)))
    along = (end - start) / length
    across = np.array([along[1], -along[0]])
    gaps = []
    for gap in openings:
        offset = np.array([gap.x, gap.y]) - start
        if abs(float(offset @ across)) < 0.02 and 0.0 < float(offset @ along) < length:
            gaps.append((float(offset @ along), gap))
    at = 0.0
    for middle, gap in sorted(gaps, key=lambda item: item[0]):
        left, right = middle - gap.width / 2.0, middle + gap.width / 2.0
        if left > at:
            b.wall(start + at * along, start + left * along, 0.0, high, kind)
        if gap.lintel is not None:
            b.face(start + left * along, start + right * along, gap.lintel, high, kind)
        at = right
    if length > at:
        b.wall(start + at * along, end, 0.0, high, kind)


def room(
    b: Builder,
    bounds: tuple[float, float, float, float],
    kinds: tuple[str, str, str, str] = ("plaster",) * 4,
    openings: Sequence[Opening] = (),
    floor: str = "carpet",
) -> None:
    """Four walls seen from inside, floor and ceiling.

    Args:
        b: collects them.
        bounds: x0, y0, x1, y1 [m].
        kinds: textures of the left, top, right and bottom wall.
        openings: of any of them.
        floor: texture of the floor.
    """
    x0, y0, x1, y1 = bounds
    corners = np.array([(x0, y0), (x0, y1), (x1, y1), (x1, y0)])
    for number, kind in enumerate(kinds):
        wall(b, corners[number], corners[(number + 1) % 4], kind, openings)
    middle, size = np.array([(x0 + x1) / 2.0, (y0 + y1) / 2.0, 0.0]), (x1 - x0, y1 - y0)
    b.plane(middle, size, 0.0, floor, 2.0)
    b.plane(middle, size, CEILING_M, "ceiling", 2.4)


def door(b: Builder, pose: tuple[float, float, float], opened: float, variant: int = 0) -> None:
    """A door between two rooms ``WALL_M`` apart.

    Args:
        b: collects its faces.
        pose: middle of the doorway, half-way through the wall; the leaf swings to local -y [m, m, rad].
        opened: how far, 0 to 1; 1 is wide open, ``WIDE_OPEN``.
        variant: of the texture.
    """
    half, deep = DOOR_WIDTH_M / 2.0, WALL_M / 2.0
    middle = np.array(pose)
    for side in (-1.0, 1.0):
        jamb = compose(middle, np.array([(side * half, side * deep, 0.0), (side * half, -side * deep, 0.0)]))
        b.face(jamb[0], jamb[1], 0.0, DOOR_HEIGHT_M, "aluminium")
    b.plane(middle, (DOOR_WIDTH_M, WALL_M), 0.0, "wood")
    b.plane(middle, (DOOR_WIDTH_M, WALL_M), DOOR_HEIGHT_M, "aluminium")
    hinge = compose(middle, (_LEAF_M / 2.0, 0.0, np.pi + opened * WIDE_OPEN))
    leaf = compose(hinge, (_LEAF_M / 2.0, 0.0, 0.0))
    b.box(leaf, (_LEAF_M, _LEAF_THICK_M), 0.01, DOOR_HEIGHT_M - 0.02, "door", "door", "wood", variant)


def sky(b: Builder, position: tuple[float, float], facing: float, number: int) -> None:
    """What windows look at: three boards 22 m wide side by side, turned to ``facing`` (the side they are seen from)."""
    for place, shift in enumerate((-22.0, 0.0, 22.0)):
        ends = compose((*position, facing), np.array([(shift - 11.0, 0.0, 0.0), (shift + 11.0, 0.0, 0.0)]))
        b.glowing(ends[0], ends[1], -9.0, 9.0, "outside", number + place)


def outside(b: Builder, windows: Sequence[float], wall_y: float) -> None:
    """What windows at these x of the top wall look at, and what closes the slits around radiators and lintels."""
    middle = float(np.mean(windows))
    corners = np.array([(middle + x, wall_y + y) for x, y in ((-13.0, 0.1), (-13.0, 9.0), (13.0, 9.0), (13.0, 0.1))])
    for number, (start, end) in enumerate(pairwise(corners)):
        b.glowing(start, end, -9.0, 12.0, "outside", number)
    for x in windows:
        left, right = np.array([x - 1.1, wall_y + 0.05]), np.array([x + 1.1, wall_y + 0.05])
        b.face(left, right, 0.0, 0.94, "plaster")
        b.face(left, right, 2.4, CEILING_M, "plaster")
        b.plane(np.array([x, wall_y + 0.03, 0.0]), (2.2, 0.06), 0.0, "plaster")


def hall_room(wall_x: float, door_y: float) -> LitRoom:
    """The small hall behind a door in a left wall."""
    right = wall_x - WALL_M
    middle = (right - HALL_M / 2.0, door_y)
    bounds = (right - HALL_M, door_y - 1.6, right, door_y + 1.6)
    return LitRoom(bounds, [(*middle, CEILING_M - 0.1)], [middle])


def hall(b: Builder, wall_x: float, door_y: float, opened: float) -> None:
    """The hall and its door, open 0 to 1; the gap in the wall before it is the caller's."""
    bounds = hall_room(wall_x, door_y).bounds
    room(b, bounds, ("brick", "plaster", "plaster", "plaster"), [door_gap(bounds[2], door_y)])
    door(b, (wall_x - WALL_M / 2.0, door_y, FACES_LEFT), opened)
