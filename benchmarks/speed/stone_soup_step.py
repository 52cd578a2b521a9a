"""Steps of the particle filter and of the Kalman filter beside Stone Soup."""

from __future__ import annotations

from functools import partial
from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.speed.agreement import global_numbers_from, same_in_distribution
from benchmarks.speed.case import Case, Pair
from benchmarks.speed.likelihood import LogLikelihood
from benchmarks.speed.particle_step import (
    CHECKED_RUNS,
    CHECKED_STEPS,
    DEVIATIONS,
    HALL,
    MOTION,
    SEEN,
    TRUTH,
    OurDrive,
    figures_of_ours,
)
from estimators.kalman import Kalman
from topoloc.estimate import mean_and_covariance
from topoloc.geometry import Floats, compose, inverse
from topoloc.types import Evidence, Motion, WeightedPoses

if TYPE_CHECKING:
    from benchmarks.speed.stone_soup import Looks, StoneSoupGaussian, StoneSoupParticles

START, START_VARIANCES = np.array([1.0, 1.0, 0.2]), np.array([0.04, 0.04, 0.003])
"""Of the Gaussian: a heading so well known that the sigma points of either filter turn it as well."""
THERE = np.array([0.3, 0.0, 0.05])
"""Motion of every other step; the others lead back."""
NOISE = np.array([0.03, 0.03, 0.02]) ** 2
"""Variances of the odometry, alike along and across, and so the same in the map's frame."""
SIGMA, KAPPA = 0.3, 200.0
"""Of the one hypothesis: a measured pose with variances SIGMA^2, SIGMA^2, 1 / KAPPA."""
SAME_MOMENTS = 1e-4
"""Means and covariances that differ by less are the same [m, rad and their products]."""
GAUSSIAN_STEPS = 20


def stone_soup_particles(count: int, log_likelihood: LogLikelihood, peer: str) -> Case:
    """Ours beside Stone Soup's particle filter.

    Args:
        count: particles.
        log_likelihood: that the peer's user wrote.
        peer: the peer, for people.
    """
    size = f"{count:,} particles x {len(HALL.nodes)}"
    return Case("estimators", "particle-step", size, peer, ("stonesoup",), partial(_particles, count, log_likelihood))


def _particles(count: int, log_likelihood: LogLikelihood) -> Pair:
    from benchmarks.speed.stone_soup import Looks

    peers, seen = _peer(count, Looks(log_likelihood), 0), cycle(SEEN[1:] + SEEN[:1])
    return Pair(
        OurDrive(count, 0).step, lambda: peers.step(next(seen)), partial(_same_particles, count, log_likelihood)
    )


def _peer(count: int, looks: Looks, seed: int) -> StoneSoupParticles:
    """The peer's filter, after the first look."""
    from benchmarks.speed.stone_soup import StoneSoupParticles

    rng = np.random.default_rng(seed)
    peers = StoneSoupParticles(rng.normal(TRUTH[0], DEVIATIONS, (count, 3)), MOTION, looks, rng)
    peers.look(SEEN[0])
    return peers


def _same_particles(count: int, log_likelihood: LogLikelihood) -> bool:
    """The same posterior and the same evidence, but for the noise of a few runs of both."""
    from benchmarks.speed.stone_soup import ToldLooks

    def peers(seed: int) -> Floats:
        looks = ToldLooks(log_likelihood)
        with global_numbers_from(seed):
            peer = _peer(count, looks, seed)
            for seen in SEEN[1 : CHECKED_STEPS + 1]:
                peer.step(seen)
        x, y, heading = peer.poses.T
        means = [values.mean() for values in (x, y, np.cos(heading), np.sin(heading))]
        return np.array([*means, looks.log_evidence])

    return same_in_distribution(partial(figures_of_ours, count), peers, CHECKED_RUNS)


def stone_soup_gaussian() -> Case:
    """Our single Gaussian, given one hypothesis and no floor, beside an unscented filter that measures the pose.

    So it is the plain filter on both sides; ours also weighs branches and gathers them, of which there is one here.
    """
    size = "predict and update, 1 hypothesis"
    return Case("estimators", "kalman-step", size, "Stone Soup", ("stonesoup",), _gaussians)


def _gaussians() -> Pair:
    return Pair(OurGaussian().step, _peer_gaussian().step, _same_gaussians)


def _same_gaussians() -> bool:
    """The same mean and covariance after a few steps."""
    ours, peers = OurGaussian(), _peer_gaussian()
    for _ in range(GAUSSIAN_STEPS):
        ours.step()
        peers.step()
    return bool(np.abs(ours.figures() - peers.figures()).max() < SAME_MOMENTS)


def _peer_gaussian() -> StoneSoupGaussian:
    from benchmarks.speed.stone_soup import StoneSoupGaussian

    noise = np.array([SIGMA**2, SIGMA**2, 1.0 / KAPPA])
    return StoneSoupGaussian(START, np.diag(START_VARIANCES), noise, _to_and_fro())


def _to_and_fro() -> list[tuple[Motion, Floats]]:
    """Motions, and the pose (3,) that is measured after each, off by a little."""
    motions = [Motion(delta, np.diag(NOISE)) for delta in (THERE, inverse(THERE))]
    places = [compose(START, THERE) + np.array([0.05, -0.03, 0.02]), START - np.array([0.02, 0.04, 0.01])]
    return list(zip(motions, places, strict=True))


class OurGaussian:
    """Ours, on its way to and fro."""

    def __init__(self) -> None:
        self._filter = Kalman()
        self._steps = cycle([(motion, _seen(pose)) for motion, pose in _to_and_fro()])
        self._filter.reset(HALL, np.random.default_rng(0), WeightedPoses.uniform(START[None], START_VARIANCES))

    def step(self) -> None:
        """Move and look."""
        motion, seen = next(self._steps)
        self._filter.predict(motion)
        self._filter.update(seen)

    def figures(self) -> Floats:
        """(12,) mean and covariance."""
        belief = self._filter.belief
        mean, covariance = mean_and_covariance(belief.poses, belief.weights, belief.spread)
        return np.append(mean, covariance)


def _seen(pose: Floats) -> Evidence:
    """One hypothesis, and nothing that could have been seen elsewhere."""
    one = np.ones(1)
    return Evidence(pose[None], np.zeros(1, dtype=int), one, 0.0 * one, 0.0 * one, SIGMA * one, KAPPA * one, -np.inf)
