"""What the other estimators must beat: the best match alone, and the odometry alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimators.gaussian import anywhere, best_hypothesis, carried, cubature_points, hypothesis_variances
from topoloc.estimate import EstimateRule, mean_and_covariance
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses


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
    estimate_rule = EstimateRule(bias=-1.41, gain=0.0, agreement_gain=0.75)  # benchmarks/calibration.py

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
    estimate_rule = EstimateRule(  # benchmarks/calibration.py
        bias=-0.39, gain=0.15, agreement_gain=0.55, mode_radius_m=np.inf
    )

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
