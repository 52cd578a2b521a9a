"""Where a map gets nodes, edges and training views along a way."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from topoloc.geometry import Floats, wrap
from topoloc.mapping.building.turns import Turn
from topoloc.types import Ints

FARTHEST_STEP = 2.0
"""No edge leads along a step between two frames that is longer than this many spacings: nobody saw the way there."""


def turns_apart(turns: Sequence[Turn], spacing_m: float) -> list[Turn]:
    """Turns at places of their own, in time: of those nearer than half a spacing the one that saw most."""
    kept: list[Turn] = []
    for turn in sorted(turns, key=lambda turn: turn.missing_deg):
        if all(np.linalg.norm(turn.position - other.position) >= 0.5 * spacing_m for other in kept):
            kept.append(turn)
    return sorted(kept, key=lambda turn: turn.first)


def frames_between(positions: Floats, taken: Floats, spacing_m: float) -> Ints:
    """Frames that become nodes, in time: each the first that is a spacing or more away from all nodes so far.

    Args:
        positions: (N, 2) of the robot at the frames [m].
        taken: (K, 2) of nodes that there are already [m].
        spacing_m: [m].
    """
    distance = np.full(len(positions), np.inf)
    for place in taken:
        distance = np.minimum(distance, np.linalg.norm(positions - place, axis=1))
    chosen: list[int] = []
    while len(free := np.flatnonzero(distance >= spacing_m - 1e-9)):
        chosen.append(int(free[0]))
        distance = np.minimum(distance, np.linalg.norm(positions - positions[free[0]], axis=1))
    return np.array(chosen, dtype=np.int64)


def edges_along(positions: Floats, nearest: Ints, spacing_m: float) -> tuple[Ints, int]:
    """Pairs of nodes that the way leads between.

    Args:
        positions: (N, 2) of the robot at the frames [m].
        nearest: (N,) index of the node nearest to each.
        spacing_m: between nodes [m].

    Returns:
        Edges (E, 2), each once; and how many steps were too long to tell one.
    """
    long = np.linalg.norm(np.diff(positions, axis=0), axis=1) > FARTHEST_STEP * spacing_m
    pairs = np.sort(np.column_stack([nearest[:-1], nearest[1:]])[~long], axis=1)
    edges = np.unique(pairs[pairs[:, 0] != pairs[:, 1]], axis=0)
    return edges.reshape(-1, 2), int(long.sum())


def views_apart(cameras: Floats, spacing_m: float, turn_rad: float, fits: Callable[[int], bool]) -> Ints:
    """Frames that become training views, in time: each moved or turned enough from all those before it.

    Args:
        cameras: (N, 3) poses of the camera.
        spacing_m: far enough, however little it turned [m].
        turn_rad: turned enough, however near [rad].
        fits: whether a frame may be taken; it is asked only where the pose would do.
    """
    kept, count = np.empty_like(cameras), 0
    chosen = []
    for frame, pose in enumerate(cameras):
        before = kept[:count]
        near = before[np.hypot(before[:, 0] - pose[0], before[:, 1] - pose[1]) < spacing_m - 1e-9]
        if (np.abs(wrap(near[:, 2] - pose[2])) < turn_rad - 1e-9).any() or not fits(frame):
            continue
        kept[count], count = pose, count + 1
        chosen.append(frame)
    return np.array(chosen, dtype=np.int64)
