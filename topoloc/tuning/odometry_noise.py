"""The noise of an odometer from what it said and what was true: maximum likelihood of the motions between looks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from topoloc.geometry import Floats, between
from topoloc.odometry import OdometryNoise
from topoloc.tuning.folds import Fold

STRIDES = (1, 2, 4)
"""Motions are taken over so many looks: the noise is used for one, and for more where the gate is coarser."""
FEWEST_MOTIONS = 20
"""Five numbers are not told from fewer motions of one look."""
LARGEST = 5.0
"""A motion that errs by more standard deviations than this is none of the odometer's: the robot was carried, say."""
MUCH_WORSE = 1.5
"""An odometer whose errors are so many times what the defaults expect needs a noise of its own."""
LEAST = OdometryNoise(0.005, 0.005, 0.005, 0.002, 0.002)
"""No odometer is trusted further than this; a truth that was made from the odometer would be, without end."""
ROBUST_FREEDOM = 4.0
"""Degrees of freedom of the Student law that the first fit has."""


@dataclass(frozen=True)
class Motions:
    """Motions that an odometer told, beside the true ones.

    Attributes:
        travelled: (N,) distance as told [m].
        turned: (N,) absolute turn as told [rad].
        errors: (N, 3) true minus told motion, in the robot's frame before it [m, m, rad].
    """

    travelled: Floats
    turned: Floats
    errors: Floats

    def __len__(self) -> int:
        return len(self.travelled)


@dataclass(frozen=True)
class NoiseFit:
    """What was fitted.

    Attributes:
        noise: the fit; without an odometer, or enough motions, the defaults.
        motions: how many it comes from, of one look or more.
        left_out: how many of them erred too much to be the odometer's own.
        beside_default: how large the errors of one look are, in the root mean square, where 1 is what the defaults
            expect; those beyond ``LARGEST`` count as if there.
    """

    noise: OdometryNoise
    motions: int = 0
    left_out: int = 0
    beside_default: float = 1.0

    @property
    def told(self) -> bool:
        """Whether there was anything to fit."""
        return self.motions > 0

    @property
    def worse(self) -> bool:
        """Whether the odometer is clearly worse than the defaults take it to be."""
        return self.beside_default > MUCH_WORSE


def motions_of(folds: Sequence[Fold], strides: Sequence[int] = STRIDES) -> Motions:
    """The motions between looks of folds, over several looks each; none where there is no odometer."""
    told, true = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for fold in folds:
        readings = [(frame.odometry, pose) for frame, pose in zip(fold.frames, fold.truth, strict=True)]
        raw = np.array([reading for reading, _ in readings if reading is not None]).reshape(-1, 3)
        pose = np.array([pose for reading, pose in readings if reading is not None]).reshape(-1, 3)
        for stride in strides:
            told.append(between(raw[:-stride], raw[stride:]))
            true.append(between(pose[:-stride], pose[stride:]))
    said, was = np.concatenate(told), np.concatenate(true)
    errors = was - said
    errors[:, 2] = (errors[:, 2] + np.pi) % (2.0 * np.pi) - np.pi
    return Motions(np.hypot(said[:, 0], said[:, 1]), np.abs(said[:, 2]), errors)


def fit_noise(folds: Sequence[Fold], strides: Sequence[int] = STRIDES) -> NoiseFit:
    """The noise under which what folds hold is likeliest (ours).

    The law is that of ``OdometryNoise.motion``: independent Gaussians along, across and in heading. A first fit with
    Student's law, which a few slips or a kidnapping hardly move, tells which motions are none of the odometer's; the
    second fits Gaussians to the others. What the law has no place for, a constant drift to one side, say, adds to the
    standard deviations.

    Args:
        folds: whose motions are fitted; fewer than ``FEWEST_MOTIONS`` of one look fit nothing.
        strides: over how many looks each motion goes.
    """
    single = motions_of(folds, (1,))
    if len(single) < FEWEST_MOTIONS:
        return NoiseFit(OdometryNoise())
    motions = motions_of(folds, strides)
    place, heading = _designs(motions)
    along, turn = motions.errors[:, :2], motions.errors[:, 2:]
    robust = [_fitted(place, along, ROBUST_FREEDOM), _fitted(heading, turn, ROBUST_FREEDOM)]
    far = (along**2).max(axis=1) > LARGEST**2 * (place @ robust[0])
    far |= turn[:, 0] ** 2 > LARGEST**2 * (heading @ robust[1])
    base, per_metre = np.sqrt(_fitted(place[~far], along[~far]))
    base_heading, heading_per_metre, per_turn = np.sqrt(_fitted(heading[~far], turn[~far]))
    found = OdometryNoise(per_metre, heading_per_metre, per_turn, base, base_heading)
    beside_default = float(np.sqrt(_squares(OdometryNoise(), single)[0].mean()))
    return NoiseFit(_bounded(found), len(motions), int(far.sum()), beside_default)


