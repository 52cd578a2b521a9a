"""Auxiliary particle filters: the evidence has its say before the particles are moved, not only afterwards."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from scipy.special import i0e, logsumexp

from estimators.free_area import FreeArea
from estimators.resampling import systematic
from estimators.sampling import sample_motion, sample_poses
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats, compose, covariance_root
from topoloc.mixture import reach_of
from topoloc.nearby import Nearby
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses

Adaptation = Literal["full", "generic"]
"""How the particles that live on are chosen and moved; see ``FullyAdapted`` and ``Generic``."""
STILL = Motion(np.zeros(3), np.zeros((3, 3)))
"""What is pending where no motion is."""
LARGEST_ANGLE_VARIANCE = 0.5
"""Up to this variance an angle may be taken for a number [rad^2]: half a turn is 4.4 standard deviations away."""
PAIRS_AT_ONCE = 16_384
"""Pairs of a particle and a hypothesis that are looked at together: few enough for the processor's cache."""


@dataclass(frozen=True)
class AuxiliaryParticleFilterConfig:
    """Settings of the auxiliary particle filter.

    Attributes:
        particles: how many.
        adaptation: ``full`` draws a particle together with a hypothesis and moves it towards that one; ``generic``
            draws a particle by the likelihood of its predicted mean and moves it at random.
        recovery: probability, at each update, that the robot is anywhere in the free area instead; as the grid's.
        resolution_m: side of the cells that the free area is made of [m]; as the grid's.
        reach_m: how far from a node or an edge the robot may be [m]; as the grid's.
    """

    particles: int = 1000
    adaptation: Adaptation = "full"
    recovery: float = 0.02
    resolution_m: float = 0.25
    reach_m: float = 0.75

    def __post_init__(self) -> None:
        if self.particles < 2:
            raise ValueError(f"particles is {self.particles}; it must be at least 2")
        if self.adaptation not in PROPOSALS:
            raise ValueError(f"adaptation is {self.adaptation!r}; use one of: {', '.join(PROPOSALS)}")
        if not 0.0 <= self.recovery <= 0.5:
            raise ValueError(f"recovery is {self.recovery}; it must lie in [0, 0.5]")
        if not 0.0 < self.resolution_m <= self.reach_m:
            raise ValueError(f"resolution_m is {self.resolution_m}; it must be positive and at most reach_m")


