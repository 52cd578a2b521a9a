"""The likelihood of evidence at poses as a user of another library would write it, in plain vectorised numpy.

A particle filter of somebody else's brings no likelihood: that part is its user's. ``log_likelihood`` is written with
scipy's ``logsumexp`` and, as ours, tells poses apart however tiny their likelihood is. ``plain_log_likelihood`` is what
a user in a hurry writes: faster, and good enough where a floor keeps the sum above zero.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.special import i0e, logsumexp

from topoloc.geometry import Floats
from topoloc.types import Evidence

LogLikelihood = Callable[[Evidence, Floats], Floats]
"""(evidence, poses (N, 3)) -> (N,)."""


def log_likelihood(evidence: Evidence, poses: Floats) -> Floats:
    """The mixture of EQUATIONS.md, 4, by ``logsumexp``: (N,) at poses (N, 3)."""
    return np.asarray(np.logaddexp(evidence.log_floor, logsumexp(_log_terms(evidence, poses), axis=1)))


def plain_log_likelihood(evidence: Evidence, poses: Floats) -> Floats:
    """The same, exponentiated as it comes: (N,) at poses (N, 3)."""
    return np.asarray(np.log(np.exp(evidence.log_floor) + np.exp(_log_terms(evidence, poses)).sum(axis=1)))


def _log_terms(evidence: Evidence, poses: Floats) -> Floats:
    """(N, M): log of each hypothesis's weight, Gaussian and von Mises."""
    squared = (poses[:, :1] - evidence.poses[:, 0]) ** 2 + (poses[:, 1:2] - evidence.poses[:, 1]) ** 2
    turned = evidence.kappa * (np.cos(poses[:, 2:] - evidence.poses[:, 2]) - 1.0) - np.log(i0e(evidence.kappa))
    return np.asarray(evidence.log_likelihoods - squared / (2.0 * evidence.sigma**2) + turned)
