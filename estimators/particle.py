"""Monte Carlo localization: a bootstrap (SIR) particle filter with recovery from the evidence."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from estimators.free_area import FreeArea
from estimators.kld import KLD
from estimators.resampling import RESAMPLERS
from estimators.sampling import sample_motion, sample_poses
from estimators.weights import WEIGHTINGS, Weighting, WeightingConfig
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses

LIKELIHOOD = "likelihood"
"""Name of the weighting that takes the evidence's own likelihood."""
ANYWHERE = 4096
"""Poses that tell how large a weighting of the third seed is in the mean."""
MOST_RECOVERED = 0.5
"""Share of the particles that recovery may take at one update."""


@dataclass(frozen=True)
class ParticleFilterConfig:
    """Settings of the particle filter.

    Attributes:
        particles: how many; with ``adaptive`` at most.
        resampling: ``systematic``, ``stratified``, ``residual`` or ``multinomial``.
        ess_threshold: resample when the effective sample size falls below this share of the particles; with
            ``adaptive`` at each update that sees something.
        recovery: probability, at each update, that the robot is anywhere in the free area instead; as the grid's.
        resolution_m: side of the cells that the free area is made of [m]; as the grid's.
        reach_m: how far from a node or an edge the robot may be [m]; as the grid's.
        weighting: ``likelihood``, the evidence's own, or ``pw1`` to ``pw7`` of the third seed.
        weights: settings of ``pw1`` to ``pw7``.
        adaptive: whether resampling draws no more particles than ``kld`` asks for, true or false.
        kld: how many it asks for.
    """

    particles: int = 1000
    resampling: str = "systematic"
    ess_threshold: float = 0.5
    recovery: float = 0.02
    resolution_m: float = 0.25
    reach_m: float = 0.75
    weighting: str = LIKELIHOOD
    weights: WeightingConfig = field(default_factory=WeightingConfig)
    adaptive: bool = False
    kld: KLD = field(default_factory=KLD)

    def __post_init__(self) -> None:
        if self.particles < (2 if self.recovery > 0.0 else 1):
            raise ValueError(f"particles is {self.particles}; it must be at least 2, or 1 with recovery 0")
        if self.resampling not in RESAMPLERS:
            raise ValueError(f"resampling is {self.resampling!r}; use one of: {', '.join(RESAMPLERS)}")
        if not 0.0 <= self.ess_threshold <= 1.0:
            raise ValueError(f"ess_threshold is {self.ess_threshold}; it must lie in [0, 1]")
        if not 0.0 <= self.recovery <= 0.5:
            raise ValueError(f"recovery is {self.recovery}; it must lie in [0, 0.5]")
        if not 0.0 < self.resolution_m <= self.reach_m:
            raise ValueError(f"resolution_m is {self.resolution_m}; it must be positive and at most reach_m")
        if self.weighting not in (LIKELIHOOD, *WEIGHTINGS):
            names = ", ".join((LIKELIHOOD, *WEIGHTINGS))
            raise ValueError(f"weighting is {self.weighting!r}; use one of: {names}")


