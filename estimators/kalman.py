"""Gaussian beliefs on filterpy's unscented Kalman filter: one Gaussian, and a weighted sum of them.

The motion turns with the heading, so it goes through the unscented filter. A hypothesis of the evidence measures the
pose itself, which is linear: its correction is the plain Kalman update, for all pairs of Gaussian and hypothesis at
once. (The unscented update gives the same numbers, one pair at a time.)

With the evidence of EQUATIONS.md, 4, a Gaussian N(x; mu, P) becomes a sum of Gaussians [ours]. K h is nearly
2 pi sigma^2 2 pi times a normal density of covariance R = diag(sigma^2, sigma^2, 1 / kappa). So the branch "hypothesis
m is right" has the weight w_m 2 pi sigma_m^2 2 pi N(z_m; mu, P + R_m) and the Kalman posterior; the branch "this frame
says nothing" has the floor's weight and stays as predicted. A von Mises is not a Gaussian: the weight is off by about
1 / (8 kappa). A heading that is less concentrated than one of which nothing is known counts as not measured.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, sin
from typing import Any

import numpy as np
from filterpy.kalman import UnscentedKalmanFilter
from numpy.polynomial.hermite_e import hermegauss
from scipy.special import log_softmax, logsumexp

from estimators.free_area import FreeArea
from estimators.gaussian import ANY_HEADING, anywhere, best_hypothesis, cubature_points, hypothesis_variances
from topoloc.estimate import EstimateRule, mean_and_covariance
from topoloc.geometry import Floats, covariance_root, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses

HEADING_NODES = 11
"""Of the quadrature over the heading: the cosine and sine of even an unknown heading then come out to 0.3 %."""
FAN = 6
"""Gaussians that share the circle where a hypothesis tells (nearly) no heading; the ripple of their sum is 1.4 %."""
FAN_BELOW = 1.0
"""Concentration of the heading below which a von Mises is too far from a Gaussian to be born as one."""
GRAIN = np.diag([1e-6, 1e-6, 1e-6])
"""Added to covariances that are compared [m^2, m^2, rad^2], so that two exactly known poses can be alike."""
LEAST = 1e-300
"""Weights below this share of the heaviest would vanish in sums."""
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
        self._filter = _pose_filter()
        self._before_start: WeightedPoses
        self._state: _Gaussians | None = None  # of one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start at the prior, or wait for the first match. Draws nothing."""
        self._before_start = anywhere(topo_map)
        self._state = None
        if prior is not None:
            mean, covariance = mean_and_covariance(prior.poses, prior.weights, prior.spread)
            self._state = _Gaussians.one(mean, covariance)

    def predict(self, motion: Motion) -> None:
        """Compose the motion, by the unscented transform."""
        if self._state is not None:
            self._state = _moved(self._filter, self._state, motion)

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
            self._state = _Gaussians.one(evidence.poses[best], np.diag(hypothesis_variances(evidence, best)))
            return None
        measured = _Measurements.of(evidence)
        log_joint = np.append(_log_joint(self._state, measured)[0], evidence.log_floor)
        log_evidence = float(logsumexp(log_joint))
        if np.isfinite(log_evidence):
            every = np.arange(len(evidence.poses))
            branches = _stacked(_corrected(self._state, measured, np.zeros_like(every), every), self._state)
            pooled = _pooled(branches.weighed(log_joint), np.zeros_like(log_joint, dtype=np.int64))
            self._state = pooled.weighed(-pooled.log_weights)
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """Six cubature points with the mean and the covariance; before the start any node with any heading."""
        return self._before_start if self._state is None else _points(self._state)


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
        self._filter = _pose_filter()
        self._area: FreeArea
        self._any_node: WeightedPoses
        self._gaussians: _Gaussians  # C of them; with the share of anywhere the weights sum to one
        self._anywhere: float

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start anywhere, or at the prior. Draws nothing."""
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        self._any_node = anywhere(topo_map)
        self._gaussians = _Gaussians.none() if prior is None else _gathered(prior, self.config.components)
        self._anywhere = 1.0 if prior is None else 0.0

    def predict(self, motion: Motion) -> None:
        """Compose the motion with every Gaussian, by the unscented transform."""
        self._gaussians = _moved(self._filter, self._gaussians, motion)

    def update(self, evidence: Evidence) -> float | None:
        """Split every Gaussian by the hypotheses, let new ones be born, prune and merge.

        Returns:
            log p(evidence | past), recovery included; None for a blind frame. -inf for a frame that is possible
            nowhere: the belief stays as predicted.
        """
        if evidence.is_blind:
            return None
        share, measured = self.config.recovery, _Measurements.of(evidence)
        prior = self._gaussians.weighed(np.log1p(-share))
        with np.errstate(divide="ignore"):  # a share of none: log 0 is meant
            log_anywhere = np.log(share + (1.0 - share) * self._anywhere)
        born = _born(evidence, self._area).weighed(log_anywhere)
        stayed = prior.weighed(evidence.log_floor)
        log_pairs = _log_joint(prior, measured)
        log_left = log_anywhere + evidence.log_floor
        log_joint = np.concatenate([log_pairs.ravel(), stayed.log_weights, born.log_weights, [log_left]])
        log_evidence = float(logsumexp(log_joint))
        if np.isfinite(log_evidence):
            least = log_joint.max() + np.log(max(self.config.negligible, LEAST))
            component, hypothesis = np.nonzero(log_pairs >= least)
            pairs = _corrected(prior, measured, component, hypothesis).weighed(log_pairs[component, hypothesis])
            branches = _stacked(pairs, stayed.above(least), born.above(least))
            self._settle(branches.weighed(-log_evidence), float(np.exp(log_left - log_evidence)))
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """Six cubature points a Gaussian; "anywhere", where it is worth naming, as any node with any heading."""
        if not len(self._gaussians.means):
            return self._any_node
        points = _points(self._gaussians)
        if self._anywhere < WORTH_NAMING:
            return points
        log_share = np.log(self._anywhere / len(self._any_node.poses))
        return WeightedPoses(
            np.concatenate([points.poses, self._any_node.poses]),
            np.concatenate([points.log_weights, np.full(len(self._any_node.poses), log_share)]),
        )

    def _settle(self, branches: _Gaussians, share: float) -> None:
        """Take branches and a share of anywhere for the new belief: merge, keep the heaviest, weigh to one."""
        merged, left = _merged(branches, self.config.overlap, self.config.components)
        total = float(np.exp(merged.log_weights).sum()) + left + share
        self._gaussians, self._anywhere = merged.weighed(-np.log(total)), (left + share) / total


@dataclass(frozen=True)
class _Gaussians:
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
    def none(cls) -> _Gaussians:
        return cls(np.zeros(0), np.zeros((0, 3)), np.zeros((0, 3, 3)))

    @classmethod
    def one(cls, mean: Floats, covariance: Floats) -> _Gaussians:
        return cls(np.zeros(1), mean[None], _bounded(covariance[None]))

    def weighed(self, log_factors: Floats | float) -> _Gaussians:
        """The same with their weights multiplied, each by its own factor (C,) or all by one."""
        return _Gaussians(self.log_weights + log_factors, self.means, self.covariances)

    def part(self, chosen: slice | Ints | np.ndarray) -> _Gaussians:
        return _Gaussians(self.log_weights[chosen], self.means[chosen], self.covariances[chosen])

    def above(self, least: float) -> _Gaussians:
        return self.part(self.log_weights >= least)


@dataclass(frozen=True)
class _Measurements:
    """Evidence as M linear measurements of the pose, z = rows x + noise.

    Attributes:
        log_likelihoods: (M,) of the hypotheses, times what makes a density of K h: 2 pi sigma^2 2 pi.
        poses: (M, 3) z.
        rows: (M, 3) 1 where x, y, theta are measured, else 0.
        variances: (M, 3) of the noise.
    """

    log_likelihoods: Floats
    poses: Floats
    rows: Floats
    variances: Floats

    @classmethod
    def of(cls, evidence: Evidence) -> _Measurements:
        """What is not measured gets the variance at which 2 pi times the density of zero is 1, which is h's mean."""
        told = evidence.kappa > 1.0 / ANY_HEADING
        heading = np.where(told, 1.0 / np.maximum(evidence.kappa, 1.0 / ANY_HEADING), 2.0 * np.pi)
        position, ones = evidence.sigma**2, np.ones(len(told))
        return cls(
            evidence.log_likelihoods + np.log(2.0 * np.pi * position) + np.log(2.0 * np.pi),
            evidence.poses,
            np.column_stack([ones, ones, told]),
            np.column_stack([position, position, heading]),
        )

    def part(self, chosen: Ints) -> _Measurements:
        return _Measurements(
            self.log_likelihoods[chosen], self.poses[chosen], self.rows[chosen], self.variances[chosen]
        )

    def innovations(self, means: Floats, covariances: Floats) -> tuple[Floats, Floats]:
        """Innovations (..., 3) of Gaussians, and their covariances (..., 3, 3); shapes broadcast with (M,)."""
        difference = self.poses - means
        difference[..., 2] = wrap(difference[..., 2])
        seen = self.rows[..., :, None] * covariances * self.rows[..., None, :]
        return self.rows * difference, seen + self.variances[..., None] * np.eye(3)


