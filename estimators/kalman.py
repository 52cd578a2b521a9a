"""Gaussian beliefs: an unscented Kalman filter of one Gaussian, and a weighted sum of them.

The motion turns with the heading, so it goes through an unscented transform (``estimators.gaussian_motion``). A
hypothesis of the evidence measures the pose itself, which is linear: its correction is the plain Kalman update
(``estimators.gaussian_look``). Either is filterpy's ``UnscentedKalmanFilter``, for all Gaussians at once.

With the evidence of EQUATIONS.md, 4, a Gaussian N(x; mu, P) becomes a sum of Gaussians [ours]. The branch "hypothesis
m is right" has the weight w_m 2 pi sigma_m^2 2 pi N(z_m; mu, P + R_m) and the Kalman posterior; the branch "this frame
says nothing" has the floor's weight and stays as predicted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimators.free_area import FreeArea
from estimators.gaussian import anywhere, best_hypothesis, hypothesis_variances
from estimators.gaussian_look import Branches, Measurements, born
from estimators.gaussian_motion import moved
from estimators.gaussian_sum import LEAST, Gaussians, collapsed, cubature_belief, gathered, merged, stacked
from topoloc.estimate import EstimateRule, mean_and_covariance
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

WORTH_NAMING = 1e-3
"""A share of "anywhere" below this is left out of the belief that is handed out; as the grid's cells."""


@dataclass(frozen=True)
class KalmanConfig:
    """The single Gaussian has no settings."""


@dataclass(frozen=True)
class MultiGaussianConfig:
    """Settings of the sum of Gaussians.

    Attributes:
        components: how many Gaussians are kept at most.
        recovery: probability, at each update, that the robot is anywhere in the free area instead; as the grid's.
        negligible: branches below this share of the heaviest are dropped.
        overlap: Gaussians whose Bhattacharyya coefficient (1: the same, 0: apart) is at least this are merged.
        resolution_m: side of the cells that the free area is made of [m]; as the grid's.
        reach_m: how far from a node or an edge the robot may be [m]; as the grid's.
    """

    components: int = 50
    recovery: float = 0.02
    negligible: float = 1e-4
    overlap: float = 0.8
    resolution_m: float = 0.25
    reach_m: float = 0.75

    def __post_init__(self) -> None:
        if self.components < 1:
            raise ValueError(f"components is {self.components}; it must be at least 1")
        if not 0.0 <= self.recovery <= 0.5:
            raise ValueError(f"recovery is {self.recovery}; it must lie in [0, 0.5]")
        if not 0.0 <= self.negligible < 1.0:
            raise ValueError(f"negligible is {self.negligible}; it must lie in [0, 1)")
        if not 0.0 < self.overlap <= 1.0:
            raise ValueError(f"overlap is {self.overlap}; it must lie in (0, 1]")
        if not 0.0 < self.resolution_m <= self.reach_m:
            raise ValueError(f"resolution_m is {self.resolution_m}; it must be positive and at most reach_m")


class Kalman:
    """One Gaussian: an unscented Kalman filter with probabilistic data association.

    Each frame's branches are collapsed into one Gaussian of the same mean and covariance, so that the covariance tells
    of the doubt which hypothesis is right. It starts at the prior's moments, or at the first best match that is not
    blind; before that, motions are discarded, since they lead from nowhere.
    It follows one place. Where false hypotheses lie near the true one it can be led astray and is too sure. Far from
    the truth no hypothesis is near enough to count and the floor takes every frame: it never comes back, and only its
    low log evidence and its growing covariance tell that it is lost.
    """

    Config = KalmanConfig
    estimate_rule = EstimateRule(  # benchmarks/calibration.py
        bias=0.59, gain=0.07, evidence_gain=1.35, agreement_gain=0.49, mode_radius_m=np.inf
    )

    def __init__(self, config: KalmanConfig | None = None) -> None:
        self.config = config or KalmanConfig()
        self._before_start: WeightedPoses
        self._state: Gaussians | None = None  # of one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start at the prior, or wait for the first match. Draws nothing."""
        self._before_start = anywhere(topo_map)
        self._state = None
        if prior is not None:
            mean, covariance = mean_and_covariance(prior.poses, prior.weights, prior.spread)
            self._state = Gaussians.one(mean, covariance)

    def predict(self, motion: Motion) -> None:
        """Compose the motion, by the unscented transform."""
        if self._state is not None:
            self._state = moved(self._state, motion)

    def update(self, evidence: Evidence) -> float | None:
        """Weigh the branches, correct the Gaussian by each, collapse.

        Returns:
            log p(evidence | past); None for a blind frame and at the start, which is chosen, not foretold. -inf for a
            frame that is possible nowhere: the belief stays as predicted.
        """
        if evidence.is_blind:
            return None
        if self._state is None:
            best = best_hypothesis(evidence)
            self._state = Gaussians.one(evidence.poses[best], np.diag(hypothesis_variances(evidence, best)))
            return None
        right = Branches.of(self._state, Measurements.of(evidence))
        every = np.arange(len(evidence.poses))
        says_nothing = self._state.weighed(evidence.log_floor)
        branches = stacked(right.corrected(np.zeros_like(every), every), says_nothing)
        if branches.log_weights.max() == -np.inf:
            return -np.inf
        posterior = collapsed(branches)
        self._state = posterior.weighed(-posterior.log_weights)
        return float(posterior.log_weights[0])

    @property
    def belief(self) -> WeightedPoses:
        """Six cubature points with the mean and the covariance; before the start any node with any heading."""
        return self._before_start if self._state is None else cubature_belief(self._state)