class ParticleFilter:
    """The belief as weighted samples: the same posterior as the grid's, without its cells.

    Particles that leave the free area or cross a wall have weight zero, unless that are all: then they keep theirs.
    """

    Config = ParticleFilterConfig
    estimate_rule = EstimateRule(
        bias=0.89, gain=0.54, evidence_gain=0.28, agreement_gain=0.24
    )  # benchmarks/calibration.py

    def __init__(self, config: ParticleFilterConfig | None = None) -> None:
        self.config = config or ParticleFilterConfig()
        self._rng: np.random.Generator
        self._area: FreeArea
        self._weigher: Weigher
        self._poses: Floats  # (N, 3)
        self._log_weights: Floats  # (N,), the weights sum to one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh: uniform over the free area, or drawn from the prior."""
        count = self.config.particles
        self._rng = rng
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        self._weigher = self._make_weigher()
        self._poses = self._area.sample(count, rng) if prior is None else sample_poses(prior, count, rng)
        self._log_weights = np.full(count, -np.log(count))
        self._remove(~self._area.contains(self._poses[:, :2]))

    def predict(self, motion: Motion) -> None:
        """Move every particle by its own draw of the motion."""
        moved = sample_motion(self._poses, motion, self._rng)
        barred = self._area.barred(self._poses[:, :2], moved[:, :2])
        self._poses = moved
        self._remove(barred | ~self._area.contains(moved[:, :2]))

    def update(self, evidence: Evidence) -> float | None:
        """Weigh the particles by the evidence; resample when too few carry the weight.

        Returns:
            log p(evidence | past), recovery included; None for a blind frame. -inf for a frame that is possible at no
            particle: the belief stays as predicted.
        """
        if evidence.is_blind:
            self._resample(self.config.ess_threshold)
            return None
        poses, log_joint = self._weighed(evidence, self.config.recovery)
        log_evidence = float(_log_sum(log_joint))
        if np.isfinite(log_evidence):
            self._poses, self._log_weights = poses, log_joint - log_evidence
            self._resample(np.inf if self.config.adaptive else self.config.ess_threshold)
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """The particles."""
        return WeightedPoses(self._poses, self._log_weights)

    def _weighed(self, evidence: Evidence, share: float) -> tuple[Floats, Floats]:
        """Particles (N, 3) and their log joint weights (N,): prior' times likelihood, not normalised.

        prior' = (1 - a) predicted + a U, with U uniform over the free area and a = ``share``. The predicted part
        is carried by the particles: (1 - a) w_i L(x_i). The part a U L is drawn where the evidence is, by as many
        particles as it has of the posterior: none at most updates while the evidence is as foretold, half of all when
        it is not. The others are drawn anew by their joint weights, so that no heavy one is lost by lot.
        """
        log_joint = self._log_weights + self._weigher.log_weights(evidence, self._poses)
        log_mean = self._weigher.log_mean(evidence) if share > 0.0 else -np.inf
        if not np.isfinite(log_mean):
            return self._poses, log_joint
        log_recovered, log_predicted = np.log(share) + log_mean, np.log1p(-share) + _log_sum(log_joint)
        part = np.exp(log_recovered - np.logaddexp(log_recovered, log_predicted))
        expected = len(self._poses) * min(part, MOST_RECOVERED)
        count = int(expected + self._rng.random())  # in the mean ``expected``, and most often none
        if count == 0:
            return self._poses, log_joint + np.log1p(-share)
        kept = self._resampled(log_joint, len(self._poses) - count)
        log_kept = np.full(len(kept), log_predicted - np.log(len(kept)))
        fresh, log_fresh = self._weigher.recover(evidence, count, self._rng)
        poses = np.concatenate([self._poses.take(kept, axis=0), fresh])
        return poses, np.concatenate([log_kept, log_fresh + np.log(share * count / expected)])

    def _resampled(self, log_weights: Floats, count: int) -> Ints:
        """Indices (count,) of particles drawn by their log weights (N,); any, where none has weight."""
        peak = log_weights.max()
        weights = np.exp(log_weights - peak) if np.isfinite(peak) else np.ones(len(log_weights))
        return RESAMPLERS[self.config.resampling](weights, count, self._rng)

    def _remove(self, dead: np.ndarray) -> None:
        """Take the weight of some particles (N,) bool, unless nothing were left."""
        if not dead.any():
            return
        log_weights = np.where(dead, -np.inf, self._log_weights)
        log_total = _log_sum(log_weights)
        if np.isfinite(log_total):
            self._log_weights = log_weights - log_total

    def _resample(self, threshold: float) -> None:
        """Draw anew where the effective sample size is below this share of the particles."""
        weights = np.exp(self._log_weights)
        effective = 1.0 / (weights @ weights)
        if effective >= threshold * len(self._poses):
            return
        chosen = RESAMPLERS[self.config.resampling](weights, self.config.particles, self._rng)
        if self.config.adaptive:
            chosen = self._rng.permutation(chosen)
            chosen = chosen[: self.config.kld.enough(self._poses[chosen])]
        self._poses = self._poses.take(chosen, axis=0)
        self._log_weights = np.full(len(chosen), -np.log(len(chosen)))

    def _make_weigher(self) -> Weigher:
        if self.config.weighting == LIKELIHOOD:
            return ByLikelihood(self._area)
        return ByNeighbours(
            WEIGHTINGS[self.config.weighting],
            self.config.weights,
            self._area,
            self._area.sample(ANYWHERE, self._rng),
        )


