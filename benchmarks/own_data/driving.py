"""Recordings of simulated robots on the disk, as an owner of a robot has them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from benchmarks.worlds.robot import SimulatedRobot
from benchmarks.worlds.world import World
from topoloc.geometry import Floats, wrap
from topoloc.recording import LazyImages, Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera
from topoloc.types import Frame

TURN_STEP = np.pi / 6.0
"""Between two frames of a robot that turns on the spot [rad]."""
STEPS_BETWEEN = 5
"""From node to node."""
FIRST_HEADING = np.pi / 2.0
"""Up the map, as the worlds' own scans begin [rad]."""


def drive_of(world: World, seed: int, folder: Path) -> Recording:
    """The drive of ``topoloc simulate``, written to a folder and read back."""
    return _recorded(zip(*world.film(seed), strict=True), world.camera, folder)


def scan_of(world: World, seed: int, folder: Path, turn_step: float = TURN_STEP) -> Recording:
    """A drive that passes the nodes of the tour exactly, and turns on each, written to a folder and read back."""
    poses = scan_poses(world.positions[list(world.tour)], turn_step)
    return _recorded(_driven(SimulatedRobot(world, seed, poses[0]), poses), world.camera, folder)


def part(recording: Recording, start: int, end: int | None = None) -> Recording:
    """Frames of a recording from one number up to another; its tracks stay whole."""
    pictures = {kind: listed[start:end] for kind, listed in recording.pictures.items()}
    return replace(recording, pictures=pictures)


def true_poses(recording: Recording) -> Floats:
    """(N, 3) true poses of the robot at the frames."""
    assert recording.truth is not None  # every simulated recording has them
    return np.array([recording.truth.at(picture.time) for picture in recording.pictures[recording.kind]])


def scan_poses(places: Floats, turn_step: float = TURN_STEP) -> Floats:
    """Poses (N, 3) round a tour of places (K, 2) and back to the first, ``turn_step`` [rad] apart in turns.

    On each place the robot turns full circle, clockwise; then it turns to the next one, the shorter way round, and
    drives there in ``STEPS_BETWEEN`` steps.
    """
    heading, poses = FIRST_HEADING, [np.array([*places[0], FIRST_HEADING])]
    for start, end in zip(places, np.roll(places, -1, axis=0), strict=True):
        ahead = float(np.arctan2(*(end - start)[::-1]))
        corner = float(wrap(ahead - heading))
        circle = heading - turn_step * np.arange(1, round(2.0 * np.pi / turn_step) + 1)
        turned = heading + corner * np.linspace(0.0, 1.0, int(np.ceil(abs(corner) / turn_step - 1e-9)) + 1)[1:]
        poses += [np.array([*start, wrap(angle)]) for angle in (*circle, *turned)]
        poses += [
            np.array([*(start + share * (end - start)), ahead]) for share in np.linspace(0, 1, STEPS_BETWEEN + 1)[1:]
        ]
        heading = ahead
    return np.array(poses)


def _driven(robot: SimulatedRobot, poses: Floats) -> Iterator[tuple[Frame, Floats]]:
    """What a robot that stands at the first of some poses (N, 3) sees on its way through them, and where it was."""
    yield robot.look(), poses[0]
    for pose in poses[1:]:
        robot.drive_to(pose)
        yield robot.look(), robot.pose


def _recorded(taken: Iterable[tuple[Frame, Floats]], camera: Camera, folder: Path) -> Recording:
    """Frames and true poses (3,), written to a folder and read back."""
    writer = RecordingWriter(folder, camera)
    for frame, pose in taken:
        writer.add(frame, pose)
        assert isinstance(frame.images, LazyImages)  # worlds render pictures when they are looked at
        frame.images.forget()
    writer.close()
    return Recording.load(folder)
