"""A weighted sum of Gaussians over poses: how it is gathered, merged, collapsed and handed out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimators.gaussian import ANY_HEADING, cubature_poses
from topoloc.geometry import Floats, wrap
from topoloc.types import Ints, WeightedPoses

GRAIN = np.diag([1e-6, 1e-6, 1e-6])
"""Added to covariances that are compared [m^2, m^2, rad^2], so that two exactly known poses can be alike."""
PAIRS = 512
"""Pairs of Gaussians that are compared at a time: more, and too many are compared with one that was merged by then."""
LEAST = 1e-300
"""Weights below this share of the heaviest would vanish in sums."""


@dataclass(frozen=True)
class Gaussians:
    """C weighted Gaussians over poses.

    Attributes:
        log_weights: (C,).
        means: (C, 3), headings by any number of turns.
        covariances: (C, 3, 3) [m, m, rad].
    """

    log_weights: Floats
    means: Floats
    covariances: Floats

    @classmethod
    def none(cls) -> Gaussians:
        """A sum of nothing."""
        return cls(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)))

    @classmethod
    def one(cls, mean: Floats, covariance: Floats) -> Gaussians:
        """A single one of weight one, with mean (3,) and covariance (3, 3)."""
        return cls(np.zeros(1), mean[None], bounded(covariance[None]))

    def weighed(self, log_factors: Floats | float) -> Gaussians:
        """The same with their weights multiplied, each by its own factor (C,) or all by one."""
        return Gaussians(self.log_weights + log_factors, self.means, self.covariances)

    def part(self, chosen: slice | Ints | np.ndarray) -> Gaussians:
        """Some of them, by index or as a mask."""
        return Gaussians(self.log_weights[chosen], self.means[chosen], self.covariances[chosen])

    def above(self, least: float) -> Gaussians:
        """Those of at least this log weight."""
        return self.part(self.log_weights >= least)


def stacked(*parts: Gaussians) -> Gaussians:
    """Several sums as one."""
    return Gaussians(
        np.concatenate([part.log_weights for part in parts]),
        np.concatenate([part.means for part in parts]),
        np.concatenate([part.covariances for part in parts]),
    )


def bounded(covariances: Floats) -> Floats:
    """Covariances (C, 3, 3) with no heading less known than any heading, its deviations shrunk where need be."""
    variances = covariances[:, 2, 2]
    if variances.max(initial=0.0) <= ANY_HEADING:
        return covariances
    shrink = np.ones(covariances.shape[:2])
    shrink[:, 2] = np.sqrt(ANY_HEADING / np.maximum(variances, ANY_HEADING))
    return np.asarray(shrink[:, :, None] * covariances * shrink[:, None, :])


def cubature_belief(gaussians: Gaussians) -> WeightedPoses:
    """Six cubature points a Gaussian, its weight shared evenly among them."""
    poses = cubature_poses(gaussians.means, gaussians.covariances)
    return WeightedPoses(poses, np.repeat(gaussians.log_weights, 6) - np.log(6.0))


def collapsed(gaussians: Gaussians) -> Gaussians:
    """One Gaussian of the weight, the mean and the covariance of them all; see ``pooled``."""
    return pooled(gaussians, np.zeros(len(gaussians.means), dtype=np.int64))


def pooled(gaussians: Gaussians, labels: Ints) -> Gaussians:
    """One Gaussian a label (0, 1, ...), with the weight, the mean and the covariance of those that bear it.

    The mean heading is the mixture's mean direction: a Gaussian pulls by its resultant exp(-variance / 2), so that one
    which knows no heading has no say in it.
    """
    heaviest = gaussians.log_weights.max(initial=-np.inf)
    weights = np.exp(gaussians.log_weights - heaviest)
    members = (labels == np.arange(labels.max(initial=-1) + 1)[:, None]) * weights  # (G, C)
    totals = members.sum(axis=1)
    shares = members / totals[:, None]
    heading, pull = gaussians.means[:, 2], np.exp(-0.5 * gaussians.covariances[:, 2, 2])
    means = np.empty((len(totals), 3))
    means[:, :2] = shares @ gaussians.means[:, :2]
    means[:, 2] = np.arctan2(shares @ (pull * np.sin(heading)), shares @ (pull * np.cos(heading)))
    means[:, 2] = wrap(means[:, 2])
    deviations = gaussians.means - means[labels]
    deviations[:, 2] = wrap(deviations[:, 2])
    second = gaussians.covariances + deviations[:, :, None] * deviations[:, None, :]
    covariances = (shares @ second.reshape(-1, 9)).reshape(-1, 3, 3)
    return Gaussians(np.log(totals) + heaviest, means, bounded(covariances))


def merged(gaussians: Gaussians, overlap: float, most: int) -> tuple[Gaussians, float]:
    """The heaviest takes in those that overlap it enough, then the heaviest of the rest, until ``most`` have done so.

    Returns:
        At most ``most`` Gaussians, and the weight that is left.
    """
    ordered = _ordered(gaussians)
    labels, count, rest = np.full(len(ordered.means), -1), 0, np.arange(len(ordered.means))
    while len(rest) and count < most:
        alike = _alike(ordered.part(rest), max(1, PAIRS // len(rest)), overlap)
        free = np.ones(len(rest), dtype=bool)
        for head in range(len(alike)):
            if free[head] and count < most:
                taken = alike[head] & free
                labels[rest[taken]] = count
                free ^= taken
                count += 1
        rest = rest[free]
    taken = labels >= 0
    return pooled(ordered.part(taken), labels[taken]), float(np.exp(ordered.log_weights[~taken]).sum())


def _ordered(gaussians: Gaussians) -> Gaussians:
    """Heaviest first; equal ones, but for rounding, by pose: their order does not matter."""
    x, y, heading = gaussians.means.T
    return gaussians.part(np.lexsort((heading, y, x, -gaussians.log_weights.round(9))))


def _alike(gaussians: Gaussians, heads: int, overlap: float) -> np.ndarray:
    """(H, C) which overlap the first H, by a Bhattacharyya coefficient: the integral of the root of two densities.

    It is at most exp(-d' M^-1 d / 8), of the difference d of the means and the mean M of the covariances, and for each
    axis d' M^-1 d is at least d_i^2 / M_ii: so most are told apart without a matrix to solve.

    Args:
        gaussians: C of them; a head is alike to itself, and not asked about those before it.
        heads: H, or more than there are.
        overlap: from this coefficient on.
    """
    means, variances = gaussians.means.T, np.diagonal(gaussians.covariances, axis1=1, axis2=2).T  # (3, C)
    difference = means[:, None] - means[:, :heads, None]  # (3, H, C)
    difference[2] = wrap(difference[2])
    farthest = -8.0 * np.log(overlap) + 1e-6  # no nearer than rounding tells
    middle = 0.5 * (variances[:, None] + variances[:, :heads, None]) + np.diag(GRAIN)[:, None, None]
    near = np.triu((difference**2 <= farthest * middle).all(axis=0), 1)
    head, other = np.nonzero(near)
    alike = np.eye(*near.shape) > 0.0
    alike[near] = _overlaps(gaussians, head, other, difference[:, near].T) >= overlap
    return np.asarray(alike)


def _overlaps(gaussians: Gaussians, one: Ints, other: Ints, difference: Floats) -> Floats:
    """(N,) Bhattacharyya coefficients of pairs, given by index (N,) and difference of the means (N, 3)."""
    log_volumes = 0.5 * np.linalg.slogdet(gaussians.covariances + GRAIN)[1]
    middle = 0.5 * (gaussians.covariances[one] + gaussians.covariances[other]) + GRAIN
    squared = (difference * np.linalg.solve(middle, difference[:, :, None])[:, :, 0]).sum(axis=1)
    log_ratio = 0.5 * (log_volumes[one] + log_volumes[other]) - 0.5 * np.linalg.slogdet(middle)[1]
    return np.asarray(np.exp(log_ratio - squared / 8.0))


def gathered(prior: WeightedPoses, most: int) -> Gaussians:
    """Weighted poses as at most ``most`` Gaussians: poses that share a cell are pooled, of cells as large as needed."""
    alive = np.flatnonzero(prior.log_weights > prior.log_weights.max() + np.log(LEAST))
    count, poses = len(alive), prior.poses[alive]
    covariances = np.broadcast_to(np.diag(prior.spread), (count, 3, 3))
    gaussians = Gaussians(np.log(prior.weights[alive]), poses, bounded(covariances))
    labels, side = np.arange(count), 0.25
    while labels.max() >= most:
        cells = np.floor((poses - poses.min(axis=0)) / side)
        labels = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
        side *= 2.0
    return pooled(gaussians, labels)
