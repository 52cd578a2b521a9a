"""A simulated robot that stands where it is and looks around, for active localization (second seed, 6.1)."""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.world import Shot, World
from topoloc.active import ORIENTATIONS, Action
from topoloc.geometry import Floats, compose, wrap
from topoloc.recording import LazyImages
from topoloc.types import Frame

UNSEEN_TURN = -0.018
"""Share of a turn that the odometer errs by, as in ``benchmarks.worlds.odometer.Drift``."""
FIRST_NUMBER = 10_000
"""Frames of standing robots are numbered from here on: other chances than a drive's."""


class StandingRobot:
    """A simulated robot that turns, or turns its camera, where it stands.

    Args:
        world: that it stands in.
        seed, number: of the world, and of the robot in it.
        pose: (3,) true pose at the start.

    Attributes:
        truth: (3,) that pose.
        mount: (3,) pose of the camera on the robot while it looks ahead.
    """

    def __init__(self, world: World, seed: int, number: int, pose: Floats) -> None:
        self._world, self._seed, self._number = world, seed, number
        self.truth, self.mount = pose, world.mount
        self._scene = world.scene(seed, world.config.now())
        self._pose, self._odometry = pose, np.zeros(3)

    def look(self, action: Action) -> Frame:
        """Turn, or turn the camera, and take a frame; the same look is the same picture."""
        self._pose = compose(self._pose, action.motion)
        self._odometry = compose(self._odometry, action.motion * (1.0 + UNSEEN_TURN))
        camera = compose(self._pose, action.camera)
        step = round(float(wrap(camera[2] - self.truth[2])) / (2.0 * np.pi) * ORIENTATIONS) % ORIENTATIONS
        time = float(self._number * ORIENTATIONS + step)  # one for each orientation
        pixels = self._world.config.turning_shake_px
        shot = Shot(self._scene, (), camera, pixels, False, True, self._seed, FIRST_NUMBER + round(time))
        return Frame(time, self._odometry, action.camera, LazyImages(self._world.readers(shot)))
