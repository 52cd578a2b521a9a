"""Sequence matching: which place now makes the best sense of the last looks, led back along the odometry."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from estimators.gaussian import ANY_HEADING, anywhere
from estimators.voting import ranked
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses


@dataclass(frozen=True)
class SequenceMatchingConfig:
    """Settings of sequence matching.

    Attributes:
        looks: how many looks a sequence has, the newest included.
        memory: how much a look counts beside the next newer one.
        candidates: how many hypotheses of the newest look are followed back: those of the highest match.
        headings: how many headings are tried for a hypothesis whose heading is unknown.
    """

    looks: int = 10
    memory: float = 0.9
    candidates: int = 50
    headings: int = 24

    def __post_init__(self) -> None:
        for name in ("looks", "candidates", "headings"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        if not 0.0 < self.memory <= 1.0:
            raise ValueError(f"memory is {self.memory}; it must be above 0 and at most 1")


@dataclass(frozen=True)
class Look:
    """What was seen, and at which odometer pose (3,)."""

    evidence: Evidence
    odometry: Floats


@dataclass(frozen=True)
class Candidates:
    """Poses (C, 3) that the robot may have now, and the variances (C, 3) [m^2, m^2, rad^2] around each."""

    poses: Floats
    variances: Floats


class SequenceMatching:
    """Causal sequence matching in the spirit of SeqSLAM (Milford & Wyeth, ICRA 2012), with odometry for its speeds.

    The candidates are the hypotheses of the newest look. Each is led back along the odometry to where it would have
    been at each remembered look, and scored by the sum of the looks' log-likelihoods there, older ones counting less:
    sum_k memory^k log p(look k | candidate led back to it). SeqSLAM scales each look's contrast before it sums; here
    the sensor's calibrated likelihood does that.

    The belief is the softmax of that sum: the posterior over the candidates if looks were independent and odometry
    exact. The mean in its stead would have the same best candidate, and could not tell ten looks that agree from one.
    Neither premise holds, so it claims too much; ``estimate_rule`` is there to undo that.

    Odometry is taken for exact: forgetting is all that there is against its drift and against a kidnapping. A place
    that the newest look does not propose cannot be found, and positions are no finer than the hypotheses'.
    """

    Config = SequenceMatchingConfig
    estimate_rule = EstimateRule(
        bias=-1.19, gain=0.37, evidence_gain=0.31, agreement_gain=0.54
    )  # benchmarks/calibration.py

    def __init__(self, config: SequenceMatchingConfig | None = None) -> None:
        self.config = config or SequenceMatchingConfig()
        self._before_start: WeightedPoses
        self._odometry: Floats  # (3,) motions composed since the reset
        self._looks: deque[Look]
        self._belief: WeightedPoses | None  # None: no prior, and no look yet

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Forget all looks. A prior is the belief until the first look, which takes its place. Draws nothing."""
        self._before_start, self._belief = anywhere(topo_map), prior
        self._odometry = np.zeros(3)
        self._looks = deque(maxlen=self.config.looks)

    def predict(self, motion: Motion) -> None:
        """Compose the motion; without a start it leads from nowhere."""
        self._odometry = compose(self._odometry, motion.delta)
        if self._belief is not None:
            moved = compose(self._belief.poses, motion.delta)
            self._belief = WeightedPoses(moved, self._belief.log_weights, self._belief.spread)

    def update(self, evidence: Evidence) -> float | None:
        """Remember the look and weigh its hypotheses by the sequence that ends there.

        Returns:
            log sum_c w_c p(evidence | c) over the last candidates c, carried on; None for a blind frame and where
            there are none. -inf for a frame that is possible nowhere: the belief stays as predicted, and the look is
            not remembered.
        """
        if evidence.is_blind:
            return None
        log_evidence = self._log_evidence(evidence)
        candidates = self._candidates(evidence)
        if np.isfinite(_log_likelihoods(evidence, candidates.poses).max()):
            self._looks.append(Look(evidence, self._odometry))
            log_weights = self._log_scores(candidates.poses)
            weights = np.exp(log_weights - logsumexp(log_weights))
            self._belief = WeightedPoses(candidates.poses, log_weights, weights @ candidates.variances)
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """The candidates, carried on since their look; before the start any node with any heading."""
        return self._before_start if self._belief is None else self._belief

    def _candidates(self, evidence: Evidence) -> Candidates:
        """The best hypotheses; one whose heading is unknown stands there once for each of some headings all around."""
        best = ranked(evidence)[: self.config.candidates]
        poses, kappa, position = evidence.poses[best], evidence.kappa[best], evidence.sigma[best] ** 2
        rows, turn = _headings_around(kappa > 0.0, self.config.headings)
        cell = (2.0 * np.pi / self.config.headings) ** 2 / 12.0
        heading = np.where(kappa > 0.0, 1.0 / np.maximum(kappa, 1.0 / ANY_HEADING), cell)
        return Candidates(
            np.column_stack([poses[rows, :2], wrap(poses[rows, 2] + turn)]),
            np.column_stack([position, position, heading])[rows],
        )

    def _log_evidence(self, evidence: Evidence) -> float | None:
        if self._belief is None:
            return None
        log_weights = self._belief.log_weights
        log_joint = log_weights + _log_likelihoods(evidence, self._belief.poses)
        return float(logsumexp(log_joint) - logsumexp(log_weights))

    def _log_scores(self, poses: Floats) -> Floats:
        """(C,) of candidates (C, 3): each remembered look's log-likelihood, where the candidate was then."""
        scores = np.zeros(len(poses))
        for age, look in enumerate(reversed(self._looks)):
            then = compose(poses, between(self._odometry, look.odometry))
            scores += self.config.memory**age * _log_likelihoods(look.evidence, then)
        return scores


def _headings_around(known: NDArray[np.bool_], headings: int) -> tuple[Ints, Floats]:
    """Each row of ``known`` (M,) once, an unknown one once for each heading: rows (C,) and turns (C,) [rad]."""
    copies = np.where(known, 1, headings)
    first = np.cumsum(copies) - copies
    rows = np.repeat(np.arange(len(known)), copies)
    return rows, (np.arange(len(rows)) - first[rows]) * 2.0 * np.pi / headings


def _log_likelihoods(evidence: Evidence, poses: Floats) -> Floats:
    """(C,) at poses (C, 3)."""
    return evidence.log_likelihood(poses[:, :2], poses[:, 2:])[:, 0]
