"""The peer of particle filter and Kalman filter: Stone Soup (Dstl; MIT licence), as a careful user would set it up.

The library brings predictors, updaters and the resampler; the models are its user's: vectorised, headings as plain
numbers instead of ``Bearing`` objects, noise from numpy's fast generator. This file alone imports the library: it need
not be installed.
"""

from __future__ import annotations

from collections.abc import Sequence
from datetime import datetime, timedelta
from itertools import cycle
from typing import Any

import numpy as np
from scipy.special import logsumexp
from stonesoup.base import Property
from stonesoup.models.base import GaussianModel, Model
from stonesoup.models.measurement.linear import LinearGaussian
from stonesoup.predictor.kalman import UnscentedKalmanPredictor
from stonesoup.predictor.particle import ParticlePredictor
from stonesoup.resampler.particle import SystematicResampler
from stonesoup.types.array import StateVector, StateVectors
from stonesoup.types.detection import Detection
from stonesoup.types.hypothesis import SingleHypothesis
from stonesoup.types.state import GaussianState, ParticleState
from stonesoup.updater.kalman import KalmanUpdater
from stonesoup.updater.particle import ParticleUpdater

from benchmarks.speed.likelihood import LogLikelihood
from topoloc.geometry import Floats, rotate
from topoloc.types import Evidence, Motion

START, SECOND = datetime(2000, 1, 1), timedelta(seconds=1)


class Drive(GaussianModel):  # type: ignore[misc]
    """A robot that makes a motion, whose noise is alike along and across and so the same in the map's frame."""

    motion: Motion = Property(doc="with variances alone")
    rng: np.random.Generator = Property(doc="of the noise")

    @property
    def ndim(self) -> int:
        """x, y and heading."""
        return 3

    @property
    def ndim_state(self) -> int:
        """The same, by the name that the unscented filter asks for."""
        return 3

    def covar(self, **_: Any) -> Floats:
        """(3, 3) of the noise."""
        return self.motion.covariance

    def rvs(self, num_samples: int = 1, **_: Any) -> Any:
        """(3, N) of the noise."""
        noise = self.rng.standard_normal((3, num_samples)) * np.sqrt(np.diag(self.motion.covariance))[:, None]
        return noise.view(StateVectors)

    def function(self, state: Any, noise: bool | None = False, **_: Any) -> Any:
        """(3, N) after the motion from (3, N), with or without noise."""
        before = np.asarray(state.state_vector, dtype=np.float64)
        moved = np.empty_like(before)
        moved[:2] = before[:2] + rotate(self.motion.delta[:2], before[2]).T
        moved[2] = before[2] + self.motion.delta[2]
        moved = moved.view(type(state.state_vector))
        return moved + self.rvs(before.shape[1]) if noise else moved


class Looks(Model):  # type: ignore[misc]
    """What is seen, as ``Evidence`` in the place of a measured vector."""

    log_likelihood: LogLikelihood = Property(doc="of evidence at poses")

    @property
    def ndim(self) -> int:
        """Evidence is one thing."""
        return 1

    def logpdf(self, state1: Any, state2: Any, **_: Any) -> Floats:
        """(N,) log-likelihood of a detection at a particle state."""
        return self.log_likelihood(state1.metadata["evidence"], np.asarray(state2.state_vector, dtype=np.float64).T)

    def pdf(self, state1: Any, state2: Any, **_: Any) -> Floats:
        """(N,) likelihood."""
        return np.asarray(np.exp(self.logpdf(state1, state2)))

    def function(self, state: Any, noise: Any = False, **_: Any) -> Any:
        """Evidence is not foretold."""
        raise NotImplementedError

    def rvs(self, num_samples: int = 1, **_: Any) -> Any:
        """Nor drawn."""
        raise NotImplementedError


class ToldLooks(Looks):
    """The same, adding up the log evidence, which the library's updater does not keep.

    Attributes:
        log_evidence: of all steps.
    """

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.log_evidence = 0.0

    def logpdf(self, state1: Any, state2: Any, **_: Any) -> Floats:
        """(N,), as ``Looks``."""
        log_likelihoods = super().logpdf(state1, state2)
        self.log_evidence += float(logsumexp(state2.log_weight + log_likelihoods))
        return log_likelihoods


class StoneSoupParticles:
    """The bootstrap filter of Stone Soup: predictor, updater, systematic resampling at each step.

    Args:
        start: (N, 3) poses.
        motion: of each step.
        looks: the model of what is seen.
        rng: of the motions' noise; the resampler draws from numpy's global generator.
    """

    def __init__(self, start: Floats, motion: Motion, looks: Looks, rng: np.random.Generator) -> None:
        ParticlePredictor.predict.__wrapped__.cache_clear()  # the library keeps the last 128 predictions
        count = len(start)
        self._predictor = ParticlePredictor(Drive(motion=motion, rng=rng))
        self._updater = ParticleUpdater(looks, SystematicResampler())
        self.state = ParticleState(
            StateVectors(np.ascontiguousarray(start.T)), log_weight=np.full(count, -np.log(count)), timestamp=START
        )

    def look(self, evidence: Evidence, state: Any = None) -> None:
        """Weigh by what is seen, and resample."""
        prior = self.state if state is None else state
        seen = Detection(StateVector([0.0]), timestamp=prior.timestamp, metadata={"evidence": evidence})
        self.state = self._updater.update(SingleHypothesis(prior, seen))

    def step(self, evidence: Evidence) -> None:
        """Move on and look."""
        self.look(evidence, self._predictor.predict(self.state, timestamp=self.state.timestamp + SECOND))

    @property
    def poses(self) -> Floats:
        """(N, 3), all of one weight."""
        return np.asarray(self.state.state_vector, dtype=np.float64).T


class StoneSoupGaussian:
    """The unscented prediction and the Kalman update by a measured pose, in Stone Soup.

    Args:
        mean: (3,) of the start.
        covariance: (3, 3) of the start.
        noise: (3,) variances of a measured pose.
        steps: motions, and the pose (3,) that is measured after each; they come round again.
    """

    def __init__(self, mean: Floats, covariance: Floats, noise: Floats, steps: Sequence[tuple[Motion, Floats]]) -> None:
        self._updater = KalmanUpdater(LinearGaussian(3, (0, 1, 2), np.diag(noise)))
        predictors = (UnscentedKalmanPredictor(Drive(motion=motion, rng=None)) for motion, _ in steps)
        self._steps = cycle([(move, StateVector(pose)) for move, (_, pose) in zip(predictors, steps, strict=True)])
        self.state = GaussianState(StateVector(mean), covariance, timestamp=START)

    def step(self) -> None:
        """Move on, and take in the pose that was measured."""
        predictor, measured = next(self._steps)
        predicted = predictor.predict(self.state, timestamp=self.state.timestamp + SECOND)
        seen = Detection(measured, timestamp=predicted.timestamp)
        self.state = self._updater.update(SingleHypothesis(predicted, seen))

    def figures(self) -> Floats:
        """(12,) mean and covariance."""
        return np.append(np.asarray(self.state.mean, dtype=np.float64), np.asarray(self.state.covar, dtype=np.float64))