class AuxiliaryParticleFilter:
    """The belief as weighted samples, as in ``ParticleFilter``, but drawn with a look at the evidence.

    The second seed's estimator (sections 3 and 4). ``predict`` is lazy: a motion waits for the evidence that its noise
    is drawn with, and until then the belief is the predicted means. Where another motion or a blind frame comes
    instead, the noise is drawn without evidence. Either way each motion's noise is drawn once.

    Particles that leave the free area or cross a wall have weight zero, unless the whole prediction is outside: then
    they keep theirs.
    """

    Config = AuxiliaryParticleFilterConfig
    estimate_rule = EstimateRule(
        bias=0.86, gain=0.59, evidence_gain=0.35, agreement_gain=0.24
    )  # benchmarks/calibration.py

    def __init__(self, config: AuxiliaryParticleFilterConfig | None = None) -> None:
        self.config = config or AuxiliaryParticleFilterConfig()
        self._rng: np.random.Generator
        self._area: FreeArea
        self._pending: Motion  # since the particles were drawn
        self._poses: Floats  # (N, 3), before the pending motion
        self._log_weights: Floats  # (N,), the weights sum to one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh: uniform over the free area, or drawn from the prior."""
        count = self.config.particles
        self._rng, self._pending = rng, STILL
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        poses = self._area.sample(count, rng) if prior is None else sample_poses(prior, count, rng)
        self._settle(poses, self._area.contains(poses[:, :2]))

    def predict(self, motion: Motion) -> None:
        """Let the motion wait for the update, in the place of one that waited already."""
        self._carry_out()
        self._pending = motion

    def update(self, evidence: Evidence) -> float | None:
        """Carry out the pending motion with a look at the evidence.

        Returns:
            log p(evidence | past), recovery included; None for a blind frame. -inf for a frame that is possible at no
            particle: the belief stays as predicted.
        """
        if evidence.is_blind:
            self._carry_out()
            return None
        poses, log_joint = self._drawn(evidence)
        log_evidence = float(logsumexp(log_joint))
        if np.isfinite(log_evidence):
            self._poses, self._log_weights, self._pending = poses, log_joint - log_evidence, STILL
        else:
            self._carry_out()
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """The particles; while a motion is pending, their predicted means."""
        return WeightedPoses(compose(self._poses, self._pending.delta), self._log_weights)

    def _carry_out(self) -> None:
        """Move by the pending motion without evidence; resampled, lest ever fewer particles are inside the area."""
        if self._pending is not STILL:
            chosen = systematic(np.exp(self._log_weights), self.config.particles, self._rng)
            before = self._poses[chosen]
            moved = sample_motion(before, self._pending, self._rng)
            self._settle(moved, self._reached(before, moved))
            self._pending = STILL

    def _reached(self, before: Floats, after: Floats) -> np.ndarray:
        """Which steps (P, 3) -> (P, 3) end in the free area and cross no wall: (P,) bool."""
        start, end = before[:, :2], after[:, :2]
        return np.asarray(self._area.contains(end) & ~self._area.barred(start, end))

    def _settle(self, poses: Floats, inside: np.ndarray) -> None:
        """Take poses (N, 3) for the particles: those ``inside`` (N,) alike, or all where none is."""
        alive = inside if inside.any() else np.ones(len(poses), dtype=bool)
        self._poses, self._log_weights = poses, np.where(alive, -np.log(alive.sum()), -np.inf)

    def _drawn(self, evidence: Evidence) -> tuple[Floats, Floats]:
        """Particles (N, 3) drawn from prior' times likelihood, and their log joint weights (N,), not normalised.

        prior' = (1 - a) predicted + a U as in ``ParticleFilter``. The recovered part has its share of the particles:
        most of them, after a kidnapping. What leaves the free area or crosses a
        wall has weight zero.
        """
        count = self.config.particles
        share = self.config.recovery if np.isfinite(evidence.log_mass) else 0.0
        proposal = PROPOSALS[self.config.adaptation](self._poses, self._pending, evidence)
        masses, log_predicted = _scaled(self._log_weights[:, None] + proposal.log_masses)
        inside = self._predicted_inside()
        log_predicted += np.log1p(-share) - (np.log(inside) if inside > 0.0 else 0.0)
        fresh, log_recovered = self._recovered(evidence, share)
        log_total = np.logaddexp(log_predicted, log_recovered)
        if not np.isfinite(log_total):
            return self._poses, np.full(count, -np.inf)
        recovered = min(count, int(count * np.exp(log_recovered - log_total) + self._rng.random()))
        chosen = systematic(masses.ravel(), count - recovered, self._rng)
        particles, branches = np.divmod(chosen, masses.shape[1])
        moved, log_corrections = proposal.draw(particles, branches, self._rng)
        allowed = self._reached(self._poses[particles], moved) | (inside == 0.0)
        log_joint = np.append(np.where(allowed, log_corrections, -np.inf), np.zeros(recovered))
        poses = np.concatenate([moved, np.resize(fresh, (recovered, 3))])  # repeated, where too few are inside
        return poses, log_joint + log_total - np.log(count)

    def _recovered(self, evidence: Evidence, share: float) -> tuple[Floats, float]:
        """Poses (at most N, 3) drawn from the evidence inside the free area, and the log joint mass they stand for.

        That is share exp(log_mass) / A, derived in ``ParticleFilter._weighed``, times the part of it that is inside.
        """
        if share == 0.0:
            return np.zeros((0, 3)), -np.inf
        fresh = evidence.sample(self.config.particles, self._rng)
        inside = self._area.contains(fresh[:, :2])
        if not inside.any():
            return np.zeros((0, 3)), -np.inf
        return fresh[inside], float(np.log(share * inside.mean() / self._area.size)) + evidence.log_mass

    def _predicted_inside(self) -> float:
        """Share of the prediction that is inside the free area, by a draw of the motion that serves nothing else."""
        predicted = sample_motion(self._poses, self._pending, self._rng)
        return float(np.exp(self._log_weights) @ self._reached(self._poses, predicted))