class _HeadingFirstPoints:
    """Sigma points for filterpy: Gauss-Hermite quadrature over the heading, the position along with it (ours).

    A motion is linear in the position but turns with the heading. So the heading is deviated alone, with the position
    that goes with it by its covariance, and the rest of the position in two more pairs, which take the place of the
    quadrature's middle. All weights are positive, a covariance may be singular, and turning the world turns the points.
    With three nodes these are the usual six points, which take an unknown heading for known to half a circle.
    """

    def __init__(self) -> None:
        nodes, weights = hermegauss(HEADING_NODES)
        middle = HEADING_NODES // 2
        self.heading_weights = weights / weights.sum()
        self.heading_nodes = nodes
        self._away = np.delete(nodes, middle)
        self._reach = np.sqrt(2.0 / self.heading_weights[middle])
        across = np.full(4, self.heading_weights[middle] / 4.0)
        self.Wm = self.Wc = np.concatenate([np.delete(self.heading_weights, middle), across])

    def num_sigmas(self) -> int:
        return len(self.Wm)

    def sigma_points(self, mean: Floats, covariance: Floats) -> Floats:
        """(S, 3) with exactly this mean (3,) and covariance (3, 3)."""
        deviation = np.sqrt(covariance[2, 2])
        along = covariance[:, 2] / deviation if deviation > 0.0 else np.zeros(3)
        across = np.zeros((2, 3))
        across[:, :2] = self._reach * covariance_root(covariance[:2, :2] - np.outer(along[:2], along[:2])).T
        return np.asarray(mean + np.concatenate([self._away[:, None] * along, across, -across]))


