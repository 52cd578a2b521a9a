"""What may differ between the making of a map and the drive of a robot: each a strength, so that they combine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.worlds.builders import Thing
from topoloc.geometry import Floats, compose

CHAIRS = ("chair", "taken_chair")
CHAIR_MOVES_M, CHAIR_TURNS_RAD = (0.3, 0.15), 1.0
"""Standard deviation of a moved chair's place, aside and to and from its desk [m], and of its turn [rad]."""
OBJECT_MOVES_M, OBJECT_TURNS_RAD = (0.15, 0.05), 0.5
"""The same of what lies about, and the most that it is moved: it stays on its desk."""
GONE, SAT_DOWN = 0.2, 0.3
"""Share of the moved things that are gone, and of the moved chairs that someone sits on."""
PULLED_OUT_M = -0.3
"""How far a chair stands back from its desk when someone sits on it [m]."""
MOST_PUSHES = 10
BLINDS = (0, 20, 45, 60)
"""How far blinds may be down, per cent."""


@dataclass(frozen=True)
class Moment:
    """How a world is at one time.

    Attributes:
        age: time since the map was made, 0 to 1; 1 is the thesis's two days.
        doors: how far the doors stand open, 0 to 1.
        bulbs: share of the light that comes from bulbs instead, 0 to 1.
        daylight: share of the light that comes through the windows instead, curtains open and lamps off, 0 to 1.
        seated: share of the chairs that someone has pulled out and sat down on, 0 to 1.
    """

    age: float = 0.0
    doors: float = 0.0
    bulbs: float = 0.0
    daylight: float = 0.0
    seated: float = 0.0


def as_they_stand(things: Iterable[Thing], moment: Moment, rng: np.random.Generator) -> list[Thing]:
    """The things at a later moment: its age is the share of what people move that was moved.

    Chairs go elsewhere and turn, small things slide, one in five of those moved is gone; blinds go up and down;
    people who sat somewhere have left, and others have come.
    """
    later = []
    for thing in things:
        moved, gone, seated = rng.random() < moment.age, rng.random() < GONE, rng.random() < SAT_DOWN
        taken = rng.random() < moment.seated
        shift, drop = rng.normal(0.0, 1.0, 3), int(rng.choice(BLINDS))
        if thing.kind == "window" and moved:
            later.append(replace(thing, variant=drop))
        elif thing.kind in CHAIRS and taken:
            pulled_out = _shifted(thing.pose, np.array([0.0, PULLED_OUT_M, shift[2]]))
            later.append(replace(thing, kind="taken_chair", pose=pulled_out))
        elif not (thing.moves and moved):
            later.append(thing)
        elif thing.kind in CHAIRS:
            elsewhere = _shifted(thing.pose, shift * (*CHAIR_MOVES_M, CHAIR_TURNS_RAD))
            later.append(replace(thing, kind="taken_chair" if seated else "chair", pose=elsewhere))
        elif not gone:
            slid = shift.clip(-1.0, 1.0) * (*OBJECT_MOVES_M, OBJECT_TURNS_RAD)
            later.append(replace(thing, pose=_shifted(thing.pose, slid)))
    return later


def _shifted(pose: tuple[float, float, float], shift: Floats) -> tuple[float, float, float]:
    """A pose moved in its own frame."""
    x, y, yaw = compose(pose, shift)
    return float(x), float(y), float(yaw)


def off_the_path(things: Sequence[Thing], legs: Floats, gap_m: float) -> list[Thing]:
    """Chairs and who sits on them pushed away from the lines that the robot drives along.

    Args:
        things: all that stands about.
        legs: (L, 4) lines between neighbouring places, x0, y0, x1, y1 [m].
        gap_m: least distance of the middle of a chair from a line [m].
    """
    steps = np.linspace(0.0, 1.0, 21)[:, None, None]
    line = (legs[:, :2] + steps * (legs[:, 2:] - legs[:, :2])).reshape(-1, 2)
    return [_pushed(thing, line, gap_m) if thing.kind in CHAIRS else thing for thing in things]


def _pushed(thing: Thing, line: Floats, gap_m: float) -> Thing:
    """One thing pushed away from the points (P, 2) of the path."""
    best, farthest = thing, 0.0
    for _ in range(MOST_PUSHES):  # away from one line may be towards another
        away = np.array(thing.pose[:2]) - line
        distance = np.linalg.norm(away, axis=1)
        nearest = int(distance.argmin())
        if distance[nearest] > farthest:
            best, farthest = thing, float(distance[nearest])
        if farthest >= gap_m - 1e-9:
            break
        x, y = line[nearest] + away[nearest] / max(float(distance[nearest]), 1e-6) * gap_m
        thing = replace(thing, pose=(float(x), float(y), thing.pose[2]))
    return best