class MultiGaussian:
    """Several weighted Gaussians, and a share of "anywhere": the grid's posterior, carried by moments.

    "Anywhere" is uniform over the free area and the circle, and the motion leaves it so. At the start it is all there
    is. What the evidence says of it makes new Gaussians at the hypotheses, of the same weights as the particles that
    the particle filter draws there: w_m 2 pi sigma_m^2 / A times the share of the hypothesis that lies in the free
    area of A m^2. Recovery adds to it at each update.
    Approximations: a Gaussian knows no wall and does not end at the border of the free area; the negligible is
    dropped, the alike are merged with their moments kept, and what exceeds ``components`` counts as anywhere.
    """

    Config = MultiGaussianConfig
    estimate_rule = EstimateRule(  # benchmarks/calibration.py
        bias=1.31, gain=0.38, evidence_gain=0.32, agreement_gain=0.25
    )

    def __init__(self, config: MultiGaussianConfig | None = None) -> None:
        self.config = config or MultiGaussianConfig()
        self._area: FreeArea
        self._any_node: WeightedPoses
        self._gaussians: Gaussians  # C of them; with the share of anywhere the weights sum to one
        self._anywhere: float

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start anywhere, or at the prior. Draws nothing."""
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        self._any_node = anywhere(topo_map)
        self._gaussians = Gaussians.none() if prior is None else gathered(prior, self.config.components)
        self._anywhere = 1.0 if prior is None else 0.0

    def predict(self, motion: Motion) -> None:
        """Compose the motion with every Gaussian, by the unscented transform."""
        self._gaussians = moved(self._gaussians, motion)

    def update(self, evidence: Evidence) -> float | None:
        """Split every Gaussian by the hypotheses, let new ones be born, prune and merge.

        Returns:
            log p(evidence | past), recovery included; None for a blind frame. -inf for a frame that is possible
            nowhere: the belief stays as predicted.
        """
        if evidence.is_blind:
            return None
        share, prior = self.config.recovery, self._gaussians.weighed(np.log1p(-self.config.recovery))
        with np.errstate(divide="ignore"):  # a share of none: log 0 is meant
            log_anywhere = np.log(share + (1.0 - share) * self._anywhere)
        right = Branches.of(prior, Measurements.of(evidence))
        others = stacked(prior.weighed(evidence.log_floor), born(evidence, self._area).weighed(log_anywhere))
        log_left = log_anywhere + evidence.log_floor
        log_joint = np.concatenate([right.log_weights.ravel(), others.log_weights, [log_left]])
        heaviest = float(log_joint.max())
        if heaviest == -np.inf:
            return heaviest
        log_evidence = heaviest + float(np.log(np.exp(log_joint - heaviest).sum()))
        least = heaviest + np.log(max(self.config.negligible, LEAST))
        branches = stacked(right.corrected(*np.nonzero(right.log_weights >= least)), others.above(least))
        self._settle(branches.weighed(-log_evidence), float(np.exp(log_left - log_evidence)))
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """Six cubature points a Gaussian; "anywhere", where it is worth naming, as any node with any heading."""
        if not len(self._gaussians.means):
            return self._any_node
        points = cubature_belief(self._gaussians)
        if self._anywhere < WORTH_NAMING:
            return points
        log_share = np.log(self._anywhere / len(self._any_node.poses))
        return WeightedPoses(
            np.concatenate([points.poses, self._any_node.poses]),
            np.concatenate([points.log_weights, np.full(len(self._any_node.poses), log_share)]),
        )

    def _settle(self, branches: Gaussians, share: float) -> None:
        """Take branches and a share of anywhere for the new belief: merge, keep the heaviest, weigh to one."""
        kept, left = merged(branches, self.config.overlap, self.config.components)
        total = float(np.exp(kept.log_weights).sum()) + left + share
        self._gaussians, self._anywhere = kept.weighed(-np.log(total)), (left + share) / total