def _pose_filter() -> Any:
    """An unscented filter of poses, to be loaded with one Gaussian after the other.

    Headings are not wrapped on the way through it: sigma points more than half a turn apart must stay so, or the
    covariance of a wide heading would shrink at each step.
    """
    return UnscentedKalmanFilter(dim_x=3, dim_z=3, dt=1.0, hx=None, fx=_composed, points=_HeadingFirstPoints())


def _composed(pose: Floats, dt: float, delta: Floats) -> Floats:
    """``compose`` for one sigma point, the heading not wrapped; a step of the odometer is one unit of time."""
    x, y, heading = pose
    along, across, turn = delta
    turned_x, turned_y = cos(heading) * along - sin(heading) * across, sin(heading) * along + cos(heading) * across
    return np.array([x + turned_x, y + turned_y, heading + turn])


def _moved(ukf: Any, gaussians: _Gaussians, motion: Motion) -> _Gaussians:
    """Every Gaussian after a motion.

    The noise stands in the robot's frame and has the mean zero whatever the heading, so by the law of total covariance
    it adds the mean of G Q G' over the heading: additive noise, and exact.
    """
    noises = _mean_noise(gaussians, ukf.points_fn, motion.covariance)
    means, covariances = np.empty_like(gaussians.means), np.empty_like(gaussians.covariances)
    for index, (mean, covariance, noise) in enumerate(zip(gaussians.means, gaussians.covariances, noises, strict=True)):
        ukf.x, ukf.P, ukf.Q = mean, covariance, noise
        ukf.predict(delta=motion.delta)
        means[index], covariances[index] = ukf.x, ukf.P
    means[:, 2] = wrap(means[:, 2])
    return _Gaussians(gaussians.log_weights, means, _bounded(covariances))


def _mean_noise(gaussians: _Gaussians, points: _HeadingFirstPoints, covariance: Floats) -> Floats:
    """(C, 3, 3) mean over each Gaussian's heading of a covariance (3, 3) turned by it."""
    deviations = np.sqrt(gaussians.covariances[:, 2, 2])
    headings = gaussians.means[:, 2:] + deviations[:, None] * points.heading_nodes
    turn = np.zeros((*headings.shape, 3, 3))
    turn[..., 0, 0] = turn[..., 1, 1] = np.cos(headings)
    turn[..., 1, 0] = np.sin(headings)
    turn[..., 0, 1] = -turn[..., 1, 0]
    turn[..., 2, 2] = 1.0
    turned = turn @ covariance @ turn.swapaxes(-1, -2)
    return np.asarray((points.heading_weights[:, None, None] * turned).sum(axis=1))


