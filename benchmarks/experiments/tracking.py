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
from topoloc.metrics import RIGHT_WITHIN_M
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Ints

Bools = NDArray[np.bool_]


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


def tracked(drive: Simulation, method: Method = THESIS) -> Tracked:
    """Run IMA and the tracker over a drive."""
    return tracked_frames(drive.topo_map, drive.frames, drive.truth, method)


def tracked_frames(topo_map: TopoMap, frames: Sequence[Frame], truth: Floats, method: Method = THESIS) -> Tracked:
    """Run IMA and the tracker over frames (N) whose true poses (N, 3) are known."""
    sensor, tracker = method.make()
    localizer = Localizer(topo_map, sensor, tracker)
    rows, steps, seen = [], [], []
    for index, frame in enumerate(frames):
        localizer.step(frame)
        looked = localizer.last
        if looked is None or looked.evidence is None:
            continue
        assert tracker.last is not None  # the gate was open
        steps.append(tracker.last)
        seen.append(looked.evidence)
        rows.append((index, *_row(tracker.last, looked.evidence, topo_map.positions, truth[index])))
    at, said, nearest, best, right, match, activity, heading_error = (np.array(c) for c in zip(*rows, strict=True))
    kinds = np.array([step.kind for step in steps])
    return Tracked(
        kinds, said, nearest, best, right, match, activity, heading_error, truth[at], at, tuple(steps), tuple(seen)
    )


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
