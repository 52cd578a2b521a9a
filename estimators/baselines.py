"""What the other estimators must beat: the best match alone, and the odometry alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topoloc.estimate import EstimateRule, mean_and_covariance
from topoloc.geometry import Floats, compose, covariance_root, rotate, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

ANY_HEADING = np.pi**2 / 3.0
"""Variance of a heading of which nothing is known [rad^2]."""


@dataclass(frozen=True)
class BestMatchConfig:
    """The best match has no settings."""


@dataclass(frozen=True)
class DeadReckoningConfig:
    """Dead reckoning has no settings."""


class BestMatch:
    """Direct inference (thesis 1.1): the robot is where the best match says, whatever came before.

    A blind frame leaves the last answer. Before the first one: the prior, or any node with any heading.
    """

    Config = BestMatchConfig
    estimate_rule = EstimateRule(bias=0.01, gain=0.08)  # benchmarks/calibration.py

    def __init__(self, config: BestMatchConfig | None = None) -> None:
        self.config = config or BestMatchConfig()
        self._belief: WeightedPoses

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Forget the last answer. Draws nothing."""
        self._belief = anywhere(topo_map) if prior is None else prior

    def predict(self, motion: Motion) -> None:
        """Nothing: direct inference knows no motion."""

    def update(self, evidence: Evidence) -> None:
        """Take the best match for the answer.

        Always None: log p(evidence | past) asks what the past foretold, and here it foretells nothing.
        """
        if not evidence.is_blind:
            best = best_hypothesis(evidence)
            self._belief = WeightedPoses.uniform(evidence.poses[best][None], hypothesis_variances(evidence, best))

    @property
    def belief(self) -> WeightedPoses:
        """One pose, as wide as its hypothesis."""
        return self._belief


class DeadReckoning:
    """The odometry from a known start on: the prior's mean, or the first best match that is not blind.

    Before the start motions are discarded, since they lead from nowhere.
    """

    Config = DeadReckoningConfig
    estimate_rule = EstimateRule(bias=-0.37, gain=0.14, mode_radius_m=np.inf)  # benchmarks/calibration.py

    def __init__(self, config: DeadReckoningConfig | None = None) -> None:
        self.config = config or DeadReckoningConfig()
        self._before_start: WeightedPoses
        self._state: tuple[Floats, Floats] | None = None  # mean (3,) and covariance (3, 3)

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start at the prior, or wait for the first match. Draws nothing."""
        self._before_start = anywhere(topo_map)
        self._state = None if prior is None else mean_and_covariance(prior.poses, prior.weights, prior.spread)

    def predict(self, motion: Motion) -> None:
        """Compose the motion; its covariance is carried to first order."""
        if self._state is not None:
            self._state = carried(*self._state, motion)

    def update(self, evidence: Evidence) -> None:
        """The first match that is not blind is the start; later ones are not looked at.

        Always None: what is not looked at cannot be judged.
        """
        if self._state is None and not evidence.is_blind:
            best = best_hypothesis(evidence)
            self._state = evidence.poses[best], np.diag(hypothesis_variances(evidence, best))

    @property
    def belief(self) -> WeightedPoses:
        """Six cubature points with the mean and the covariance; before the start any node with any heading."""
        return self._before_start if self._state is None else cubature_points(*self._state)


def anywhere(topo_map: TopoMap) -> WeightedPoses:
    """Every node with four headings, all equally likely."""
    count = len(topo_map.nodes)
    headings = np.tile(wrap(np.arange(4) * np.pi / 2.0), count)
    return WeightedPoses.uniform(np.column_stack([np.repeat(topo_map.positions, 4, axis=0), headings]))


def best_hypothesis(evidence: Evidence) -> int:
    """Index of the highest match; of equal ones the lowest node, then the lowest pose: their order does not matter."""
    x, y, heading = evidence.poses.T
    return int(np.lexsort((heading, y, x, evidence.nodes, -evidence.match))[0])


def hypothesis_variances(evidence: Evidence, index: int) -> Floats:
    """(3,) [m^2, m^2, rad^2] around a hypothesis; 1 / kappa, but no heading is less known than any heading."""
    position = evidence.sigma[index] ** 2
    return np.array([position, position, 1.0 / max(evidence.kappa[index], 1.0 / ANY_HEADING)])


def carried(mean: Floats, covariance: Floats, motion: Motion) -> tuple[Floats, Floats]:
    """Mean (3,) and covariance (3, 3) after a motion, to first order: F P F' + G Q G'."""
    x, y = rotate(motion.delta[:2], mean[2])
    by_pose = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    cos, sin = np.cos(mean[2]), np.sin(mean[2])
    by_motion = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    spread = by_pose @ covariance @ by_pose.T + by_motion @ motion.covariance @ by_motion.T
    return compose(mean, motion.delta), spread


def cubature_points(mean: Floats, covariance: Floats) -> WeightedPoses:
    """Six equal weights with exactly this mean (3,) and covariance (3, 3) (ours; DESIGN.md, "Values").

    A heading less known than any heading cannot be told on the circle: its deviation is shrunk to just below that.
    """
    shrink = min(1.0, np.sqrt(0.999 * ANY_HEADING / max(covariance[2, 2], 1e-300)))
    root = np.sqrt(3.0) * np.diag([1.0, 1.0, shrink]) @ covariance_root(covariance)  # columns: the points' deviations
    poses = mean + np.concatenate([root.T, -root.T])
    return WeightedPoses.uniform(np.column_stack([poses[:, :2], wrap(poses[:, 2])]))