def _bounded(covariances: Floats) -> Floats:
    """Covariances (C, 3, 3) with no heading less known than any heading, its deviations shrunk where need be."""
    shrink = np.ones(covariances.shape[:2])
    shrink[:, 2] = np.sqrt(ANY_HEADING / np.maximum(covariances[:, 2, 2], ANY_HEADING))
    return np.asarray(shrink[:, :, None] * covariances * shrink[:, None, :])


def _log_joint(gaussians: _Gaussians, measured: _Measurements) -> Floats:
    """(C, M) log of a Gaussian's weight times the integral of w_m K h over it."""
    innovation, spread = measured.innovations(gaussians.means[:, None], gaussians.covariances[:, None])
    squared = (innovation * np.linalg.solve(spread, innovation[..., None])[..., 0]).sum(axis=-1)
    log_density = -0.5 * (squared + np.linalg.slogdet(spread)[1] + 3.0 * np.log(2.0 * np.pi))
    return np.asarray(gaussians.log_weights[:, None] + measured.log_likelihoods + log_density)


def _corrected(gaussians: _Gaussians, measured: _Measurements, component: Ints, hypothesis: Ints) -> _Gaussians:
    """The Gaussians (N,) of pairs of component (N,) and hypothesis (N,), by the Kalman update; log weights 0.

    Joseph's form of the covariance: a measurement to a hair of a pose known to a kilometre must not round below zero.
    """
    means, covariances = gaussians.means[component], gaussians.covariances[component]
    chosen = measured.part(hypothesis)
    innovation, spread = chosen.innovations(means, covariances)
    gain = np.linalg.solve(spread, chosen.rows[:, :, None] * covariances).swapaxes(-1, -2)
    means = means + (gain @ innovation[:, :, None])[:, :, 0]
    kept = np.eye(3) - gain * chosen.rows[:, None, :]
    noise = (gain * chosen.variances[:, None, :]) @ gain.swapaxes(-1, -2)
    return _Gaussians(np.zeros(len(means)), means, kept @ covariances @ kept.swapaxes(-1, -2) + noise)


def _born(evidence: Evidence, area: FreeArea) -> _Gaussians:
    """What evidence makes of a robot that could be anywhere: a Gaussian a hypothesis, weighed by its likelihood."""
    seeds = evidence.poses[:, None, :2] + evidence.sigma[:, None, None] * _disc()
    inside = area.contains(seeds.reshape(-1, 2)).reshape(seeds.shape[:2]).mean(axis=1)
    with np.errstate(divide="ignore"):  # a hypothesis outside: log 0 is meant
        log_mass = np.log(2.0 * np.pi * evidence.sigma**2 * inside / area.size)
    position, concentration = evidence.sigma**2, np.maximum(evidence.kappa, FAN_BELOW)
    variances = np.column_stack([position, position, 1.0 / concentration])
    means = np.column_stack([evidence.poses[:, :2], wrap(evidence.poses[:, 2])])
    born = _Gaussians(evidence.log_likelihoods + log_mass, means, variances[:, :, None] * np.eye(3))
    wide = evidence.kappa < FAN_BELOW
    return _stacked(born.part(~wide), _fanned(born.part(wide), evidence.kappa[wide]))


def _fanned(gaussians: _Gaussians, kappa: Floats) -> _Gaussians:
    """Each of M Gaussians as ``FAN`` of them around the circle, for headings of small concentration (M,)."""
    turns = 2.0 * np.pi * np.arange(FAN) / FAN
    log_shares = log_softmax(kappa[:, None] * np.cos(turns), axis=1)
    fan = gaussians.part(np.repeat(np.arange(len(kappa)), FAN)).weighed(log_shares.ravel())
    fan.means[:, 2] += np.tile(turns, len(kappa))
    fan.covariances[:, 2, 2] = (np.pi / FAN) ** 2
    return fan


