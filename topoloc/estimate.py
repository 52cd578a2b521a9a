"""Belief -> Estimate: one formula for every estimator."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import expit, logit

from topoloc.geometry import Floats, circular_mean, cos_sin, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Evidence, Status, WeightedPoses

SUREST = 0.999
"""A belief of samples or cells that is surer than this says nothing by it."""
CACHED = 8192
"""Headings that are worked on at a time."""
CANCELLED = 1e-5
"""Length of a mean of unit vectors below which its direction is not good to 1e-9."""
TIED = 1e-9
"""Nodes are as likely where their masses differ by no more than this share."""
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
    return _moments(np.ascontiguousarray(poses.T), weights, spread)


def _moments(columns: Floats, weights: Floats, spread: Floats) -> tuple[Floats, Floats]:
    """``mean_and_covariance`` of columns (3, N) of poses: a row is one stretch of memory, which numpy is fastest at."""
    share = weights / weights.sum()
    mean = np.append(columns[:2] @ share, _mean_heading(columns[2], share))
    deviation = columns - mean[:, None]
    deviation[2] = wrap(deviation[2])
    return mean, (share * deviation) @ deviation.T + np.diag(spread)


def _mean_heading(headings: Floats, share: Floats) -> float:
    """``circular_mean`` of headings (N,) with weights (N,) that sum to one, by parts that stay in the cache.

    Headings that all but cancel have no direction but rounding's, which is left to ``circular_mean``.
    """
    resultant = np.zeros(2)
    for part in (slice(first, first + CACHED) for first in range(0, len(headings), CACHED)):
        resultant += np.stack(cos_sin(headings[part])) @ share[part]
    if np.abs(resultant).max() < CANCELLED:
        return circular_mean(headings, share)
    return float(wrap(np.arctan2(resultant[1], resultant[0])))


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
    tied = np.count_nonzero(mass - masses <= TIED * mass) > 1
    pose, covariance = _leading_mode(belief, weights, nearest == leader, chosen.mode_radius_m)
    clues = (1.0, sureness(mass), log_evidence, agreement(evidence, pose))
    probability = float(expit(np.dot(chosen.coefficients, clues)))
    node = None if tied else leader
    if tied or _astray(pose, topo_map, leader, chosen.astray_m):
        probability = 0.0
    return Estimate(pose, covariance, node, probability, _status(node, probability, chosen))


def _astray(pose: Floats, topo_map: TopoMap, leader: int, reach: float) -> bool:
    """Whether a pose lies off the map; most lie near the leading node, and need no look at the others or the edges."""
    if np.linalg.norm(pose[:2] - topo_map.positions[leader]) <= reach:
        return False
    place = pose[None, :2]
    return bool(topo_map.distance_to_nearest(place)[0] > reach and not topo_map.is_free(place, reach)[0])


def _leading_mode(belief: WeightedPoses, weights: Floats, leading: np.ndarray, radius: float) -> tuple[Floats, Floats]:
    """Mean and covariance of the belief around its leading share (N,) bool: a mode does not end at a node's border."""
    own, columns = weights * leading, np.ascontiguousarray(belief.poses.T)
    x, y = columns[:2] - (own @ belief.poses[:, :2] / own.sum())[:, None]
    near = np.sqrt(x * x + y * y) <= radius
    if weights[near].sum() == 0.0:  # the share is spread wide around an empty middle
        near = own > 0.0
    return _moments(columns.compress(near, axis=1), weights[near], belief.spread)


def _status(node: int | None, probability: float, rule: EstimateRule) -> Status:
    if node is None or probability < rule.lost_below:
        return Status.LOST
    return Status.LOCALIZED if probability >= rule.localized_above else Status.AMBIGUOUS
