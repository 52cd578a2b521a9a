"""Where the simulated robot drives: past the nodes of a tour or of a random walk (thesis 5.2.3, 5.2.8, 5.2.9)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline

from topoloc.geometry import Floats, wrap
from topoloc.types import Ints

FINE_M = 0.005
"""Spacing at which the path is measured before it is sampled [m]."""
FINE_RAD = np.deg2rad(1.0)
"""The same of a turn on the spot [rad]."""
SPARE_NODES = 8
"""A random way is drawn this many nodes longer at least, and twice as long each time that it ends too soon."""
TURNS_BACK = np.deg2rad(150.0)
"""Where the next leg turns this far from the last one, the robot turns on the spot [rad]."""
GATE_REACH_M = 0.4
"""A leg that passes the middle of a doorway nearer than this leads through it [m]."""
Pace = Callable[[Floats], Floats]
"""Positions (N, 2) -> factors (N,) of the distance between two frames."""


@dataclass(frozen=True)
class Route:
    """How the robot keeps off the nodes and how often a frame is taken.

    Attributes:
        nearest_m, farthest_m: range of the distance to each node, drawn anew at every pass, metres.
        step_m: length of path between two frames, metres.
        step_spread_m: half the range that the step varies in, metres.
        turn_step_deg: turn between two frames where the robot turns on the spot, degrees.
        random: whether the robot goes from node to node at random instead of along the tour, true or false.
    """

    nearest_m: float = 0.28
    farthest_m: float = 0.34
    step_m: float = 0.40
    step_spread_m: float = 0.03
    turn_step_deg: float = 25.0
    random: bool = False

    def __post_init__(self) -> None:
        if not 0.0 <= self.nearest_m <= self.farthest_m:
            raise ValueError(f"nearest_m {self.nearest_m} and farthest_m {self.farthest_m} are no range from 0 up")
        if not 0.0 <= self.step_spread_m < self.step_m:
            raise ValueError(f"step_m is {self.step_m}; it must be more than step_spread_m, {self.step_spread_m}")
        if self.turn_step_deg <= 0.0:
            raise ValueError(f"turn_step_deg is {self.turn_step_deg}; it must be positive")


def passes(places: Floats, radius: Floats) -> Floats:
    """Where the robot passes each of a sequence of nodes: to their right, so outside a counter-clockwise tour.

    Args:
        places: (K, 2) nodes in their order; the drive starts exactly on the first [m].
        radius: (K,) distance from each of them [m].

    Returns:
        (K, 2) [m].
    """
    leg = np.diff(places, axis=0)
    right = np.column_stack([leg[:, 1], -leg[:, 0]]) / np.linalg.norm(leg, axis=1, keepdims=True)
    into, out = np.concatenate([right[:1], right]), np.concatenate([right, right[-1:]])
    aside = np.where(_turned(into, out)[:, None] > TURNS_BACK, into, into + out)
    aside /= np.linalg.norm(aside, axis=1, keepdims=True)
    at = places + aside * radius[:, None]
    at[0] = places[0]
    return np.asarray(at)


def _turned(one: Floats, other: Floats) -> Floats:
    """Angle (N,) between unit vectors (N, 2) [rad]."""
    return np.asarray(np.arccos(np.clip((one * other).sum(axis=1), -1.0, 1.0)))


def path_past(places: Floats, radius: Floats, gates: Floats | None = None) -> Floats:
    """A smooth path past a sequence of nodes, turning on the spot where it comes back the way it went.

    Args:
        places: (K, 2) nodes in their order, neighbours apart [m].
        radius: (K,) distance from each of them [m].
        gates: (G, 2) doorways, through whose middle the path leads wherever a leg passes one [m].

    Returns:
        (P, 3) poses, close together [m, m, rad].
    """
    corners, leg = passes(places, radius), np.diff(places, axis=0)
    leg /= np.linalg.norm(leg, axis=1, keepdims=True)
    back = np.flatnonzero(_turned(leg[:-1], leg[1:]) > TURNS_BACK) + 1
    ends = [0, *back.tolist(), len(places) - 1]
    pieces: list[Floats] = []
    for start, end in pairwise(ends):
        points = corners[start : end + 1]
        piece = _smooth(points if gates is None else _with_gates(points, places[start : end + 1], gates))
        if pieces:
            pieces.append(_turn(pieces[-1][-1], float(piece[0, 2])))
        pieces.append(piece)
    return np.concatenate(pieces)


def _with_gates(points: Floats, places: Floats, gates: Floats) -> Floats:
    """The points (K, 2) of a path past places (K, 2), and between them the doorways that its legs pass."""
    result = [points[0]]
    for start, end, following in zip(places[:-1], places[1:], points[1:], strict=True):
        leg = end - start
        share = (gates - start) @ leg / (leg @ leg)
        aside = np.linalg.norm(gates - start - share[:, None] * leg, axis=1)
        passed = np.flatnonzero((share > 0.0) & (share < 1.0) & (aside < GATE_REACH_M))
        result += [gates[gate] for gate in passed[np.argsort(share[passed])]]
        result.append(following)
    return np.stack(result)


def _smooth(corners: Floats) -> Floats:
    """Poses (P, 3) along a spline through points (K, 2)."""
    chord = np.sqrt(np.linalg.norm(np.diff(corners, axis=0), axis=1))  # centripetal: no loops and no overshooting
    curve = CubicSpline(np.concatenate([[0.0], np.cumsum(chord)]), corners)
    length = float(np.linalg.norm(np.diff(corners, axis=0), axis=1).sum())
    parameter = np.linspace(0.0, chord.sum(), max(2, int(length / FINE_M)))
    direction = curve(parameter, 1)
    return np.column_stack([curve(parameter), wrap(np.arctan2(direction[:, 1], direction[:, 0]))])


def _turn(pose: Floats, heading: float) -> Floats:
    """Poses (P, 3) of a turn on the spot, the shorter way round."""
    angle = float(wrap(heading - pose[2]))
    turned = np.linspace(0.0, angle, max(2, int(abs(angle) / FINE_RAD)))
    return np.column_stack([np.tile(pose[:2], (len(turned), 1)), wrap(pose[2] + turned)])


def progress(path: Floats, route: Route, pace: Pace | None = None) -> Floats:
    """How many usual steps lie between the start and each pose (P,) of a path (P, 3)."""
    length = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1) / route.step_m
    if pace is not None:
        length = length / pace(path[1:, :2])
    on_the_spot = length == 0.0
    turn = np.abs(wrap(np.diff(path[:, 2]))) / np.deg2rad(route.turn_step_deg)
    return np.concatenate([[0.0], np.cumsum(np.where(on_the_spot, turn, length))])


def drive(
    tour: Floats,
    frames: int,
    rng: np.random.Generator,
    route: Route | None = None,
    pace: Pace | None = None,
    gates: Floats | None = None,
) -> Floats:
    """Drive round a tour of nodes.

    Args:
        tour: (K, 2) nodes [m]; the drive starts exactly on the first, and comes back to it from the last.
        frames: number of poses wanted.
        rng: varies the distance to the nodes and between the frames.
        route: how to drive.
        pace: how much farther apart frames are at some positions.
        gates: (G, 2) doorways, whose middle the path leads through [m].

    Returns:
        (frames, 3) poses of the robot's axis of rotation [m, m, rad, map frame], heading along the path.
    """
    route = route or Route()
    rounds = int(np.ceil(frames / frames_per_tour(tour, route, pace) * (1.0 + route.step_spread_m))) + 2
    while True:
        poses = _sampled(np.tile(tour, (rounds, 1)), frames, deepcopy(rng), route, pace, gates)
        if poses is not None:
            return poses
        rounds += (
            rounds // 8 + 1
        )  # doorways and uneven distances to the nodes made the rounds shorter than the usual one


def wander(
    places: Floats,
    neighbours: Sequence[Ints],
    start: int,
    frames: int,
    rng: np.random.Generator,
    route: Route | None = None,
    pace: Pace | None = None,
    gates: Floats | None = None,
) -> Floats:
    """Drive from node to neighbouring node at random, back only from where there is no other way.

    Args:
        places: (K, 2) nodes [m].
        neighbours: of each node, indices.
        start: node that the drive starts on.
        frames: number of poses wanted.
        rng: draws the way, the distance to the nodes and between the frames.
        route: how to drive.
        pace: how much farther apart frames are at some positions.
        gates: (G, 2) doorways, whose middle the path leads through [m].

    Returns:
        (frames, 3) poses of the robot's axis of rotation [m, m, rad, map frame].
    """
    if not all(len(others) for others in neighbours):
        raise ValueError("a node has no neighbour; a random route needs a way from each to another")
    way, bends = rng.spawn(2)
    order, route = [start], route or Route()
    while True:
        for _ in range(len(order) + SPARE_NODES):
            before = order[-2] if len(order) > 1 else -1
            ways = [int(node) for node in neighbours[order[-1]] if node != before] or [before]
            order.append(ways[int(way.integers(len(ways)))])
        poses = _sampled(places[order], frames, deepcopy(bends), route, pace, gates)
        if poses is not None:
            return poses


def _sampled(
    places: Floats, frames: int, rng: np.random.Generator, route: Route, pace: Pace | None, gates: Floats | None
) -> Floats | None:
    """Poses (frames, 3) at the places where frames are taken on the way past nodes (K, 2); None: it is too short."""
    near, far = rng.spawn(2)  # apart, so that a longer drive begins as a shorter one does
    path = path_past(places, near.uniform(route.nearest_m, route.farthest_m, len(places)), gates)
    spread = route.step_spread_m / route.step_m
    at = np.concatenate([[0.0], np.cumsum(far.uniform(1.0 - spread, 1.0 + spread, frames - 1))])
    done = progress(path, route, pace)
    if done[-1] < at[-1]:
        return None
    x, y, heading = (np.interp(at, done, values) for values in (path[:, 0], path[:, 1], np.unwrap(path[:, 2])))
    return np.column_stack([x, y, wrap(heading)])


def frames_per_tour(tour: Floats, route: Route, pace: Pace | None = None) -> float:
    """Frames of one round of a tour (K, 2), at the middle of all ranges."""
    radius = (route.nearest_m + route.farthest_m) / 2.0

    def frames(rounds: int) -> float:
        places = np.concatenate([np.tile(tour, (rounds, 1)), tour[:1]])
        return float(progress(path_past(places, np.full(len(places), radius)), route, pace)[-1])

    return frames(2) - frames(1)
