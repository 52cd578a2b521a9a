"""The one step: a motion, one look, an estimate. A newcomer reads this page first."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from topoloc.errors import UnreadableImage
from topoloc.estimate import SURPRISE, EstimateRule, estimate_from
from topoloc.geometry import Floats, between, compose
from topoloc.interfaces import Estimator, Sensor, Upkeep
from topoloc.odometry import MotionGate, OdometryNoise
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Evidence, Frame, Motion, Status, WeightedPoses


@dataclass(frozen=True)
class Step:
    """What happened at one frame.

    Attributes:
        timestamp: of the frame [s].
        kind: ``update``, ``blind`` (the frame said nothing), ``unreadable`` (its image did not decode) or ``gated``.
        estimate: after the step.
        evidence: about the robot; None where the gate stayed closed.
        problem: what was wrong with the image, where it was unreadable.
    """

    timestamp: float
    kind: str
    estimate: Estimate
    evidence: Evidence | None = None
    problem: str = ""

    @property
    def match(self) -> float | None:
        """Best match of the hypotheses at the estimated node; None where there is none."""
        if self.evidence is None or self.estimate.node is None:
            return None
        here = self.evidence.match[self.evidence.nodes == self.estimate.node]
        return float(here.max()) if len(here) else None


class Localizer:
    """One sensor model and one estimator on one map.

    Args:
        topo_map: the map; the sensor is fitted to it.
        sensor, estimator: any that follow ``topoloc.interfaces``.
        rng: the random numbers of the estimator; a seed makes a run repeatable.
        prior: where the robot may be at the start; None: anywhere.
        gate: decides which frames are worth an update.
        noise: of the odometry.
        upkeep: is shown each update, after it was made; it may refresh what the sensor knows of the map.
    """

    def __init__(
        self,
        topo_map: TopoMap,
        sensor: Sensor,
        estimator: Estimator,
        *,
        rng: np.random.Generator | int = 0,
        prior: WeightedPoses | None = None,
        gate: MotionGate | None = None,
        noise: OdometryNoise | None = None,
        upkeep: Upkeep | None = None,
    ) -> None:
        self.topo_map, self.sensor, self.estimator, self.upkeep = topo_map, sensor, estimator, upkeep
        self.gate, self.noise = gate or MotionGate(), noise or OdometryNoise()
        self.rule: EstimateRule = getattr(type(estimator), "estimate_rule", EstimateRule())
        self.last: Step | None = None
        self._anchor: tuple[Frame, Estimate] | None = None  # the last frame that was looked at, and what came of it
        self._reading: Floats | None = None  # of the odometer, the last one that a motion was measured from
        self._informed = prior is not None  # before the first look that said something, no node can be named
        self.log_evidence = 0.0  # running mean of log p(evidence | past); 0 where the estimator tells none
        sensor.fit(topo_map)
        estimator.reset(topo_map, np.random.default_rng(rng), prior)

    def step(self, frame: Frame) -> Estimate:
        """Take in one frame: where the robot is now. Frames must come in the order of time."""
        if self._anchor is not None and not self._opens(self._anchor[0], frame):
            self.last = Step(frame.timestamp, "gated", self._carried(*self._anchor, frame))
            return self.last.estimate
        if self._anchor is not None:
            self.estimator.predict(self._motion(frame))
        self._reading = self._reading if frame.odometry is None else frame.odometry
        evidence, problem = look(self.sensor, frame)
        self._remember(self.estimator.update(evidence))
        self._informed |= not evidence.is_blind
        estimate = estimate_from(self.estimator.belief, self.topo_map, self.log_evidence, self.rule, evidence)
        if not self._informed:
            estimate = replace(estimate, node=None, probability=0.0, status=Status.LOST)
        kind = "unreadable" if problem else "blind" if evidence.is_blind else "update"
        self.last = Step(frame.timestamp, kind, estimate, evidence, problem)
        if self.upkeep is not None and kind == "update":
            self.upkeep.after(frame, estimate, evidence)
        self._anchor = (replace(frame, images={}), estimate)  # the pictures may be large, and are not needed again
        return estimate

    def _opens(self, before: Frame, frame: Frame) -> bool:
        """Without an odometer there is nothing to measure: every frame is looked at."""
        if before.odometry is None or frame.odometry is None:
            return True
        return self.gate.opens(before.odometry, before.camera, frame.odometry, frame.camera)

    def _motion(self, frame: Frame) -> Motion:
        """Since the last reading of the odometer: a frame in between that has none loses nothing."""
        if self._reading is None or frame.odometry is None:
            return self.noise.unknown()
        return self.noise.motion(self._reading, frame.odometry)

    def _carried(self, before: Frame, estimate: Estimate, frame: Frame) -> Estimate:
        """Between updates the last estimate rides on the odometry."""
        assert before.odometry is not None and frame.odometry is not None  # or the gate would have opened
        return replace(estimate, pose=compose(estimate.pose, between(before.odometry, frame.odometry)))

    def _remember(self, log_evidence: float | None) -> None:
        if log_evidence is not None:
            share, news = self.rule.evidence_memory, min(max(log_evidence, SURPRISE), -SURPRISE)
            self.log_evidence = share * self.log_evidence + (1.0 - share) * news


def look(sensor: Sensor, frame: Frame) -> tuple[Evidence, str]:
    """Let a sensor look at a frame: evidence about the robot, and what was wrong with the image, if anything.

    An image that is missing or does not decode makes a blind frame: a robot that runs must not stop for it.
    """
    missing = sensor.needs - frozenset(frame.images)
    if missing:
        return Evidence.blind(), f"no {', '.join(sorted(missing))} image"
    try:
        return sensor.observe(frame).of_robot(frame.camera), ""
    except UnreadableImage as error:
        return Evidence.blind(), str(error)
