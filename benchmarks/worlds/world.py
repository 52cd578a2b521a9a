"""What every simulated world has in common: a map made at one moment, and a drive at another."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.drive import Route, drive, frames_per_tour, wander
from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.light import tint_at
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.odometer import odometer, on_grille
from benchmarks.worlds.people import crowd, present
from benchmarks.worlds.renderer import EYE_M, Faces, Scene, Shake, focal_length, render_depth, render_frame, right_of
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.snapshots import first_column_heading, panorama_of
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.recording import LazyImages
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import DEPTH_UNITS_PER_M, Depth, Frame, Image, Ints, Pixels

SECONDS_PER_FRAME = 1.0
"""Between two frames [s]."""
LONGEST_CARRY = 4
"""On a random route the robot may be carried on this many times as far as asked for."""
OPEN_ENOUGH = 0.9
"""How far doors must stand open where the way leads through them."""
KIDNAP_COVERED = 2
"""Frames during which the camera is covered while the robot is carried."""
AGED_GLARE = 0.1
"""Glare that the sun adds when it has come round to the other windows, as a share of the picture's light."""


class Place(NamedTuple):
    """A node to be: id, name for people, x, y [m]."""

    id: str
    name: str
    x: float
    y: float


@dataclass(frozen=True)
class Simulation:
    """What a simulated drive gives.

    Attributes:
        topo_map: what the robot knows beforehand.
        frames: what it has at each moment; their pictures are rendered when first looked at.
        truth: (N, 3) poses of the robot's axis of rotation, map frame.
    """

    topo_map: TopoMap
    frames: Sequence[Frame]
    truth: Floats


@dataclass(frozen=True)
class Shot:
    """All that a frame's pictures depend on.

    Attributes:
        scene: what there is to see.
        people: who stands before it.
        pose: (3,) of the camera [m, m, rad].
        shake_px: standard deviation of the horizon, rows of the thesis's camera, 384 x 288 and 40 degrees wide.
        covered: whether the camera is.
        still: whether the robot stands, so that nothing is streaked.
        seed, number: of the world and of the frame, whose own chances they fix: frames may be rendered in any order.
    """

    scene: Scene
    people: Sequence[Faces]
    pose: Floats
    shake_px: float
    covered: bool
    still: bool
    seed: int
    number: int

    def view(self) -> Scene:
        """All that there is to see."""
        seen = self.scene
        for faces in self.people:
            seen = seen.with_faces(faces)
        return seen