class Proposal(Protocol):
    """A way of drawing particles from prediction times likelihood, in two stages.

    First a particle and one of its B branches are drawn, by the particle's weight times ``exp(log_masses)``. Then the
    branch says where the particle goes, and by what weight the draw is corrected.
    """

    log_masses: Floats
    """(N, B): each particle's evidence, branch by branch, as far as it can be told before the particle is moved."""

    def draw(self, particles: Ints, branches: Ints, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """New poses (n, 3) and log corrections (n,) of n particles (n,) and branches (n,) drawn by their masses.

        The likelihood, integrated over where particle i may be, is sum_b exp(log_masses[i, b]) E[exp(correction)].
        """


class Generic:
    """Draw particle k by w_k p(z|mu_k), mu_k its predicted mean; move it; weigh it by p(z|x) / p(z|mu_k).

    Pitt and Shephard: Filtering via simulation: auxiliary particle filters, JASA 94, 1999; standard (EQUATIONS.md, 2).

    Attributes:
        log_masses: (N, 1) log p(z|mu_k).
    """

    def __init__(self, poses: Floats, motion: Motion, evidence: Evidence) -> None:
        self._poses, self._motion, self._evidence = poses, motion, evidence
        self.log_masses = self._log_likelihoods(compose(poses, motion.delta))[:, None]

    def draw(self, particles: Ints, branches: Ints, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """Each particle moves by its own draw of the motion."""
        moved = sample_motion(self._poses[particles], self._motion, rng)
        return moved, self._log_likelihoods(moved) - self.log_masses[particles, branches]

    def _log_likelihoods(self, poses: Floats) -> Floats:
        return self._evidence.log_likelihood(poses[:, :2], poses[:, 2:])[:, 0]


class FullyAdapted:
    """Draw particle i with hypothesis j by w_i lambda_j N(x_i + u; x_j, Q + H); move i towards j (EQUATIONS.md, 2).

    Ours, for the nearest-neighbour evidence of the second seed (sections 3 and 4), whose formula is rebuilt. With the
    evidence of EQUATIONS.md, 4, lambda_j = w_j 2 pi sigma_j^2 2 pi and H = diag(sigma_j^2, sigma_j^2, 1 / kappa_j).
    Where kappa is 0 the heading row drops: its H is infinite. The floor is one more hypothesis, of infinite H: its
    particles move as the motion says. So H is kept as H^-1/2.

    All is done in the particle's frame before the step. There every particle has the same Q, the motion's, so that
    Q + H and the gain K = Q (Q + H)^-1 belong to the hypothesis alone; and Q may be singular.

    A von Mises is not a Gaussian: their ratio at the new heading is the draw's correction, near 1 for a sharp kappa.
    Where 1 / kappa + Q is too wide for an angle (``LARGEST_ANGLE_VARIANCE``) the heading row drops as for kappa 0, and
    the correction is the whole von Mises.

    Where hypotheses are many, the branches of a particle are those in its reach only: beside the floor the others
    vanish.

    Attributes:
        gains: (M + 1, 3, 3) K of each hypothesis and, last, of the floor.
        branches: (N, B) hypotheses that particles may move towards, the last M, which is the floor.
        log_masses: (N, B) log of lambda_j N(x_i + u; x_j, Q + H), and log floor; -inf fills up.
    """

    def __init__(self, poses: Floats, motion: Motion, evidence: Evidence) -> None:
        self._poses, self._motion = poses, motion
        self._hypotheses = np.vstack([evidence.poses, np.zeros(3)])
        self._kappa = np.append(evidence.kappa, 0.0)
        self._noise_root = covariance_root(motion.covariance)
        noise = self._noise_root @ self._noise_root.T
        narrow = self._kappa * (LARGEST_ANGLE_VARIANCE - noise[2, 2]) > 1.0  # 1 / kappa + Q is below it
        self._gaussian_kappa = np.where(narrow, self._kappa, 0.0)
        place = np.append(1.0 / evidence.sigma, 0.0)
        self._sharpness = np.column_stack([place, place, np.sqrt(self._gaussian_kappa)])  # diagonals of H^-1/2
        sharp = self._sharpness
        root = np.linalg.cholesky(np.eye(3) + sharp[:, :, None] * noise * sharp[:, None, :])  # of H^-1/2 (Q + H) H^-1/2
        whitener = np.linalg.inv(root) * sharp[:, None, :]  # V with V' V = (Q + H)^-1
        self.gains = noise @ whitener.transpose(0, 2, 1) @ whitener
        # log of lambda N(0; 0, Q + H): the sigma in lambda cancels against the determinant of H
        log_peaks = np.append(evidence.log_likelihoods, evidence.log_floor) + _log_gaussian(0.0, self._gaussian_kappa)
        log_peaks = log_peaks - np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1)
        self._log_peaks, self._whitener = log_peaks, whitener
        nearby = self._nearby(evidence, noise)
        self.branches, self.log_masses = self._of_all() if nearby is None else self._of_those_near(nearby)

    def _nearby(self, evidence: Evidence, noise: Floats) -> Nearby | None:
        """The hypotheses by place, for predicted means; None where all are looked at."""
        if evidence.log_floor == -np.inf:
            return None
        # an innovation is no shorter than its place; along no direction is the place's noise wider than this
        widths = np.sqrt(evidence.sigma**2 + np.linalg.norm(noise[:2, :2], ord=2))
        reach = reach_of(self._log_peaks[:-1], evidence.log_floor, widths)
        return Nearby.worthwhile(evidence.poses[:, :2], reach)

    def _of_all(self) -> tuple[Ints, Floats]:
        """Branches and log masses (N, M + 1), block by block."""
        count = len(self._log_peaks)
        log_masses = np.empty((len(self._poses), count))
        rows = 1 + PAIRS_AT_ONCE // count
        everyone = np.arange(count)
        for start in range(0, len(log_masses), rows):
            poses = self._poses[start : start + rows]
            log_masses[start : start + rows] = self._log_masses_of(poses[:, None], everyone)
        return np.broadcast_to(everyone, log_masses.shape), log_masses

    def _of_those_near(self, nearby: Nearby) -> tuple[Ints, Floats]:
        """Branches and log masses (N, B) of those in reach and the floor, tile by tile."""
        floor = len(self._log_peaks) - 1
        tiles = list(nearby.tiles(compose(self._poses, self._motion.delta)[:, :2]))
        most = max(some.points.shape[1] for some in tiles)
        branches = np.full((len(self._poses), most + 1), floor, dtype=np.int32)
        log_masses = np.full(branches.shape, -np.inf)
        for some in tiles:
            near, held = some.points[:, None], some.points.shape[1]
            found = self._log_masses_of(self._poses[some.places][:, :, None], near)
            log_masses[some.places, :held] = np.where(near < floor, found, -np.inf)
            branches[some.places, :held] = near
        log_masses[:, -1] = self._log_peaks[floor]
        return branches, log_masses

    def _log_masses_of(self, poses: Floats, hypotheses: Ints) -> Floats:
        """(...) of poses (..., 3) and hypotheses (...), which broadcast."""
        innovations = _innovations(poses, self._motion, self._hypotheses[hypotheses])
        lengths = _squared_lengths(self._whitener[hypotheses], innovations)
        return np.asarray(self._log_peaks[hypotheses] - 0.5 * lengths)

    def draw(self, particles: Ints, branches: Ints, rng: np.random.Generator) -> tuple[Floats, Floats]:
        """From the product of the motion and the hypothesis, both Gaussian, by a draw of each.

        A draw of the motion's noise, moved by the gain towards a draw of the hypothesis, has the product's mean and
        covariance, Q - K Q. No root of that is needed.
        """
        hypotheses = self.branches[particles, branches]
        poses, sharp = self._poses[particles], self._sharpness[hypotheses]
        innovation = np.stack(_innovations(poses, self._motion, self._hypotheses[hypotheses]), axis=-1)
        deviation = np.divide(1.0, sharp, out=np.zeros_like(sharp), where=sharp > 0.0)  # infinite: the gain is zero
        told = innovation + deviation * rng.normal(size=innovation.shape)
        noise = rng.normal(size=innovation.shape) @ self._noise_root.T
        noise = noise + np.einsum("nab,nb->na", self.gains[hypotheses], told - noise)
        off = innovation[:, 2] - noise[:, 2]
        kappa, gaussian_kappa = self._kappa[hypotheses], self._gaussian_kappa[hypotheses]
        log_corrections = _log_von_mises(off, kappa) - _log_gaussian(off, gaussian_kappa)
        return compose(poses, self._motion.delta + noise), log_corrections


PROPOSALS: dict[str, type[FullyAdapted] | type[Generic]] = {"full": FullyAdapted, "generic": Generic}
"""The proposals by name."""


def _scaled(log_masses: Floats) -> tuple[Floats, float]:
    """Masses in their place, scaled so that the largest is 1, and the log of their sum unscaled; -inf for none."""
    peak = float(log_masses.max())
    log_masses -= peak if np.isfinite(peak) else 0.0
    masses = np.exp(log_masses, out=log_masses)
    with np.errstate(divide="ignore"):
        return masses, peak + float(np.log(masses.sum()))


def _innovations(poses: Floats, motion: Motion, targets: Floats) -> tuple[Floats, Floats, Floats]:
    """The motion's noise that leads from poses (..., 3) exactly to targets (..., 3): ahead, left [m], turn [rad].

    Three arrays (...): one of shape (..., 3) takes several times as long to fill. The turn is wrapped by rounding,
    since a remainder takes several times as long, too.
    """
    x, y = targets[..., 0] - poses[..., 0], targets[..., 1] - poses[..., 1]
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    ahead, left, turn = motion.delta
    off = targets[..., 2] - poses[..., 2] - turn
    return cos * x + sin * y - ahead, cos * y - sin * x - left, off - 2.0 * np.pi * np.rint(off / (2.0 * np.pi))


def _squared_lengths(whitener: Floats, innovations: tuple[Floats, Floats, Floats]) -> Floats:
    """(...) squared lengths of innovations (...), whitened by lower triangular matrices (..., 3, 3)."""
    ahead, left, turn = innovations
    first, second, third = (whitener[..., row, :] for row in range(3))
    total = (first[..., 0] * ahead) ** 2
    total = total + (second[..., 0] * ahead + second[..., 1] * left) ** 2
    return np.asarray(total + (third[..., 0] * ahead + third[..., 1] * left + third[..., 2] * turn) ** 2)


def _log_von_mises(off: Floats, kappa: Floats) -> Floats:
    """Log of the von Mises of mean 1 over the circle, off [rad] from its direction."""
    return np.asarray(kappa * (np.cos(off) - 1.0) - np.log(i0e(kappa)))


def _log_gaussian(off: Floats | float, kappa: Floats) -> Floats:
    """Log of 2 pi times the Gaussian of variance 1 / kappa, off [rad] from its mean; 0 for kappa 0."""
    return np.asarray(0.5 * np.log(np.where(kappa > 0.0, 2.0 * np.pi * kappa, 1.0)) - 0.5 * kappa * off**2)