def _disc(count: int = 64) -> Floats:
    """(count, 2) points of equal weight, spread like a normal distribution of the plane: a sunflower's seeds."""
    order = np.arange(count)
    radius, angle = np.sqrt(-2.0 * np.log1p(-(order + 0.5) / count)), order * np.pi * (3.0 - np.sqrt(5.0))
    return np.asarray(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


def _stacked(*parts: _Gaussians) -> _Gaussians:
    return _Gaussians(
        np.concatenate([part.log_weights for part in parts]),
        np.concatenate([part.means for part in parts]),
        np.concatenate([part.covariances for part in parts]),
    )


def _points(gaussians: _Gaussians) -> WeightedPoses:
    """Six cubature points a Gaussian, its weight shared evenly among them."""
    pairs = zip(gaussians.means, gaussians.covariances, strict=True)
    poses = np.concatenate([cubature_points(mean, covariance).poses for mean, covariance in pairs])
    return WeightedPoses(poses, np.repeat(gaussians.log_weights, 6) - np.log(6.0))


def _pooled(gaussians: _Gaussians, labels: Ints) -> _Gaussians:
    """One Gaussian a label (0, 1, ...), with the weight, the mean and the covariance of those that bear it.

    The mean heading is the mixture's mean direction: a Gaussian pulls by its resultant exp(-variance / 2), so that one
    which knows no heading has no say in it.
    """
    heaviest = gaussians.log_weights.max(initial=-np.inf)
    weights = np.exp(gaussians.log_weights - heaviest)
    members = (labels == np.arange(labels.max(initial=-1) + 1)[:, None]) * weights  # (G, C)
    totals = members.sum(axis=1)
    shares = members / totals[:, None]
    heading = gaussians.means[:, 2]
    pull = np.exp(-0.5 * gaussians.covariances[:, 2, 2])
    direction = np.arctan2(shares @ (pull * np.sin(heading)), shares @ (pull * np.cos(heading)))
    means = np.column_stack([shares @ gaussians.means[:, :2], wrap(direction)])
    deviations = gaussians.means - means[labels]
    deviations[:, 2] = wrap(deviations[:, 2])
    second = gaussians.covariances + deviations[:, :, None] * deviations[:, None, :]
    covariances = np.tensordot(shares, second, axes=1)
    return _Gaussians(np.log(totals) + heaviest, means, _bounded(covariances))


def _merged(gaussians: _Gaussians, overlap: float, most: int) -> tuple[_Gaussians, float]:
    """The heaviest takes in those that overlap it enough, then the heaviest of the rest, until ``most`` have done so.

    Returns:
        At most ``most`` Gaussians, and the weight that is left.
    """
    ordered = _ordered(gaussians)
    log_volumes = 0.5 * np.linalg.slogdet(ordered.covariances + GRAIN)[1]
    labels = np.full(len(ordered.means), -1)
    for label in range(most):
        rest = np.flatnonzero(labels < 0)
        if not len(rest):
            break
        alike = _overlaps(ordered.part(rest), log_volumes[rest]) >= overlap
        alike[0] = True  # whatever the rounding
        labels[rest[alike]] = label
    taken = labels >= 0
    return _pooled(ordered.part(taken), labels[taken]), float(np.exp(ordered.log_weights[~taken]).sum())


def _ordered(gaussians: _Gaussians) -> _Gaussians:
    """Heaviest first; equal ones, but for rounding, by pose: their order does not matter."""
    x, y, heading = gaussians.means.T
    return gaussians.part(np.lexsort((heading, y, x, -gaussians.log_weights.round(9))))


def _overlaps(gaussians: _Gaussians, log_volumes: Floats) -> Floats:
    """(C,) Bhattacharyya coefficients with the first: the integrals of the root of two densities' product.

    Args:
        gaussians: C of them.
        log_volumes: (C,) log roots of their covariances' determinants, the grain added.
    """
    difference = gaussians.means - gaussians.means[0]
    difference[:, 2] = wrap(difference[:, 2])
    middle = 0.5 * (gaussians.covariances + gaussians.covariances[0]) + GRAIN
    squared = (difference * np.linalg.solve(middle, difference[:, :, None])[:, :, 0]).sum(axis=1)
    log_ratio = 0.5 * (log_volumes + log_volumes[0]) - 0.5 * np.linalg.slogdet(middle)[1]
    return np.asarray(np.exp(log_ratio - squared / 8.0))


def _gathered(prior: WeightedPoses, most: int) -> _Gaussians:
    """Weighted poses as at most ``most`` Gaussians: poses that share a cell are pooled, of cells as large as needed."""
    alive = np.flatnonzero(prior.log_weights > prior.log_weights.max() + np.log(LEAST))
    count, poses = len(alive), prior.poses[alive]
    covariances = np.broadcast_to(np.diag(prior.spread), (count, 3, 3))
    gaussians = _Gaussians(np.log(prior.weights[alive]), poses, _bounded(covariances))
    labels, side = np.arange(count), 0.25
    while labels.max() >= most:
        cells = np.floor((poses - poses.min(axis=0)) / side)
        labels = np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1)
        side *= 2.0
    return _pooled(gaussians, labels)