def _log_sum(log_values: Floats) -> float:
    """Log of the sum of exponentials (N,); scipy's does more, and takes three times as long."""
    peak = float(log_values.max(initial=-np.inf))
    if not np.isfinite(peak):
        return peak
    return peak + float(np.log(np.exp(log_values - peak).sum()))


class Weigher(Protocol):
    """What weighs particles by evidence, as a ratio to what the evidence weighs anywhere, and where it recovers."""

    def log_weights(self, evidence: Evidence, poses: Floats) -> Floats:
        """(N,) at poses (N, 3)."""

    def log_mean(self, evidence: Evidence) -> float:
        """Log of the mean weight over the free area and the circle, as far as ``recover`` draws it."""

    def recover(self, evidence: Evidence, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Poses (n, 3) and log weights (n,) that stand for a uniform prior times the evidence."""


@dataclass(frozen=True)
class ByLikelihood:
    """The evidence's own likelihood L = floor + S, with the mixture S = sum_m w_m K h (EQUATIONS.md, 4).

    U L is far from most of U, so it is drawn where L is large: from q = S / Z, with Z = integral of S =
    2 pi exp(log_mass), since h has mean 1 over the circle. Importance weights U L / q / n = Z / (A 2 pi n) =
    exp(log_mass) / (A n) over A m^2: constant while L = S, that is, with the floor left out. The floor's own share,
    a times the floor, is at most a / (1 - a) of what the predicted part has from the same floor. U is zero outside
    the free area, and so is the weight of what was drawn there.
    """

    area: FreeArea

    def log_weights(self, evidence: Evidence, poses: Floats) -> Floats:
        """(N,) at poses (N, 3)."""
        return evidence.log_likelihood(poses[:, :2], poses[:, 2:])[:, 0]

    def log_mean(self, evidence: Evidence) -> float:
        """Of S; -inf where there is nothing to draw from."""
        return evidence.log_mass - float(np.log(self.area.size))

    def recover(self, evidence: Evidence, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Drawn from S, all of one weight; none outside the free area."""
        poses = evidence.sample(n, rng)
        inside = self.area.contains(poses[:, :2])
        return poses, np.where(inside, self.log_mean(evidence) - np.log(n), -np.inf)


@dataclass(frozen=True)
class ByNeighbours:
    """A weighting of the third seed, divided by its mean at ``anywhere`` (M, 3): uniform poses in the free area."""

    weighting: Weighting
    settings: WeightingConfig
    area: FreeArea
    anywhere: Floats

    def log_weights(self, evidence: Evidence, poses: Floats) -> Floats:
        """(N,) at poses (N, 3)."""
        log_weights = self.weighting(evidence, np.concatenate([poses, self.anywhere]), self.settings)
        log_mean = _log_sum(log_weights[len(poses) :]) - np.log(len(self.anywhere))
        return np.asarray(log_weights[: len(poses)] - (log_mean if np.isfinite(log_mean) else 0.0))

    def log_mean(self, evidence: Evidence) -> float:
        """0: that is what the division is for."""
        return 0.0

    def recover(self, evidence: Evidence, n: int, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Drawn uniformly, weighed as any particle: these weightings are no densities that could be drawn from."""
        poses = self.area.sample(n, rng)
        return poses, self.log_weights(evidence, poses) - np.log(n)
