"""Where the camera turned on the spot: what panoramas are made of."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from topoloc.geometry import Floats, wrap
from topoloc.types import Ints

STEP_M, STEP_RAD = 0.05, np.deg2rad(10.0)
"""Frames are told apart where the robot moved or the camera turned so far: less may be the noise of the poses."""
SPOT_RADIUS_M = 0.2
"""A curve tighter than this is a turn on the spot [m]."""
STRAYS_M = 0.3
"""No frame of a turn may be farther from its middle [m]."""
LEAST_TURN = np.pi
"""What turned less is not told of: any drive has corners [rad]."""
OVERLAP_STEP = 0.6
"""Snapshots of a panorama are chosen so far apart, as a share of a view."""
TURN = 2.0 * np.pi


@dataclass(frozen=True)
class Turn:
    """A turn on the spot.

    Attributes:
        first: index of the first frame of the turn on its way.
        position: (2,) of the robot meanwhile [m].
        frames: (S,) indices of the snapshots chosen, in the order that they lie clockwise, one turn at most.
        clockwise: (S,) how far each lies clockwise of the first of them, by the poses [rad].
        missing_deg: of the circle that no snapshot shows, degrees.
    """

    first: int
    position: Floats
    frames: Ints
    clockwise: Floats
    missing_deg: float

    def without(self, bad: np.ndarray, hfov: float) -> Turn:
        """The turn without some of its snapshots, (S,) which; others must remain."""
        frames, clockwise = self.frames[~bad], self.clockwise[~bad]
        return Turn(self.first, self.position, frames, clockwise - clockwise[0], missing(clockwise, hfov))


def turns_on_the_spot(robot: Floats, headings: Floats, hfov: float) -> list[Turn]:
    """The turns of at least ``LEAST_TURN``, in time.

    Args:
        robot: (N, 3) poses of the robot along its way; only the positions are looked at.
        headings: (N,) of the camera, which may turn on its own [rad].
        hfov: its horizontal field of view [rad].
    """
    turns = []
    for start, end in _spots(robot[:, :2], headings):
        places, turned = robot[start : end + 1, :2], -np.unwrap(headings[start : end + 1])
        middle = np.median(places, axis=0)
        if np.linalg.norm(places - middle, axis=1).max() > STRAYS_M or np.ptp(turned) < LEAST_TURN:
            continue
        chosen = snapshots(turned, hfov)
        clockwise = turned[chosen] - turned[chosen[0]]
        turns.append(Turn(start, middle, start + chosen, clockwise, missing(clockwise, hfov)))
    return turns


def _spots(positions: Floats, headings: Floats) -> Iterator[tuple[int, int]]:
    """First and last frame of each stretch on which the camera turns and hardly moves."""
    told = _told_apart(positions, headings)
    moved = np.linalg.norm(np.diff(positions[told], axis=0), axis=1)
    turned = np.abs(wrap(np.diff(headings[told])))
    turns = np.concatenate([[False], moved <= SPOT_RADIUS_M * turned, [False]])
    edges = np.flatnonzero(np.diff(turns))
    for start, end in edges.reshape(-1, 2).tolist():
        yield int(told[start]), int(told[end])


def _told_apart(positions: Floats, headings: Floats) -> Ints:
    """Indices of frames, each of which the robot moved or turned well since the one before."""
    kept = [0]
    for frame in range(1, len(positions)):
        moved = np.hypot(*(positions[frame] - positions[kept[-1]]))
        if moved >= STEP_M or abs(wrap(headings[frame] - headings[kept[-1]])) >= STEP_RAD:
            kept.append(frame)
    return np.array(kept)


def snapshots(turned: Floats, hfov: float) -> Ints:
    """Which frames (S,) of a turn to make a panorama of: one circle, evenly spread, overlapping where they can.

    Args:
        turned: (N,) how far clockwise the camera had turned, beyond a circle too [rad].
        hfov: horizontal field of view [rad].

    Returns:
        Indices in the order that they lie clockwise.
    """
    order = np.argsort(turned, kind="stable")
    angle = turned[order] - turned[order[0]]
    count = int(np.ceil(TURN / (OVERLAP_STEP * hfov)))
    targets = np.arange(count) * (TURN / count)
    within = np.flatnonzero(angle <= TURN - 0.5 * OVERLAP_STEP * hfov)
    chosen = {_nearest(within, angle, target) for target in targets[targets <= angle[-1]]}
    while True:  # where frames are uneven, the nearest to the targets may leave a gap that another one fills
        kept = sorted(chosen)
        ends = [*angle[kept[1:]], TURN]
        wide = [(a, b) for a, b in zip(angle[kept], ends, strict=True) if b - a > 0.9 * hfov]
        more = {_nearest(within, angle, (a + b) / 2.0) for a, b in wide} - chosen
        if not more:
            return np.asarray(order[kept], dtype=np.int64)
        chosen |= more


def _nearest(within: Ints, angle: Floats, wanted: float) -> int:
    return int(within[np.abs(angle[within] - wanted).argmin()])


def missing(clockwise: Floats, hfov: float) -> float:
    """Degrees of the circle that views at angles (S,) [rad], ascending, of this width [rad] do not show."""
    steps = np.diff(np.append(clockwise, clockwise[0] + TURN))
    return float(np.rad2deg(np.maximum(steps - hfov, 0.0).sum()))