class World(ABC):
    """A simulated world: subclasses say what stands in it, where its places are, and where one drives.

    Args:
        config: what happens; None takes the defaults.

    Raises:
        ValueError: the settings do not suit each other or the world.
    """

    Config: ClassVar[type[WorldSettings]] = WorldSettings
    title: ClassVar[str]
    """Name of the map."""
    camera: ClassVar[Camera] = Camera()

    def __init__(self, config: Any = None) -> None:
        self.config: Any = self.Config() if config is None else config
        self.config.check_events(self.frame_count)
        if self.gates() is not None and self.config.doors < OPEN_ENOUGH:
            raise ValueError(f"doors is {self.config.doors}; the robot drives through them: {OPEN_ENOUGH} to 1")

    @property
    @abstractmethod
    def places(self) -> Sequence[Place]:
        """The nodes of the map."""

    @property
    @abstractmethod
    def tour(self) -> Sequence[int]:
        """Indices of the places in the order of the usual round, which closes with the first."""

    @abstractmethod
    def scene(self, seed: int, moment: Moment) -> Scene:
        """What there is to see; the same seed is the same building, at any moment."""

    def edges(self) -> Ints | None:
        """Pairs (E, 2) of places that are joined; None joins near ones."""
        return None

    def pace(self, positions: Floats) -> Floats:
        """How much farther apart than usual frames are, a factor (N,), at positions (N, 2)."""
        return np.ones(len(positions))

    def gates(self) -> Floats | None:
        """Middles (G, 2) of the doorways that the robot drives through [m]."""
        return None

    def mapped_at(self, place: int) -> Moment:
        """How the world was when this place's panorama was taken."""
        return Moment()

    @property
    def positions(self) -> Floats:
        """(K, 2) of the places [m]."""
        return np.array([(place.x, place.y) for place in self.places])

    @property
    def mount(self) -> Floats:
        """(3,) pose of the camera on the robot, looking ahead [m, m, rad]."""
        return np.array([self.config.camera_ahead_m, 0.0, 0.0])

    @property
    def route(self) -> Route:
        """How the robot drives around the nodes."""
        route: Route = self.config.route
        return route

    @property
    def view_rad(self) -> float:
        """How wide the camera sees [rad]."""
        return float(np.deg2rad(self.camera.hfov_deg))

    @cached_property
    def frames_per_lap(self) -> float:
        """Frames of one round of the tour."""
        return frames_per_tour(self.positions[list(self.tour)], self.route, self.pace)

    @property
    def frame_count(self) -> int:
        """Number of frames of the drive."""
        return int(self.config.updates or round(self.config.laps * self.frames_per_lap))

    def topo_map(self, seed: int) -> TopoMap:
        """The map that was made before the drive: a panorama on every place."""
        heading, config, nodes = first_column_heading(self.camera), self.config, []
        for number, place in enumerate(self.places):
            moment, rng = self.mapped_at(number), generator(seed, Stream.MAP, number)
            panorama = panorama_of(
                self.scene(seed, moment),
                np.array([place.x, place.y]),
                self.camera,
                rng,
                self.mount,
                config.scan,
                effects_at(config.effects, moment),
                tint_at(moment),
            )
            nodes.append(Node(*place, heading, panorama))
        return replace(self.layout(), nodes=tuple(nodes))

    def layout(self) -> TopoMap:
        """The map without any picture."""
        nodes = tuple(Node(*place) for place in self.places)
        return TopoMap(f"{self.title} (simulated)", self.camera, nodes, self.edges())

    def simulate(self, seed: int) -> Simulation:
        """A map, a drive and its truth; the same seed gives the same bytes.

        Args:
            seed: of the building, the panoramas, the drive and every frame.
        """
        return Simulation(self.topo_map(seed), *self.film(seed))

    def film(self, seed: int) -> tuple[Sequence[Frame], Floats]:
        """The frames of the drive and the true poses (N, 3) of the robot's axis, without making the map."""
        return _film(self, seed)

    def drive(self, seed: int) -> tuple[Floats, Floats]:
        """What the odometer says, and the truth, (N, 3) each, of the drive that ``film`` takes pictures on."""
        return _driven(self, seed)[:2]

    def pans(self, frames: int) -> Floats:
        """Angle (N,) of the pan head at each frame [rad, ccw]."""
        return np.zeros(frames)

    def readers(self, shot: Shot) -> Mapping[str, Callable[[], Pixels]]:
        """What makes a frame's pictures, by kind."""
        readers: dict[str, Callable[[], Pixels]] = {"rgb": partial(self._picture, shot, 0)}
        if self.config.stereo_baseline_m > 0.0:
            readers["right"] = partial(self._picture, shot, 1)
        if self.config.depth:
            readers["depth"] = partial(self._depth, shot)
        return readers

    def _picture(self, shot: Shot, eye: int) -> Image:
        """What the left (0) or right (1) camera gives, (height, width, 3)."""
        rng = generator(shot.seed, Stream.FRAME, shot.number)  # one camera body: both eyes expose and move alike
        noise = generator(shot.seed, Stream.NOISE, shot.number, eye)
        pose = right_of(shot.pose, self.config.stereo_baseline_m) if eye else shot.pose
        moment = self.config.now()
        if shot.covered:
            image = covered_picture((self.camera.height, self.camera.width), noise)
        else:
            frame = render_frame(shot.view(), pose, self.camera, EYE_M, shake_of(shot, self.camera))
            image = sense(frame, effects_at(self.config.effects, moment), rng, tint_at(moment), shot.still, noise)
        image.setflags(write=False)
        return image

    def _depth(self, shot: Shot) -> Depth:
        """True depth (height, width), uint16, ``DEPTH_UNITS_PER_M`` a metre.

        Unknown, 0, is what lies beyond the 13 m that 16 bits hold, and all that a covered camera does not see.
        """
        metres = render_depth(shot.view(), shot.pose, self.camera, EYE_M, shake_of(shot, self.camera))
        units = np.round(metres * DEPTH_UNITS_PER_M)
        image = np.where((units < 2**16) & (not shot.covered), units, 0.0).astype(np.uint16)
        image.setflags(write=False)
        return image


def shake_of(shot: Shot, camera: Camera) -> Shake:
    """How the camera points beside where its pose says: one body, so the same for both eyes and for depth."""
    shake_px = shot.shake_px * focal_length(camera) / focal_length(Camera())
    down, aside, roll = generator(shot.seed, Stream.SHAKE, shot.number).normal(0.0, shake_px, 3) * (1.0, 0.7, 0.7)
    return Shake(down, aside, roll)


def covered_picture(shape: tuple[int, int], rng: np.random.Generator) -> Image:
    """What a covered camera gives: darkness and noise, (rows, cols, 3)."""
    dark = np.full((*shape, 3), 6, dtype=np.uint8)
    return sense(dark, replace(SensorEffects.none(), noise_grey=1.0), rng)


def effects_at(effects: SensorEffects, moment: Moment) -> SensorEffects:
    """The errors of the sensor at a moment: a low sun glares."""
    return replace(effects, glare=min(1.0, effects.glare + AGED_GLARE * moment.age))


