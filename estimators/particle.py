"""Monte Carlo localization: a bootstrap (SIR) particle filter with recovery from the evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from estimators.free_area import FreeArea
from estimators.resampling import RESAMPLERS
from estimators.sampling import sample_motion, sample_poses
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses


@dataclass(frozen=True)
class ParticleFilterConfig:
    """Settings of the particle filter.

    Attributes:
        particles: how many.
        resampling: ``systematic``, ``stratified``, ``residual`` or ``multinomial``.
        ess_threshold: resample when the effective sample size falls below this share of the particles.
        recovery: probability, at each update, that the robot is anywhere in the free area instead; as the grid's.
        resolution_m: side of the cells that the free area is made of [m]; as the grid's.
        reach_m: how far from a node or an edge the robot may be [m]; as the grid's.
    """

    particles: int = 1000
    resampling: str = "systematic"
    ess_threshold: float = 0.5
    recovery: float = 0.01
    resolution_m: float = 0.25
    reach_m: float = 0.75

    def __post_init__(self) -> None:
        if self.particles < 2:
            raise ValueError(f"particles is {self.particles}; it must be at least 2")
        if self.resampling not in RESAMPLERS:
            raise ValueError(f"resampling is {self.resampling!r}; use one of: {', '.join(RESAMPLERS)}")
        if not 0.0 <= self.ess_threshold <= 1.0:
            raise ValueError(f"ess_threshold is {self.ess_threshold}; it must lie in [0, 1]")
        if not 0.0 <= self.recovery <= 0.5:
            raise ValueError(f"recovery is {self.recovery}; it must lie in [0, 0.5]")
        if not 0.0 < self.resolution_m <= self.reach_m:
            raise ValueError(f"resolution_m is {self.resolution_m}; it must be positive and at most reach_m")


class ParticleFilter:
    """The belief as weighted samples: the same posterior as the grid's, without its cells.

    Particles outside the free area have weight zero, unless all are outside: then they keep their weights.
    """

    Config = ParticleFilterConfig
    estimate_rule = EstimateRule(bias=1.07, gain=0.43, evidence_gain=0.49)  # benchmarks/calibration.py

    def __init__(self, config: ParticleFilterConfig | None = None) -> None:
        self.config = config or ParticleFilterConfig()
        self._rng: np.random.Generator
        self._area: FreeArea
        self._poses: Floats  # (N, 3)
        self._log_weights: Floats  # (N,), the weights sum to one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh: uniform over the free area, or drawn from the prior."""
        count = self.config.particles
        self._rng = rng
        self._area = FreeArea.of(topo_map, self.config.resolution_m, self.config.reach_m)
        self._poses = self._area.sample(count, rng) if prior is None else sample_poses(prior, count, rng)
        self._log_weights = np.full(count, -np.log(count))
        self._leave_the_outside()

    def predict(self, motion: Motion) -> None:
        """Move every particle by its own draw of the motion."""
        self._poses = sample_motion(self._poses, motion, self._rng)
        self._leave_the_outside()

    def update(self, evidence: Evidence) -> float | None:
        """Weigh the particles by the evidence; resample when too few carry the weight.

        Returns:
            log p(evidence | past), recovery included; None for a blind frame. -inf for a frame that is possible at no
            particle: the belief stays as predicted.
        """
        if evidence.is_blind:
            self._resample()
            return None
        poses, log_joint = self._weighed(evidence)
        log_evidence = float(logsumexp(log_joint))
        if np.isfinite(log_evidence):
            self._poses, self._log_weights = poses, log_joint - log_evidence
            self._resample()
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """The particles."""
        return WeightedPoses(self._poses, self._log_weights)

    def _weighed(self, evidence: Evidence) -> tuple[Floats, Floats]:
        """Particles (N, 3) and their log joint weights (N,): prior' times likelihood, not normalised.

        prior' = (1 - a) predicted + a U, with U = 1 / (A 2 pi) over the free area of A m^2 and a = ``recovery``.
        The predicted part is carried by the particles: (1 - a) w_i L(x_i).
        The part a U L is far from most of U, so it is drawn where L is large: from q = S / Z, the evidence's mixture
        S = sum_m w_m K h alone, with Z = integral of S = 2 pi exp(log_mass), since h has mean 1 over the circle.
        Importance weights a U L / q / n = a Z / (A 2 pi n) = a exp(log_mass) / (A n): constant while L = S, that is,
        with the floor left out (the floor's own share, a times the floor, is at most a / (1 - a) of what the predicted
        part has from the same floor). U is zero outside the free area, and so is the weight of what was drawn there.
        """
        share, log_mass = self.config.recovery, evidence.log_mass
        if share == 0.0 or not np.isfinite(log_mass):
            return self._poses, self._log_weights + _log_likelihoods(evidence, self._poses)
        count = max(1, round(share * self.config.particles))
        kept = self._without(count)
        fresh = evidence.sample(count, self._rng)
        log_fresh = np.log(share) + log_mass - np.log(self._area.size * count)
        log_weights = self._log_weights[kept] - logsumexp(self._log_weights[kept]) + np.log(1.0 - share)
        log_joint = log_weights + _log_likelihoods(evidence, self._poses[kept])
        log_recovered = np.where(self._area.contains(fresh[:, :2]), log_fresh, -np.inf)
        return np.concatenate([self._poses[kept], fresh]), np.concatenate([log_joint, log_recovered])

    def _without(self, count: int) -> np.ndarray:
        """Indices (N - count,) of the particles that stay: those of weight zero go first, then any, by lot."""
        order = self._rng.permutation(self.config.particles)
        alive = np.isfinite(self._log_weights[order])
        return np.asarray(order[np.argsort(alive, kind="stable")][count:])

    def _leave_the_outside(self) -> None:
        inside = self._area.contains(self._poses[:, :2])
        log_weights = np.where(inside, self._log_weights, -np.inf)
        log_total = logsumexp(log_weights)
        if np.isfinite(log_total):
            self._log_weights = log_weights - log_total

    def _resample(self) -> None:
        count = self.config.particles
        effective = np.exp(-logsumexp(2.0 * self._log_weights))
        if effective < self.config.ess_threshold * count:
            chosen = RESAMPLERS[self.config.resampling](np.exp(self._log_weights), count, self._rng)
            self._poses = self._poses[chosen]
            self._log_weights = np.full(count, -np.log(count))


def _log_likelihoods(evidence: Evidence, poses: Floats) -> Floats:
    """(N,) at poses (N, 3)."""
    return evidence.log_likelihood(poses[:, :2], poses[:, 2:])[:, 0]
