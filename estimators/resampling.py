"""Resampling: weights -> indices of the particles that live on. Pure functions; the random numbers are handed in.

Each draws n indices so that particle i is expected n * w_i times. They differ in how far a count strays from that:
systematic and residual by less than one and least in practice, multinomial the most.
Douc, Cappe, Moulines: Comparison of resampling schemes for particle filtering, ISPA 2005.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from topoloc.geometry import Floats
from topoloc.types import Ints

Resampler = Callable[[ArrayLike, int, np.random.Generator], Ints]
"""(weights (N,) up to a factor, n, rng) -> indices (n,) into the weights."""


def systematic(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """One random number: n points at equal distances along the cumulated weights. Indices (n,), ascending."""
    return _at((np.arange(n) + rng.random()) / n, weights)


def stratified(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """One random point in each n-th part of the cumulated weights. Indices (n,), ascending."""
    return _at((np.arange(n) + rng.random(n)) / n, weights)


def multinomial(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """Independent draws. Indices (n,)."""
    return _at(rng.random(n), weights)


def residual(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """floor(n w_i) copies of each particle for certain, the rest drawn from what is left over. Indices (n,)."""
    expected = n * _cumulated_and_shares(weights)[1]
    certain = np.floor(expected).astype(np.int64)
    missing = n - int(certain.sum())
    copies = np.repeat(np.arange(len(certain)), certain)
    if missing <= 0:
        return np.asarray(copies[:n], dtype=np.int64)
    return np.concatenate([copies, multinomial(expected - certain, missing, rng)])


RESAMPLERS: dict[str, Resampler] = {
    "systematic": systematic,
    "stratified": stratified,
    "residual": residual,
    "multinomial": multinomial,
}
"""The resamplers by name."""


def _cumulated_and_shares(weights: ArrayLike) -> tuple[Floats, Floats]:
    """Cumulated weights (N,) that end at one exactly, and the weights (N,) scaled to sum to one."""
    weight = np.asarray(weights, dtype=np.float64)
    cumulated = np.cumsum(weight)
    total = float(cumulated[-1]) if len(cumulated) else 0.0
    if not (0.0 < total < np.inf) or (weight < 0.0).any():
        raise ValueError("weights must not be negative or infinite, and one at least must be positive")
    return cumulated / total, weight / total


def _at(points: Floats, weights: ArrayLike) -> Ints:
    """The particles (n,) in whose share of the cumulated weights the points (n,) of [0, 1) fall."""
    cumulated, _ = _cumulated_and_shares(weights)
    below_one = np.minimum(points, np.nextafter(1.0, 0.0))  # (n - 1 + 0.999...) / n may round up to one
    # side="right" steps over particles of weight zero: their share of the line is empty
    return np.asarray(np.searchsorted(cumulated, below_one, side="right"), dtype=np.int64)