def _advances(config: WorldSettings, frames: int, carried: int) -> Ints:
    """How many frames of the usual path lie between each frame (N,) and the one before it."""
    advance = np.ones(frames, dtype=np.int64)
    advance[0] = 0
    if config.kidnap_at >= 0:
        advance[config.kidnap_at + 1 : config.kidnap_at + KIDNAP_COVERED] = 0  # put down, and not yet seeing
    if config.turned_at >= 0:
        advance[config.turned_at : config.turned_at + 2] = 0  # turned where it stood, then it turns back by itself
    if config.kidnap_at >= 0:
        advance[config.kidnap_at] = carried
    return advance


def _far_enough(path: Floats, start: int, least: int) -> int:
    """How many frames on, ``least`` or more, a random path (P, 3) leads half as far away as it ever does.

    A random walk may be back where it was: that would be no kidnapping.
    """
    away = np.linalg.norm(path[start + least :, :2] - path[max(start - 1, 0), :2], axis=1)
    return least + int(np.argmax(away >= 0.5 * away.max()))


def _true_path(world: World, rng: np.random.Generator) -> tuple[Floats, Floats]:
    """True poses (N, 3), and their steps (N - 1, 3) as far as the wheels turn."""
    config, frames = world.config, world.frame_count
    carried = round(config.kidnap_laps * world.frames_per_lap) if config.kidnap_at >= 0 else 0
    path = _whole_path(world, frames + (LONGEST_CARRY if world.route.random else 1) * carried, rng)
    if carried and world.route.random:
        carried = _far_enough(path, config.kidnap_at, carried)
    truth = path[np.cumsum(_advances(config, frames, carried))]
    if config.turned_at >= 0:
        truth[config.turned_at, 2] = wrap(truth[config.turned_at, 2] + np.deg2rad(config.turned_deg))
    steps = between(truth[:-1], truth[1:])
    for event in (config.kidnap_at, config.turned_at):
        if event > 0:
            steps[event - 1] = 0.0
    return truth, steps


def _whole_path(world: World, frames: int, rng: np.random.Generator) -> Floats:
    """Poses (frames, 3) along the tour or at random."""
    route, tour = world.route, list(world.tour)
    if not route.random:
        return drive(world.positions[tour], frames, rng, route, world.pace, world.gates())
    pairs = np.asarray(world.layout().edges)
    both = np.concatenate([pairs, pairs[:, ::-1]])
    neighbours = [both[both[:, 0] == node, 1] for node in range(len(world.places))]
    return wander(world.positions, neighbours, tour[0], frames, rng, route, world.pace, world.gates())


def _driven(world: World, seed: int) -> tuple[Floats, Floats, Floats, NDArray[np.bool_]]:
    """Odometer readings (N, 3), true poses (N, 3), steps (N - 1, 3) of the wheels, and which cross a grille."""
    drift, rng = world.config.drift, generator(seed, Stream.ODOMETER)
    truth, steps = _true_path(world, generator(seed, Stream.PATH))
    start = np.array([*rng.uniform(-5.0, 5.0, 2), rng.uniform(-np.pi, np.pi)])
    grille = on_grille(truth, drift.grille_spacing_m)
    return odometer(steps, start, drift, rng, grille), truth, steps, grille


def _covered(config: WorldSettings, frames: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Which frames (N,) show nothing."""
    covered = present(config.covered_share, frames, rng)
    covered[list(config.covered)] = True
    if config.kidnap_at >= 0:
        covered[config.kidnap_at : config.kidnap_at + KIDNAP_COVERED] = True
    return covered


def _film(world: World, seed: int) -> tuple[Sequence[Frame], Floats]:
    """See ``World.film``."""
    config, frames = world.config, world.frame_count
    scene = world.scene(seed, config.now())
    readings, truth, steps, grille = _driven(world, seed)
    covered = _covered(config, frames, generator(seed, Stream.COVER))
    shakes = _shakes(config, steps, grille)
    mounts = np.tile(world.mount, (frames, 1))
    mounts[:, 2] = wrap(mounts[:, 2] + world.pans(frames))
    cameras = compose(truth, mounts)
    people = crowd(config.people, cameras, scene, world.view_rad / 2.0, seed, generator(seed, Stream.PEOPLE))
    taken = []
    for number, pose in enumerate(cameras):
        still = number == 0 or not steps[number - 1].any()
        dark = bool(covered[number])
        shot = Shot(scene, people[number], pose, float(shakes[number]), dark, still, seed, number)
        images = LazyImages(world.readers(shot))
        taken.append(Frame(number * SECONDS_PER_FRAME, readings[number], mounts[number], images))
    return tuple(taken), truth


def _shakes(config: WorldSettings, steps: Floats, grille: NDArray[np.bool_]) -> Floats:
    """Standard deviation (N,) of the horizon at each frame [rows]: the robot has moved there in its last step."""
    turned = np.linalg.norm(steps[:, :2], axis=1) == 0.0
    shake = np.where(turned, config.turning_shake_px, config.shake_px)
    shake = np.hypot(shake, config.grille_shake_px * grille)
    return np.concatenate([[config.shake_px], shake])
