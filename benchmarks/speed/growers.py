"""What is measured as it grows: sensors and estimators by nodes, the particle filter by particles, the grid by cells.

Maps are regular grids of nodes a metre apart; pictures are noise drawn from a seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import fields, replace
from functools import partial
from itertools import cycle
from math import isqrt

import numpy as np

from benchmarks.speed.grid import Hall
from benchmarks.speed.growth import Grower, SetUp, Step
from benchmarks.speed.particle_step import HALL, MOTION, SEEN
from benchmarks.speed.pictures import noise_pictures
from estimators.activity import ActivityTracker
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter
from sensors.histogram import ColorHistogram
from sensors.ima import IMA, IMAConfig
from sensors.pca import PCAMap
from topoloc.geometry import between
from topoloc.interfaces import Estimator, Sensor
from topoloc.plugins import make_sensor
from topoloc.testing import evidence_for, toy_map
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Evidence, Frame, Image, Motion

NODES = (8, 30, 100, 300, 1_000, 3_000, 10_000)
PARTICLES = (100, 1_000, 10_000, 100_000, 1_000_000)
LAYERS = 24
CELLS = tuple(LAYERS * side**2 for side in (20, 65, 204, 645))
"""Of square halls, all headings counted: 9,600 to 9,984,600."""
CANDIDATES = 100
"""Of the coarse stage of IMA."""
CIRCLE_CAMERA, VIEW_CAMERA = Camera(40.0, 72, 54), Camera(60.0, 64, 48)
"""As small as IMA scales its pictures, and of the size of the third seed's views."""
VIEWS = 4
"""Of a node, one each way."""
LOOKS = 5
"""Different frames that come round again."""
ROUND = 12
"""Steps of the robot around a circle of 1 m radius in the middle of the map."""


def growers() -> tuple[Grower, ...]:
    """All of them; the coarse stage of IMA as far as there is one."""
    sensors: list[tuple[str, Callable[[], Sensor], Callable[[int], tuple[TopoMap, Image]]]] = [
        ("ima", IMA, panoramas),
        ("pca", PCAMap, views),
        ("histogram", ColorHistogram, views),
    ]
    if "candidates" in (field.name for field in fields(IMAConfig)):
        coarse = partial(make_sensor, "ima", {"candidates": CANDIDATES})
        sensors.insert(1, (f"ima, {CANDIDATES} candidates", coarse, panoramas))
    estimators: list[tuple[str, Callable[[], Estimator]]] = [
        ("activity", ActivityTracker),
        ("grid", MarkovGrid),
        ("particle, 1,000 particles", ParticleFilter),
    ]
    return (
        *(Grower(name, "nodes", NODES, partial(_looks, make, pictured)) for name, make, pictured in sensors),
        *(Grower(name, "nodes", NODES, partial(_updates, make)) for name, make in estimators),
        Grower("particle, 10 hypotheses", "particles", PARTICLES, _particles),
        Grower("grid, 10 hypotheses", "cells", CELLS, _cells),
    )


def panoramas(count: int) -> tuple[TopoMap, Image]:
    """A map of so many panoramas, and frames (LOOKS, rows, columns) that show some of them."""
    rng, columns = np.random.default_rng(count), CIRCLE_CAMERA.panorama_columns()
    circles = noise_pictures(rng, count, CIRCLE_CAMERA.height, columns)
    nodes = [Node(str(k), str(k), *place, 0.0, circles[k]) for k, place in enumerate(_places(count))]
    shown = circles[rng.integers(0, count, LOOKS), :, : CIRCLE_CAMERA.width]
    return TopoMap("noise", CIRCLE_CAMERA, tuple(nodes)), _seen(shown, rng)


def views(count: int) -> tuple[TopoMap, Image]:
    """A map of so many nodes with ``VIEWS`` views each, and frames (LOOKS, rows, columns, 3) that show some of them."""
    rng, places = np.random.default_rng(count), _places(count)
    pictures = noise_pictures(rng, VIEWS * count, VIEW_CAMERA.height, VIEW_CAMERA.width, channels=3)
    poses = [np.array([*place, 2.0 * np.pi * turn / VIEWS - np.pi]) for place in places for turn in range(VIEWS)]
    nodes = tuple(Node(str(k), str(k), *place) for k, place in enumerate(places))
    made = tuple(View(pose, picture) for pose, picture in zip(poses, pictures, strict=True))
    shown = pictures[rng.integers(0, len(pictures), LOOKS)]
    return TopoMap("noise", VIEW_CAMERA, nodes, views=made), _seen(shown, rng)


def _seen(shown: Image, rng: np.random.Generator) -> Image:
    """Pictures as a camera sees them again: with less contrast, and noisy."""
    noisy = 20.0 + 0.7 * shown + rng.normal(0.0, 5.0, shown.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _places(count: int) -> list[tuple[float, float]]:
    side = isqrt(count - 1) + 1
    return [(float(k % side), float(k // side)) for k in range(count)]


def _looks(make: Callable[[], Sensor], pictured: Callable[[int], tuple[TopoMap, Image]], count: int) -> SetUp:
    topo_map, pictures = pictured(count)
    frames = [Frame(0.0, None, np.zeros(3), {"rgb": picture}) for picture in pictures]

    def set_up() -> Step:
        sensor, again = make(), cycle(frames)
        sensor.fit(topo_map)
        return lambda: sensor.observe(next(again))

    return set_up


def _updates(make: Callable[[], Estimator], count: int) -> SetUp:
    """On a map of so many nodes, with evidence of a hypothesis a node."""
    columns = next(side for side in range(isqrt(count - 1) + 1, count + 1) if count % side == 0)
    topo_map = toy_map(columns, count // columns)
    angles = 2.0 * np.pi * np.arange(ROUND) / ROUND
    middle = topo_map.positions.mean(axis=0)
    truth = np.column_stack([middle[0] + np.cos(angles), middle[1] + np.sin(angles), angles + 0.5 * np.pi])
    seen = [evidence_for(topo_map, pose) for pose in truth]
    motion = Motion(between(truth[0], truth[1]), np.diag([0.05, 0.05, 0.05]) ** 2)
    return _stepping(make, topo_map, motion, seen)


def _particles(count: int) -> SetUp:
    return _stepping(lambda: ParticleFilter(ParticleFilter.Config(particles=count)), HALL, MOTION, SEEN)


def _cells(count: int) -> SetUp:
    side = isqrt(count // LAYERS)
    hall = Hall(side, side, LAYERS)
    config = MarkovGrid.Config(resolution_m=hall.resolution_m, reach_m=hall.resolution_m, headings=LAYERS)
    return _stepping(lambda: MarkovGrid(config), hall.topo_map, hall.motion, [hall.seen])


def _stepping(make: Callable[[], Estimator], topo_map: TopoMap, motion: Motion, seen: Sequence[Evidence]) -> SetUp:
    """Predict and update; what is seen comes round again, but as new evidence, of which nothing is prepared yet."""

    def set_up() -> Step:
        estimator, again = make(), cycle(seen)
        estimator.reset(topo_map, np.random.default_rng(0))

        def step() -> None:
            estimator.predict(motion)
            estimator.update(replace(next(again)))

        return step

    return set_up
