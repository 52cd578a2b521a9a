"""What evidence makes of Gaussians: branches "hypothesis m is right", and new ones where the robot could be anywhere.

A hypothesis measures the pose itself, which is linear: its correction is the plain Kalman update, for all pairs of
Gaussian and hypothesis at once. With the evidence of EQUATIONS.md, 4, K h is nearly 2 pi sigma^2 2 pi times a normal
density of covariance R = diag(sigma^2, sigma^2, 1 / kappa) [ours]. A von Mises is not a Gaussian: the weight is off by
about 1 / (8 kappa). A heading that is less concentrated than one of which nothing is known counts as not measured.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import log_softmax

from estimators.free_area import FreeArea
from estimators.gaussian import ANY_HEADING
from estimators.gaussian_sum import Gaussians, stacked
from topoloc.geometry import Floats, wrap
from topoloc.types import Evidence, Ints

FAN = 6
"""Gaussians that share the circle where a hypothesis tells (nearly) no heading; the ripple of their sum is 1.4 %."""
FAN_BELOW = 1.0
"""Concentration of the heading below which a von Mises is too far from a Gaussian to be born as one."""
DISC_POINTS = 64
"""That tell how much of a hypothesis lies in the free area."""


@dataclass(frozen=True)
class Measurements:
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
    def of(cls, evidence: Evidence) -> Measurements:
        """What is not measured gets the variance at which 2 pi times the density of zero is 1, which is h's mean."""
        told = evidence.kappa > 1.0 / ANY_HEADING
        rows, variances = np.ones((len(told), 3)), np.empty((len(told), 3))
        rows[:, 2] = told
        variances[:, 0] = variances[:, 1] = evidence.sigma**2
        variances[:, 2] = np.where(told, 1.0 / np.maximum(evidence.kappa, 1.0 / ANY_HEADING), 2.0 * np.pi)
        log_volumes = np.log((2.0 * np.pi) ** 2 * variances[:, 0])
        return cls(evidence.log_likelihoods + log_volumes, evidence.poses, rows, variances)


@dataclass(frozen=True)
class Branches:
    """C Gaussians by M measurements: what each pair weighs, and what it needs to be corrected.

    Attributes:
        log_weights: (C, M) log of a Gaussian's weight times the integral of w_m K h over it.
        gaussians, measured: of the pairs.
        innovations: (C, M, 3).
        spreads: (C, M, 3, 3) their covariances.
    """

    log_weights: Floats
    gaussians: Gaussians
    measured: Measurements
    innovations: Floats
    spreads: Floats

    @classmethod
    def of(cls, gaussians: Gaussians, measured: Measurements) -> Branches:
        """Of every Gaussian with every measurement."""
        innovations = measured.poses - gaussians.means[:, None]
        innovations[..., 2] = wrap(innovations[..., 2])
        innovations *= measured.rows
        seen = measured.rows[:, :, None] * gaussians.covariances[:, None] * measured.rows[:, None, :]
        spreads = seen + measured.variances[:, None, :] * np.eye(3)
        squared = (innovations * np.linalg.solve(spreads, innovations[..., None])[..., 0]).sum(axis=2)
        log_densities = -0.5 * (squared + np.linalg.slogdet(spreads)[1] + 3.0 * np.log(2.0 * np.pi))
        log_weights = gaussians.log_weights[:, None] + measured.log_likelihoods + log_densities
        return cls(log_weights, gaussians, measured, innovations, spreads)

    def corrected(self, component: Ints, hypothesis: Ints) -> Gaussians:
        """The Gaussians (N,) of pairs of component (N,) and hypothesis (N,), by the Kalman update.

        Joseph's form of the covariance: a measurement to a hair of a pose known to a kilometre must not round below
        zero.
        """
        covariances, rows = self.gaussians.covariances[component], self.measured.rows[hypothesis]
        spreads, innovations = self.spreads[component, hypothesis], self.innovations[component, hypothesis]
        gains = np.linalg.solve(spreads, rows[:, :, None] * covariances).swapaxes(1, 2)
        means = self.gaussians.means[component] + (gains @ innovations[:, :, None])[:, :, 0]
        kept = np.eye(3) - gains * rows[:, None]
        noise = (gains * self.measured.variances[hypothesis, None]) @ gains.swapaxes(1, 2)
        covariances = kept @ covariances @ kept.swapaxes(1, 2) + noise
        return Gaussians(self.log_weights[component, hypothesis], means, covariances)


def born(evidence: Evidence, area: FreeArea) -> Gaussians:
    """What evidence makes of a robot that could be anywhere: a Gaussian a hypothesis, weighed by its likelihood."""
    seeds = evidence.poses[:, None, :2] + evidence.sigma[:, None, None] * DISC
    inside = area.contains(seeds.reshape(-1, 2)).reshape(seeds.shape[:2]).mean(axis=1)
    with np.errstate(divide="ignore"):  # a hypothesis outside: log 0 is meant
        log_mass = np.log(2.0 * np.pi * evidence.sigma**2 * inside / area.size)
    means, variances = evidence.poses.copy(), np.empty((len(inside), 3))
    means[:, 2] = wrap(means[:, 2])
    variances[:, 0] = variances[:, 1] = evidence.sigma**2
    variances[:, 2] = 1.0 / np.maximum(evidence.kappa, FAN_BELOW)
    at_hypotheses = Gaussians(evidence.log_likelihoods + log_mass, means, variances[:, :, None] * np.eye(3))
    wide = evidence.kappa < FAN_BELOW
    if not wide.any():
        return at_hypotheses
    return stacked(at_hypotheses.part(~wide), _fanned(at_hypotheses.part(wide), evidence.kappa[wide]))


def _fanned(gaussians: Gaussians, kappa: Floats) -> Gaussians:
    """Each of M Gaussians as ``FAN`` of them around the circle, for headings of small concentration (M,)."""
    turns = 2.0 * np.pi * np.arange(FAN) / FAN
    log_shares = log_softmax(kappa[:, None] * np.cos(turns), axis=1)
    fan = gaussians.part(np.repeat(np.arange(len(kappa)), FAN)).weighed(log_shares.ravel())
    fan.means[:, 2] += np.tile(turns, len(kappa))
    fan.covariances[:, 2, 2] = (np.pi / FAN) ** 2
    return fan


def _disc(count: int) -> Floats:
    """(count, 2) points of equal weight, spread like a normal distribution of the plane: a sunflower's seeds."""
    order = np.arange(count)
    radius, angle = np.sqrt(-2.0 * np.log1p(-(order + 0.5) / count)), order * np.pi * (3.0 - np.sqrt(5.0))
    return np.asarray(radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)]))


DISC = _disc(DISC_POINTS)
"""(64, 2) points of equal weight of a normal distribution of the plane."""
