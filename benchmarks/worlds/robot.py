"""A simulated robot that looks, turns and drives in a simulated world, for ``topoloc.behaviours``."""

from __future__ import annotations

from dataclasses import dataclass
from threading import Lock

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.odometer import odometer, on_grille
from benchmarks.worlds.world import SECONDS_PER_FRAME, Shot, World
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.recording import LazyImages
from topoloc.types import Frame

FIRST_NUMBER = 1_000_000
"""Frames of simulated robots are numbered from here on: no drive of a world has frames so late."""
NUMBERS = 100_000
"""And each robot has so many of them."""


@dataclass(frozen=True)
class Wheels:
    """How exactly the robot does what it is told (chosen here; the thesis says only that steps are very bad, 5.1.2).

    Attributes:
        turn_sd_deg: standard deviation of a turn on the spot, of whatever angle, degrees.
        turn_sd: the same as a share of the turn; the two add in quadrature.
        drive_sd: standard deviation of a distance, as a share of it.
    """

    turn_sd_deg: float = 1.0
    turn_sd: float = 0.1
    drive_sd: float = 0.03

    def __post_init__(self) -> None:
        for name in ("turn_sd_deg", "turn_sd", "drive_sd"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative, and finite")


class SimulatedRobot:
    """A ``topoloc.behaviours.MobileRobot`` in a world as it is now; simulated.

    Time passes only when the robot moves or is carried, ``SECONDS_PER_FRAME`` each time: to look twice from one place
    gives the same picture. So what behaviours in other threads see does not depend on how quick they are.

    All methods are safe in several threads: a look shows one of the places that the robot stops at.

    Args:
        world: its camera, effects, shake and odometer are the robot's too.
        seed: of the world.
        pose: (3,) true pose of its axis at the start, map frame [m, m, rad].
        wheels: how exactly it moves.
        number: of the robot in the world: another one has other chances.
    """

    def __init__(self, world: World, seed: int, pose: ArrayLike, wheels: Wheels | None = None, number: int = 0) -> None:
        self._world, self._seed, self._number = world, seed, number
        self._scene = world.scene(seed, world.config.now())
        self._wheels, self._rng = wheels or Wheels(), generator(seed, Stream.PATH, FIRST_NUMBER, number)
        self._lock = Lock()
        self._truth = [np.asarray(pose, dtype=np.float64)]
        self._steps: list[Floats] = []

    @property
    def pose(self) -> Floats:
        """(3,) true pose of its axis now, map frame [m, m, rad]."""
        with self._lock:
            return self._truth[-1]

    @property
    def time(self) -> float:
        """The robot's clock now [s]."""
        with self._lock:
            return self._time()

    def odometry(self) -> Floats:
        """(3,) raw pose of the odometer now, in its own frame [m, m, rad]."""
        with self._lock:
            return self._odometry()

    def look(self) -> Frame:
        """A frame of where the robot stands now; its pictures are rendered when first looked at."""
        with self._lock:
            config, count, mount = self._world.config, len(self._steps), self._world.mount
            still = count == 0 or not self._steps[-1][:2].any()
            shake = config.turning_shake_px if still else config.shake_px
            number = FIRST_NUMBER + self._number * NUMBERS + count
            camera = compose(self._truth[-1], mount)
            shot = Shot(self._scene, (), camera, shake, False, still, self._seed, number)
            return Frame(self._time(), self._odometry(), mount, LazyImages(self._world.readers(shot)))

    def turn(self, angle: float) -> None:
        """Turn on the spot by about so much [rad, ccw]."""
        spread = float(np.hypot(np.deg2rad(self._wheels.turn_sd_deg), self._wheels.turn_sd * angle))
        with self._lock:
            self._move(np.array([0.0, 0.0, angle + self._rng.normal(0.0, spread)]))

    def drive(self, distance: float) -> None:
        """Drive straight ahead by about so much [m]; backwards where negative. There are no obstacles."""
        with self._lock:
            self._move(np.array([distance * (1.0 + self._rng.normal(0.0, self._wheels.drive_sd)), 0.0, 0.0]))

    def drive_to(self, pose: ArrayLike) -> None:
        """Drive to a true pose (3,), as somebody who knows it steers the robot; the odometer errs all the same."""
        with self._lock:
            self._move(between(self._truth[-1], pose))

    def carry_to(self, pose: ArrayLike) -> None:
        """Put the robot at a true pose (3,): the wheels do not turn, the odometer knows nothing of it."""
        with self._lock:
            self._truth.append(np.asarray(pose, dtype=np.float64))
            self._steps.append(np.zeros(3))

    def _move(self, step: Floats) -> None:
        reached = compose(self._truth[-1], step)
        self._truth.append(reached)
        self._steps.append(np.array([step[0], step[1], float(wrap(step[2]))]))

    def _time(self) -> float:
        return len(self._steps) * SECONDS_PER_FRAME

    def _odometry(self) -> Floats:
        """All of the way again: ``odometer`` draws a longer drive so that it goes on as the shorter one was."""
        if not self._steps:
            return np.zeros(3)
        drift, truth = self._world.config.drift, np.stack(self._truth)
        rng = generator(self._seed, Stream.ODOMETER, FIRST_NUMBER, self._number)
        crossed = on_grille(truth, drift.grille_spacing_m)
        return np.asarray(odometer(np.stack(self._steps), np.zeros(3), drift, rng, crossed)[-1])
