"""The peer of the particle filter: the bootstrap filter of the ``particles`` library (N. Chopin; MIT licence).

The library brings the filter, its resampling and the distributions of start and motion; the likelihood is its user's.
This file alone imports it: it need not be installed.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from particles import SMC
from particles import distributions as dists
from particles.state_space_models import Bootstrap, StateSpaceModel

from benchmarks.speed.likelihood import LogLikelihood
from topoloc.geometry import Floats, rotate
from topoloc.types import Evidence, Motion


class Seen(dists.ProbDist):  # type: ignore[misc]
    """The law of what is seen at poses (N, 3)."""

    def __init__(self, poses: Floats, log_likelihood: LogLikelihood) -> None:
        self.poses, self.log_likelihood = poses, log_likelihood

    def logpdf(self, x: Evidence) -> Floats:
        """(N,) log-likelihood of what was seen."""
        return self.log_likelihood(x, self.poses)


class Drive(StateSpaceModel):  # type: ignore[misc]
    """A robot that makes the same motion at each step, and whose camera sees evidence.

    Attributes (as the library sets them, by name):
        mean, deviations: (3,) of the start, Gaussian and independent.
        motion: with variances alone, alike along and across, so that the noise is the same in the map's frame.
        log_likelihood: of evidence at poses.
    """

    mean: Floats
    deviations: Floats
    motion: Motion
    log_likelihood: LogLikelihood

    def PX0(self) -> Any:  # noqa: N802
        """The law of the start."""
        return dists.IndepProd(*map(dists.Normal, self.mean, self.deviations))

    def PX(self, t: int, xp: Floats) -> Any:  # noqa: N802
        """The law of the pose after a step from poses (N, 3)."""
        place = xp[:, :2] + rotate(self.motion.delta[:2], xp[:, 2])
        means = (place[:, 0], place[:, 1], xp[:, 2] + self.motion.delta[2])
        return dists.IndepProd(*map(dists.Normal, means, np.sqrt(np.diag(self.motion.covariance))))

    def PY(self, t: int, xp: Floats, x: Floats) -> Seen:  # noqa: N802
        """The law of what is seen at poses (N, 3)."""
        return Seen(x, self.log_likelihood)


class Endless(Bootstrap):  # type: ignore[misc]
    """The bootstrap filter of a drive that comes round to what was seen at first."""

    T = math.inf

    def logG(self, t: int, xp: Floats, x: Floats) -> Floats:  # noqa: N802
        """(N,) log-likelihood at poses (N, 3) of what is seen at step t."""
        return np.asarray(super().logG(t % len(self.data), xp, x))


def bootstrap_filter(drive: Drive, seen: Sequence[Evidence], count: int) -> Any:
    """The filter at work: ``next`` makes a step, the first one to the start, and takes in what is seen there."""
    return SMC(fk=Endless(ssm=drive, data=seen), N=count, resampling="systematic", ESSrmin=1.0, collect="off")
