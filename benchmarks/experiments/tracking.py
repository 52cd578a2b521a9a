"""What IMA and the tracker make of a drive, update by update, as chapter 5.2 counts it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments.methods import THESIS, Method
from benchmarks.worlds.world import Simulation
from estimators.activity import TrackerStep
from topoloc.geometry import Floats, wrap
from topoloc.localizer import Localizer
from topoloc.metrics import RIGHT_WITHIN_M, Bools
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Ints


@dataclass(frozen=True)
class Tracked:
    """A drive as the tracker saw it; an entry an update (U,), frames whose gate stayed shut left out.

    Attributes:
        kind: ``normal``, ``virtual``, ``supposed`` or ``none``, see ``TrackerStep``.
        said: node that it named, the winner d* or d0; -1 for none.
        nearest: node nearest to the truth.
        best: node that the image alone says; -1 for a blind frame.
        right: the node named is at most ``RIGHT_WITHIN_M`` farther from the truth than the nearest.
        match, activity: of the winner; NaN where there is none.
        heading_error: of the winner's matched heading against the robot's true one [rad]; NaN where no normal
            destination won.
        heading: as the tracker corrected the odometer's [rad]; without meaning before anything won.
        poses: (U, 3) estimated poses.
        truth: (U, 3) true poses.
        frames: index of each update's frame.
        steps: the tracker's own account.
        evidence: about the robot.
    """

    kind: NDArray[np.str_]
    said: Ints
    nearest: Ints
    best: Ints
    right: Bools
    match: Floats
    activity: Floats
    heading_error: Floats
    heading: Floats
    poses: Floats
    truth: Floats
    frames: Ints
    steps: tuple[TrackerStep, ...]
    evidence: tuple[Evidence, ...]

    @property
    def destinations(self) -> Bools:
        """(U,) whether any destination, normal or virtual, won."""
        return np.isin(self.kind, ("normal", "virtual"))

    @property
    def strict(self) -> Bools:
        """(U,) whether the node named is the very nearest."""
        return np.asarray(self.said == self.nearest)

    def counts(self) -> dict[str, float]:
        """What Tables 5.3, 5.5 and 5.9 report, and the errors; shares are of the updates unless told otherwise."""
        normal, virtual, wrong = self.kind == "normal", self.kind == "virtual", ~self.right
        found = int(self.destinations.sum())
        return {
            "updates": float(len(self.kind)),
            "destinations": float(found),
            "normal": float(normal.sum()),
            "virtual": float(virtual.sum()),
            "supposed": float(len(self.kind) - found),
            "mean activity": float(self.activity[self.destinations].mean()) if found else float("nan"),
            "mean match": float(self.match[normal].mean()) if normal.any() else float("nan"),
            "errors": float(wrong.sum()),
            "error rate": float(wrong.mean()),
            "strict error rate": float(1.0 - self.strict.mean()),
        }


class Fitted:
    """IMA that knows its map already: that takes a second, and many drives may have one map.

    Args:
        method: whose sensor.
        topo_map: to be fitted to.
    """

    def __init__(self, method: Method, topo_map: TopoMap) -> None:
        self._sensor, _ = method.make()
        self._sensor.fit(topo_map)
        self.needs = self._sensor.needs

    def fit(self, topo_map: TopoMap) -> None:
        """Nothing is left to prepare."""

    def observe(self, frame: Frame) -> Evidence:
        """What IMA sees."""
        return self._sensor.observe(frame)


def tracked(drive: Simulation, method: Method = THESIS) -> Tracked:
    """Run IMA and the tracker over a drive."""
    return tracked_frames(drive.topo_map, drive.frames, drive.truth, method)


def tracked_frames(
    topo_map: TopoMap,
    frames: Sequence[Frame],
    truth: Floats,
    method: Method = THESIS,
    fitted: Fitted | None = None,
) -> Tracked:
    """Run IMA and the tracker over frames (N) whose true poses (N, 3) are known.

    Args:
        topo_map: what the robot knows beforehand.
        frames: N of them; the robot may be anywhere at the first.
        truth: (N, 3).
        method: sensor and tracker.
        fitted: the method's sensor if it knows the map already; None makes it.
    """
    sensor, tracker = method.make()
    localizer = Localizer(topo_map, sensor if fitted is None else fitted, tracker)
    rows, headings, poses, steps, seen = [], [], [], [], []
    for index, frame in enumerate(frames):
        localizer.step(frame)
        looked = localizer.last
        if looked is None or looked.evidence is None:
            continue
        assert tracker.last is not None  # the gate was open
        steps.append(tracker.last)
        seen.append(looked.evidence)
        headings.append(tracker.heading)
        poses.append(looked.estimate.pose)
        rows.append((index, *_row(tracker.last, looked.evidence, topo_map.positions, truth[index])))
    at, said, nearest, best, right, match, activity, heading_error = (np.array(c) for c in zip(*rows, strict=True))
    return Tracked(
        kind=np.array([step.kind for step in steps]),
        said=said,
        nearest=nearest,
        best=best,
        right=right,
        match=match,
        activity=activity,
        heading_error=heading_error,
        heading=np.array(headings),
        poses=np.array(poses),
        truth=truth[at],
        frames=at,
        steps=tuple(steps),
        evidence=tuple(seen),
    )


def right_nodes(topo_map: TopoMap, truth: Floats) -> Bools:
    """(U, K) which nodes are right at true poses (U, 3): at most ``RIGHT_WITHIN_M`` farther than the nearest."""
    distance = np.linalg.norm(topo_map.positions - truth[:, None, :2], axis=2)
    return np.asarray(distance <= distance.min(axis=1, keepdims=True) + RIGHT_WITHIN_M)


def _row(
    step: TrackerStep, seen: Evidence, positions: Floats, pose: Floats
) -> tuple[int, int, int, bool, float, float, float]:
    distance = np.linalg.norm(positions - pose[:2], axis=1)
    said = -1 if step.node is None else step.node
    best = int(seen.nodes[seen.match.argmax()]) if len(seen.match) else -1
    right = said >= 0 and distance[said] <= distance.min() + RIGHT_WITHIN_M
    match = activity = heading_error = float("nan")
    if step.winner is not None:
        match = float(step.destinations.match[step.winner])
        activity = float(step.destinations.activity[step.winner])
        if step.kind == "normal":
            heading_error = float(wrap(step.destinations.headings[step.winner] - pose[2]))
    return said, int(distance.argmin()), best, right, match, activity, heading_error
