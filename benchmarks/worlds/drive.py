"""How the simulated robot drives around the nodes (thesis 5.2.3), and what its odometer says of it (5.2.1)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from topoloc.geometry import Floats, compose, rotate, wrap

FINE_M = 0.005
"""Spacing at which the path is measured before it is sampled [m]."""


@dataclass(frozen=True)
class Route:
    """How the robot keeps outside the nodes and how often a frame is taken.

    Attributes:
        nearest_m, farthest_m: range of the distance to each node, drawn anew at every pass [m].
        step_m: length of path between two frames [m].
        step_spread_m: half the range that the step varies in [m].
    """

    nearest_m: float = 0.28
    farthest_m: float = 0.34
    step_m: float = 0.40
    step_spread_m: float = 0.03


def outward(loop: Floats) -> Floats:
    """Unit vectors (K, 2) that point out of a counter-clockwise polygon (K, 2) at its corners."""
    edge = np.roll(loop, -1, axis=0) - loop
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(edge, axis=1, keepdims=True)
    bisector = normal + np.roll(normal, 1, axis=0)
    return np.asarray(bisector / np.linalg.norm(bisector, axis=1, keepdims=True))


def drive(loop: Floats, frames: int, rng: np.random.Generator, route: Route | None = None) -> Floats:
    """Drive around a loop of nodes, outside of them.

    Args:
        loop: (K, 2) nodes, counter-clockwise [m]; the drive starts exactly on the first.
        frames: number of poses wanted.
        rng: varies the distance to the nodes and between the frames.
        route: how to drive.

    Returns:
        (frames, 3) poses of the robot's axis of rotation [m, m, rad, map frame], heading along the path.
    """
    route = route or Route()
    perimeter = float(np.linalg.norm(np.roll(loop, -1, axis=0) - loop, axis=1).sum())
    laps = int(np.ceil(frames * (route.step_m + route.step_spread_m) / perimeter)) + 1
    order = np.tile(np.arange(len(loop)), laps)
    radius = rng.uniform(route.nearest_m, route.farthest_m, len(order))
    corners = loop[order] + outward(loop)[order] * radius[:, None]
    corners[0] = loop[0]
    chord = np.sqrt(np.linalg.norm(np.diff(corners, axis=0), axis=1))  # centripetal: no loops and no overshooting
    curve = CubicSpline(np.concatenate([[0.0], np.cumsum(chord)]), corners)
    parameter = np.linspace(0.0, chord.sum(), int(perimeter * laps / FINE_M))
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve(parameter), axis=0), axis=1))])
    steps = rng.uniform(route.step_m - route.step_spread_m, route.step_m + route.step_spread_m, frames - 1)
    at = np.interp(np.concatenate([[0.0], np.cumsum(steps)]), travelled, parameter)
    direction = curve(at, 1)
    return np.column_stack([curve(at), wrap(np.arctan2(direction[:, 1], direction[:, 0]))])


@dataclass(frozen=True)
class Drift:
    """The odometer's errors: systematic ones, their size and sign drawn once a run, and a little noise.

    Attributes:
        rotation_scale: error of a turn, as a share of it.
        rotation_scale_sd: its standard deviation over runs.
        curvature_deg: false turn in degrees per metre driven; its sign is drawn.
        curvature_sd_deg: its standard deviation over runs, degrees per metre.
        distance_sd: standard deviation of a distance, as a share of it.
        heading_sd_deg: standard deviation of the heading of a step, degrees.
    """

    rotation_scale: float = -0.017
    rotation_scale_sd: float = 0.001
    curvature_deg: float = 2.2
    curvature_sd_deg: float = 0.3
    distance_sd: float = 0.02
    heading_sd_deg: float = 0.2


def odometer(steps: Floats, start: Floats, drift: Drift, rng: np.random.Generator) -> Floats:
    """What the odometer says.

    Args:
        steps: (N - 1, 3) true motions, each in the robot's frame before it [m, m, rad].
        start: (3,) first reading, in the odometer's own frame.
        drift: its errors.
        rng: draws them.

    Returns:
        (N, 3) raw odometer poses.
    """
    scale = rng.normal(drift.rotation_scale, drift.rotation_scale_sd)
    curvature = np.deg2rad(rng.normal(drift.curvature_deg, drift.curvature_sd_deg)) * rng.choice([-1.0, 1.0])
    distance = np.linalg.norm(steps[:, :2], axis=1)
    moving = (distance > 0.0) | (steps[:, 2] != 0.0)  # a robot that is carried turns no wheel
    noise = np.deg2rad(drift.heading_sd_deg) * rng.standard_normal(len(steps)) * moving
    false_turn = scale * steps[:, 2] + curvature * distance + noise
    stretched = steps[:, :2] * (1.0 + drift.distance_sd * rng.standard_normal(len(steps)))[:, None]
    shifted = rotate(stretched, false_turn / 2.0)  # the error grows along the step: half of it bends the chord
    readings = [np.asarray(start, dtype=np.float64)]
    for move in np.column_stack([shifted, steps[:, 2] + false_turn]):
        readings.append(compose(readings[-1], move))
    return np.stack(readings)
