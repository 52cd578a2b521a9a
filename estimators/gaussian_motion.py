"""Gaussians after a motion: an unscented transform in its closed form, for all of them at once (ours).

A motion is linear in the position and turns with the heading alone. So sigma points are needed along the heading only,
where they are those of a Gauss-Hermite quadrature, the position going along by its covariance with the heading; what
the position varies besides is carried over as it is. The moments are those of filterpy's ``UnscentedKalmanFilter``
with these points and two more pairs for the rest of the position. All weights are positive, a covariance may be
singular, and turning the world turns the result.
Headings are not wrapped on the way through: points more than half a turn apart must stay so, or the covariance of a
wide heading would shrink at each step.
"""

from __future__ import annotations

import numpy as np
from numpy.polynomial.hermite_e import hermegauss

from estimators.gaussian_sum import Gaussians, bounded
from topoloc.geometry import Floats, wrap
from topoloc.types import Motion

NODES, WEIGHTS = hermegauss(11)
"""Of the quadrature over the heading: the cosine and sine of even an unknown heading then come out to 0.3 %."""
WEIGHTS = WEIGHTS / WEIGHTS.sum()


def moved(gaussians: Gaussians, motion: Motion) -> Gaussians:
    """Every Gaussian after a motion.

    The noise stands in the robot's frame and has the mean zero whatever the heading, so by the law of total covariance
    it adds the mean of G Q G' over the heading: additive noise, and exact.
    """
    deviations = np.sqrt(gaussians.covariances[:, 2:, 2])  # (C, 1)
    turns = _turns(gaussians.means[:, 2:] + deviations * NODES)
    driven = turns @ motion.delta  # (C, 11, 3), in the map's frame
    drive = WEIGHTS @ driven  # (C, 3), the mean
    along = np.divide(gaussians.covariances[:, 2], deviations, out=np.zeros((len(turns), 3)), where=deviations > 0.0)
    away = along[:, None] * NODES[:, None] + (driven - drive[:, None])  # (C, 11, 3) of the points from the mean
    spread = away.swapaxes(1, 2) @ (WEIGHTS[:, None] * away)
    besides = gaussians.covariances - along[:, :, None] * along[:, None]
    noises = turns @ motion.covariance @ turns.swapaxes(2, 3)
    noise = (WEIGHTS @ noises.reshape(len(turns), len(NODES), 9)).reshape(-1, 3, 3)
    means = gaussians.means + drive
    means[:, 2] = wrap(means[:, 2])
    return Gaussians(gaussians.log_weights, means, bounded(besides + spread + noise))


def _turns(headings: Floats) -> Floats:
    """(C, K, 3, 3) that turn a motion by headings (C, K) [rad] into the map's frame."""
    turns = np.zeros((*headings.shape, 3, 3))
    turns[..., 0, 0] = turns[..., 1, 1] = np.cos(headings)
    turns[..., 1, 0] = np.sin(headings)
    turns[..., 0, 1] = -turns[..., 1, 0]
    turns[..., 2, 2] = 1.0
    return turns