def log_likelihood(noise: OdometryNoise, motions: Motions) -> float:
    """Mean log density of motions under a noise [nats a motion]; those beyond ``LARGEST`` count as if there."""
    square, variance = _squares(noise, motions)
    return float(-0.5 * (square + np.log(2.0 * np.pi * variance)).sum(axis=1).mean())


def _squares(noise: OdometryNoise, motions: Motions) -> tuple[Floats, Floats]:
    """Squared errors (N, 3) in units of the variance, ``LARGEST``^2 at most, and the variances (N, 3)."""
    place, heading = _designs(motions)
    at_place = place @ np.square([noise.base_distance, noise.distance_per_metre])
    at_heading = heading @ np.square([noise.base_heading, noise.heading_per_metre, noise.heading_per_turn])
    variance = np.column_stack([at_place, at_place, at_heading])
    return np.minimum(motions.errors**2 / variance, LARGEST**2), variance


def scaled(noise: OdometryNoise, factor: float) -> OdometryNoise:
    """A noise whose standard deviations are so many times as large; those without an odometer stay."""
    values = {name: factor * value for name, value in asdict(noise).items() if not name.startswith("unknown")}
    return OdometryNoise(**values)


def _designs(motions: Motions) -> tuple[Floats, Floats]:
    """What variances are sums of, by their squared parameters: of the place (N, 2) and of the heading (N, 3)."""
    one = np.ones(len(motions))
    place = np.column_stack([one, motions.travelled**2])
    return place, np.column_stack([one, motions.travelled**2, motions.turned**2])


def _fitted(design: Floats, errors: Floats, freedom: float | None = None) -> Floats:
    """Variances (P,), not negative, of a law whose variance is ``design @ variances``.

    Args:
        design: (N, P).
        errors: (N, D), each of the D columns of that variance, with mean 0.
        freedom: of Student's law; None: a Gaussian.
    """
    from scipy.optimize import minimize

    def loss(logs: Floats) -> tuple[float, Floats]:
        variance = design @ np.exp(logs)
        square = errors**2 / variance[:, None]
        if freedom is None:
            value, weight = square, np.ones_like(square)
        else:
            value = (freedom + 1.0) * np.log1p(square / freedom)
            weight = (freedom + 1.0) / (freedom + square)
        each = value + np.log(variance)[:, None]
        slope = ((1.0 - weight * square) / variance[:, None]).sum(axis=1)
        return float(0.5 * each.mean()), 0.5 * (slope @ design) * np.exp(logs) / errors.size

    start = np.log(np.maximum(np.median(errors**2) / design.mean(axis=0) / design.shape[1], 1e-8))
    found = minimize(loss, start, jac=True, method="L-BFGS-B", bounds=[(-25.0, 5.0)] * design.shape[1])
    return np.asarray(np.exp(found.x))


def _bounded(noise: OdometryNoise) -> OdometryNoise:
    """No smaller than ``LEAST``, rounded to three digits; what it says without an odometer stays the default's."""
    values, default = asdict(noise), asdict(OdometryNoise())
    least = asdict(LEAST)
    return OdometryNoise(
        **{
            name: default[name] if name.startswith("unknown") else float(f"{max(value, least[name]):.3g}")
            for name, value in values.items()
        }
    )
