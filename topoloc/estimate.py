"""Belief -> Estimate: one formula for every estimator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit

from topoloc.geometry import Floats, circular_mean, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Evidence, Status, WeightedPoses

SUREST = 0.999
"""A belief of samples or cells that is surer than this says nothing by it."""
SURPRISE = -20.0
"""A log-likelihood below this counts as this, and above its opposite as that: one look must not outweigh all else."""


@dataclass(frozen=True)
class EstimateRule:
    """Coefficients of the formula (ours) for the probability that the named node is right.

    probability = expit(bias + gain * logit(mass) + evidence_gain * log evidence + agreement_gain * agreement).

    ``mass`` is the belief's share nearest to the leading node, at most ``SUREST``; the log evidence is a running mean
    of what ``update`` returns; the agreement is the log-likelihood of the last look at the estimated pose, which asks
    nothing of the estimator. An estimator class may carry its own rule as the attribute ``estimate_rule``, fitted by
    ``benchmarks/calibration.py``; this default takes the belief at its word.

    Attributes:
        bias, gain, evidence_gain, agreement_gain: coefficients of the formula.
        evidence_memory: share of the running log evidence that stays at each update.
        mode_radius_m: poses within this distance of the leading node's mean make up the reported mode [m]; infinity
            for an estimator that holds one Gaussian, whose mean and covariance then come out exactly.
        localized_above: LOCALIZED from this probability on.
        lost_below: LOST below this probability.
        astray_m: a mode farther than this from every node, edge and free area is at no node: probability 0, LOST [m].
    """

    bias: float = 0.0
    gain: float = 1.0
    evidence_gain: float = 0.0
    agreement_gain: float = 0.0
    evidence_memory: float = 0.7
    mode_radius_m: float = 1.0
    localized_above: float = 0.7
    lost_below: float = 0.3
    astray_m: float = 2.0

    @property
    def coefficients(self) -> tuple[float, float, float, float]:
        """Of 1, the logit of the mass, the log evidence and the agreement."""
        return self.bias, self.gain, self.evidence_gain, self.agreement_gain


def agreement(evidence: Evidence | None, pose: Floats) -> float:
    """Log-likelihood of a look at a pose (3,): above 0 it speaks for the pose; 0 for a blind look, or none.

    No farther from 0 than ``SURPRISE``.
    """
    if evidence is None or evidence.is_blind:
        return 0.0
    there = float(evidence.log_likelihood(pose[None, :2], pose[None, 2:])[0, 0])
    return min(max(there, SURPRISE), -SURPRISE)


def sureness(mass: float) -> float:
    """Logit of a belief's mass, as if it were at most ``SUREST`` and at least one minus that."""
    return float(logit(np.clip(mass, 1.0 - SUREST, SUREST)))


def node_masses(belief: WeightedPoses, topo_map: TopoMap) -> Floats:
    """Share (K,) of the belief that lies nearest to each node; sums to one."""
    nearest = topo_map.nearest_node(belief.poses[:, :2])
    return np.asarray(np.bincount(nearest, weights=belief.weights, minlength=len(topo_map.nodes)), dtype=np.float64)


def mean_and_covariance(poses: Floats, weights: Floats, spread: Floats) -> tuple[Floats, Floats]:
    """Mean pose (3,) and covariance (3, 3) of weighted poses (N, 3), headings on the circle, the spread added."""
    share = weights / weights.sum()
    mean = np.array([*(share @ poses[:, :2]), circular_mean(poses[:, 2], share)])
    deviation = np.column_stack([poses[:, :2] - mean[:2], wrap(poses[:, 2] - mean[2])])
    return mean, (share[:, None] * deviation).T @ deviation + np.diag(spread)


def estimate_from(
    belief: WeightedPoses,
    topo_map: TopoMap,
    log_evidence: float = 0.0,
    rule: EstimateRule | None = None,
    evidence: Evidence | None = None,
) -> Estimate:
    """Read an estimate off a belief.

    Args:
        belief: of any estimator.
        topo_map: whose nodes are named.
        log_evidence: running log p(evidence | past); 0 where there is none.
        rule: coefficients; the default takes the belief at its word.
        evidence: of the last look, about the robot; None where there was none.

    Returns:
        The leading node (None on an exact tie), its probability, and the mode around it.
    """
    chosen = rule or EstimateRule()
    nearest, weights = topo_map.nearest_node(belief.poses[:, :2]), belief.weights
    masses = np.bincount(nearest, weights=weights, minlength=len(topo_map.nodes))
    leader = int(np.argmax(masses))
    mass = float(masses[leader])
    tied = bool(np.isclose(np.delete(masses, leader), mass, rtol=1e-9, atol=0.0).any())
    pose, covariance = _leading_mode(belief, weights, nearest == leader, chosen.mode_radius_m)
    clues = (1.0, sureness(mass), log_evidence, agreement(evidence, pose))
    probability = float(expit(np.dot(chosen.coefficients, clues)))
    node = None if tied else leader
    if tied or _astray(pose, topo_map, chosen.astray_m):
        probability = 0.0
    return Estimate(pose, covariance, node, probability, _status(node, probability, chosen))


def _astray(pose: Floats, topo_map: TopoMap, reach: float) -> bool:
    """Whether a pose lies off the map; most lie near a node, and need no look at the edges."""
    place = pose[None, :2]
    return bool(topo_map.distance_to_nearest(place)[0] > reach and not topo_map.is_free(place, reach)[0])


def _leading_mode(belief: WeightedPoses, weights: Floats, leading: np.ndarray, radius: float) -> tuple[Floats, Floats]:
    """Mean and covariance of the belief around its leading share (N,) bool: a mode does not end at a node's border."""
    own = weights * leading
    centre = own @ belief.poses[:, :2] / own.sum()
    near = np.linalg.norm(belief.poses[:, :2] - centre, axis=1) <= radius
    if weights[near].sum() == 0.0:  # the share is spread wide around an empty middle
        near = own > 0.0
    return mean_and_covariance(belief.poses[near], weights[near], belief.spread)


def _status(node: int | None, probability: float, rule: EstimateRule) -> Status:
    if node is None or probability < rule.lost_below:
        return Status.LOST
    return Status.LOCALIZED if probability >= rule.localized_above else Status.AMBIGUOUS
