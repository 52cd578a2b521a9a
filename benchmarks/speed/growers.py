"""What is measured as it grows: sensors and estimators by nodes, the particle filter by particles, the grid by cells.

Maps are regular grids of nodes a metre apart; pictures are noise drawn from a seed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import cycle
from math import isqrt

import numpy as np

from benchmarks.speed.grid import Hall
from benchmarks.speed.growth import BUDGET_S, Grower, SetUp, Step
from benchmarks.speed.particle_step import HALL, MOTION, SEEN
from benchmarks.speed.pictures import noise_pictures
from estimators.activity import ActivityTracker
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter
from sensors.fourier import FourierSignature
from sensors.histogram import ColorHistogram
from sensors.ima import IMA, IMAConfig
from sensors.pca import PCAMap
from topoloc.geometry import between
from topoloc.interfaces import Estimator, Sensor
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
ROOM_MB = 6000.0
"""That exact IMA may keep, so that on no map here it makes anything anew [MB]."""
IMA_BUDGET_S = 25.0
"""By default [s], so that IMA reaches 3,000 nodes."""
CIRCLE_CAMERA, VIEW_CAMERA = Camera(40.0, 72, 54), Camera(60.0, 64, 48)
"""As small as IMA scales its pictures, and of the size of the third seed's views."""
OMNI_CAMERA = Camera(45.0, 32, 56)
"""Its panoramas have the 256 columns that ``fourier`` scales to, so that frames are full circles of the same size."""
VIEWS = 4
"""Of a node, one each way."""
LOOKS = 5
"""Different frames that come round again."""
ROUND = 12
"""Steps of the robot around a circle of 1 m radius in the middle of the map."""


def growers() -> tuple[Grower, ...]:
    """All of them."""
    exact, coarse = IMAConfig(memory_mb=ROOM_MB), IMAConfig(candidates=CANDIDATES)
    sensors: list[tuple[str, Callable[[], Sensor], Pictured, float]] = [
        (f"ima, memory_mb {ROOM_MB:.0f}", partial(IMA, exact), panoramas, IMA_BUDGET_S),
        (f"ima, {CANDIDATES} candidates", partial(IMA, coarse), panoramas, IMA_BUDGET_S),
        ("pca", PCAMap, views, BUDGET_S),
        ("histogram", ColorHistogram, views, BUDGET_S),
        ("fourier", FourierSignature, circles, BUDGET_S),
    ]
    estimators: list[tuple[str, Callable[[], Estimator]]] = [
        ("activity", ActivityTracker),
        ("grid", MarkovGrid),
        ("particle, 1,000 particles", ParticleFilter),
    ]
    return (
        *(Grower(name, "nodes", NODES, partial(_looks, make, made), budget) for name, make, made, budget in sensors),
        *(Grower(name, "nodes", NODES, partial(_updates, make)) for name, make in estimators),
        Grower("particle, 10 hypotheses", "particles", PARTICLES, _particles),
        Grower("grid, 10 hypotheses", "cells", CELLS, _cells),
    )


@dataclass(frozen=True)
class Pictures:
    """A map, and what a robot sees on it.

    Attributes:
        topo_map: with panoramas or views.
        kind: of the frames, as in ``Frame.images``.
        frames: ``LOOKS`` pictures that show some of the map's.
    """

    topo_map: TopoMap
    kind: str
    frames: Image


Pictured = Callable[[int], Pictures]
"""Makes a map of so many nodes."""


def panoramas(count: int) -> Pictures:
    """A map of so many panoramas, and frames (LOOKS, rows, columns) that show a part of one."""
    rng = np.random.default_rng(count)
    topo_map, made = _map_of_panoramas(rng, count, CIRCLE_CAMERA, channels=1)
    shown = made[rng.integers(0, count, LOOKS), :, : CIRCLE_CAMERA.width]
    return Pictures(topo_map, "rgb", _seen(shown, rng))


def circles(count: int) -> Pictures:
    """A map of so many panoramas, and full circles (LOOKS, rows, columns, 3) as frames, turned."""
    rng = np.random.default_rng(count)
    topo_map, made = _map_of_panoramas(rng, count, OMNI_CAMERA, channels=3)
    shown = np.roll(made[rng.integers(0, count, LOOKS)], rng.integers(OMNI_CAMERA.panorama_columns()), axis=2)
    return Pictures(topo_map, "omni", _seen(shown, rng))


def _map_of_panoramas(rng: np.random.Generator, count: int, camera: Camera, channels: int) -> tuple[TopoMap, Image]:
    """The map, and its panoramas (K, rows, columns[, 3])."""
    made = noise_pictures(rng, count, camera.height, camera.panorama_columns(), channels)
    nodes = tuple(Node(str(k), str(k), *place, 0.0, made[k]) for k, place in enumerate(_places(count)))
    return TopoMap("noise", camera, nodes), made


def views(count: int) -> Pictures:
    """A map of so many nodes with ``VIEWS`` views each, and frames (LOOKS, rows, columns, 3) that show some of them."""
    rng, places = np.random.default_rng(count), _places(count)
    pictures = noise_pictures(rng, VIEWS * count, VIEW_CAMERA.height, VIEW_CAMERA.width, channels=3)
    poses = [np.array([*place, 2.0 * np.pi * turn / VIEWS - np.pi]) for place in places for turn in range(VIEWS)]
    nodes = tuple(Node(str(k), str(k), *place) for k, place in enumerate(places))
    made = tuple(View(pose, picture) for pose, picture in zip(poses, pictures, strict=True))
    shown = pictures[rng.integers(0, len(pictures), LOOKS)]
    return Pictures(TopoMap("noise", VIEW_CAMERA, nodes, views=made), "rgb", _seen(shown, rng))


def _seen(shown: Image, rng: np.random.Generator) -> Image:
    """Pictures as a camera sees them again: with less contrast, and noisy."""
    noisy = 20.0 + 0.7 * shown + rng.normal(0.0, 5.0, shown.shape)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def _places(count: int) -> list[tuple[float, float]]:
    side = isqrt(count - 1) + 1
    return [(float(k % side), float(k // side)) for k in range(count)]


def frames_of(pictures: Pictures) -> list[Frame]:
    """Of a robot that has its camera on its axis."""
    return [Frame(0.0, None, np.zeros(3), {pictures.kind: picture}) for picture in pictures.frames]


def _looks(make: Callable[[], Sensor], pictured: Pictured, count: int) -> SetUp:
    pictures = pictured(count)
    frames = frames_of(pictures)

    def set_up() -> Step:
        sensor, again = make(), cycle(frames)
        sensor.fit(pictures.topo_map)
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
