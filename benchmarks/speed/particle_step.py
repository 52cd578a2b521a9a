"""A step of the particle filter: move, weigh by ten hypotheses, resample."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from benchmarks.speed.agreement import global_numbers_from, same_in_distribution
from benchmarks.speed.case import Case, Pair
from benchmarks.speed.likelihood import LogLikelihood
from estimators.particle import ParticleFilter
from topoloc.geometry import Floats, between
from topoloc.testing import evidence_for, toy_map
from topoloc.types import Motion, WeightedPoses

ROUND = 20
"""Steps of the robot around its circle of 1 m radius."""
ANGLES = 2.0 * np.pi * np.arange(ROUND) / ROUND
TRUTH = np.column_stack([2.0 + np.cos(ANGLES), 0.5 + np.sin(ANGLES), ANGLES + 0.5 * np.pi])
HALL = replace(toy_map(5, 2), free=(np.array([[-20.0, -20.0], [20.0, -20.0], [20.0, 20.0], [-20.0, 20.0]]),))
"""Ten nodes in a hall so wide that no particle leaves it: the peer knows no walls."""
SEEN = [evidence_for(HALL, pose) for pose in TRUTH]
MOTION = Motion(between(TRUTH[0], TRUTH[1]), np.diag([0.05, 0.05, 0.05]) ** 2)
DEVIATIONS = np.array([0.25, 0.25, 0.2])
"""Of the start [m, m, rad]."""
CHECKED_STEPS, CHECKED_RUNS = 4, 6


class OurDrive:
    """Our filter on its way around the circle.

    Args:
        count: particles.
        seed: of the random numbers.
    """

    def __init__(self, count: int, seed: int) -> None:
        self._filter = ParticleFilter(ParticleFilter.Config(particles=count, ess_threshold=1.0, recovery=0.0))
        self._filter.reset(HALL, np.random.default_rng(seed), WeightedPoses.uniform(TRUTH[:1], DEVIATIONS**2))
        self._seen = cycle(SEEN)
        self.log_evidence = self._look()

    def step(self) -> None:
        """Move on and look."""
        self._filter.predict(MOTION)
        self.log_evidence += self._look()

    def _look(self) -> float:
        log_evidence = self._filter.update(next(self._seen))
        assert log_evidence is not None  # what is seen here is never blind
        return log_evidence

    def figures(self) -> Floats:
        """Mean of the posterior and log evidence, as ``_figures``."""
        return _figures(self._filter.belief.weights, self._filter.belief.poses, self.log_evidence)


def particle_filter_step(count: int, log_likelihood: LogLikelihood, peer: str) -> Case:
    """Ours beside ``particles``.

    Args:
        count: particles.
        log_likelihood: that the peer's user wrote.
        peer: the peer, for people.
    """
    size = f"{count:,} particles x {len(HALL.nodes)}"
    prepare = partial(_pair, count, log_likelihood)
    return Case("estimators", "particle-step", size, peer, ("particles", "numba"), prepare)


def _pair(count: int, log_likelihood: LogLikelihood) -> Pair:
    peers = _peer(count, log_likelihood)
    return Pair(OurDrive(count, 0).step, partial(next, peers), partial(_agree, count, log_likelihood))


def _peer(count: int, log_likelihood: LogLikelihood) -> Any:
    """The peer's filter, as far as ours is when it has just been built."""
    from benchmarks.speed.bootstrap import Drive, bootstrap_filter

    drive = Drive(mean=TRUTH[0], deviations=DEVIATIONS, motion=MOTION, log_likelihood=log_likelihood)
    peers = bootstrap_filter(drive, SEEN, count)
    next(peers)
    return peers


def figures_of_ours(count: int, seed: int) -> Floats:
    """``OurDrive.figures`` of a drive of ``CHECKED_STEPS``."""
    drive = OurDrive(count, seed)
    for _ in range(CHECKED_STEPS):
        drive.step()
    return drive.figures()


def _agree(count: int, log_likelihood: LogLikelihood) -> bool:
    """The same posterior and the same evidence, but for the noise of a few runs of both."""

    def peers(seed: int) -> Floats:
        with global_numbers_from(seed):
            peer = _peer(count, log_likelihood)
            for _ in range(CHECKED_STEPS):
                next(peer)
        return _figures(peer.W, peer.X, peer.logLt)

    return same_in_distribution(partial(figures_of_ours, count), peers, CHECKED_RUNS)


def _figures(weights: Floats, poses: Floats, log_evidence: float) -> Floats:
    """(5,): mean x, y, cosine and sine of the heading over weighted poses (N, 3), and the log evidence of all steps."""
    columns = np.column_stack([poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    return np.asarray(np.append(weights @ columns, log_evidence))
