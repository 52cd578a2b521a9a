"""A drive through the simulated laboratory: the map with its panoramas, the robot's frames, and the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import ndtri

from benchmarks.worlds.drive import Drift, Route, drive, odometer
from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.lab import NODES, lab_scene, person
from benchmarks.worlds.renderer import EYE_M, Scene, Shake, render_frame
from benchmarks.worlds.snapshots import first_column_heading, panorama_of
from topoloc.geometry import Floats, between, compose
from topoloc.recording import LazyImages
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

FRAMES_PER_LAP = 24.5
KIDNAP_COVERED = 2
"""Frames during which the camera is covered while the robot is carried."""
PEOPLE_LINGER = 0.7
"""Correlation of people's presence from one frame to the next."""
SECONDS_PER_FRAME = 1.0
MOST_FRAMES = 100_000


@dataclass(frozen=True)
class LabSettings:
    """What happens in the laboratory.

    Attributes:
        laps: rounds driven, about 24.5 frames each; ``updates`` overrules it.
        updates: number of frames; 0 takes ``laps``.
        kidnap_at: index of the frame at which the robot is carried half a lap on, its camera covered for two frames,
            and the odometer knows nothing; -1 never.
        covered: indices of frames with a covered camera.
        people: share of the frames with someone in view, 0 to 1; they stay for some frames.
        age: change since the map was made, 0 to 1: light from another side, chairs and small things moved.
        shake_px: standard deviation of the horizon while driving, rows of 288; sideways it is 0.7 of that.
        snapshot_shake_px: the same from snapshot to snapshot of a panorama: the robot stands, but has just braked.
        placement_noise_columns: standard deviation of a snapshot's place in a panorama, columns of 72 a frame.
        camera_ahead_m: camera ahead of the axis of rotation, metres.
        effects: errors of the sensor.
        route: how the robot drives around the nodes.
        drift: errors of the odometer.
    """

    laps: float = 3.0
    updates: int = 0
    kidnap_at: int = -1
    covered: tuple[int, ...] = ()
    people: float = 0.0
    age: float = 0.0
    shake_px: float = 4.0
    snapshot_shake_px: float = 2.0
    placement_noise_columns: float = 0.7
    camera_ahead_m: float = 0.10
    effects: SensorEffects = field(default_factory=SensorEffects)
    route: Route = field(default_factory=Route)
    drift: Drift = field(default_factory=Drift)

    def __post_init__(self) -> None:
        for name in ("people", "age"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and 1")
        for name in ("shake_px", "snapshot_shake_px", "placement_noise_columns"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative")
        if not (np.isfinite(self.laps) and self.frames <= MOST_FRAMES):
            raise ValueError(f"laps {self.laps} and updates {self.updates} make more than {MOST_FRAMES} frames")
        if self.frames < 1:
            raise ValueError(f"laps {self.laps} and updates {self.updates} leave no frame")
        if not -1 <= self.kidnap_at < self.frames:
            raise ValueError(
                f"kidnap_at is {self.kidnap_at}; with {self.frames} frames it lies between -1 and the last"
            )
        if any(not 0 <= index < self.frames for index in self.covered):
            raise ValueError(f"covered is {self.covered}; with {self.frames} frames indices lie between 0 and the last")

    @property
    def frames(self) -> int:
        """Number of frames."""
        return self.updates or round(self.laps * FRAMES_PER_LAP)


@dataclass(frozen=True)
class Simulation:
    """What a simulated drive gives.

    Attributes:
        topo_map: nodes with panoramas.
        frames: what the robot has at each moment; their pictures are rendered when first looked at.
        truth: (N, 3) poses of the robot's axis of rotation, map frame.
    """

    topo_map: TopoMap
    frames: Sequence[Frame]
    truth: Floats


def _taken(
    scene: Scene, pose: Floats, camera: Camera, settings: LabSettings, covered: bool, seed: tuple[int, ...]
) -> Image:
    """The picture (height, width, 3) of a camera at ``pose`` (3,); its own seed makes the order irrelevant."""
    rng = np.random.default_rng(seed)
    down, aside, roll = rng.normal(0.0, settings.shake_px, 3) * (1.0, 0.7, 0.7)
    if covered:
        dark = np.full((camera.height, camera.width, 3), 6, dtype=np.uint8)
        image = sense(dark, SensorEffects(0.0, 1.0, 0.0, 0.0, 0.0), rng)
    else:
        frame = render_frame(scene, pose, camera, EYE_M, Shake(down, aside, roll))
        image = sense(frame, settings.effects, rng)
    image.setflags(write=False)
    return image


def _lab_map(scene: Scene, camera: Camera, mount: Floats, settings: LabSettings, seed: int) -> TopoMap:
    """The map: eight nodes, each with the panorama taken on it."""
    heading = first_column_heading(camera)
    nodes = [
        Node(
            name,
            label,
            x,
            y,
            heading,
            panorama_of(
                scene,
                np.array([x, y]),
                camera,
                np.random.default_rng([seed, 4, number]),
                mount,
                settings.placement_noise_columns,
                settings.effects,
                settings.snapshot_shake_px,
            ),
        )
        for number, (name, label, x, y) in enumerate(NODES)
    ]
    return TopoMap("laboratory (simulated)", camera, tuple(nodes))


def _drive(settings: LabSettings, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """True poses (N, 3) and odometer readings (N, 3)."""
    frames, kidnap = settings.frames, settings.kidnap_at
    loop = np.array([node[2:] for node in NODES])
    carried = round(FRAMES_PER_LAP / 2.0)
    path = drive(loop, frames + (carried if kidnap >= 0 else 0), rng, settings.route)
    index = np.arange(frames)
    if kidnap >= 0:
        index[kidnap:] += carried
        index[kidnap + 1 :] -= KIDNAP_COVERED - 1  # it stands where it was put down until the camera is free
    truth = path[index]
    steps = between(truth[:-1], truth[1:])
    if kidnap > 0:
        steps[kidnap - 1] = 0.0
    start = np.array([*rng.uniform(-5.0, 5.0, 2), rng.uniform(-np.pi, np.pi)])
    return truth, odometer(steps, start, settings.drift, rng)


def people_present(share: float, frames: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """In which frames (N,) someone stands: a share that is exact in the mean, in stays of some frames."""
    fresh = np.sqrt(1.0 - PEOPLE_LINGER**2) * rng.standard_normal(frames)
    fresh[0] = rng.standard_normal()
    wish = lfilter([1.0], [1.0, -PEOPLE_LINGER], fresh)  # a standard normal at every frame
    return np.asarray(wish < ndtri(share))


def _with_person(scene: Scene, camera: Camera, pose: Floats, seed: int, rng: np.random.Generator) -> Scene:
    """The scene with someone 0.7 to 2 m in front of a camera at ``pose``."""
    half = np.tan(np.deg2rad(camera.hfov_deg) / 2.0)
    distance = rng.uniform(0.7, 2.0)
    at = compose(pose, (distance, distance * half * rng.uniform(-0.85, 0.85), 0.0))
    return scene.with_faces(person(seed, at[:2], float(rng.uniform(-np.pi, np.pi)), int(rng.integers(8))))


def simulate(settings: LabSettings | None = None, seed: int = 0) -> Simulation:
    """Drive through the laboratory.

    Args:
        settings: what happens; None is a fresh map and three laps.
        seed: of the room, the panoramas, the drive and every frame; the same seed gives the same bytes.
    """
    settings, camera = settings or LabSettings(), Camera()
    mount = np.array([settings.camera_ahead_m, 0.0, 0.0])
    then = lab_scene(seed)
    now = lab_scene(seed, settings.age)
    topo_map = _lab_map(then, camera, mount, settings, seed)
    rng = np.random.default_rng([seed, 5])
    truth, readings = _drive(settings, rng)
    someone = people_present(settings.people, settings.frames, rng)
    kidnap = settings.kidnap_at
    dark = set(settings.covered) | (set(range(kidnap, kidnap + KIDNAP_COVERED)) if kidnap >= 0 else set())
    frames = []
    for number, (pose, reading) in enumerate(zip(compose(truth, mount), readings, strict=True)):
        own = np.random.default_rng([seed, 6, number])
        scene = _with_person(now, camera, pose, seed, own) if someone[number] else now
        render = partial(_taken, scene, pose, camera, settings, number in dark, (seed, 7, number))
        frames.append(Frame(number * SECONDS_PER_FRAME, reading, mount, LazyImages({"rgb": render})))
    return Simulation(topo_map, tuple(frames), truth)
