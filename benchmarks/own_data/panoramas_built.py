"""How panoramas of the same turns compare: frames placed by the poses, or by what they show."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from benchmarks.own_data.built import where_nodes_are
from benchmarks.own_data.driving import scan_of
from benchmarks.own_data.own_table import Figures, OwnTable, mean
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.robot import SimulatedRobot
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import World
from topoloc import localizer, plugins
from topoloc.geometry import Floats, wrap
from topoloc.mapping.building import BuildConfig, build_map
from topoloc.mapping.building.config import Poses
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap
from topoloc.types import Frame

SENSOR = "ima"
PLACED: tuple[tuple[Poses, Literal["headings", "circle"]], ...] = (
    ("truth", "headings"),
    ("truth", "circle"),
    ("odometry", "headings"),
    ("odometry", "circle"),
)
"""Source of the poses, and by what frames are placed."""
CAMERAS = {"on the axis": 0.0, "ahead": 0.1}
"""How far ahead of the axis the camera sits on the robot that scans and looks [m]."""
FRAMES_A_NODE, FARTHEST_M = 12, 0.1
"""So many fresh frames, each at random within so much of a node [m]."""
FRESH = 1
"""Number of the robot that looks: another one than that which scanned."""
CHANCE = 61
"""Of the measurements that worlds leave to chance."""


def measure(seed: int, kind: type[World] = LabWorld) -> Iterator[Figures]:
    """Each way to make the panoramas, then the world's own; both places of the camera side by side."""
    with TemporaryDirectory() as folder:
        sides = [_Side.of(where, kind, seed, Path(folder) / where) for where in CAMERAS]
        for poses, by in PLACED:
            config = BuildConfig(poses=poses, nodes="panoramas", panoramas=by)
            yield {name: value for side in sides for name, value in side.built(config).items()}
        yield {name: value for side in sides for name, value in side.own(seed).items()}


@dataclass(frozen=True)
class Look:
    """A fresh frame, the true pose (3,) of the robot, and the place (2,) that it is near."""

    frame: Frame
    pose: Floats
    place: Floats


@dataclass(frozen=True)
class _Side:
    """A world whose robots have their camera at one place, a scan in it, and fresh frames."""

    where: str
    world: World
    scan: Recording
    looks: Sequence[Look]

    @classmethod
    def of(cls, where: str, kind: type[World], seed: int, folder: Path) -> _Side:
        """The scan is written to a folder."""
        world = kind(WorldSettings(camera_ahead_m=CAMERAS[where]))
        return cls(where, world, scan_of(world, seed, folder), fresh(world, seed))

    def built(self, config: BuildConfig) -> Figures:
        """Of the map that is built from the scan."""
        topo_map = build_map(self.scan, config).topo_map
        return self._figures(topo_map, where_nodes_are(topo_map, self.scan))

    def own(self, seed: int) -> Figures:
        """Of the world's own map."""
        topo_map = self.world.topo_map(seed)
        return self._figures(topo_map, topo_map)

    def _figures(self, topo_map: TopoMap, there: TopoMap) -> Figures:
        off, match = compared(topo_map, there, self.looks)
        return {f"error, {self.where}": off, f"match, {self.where}": match}


def fresh(world: World, seed: int) -> list[Look]:
    """Frames of another robot around each place, with headings at random; their pictures are rendered once."""
    robot, looks = SimulatedRobot(world, seed, np.zeros(3), number=FRESH), []
    rng = generator(seed, Stream.MEASUREMENT, CHANCE)
    for place in world.positions:
        for _ in range(FRAMES_A_NODE):
            away, direction = FARTHEST_M * np.sqrt(rng.uniform()), rng.uniform(-np.pi, np.pi)
            at = place + away * np.array([np.cos(direction), np.sin(direction)])
            robot.carry_to((*at, rng.uniform(-np.pi, np.pi)))
            looks.append(Look(robot.look(), robot.pose, place))
    return looks


def compared(topo_map: TopoMap, there: TopoMap, looks: Sequence[Look]) -> tuple[float, float]:
    """Median heading error [degrees] beside the median at its node, and the mean match, both at the right node.

    A map of odometry is turned as a whole and bent, which is no fault of its panoramas: hence beside the median.

    Args:
        topo_map: with panoramas.
        there: the same nodes where they truly are.
        looks: near nodes.
    """
    sensor = plugins.make_sensor(SENSOR)
    sensor.fit(topo_map)
    nodes = there.nearest_node(np.array([one.place for one in looks]))
    errors, matches = np.empty(len(looks)), np.empty(len(looks))
    for number, (one, node) in enumerate(zip(looks, nodes, strict=True)):
        evidence, _ = localizer.look(sensor, one.frame)
        at_node = np.flatnonzero(evidence.nodes == node)
        best = at_node[evidence.match[at_node].argmax()]
        errors[number] = wrap(evidence.poses[best, 2] - one.pose[2])
        matches[number] = evidence.match[best]
    usual = np.array([np.median(errors[nodes == node]) for node in nodes])
    return float(np.rad2deg(np.median(np.abs(wrap(errors - usual))))), float(matches.mean())


PANORAMAS_BUILT = OwnTable(
    name="panoramas-built",
    page="maps.md",
    about=(
        f"Simulated laboratory, {FRAMES_A_NODE} fresh frames a node and seed, within {FARTHEST_M:g} m of it: median "
        f"heading error of `{SENSOR}` beside its median at the node, and mean match; a camera on the axis, and "
        f"{CAMERAS['ahead']:g} m ahead of it."
    ),
    seeds=(0, 1, 2),
    heads=("poses", "frames placed by"),
    rows=(*PLACED, ("the world's own", "")),
    columns={
        f"{what}, {where}": form for where in CAMERAS for what, form in (("error", mean(2, "°")), ("match", mean(3)))
    },
    measure=measure,
)
