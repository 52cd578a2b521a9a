"""Groups of things as they stand in offices."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.worlds.builders import DESK_M, Thing
from topoloc.geometry import compose

FACES_DOWN, FACES_LEFT, FACES_UP, FACES_RIGHT = 0.0, -np.pi / 2.0, np.pi, np.pi / 2.0
"""Yaw of a thing that is turned to that side of the map."""
SEATED = 0.12
"""Share of the desks that someone sits at when the map is made."""
Pose = tuple[float, float, float]


def workplace(desk: Pose, number: int, rng: np.random.Generator) -> Iterator[Thing]:
    """A desk with its computer, a chair with or without someone on it, and what lies about."""

    def on(x: float, y: float, yaw: float = 0.0) -> Pose:
        pose = compose(desk, (x, y, yaw))
        return float(pose[0]), float(pose[1]), float(pose[2])

    side = float(rng.choice([-1.0, 1.0]))
    yield Thing("desk", desk, 0.0, number)
    yield Thing("monitor", on(side * rng.uniform(0.0, 0.25), 0.1, rng.normal(0.0, 0.15)), DESK_M)
    yield Thing("computer", on(side * rng.uniform(0.55, 0.68), 0.1), DESK_M)
    chair = on(rng.normal(0.0, 0.15), -0.4, rng.normal(0.0, 0.5))
    kind, who = "taken_chair" if rng.random() < SEATED else "chair", int(rng.integers(8))
    yield Thing(kind, chair, 0.0, who, True)
    clutter = rng.permutation(["papers", "books", "carton", "plant", "lamp", "telephone", "papers"])[:4]
    for kind, x in zip(clutter, (-0.66, -0.45, -0.3, -0.55), strict=True):
        y = float(rng.uniform(-0.25, 0.25))
        yield Thing(str(kind), on(side * x, y, rng.uniform(-0.6, 0.6)), DESK_M, int(rng.integers(8)), True)
