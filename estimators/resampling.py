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
    return _at_one_in_each_part(rng.random(), n, weights)


def stratified(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """One random point in each n-th part of the cumulated weights. Indices (n,), ascending."""
    return _at_one_in_each_part(rng.random(n), n, weights)


def multinomial(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """Independent draws. Indices (n,)."""
    return _at(rng.random(n), weights)


def residual(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """floor(n w_i) copies of each particle for certain, the rest drawn from what is left over. Indices (n,)."""
    expected = n * (np.asarray(weights, dtype=np.float64) / _cumulated(weights)[1])
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


def _cumulated(weights: ArrayLike) -> tuple[Floats, float]:
    """Cumulated weights (N,), scaled to end at one exactly, and what they were divided by."""
    weight = np.asarray(weights, dtype=np.float64)
    cumulated = np.cumsum(weight)
    total = float(cumulated[-1]) if len(cumulated) else 0.0
    if not (0.0 < total < np.inf) or weight.min() < 0.0:
        raise ValueError("weights must not be negative or infinite, and one at least must be positive")
    cumulated /= total
    return cumulated, total


def _at(points: Floats, weights: ArrayLike) -> Ints:
    """The particles (n,) in whose share of the cumulated weights the points (n,) of [0, 1) fall."""
    # side="right" steps over particles of weight zero: their share of the line is empty
    return np.asarray(np.searchsorted(_cumulated(weights)[0], points, side="right"), dtype=np.int64)


def _at_one_in_each_part(places: ArrayLike, n: int, weights: ArrayLike) -> Ints:
    """What ``_at`` gives for one point in each n-th part of the line, at ``places`` in it, (n,) or one for all.

    The points before the end of each share are counted, which is faster than searching for each point's share.
    """
    cumulated, _ = _cumulated(weights)
    points = np.arange(n) + np.asarray(places)
    points /= n
    np.minimum(points, np.nextafter(1.0, 0.0), out=points)  # (n - 1 + 0.999...) / n may round up to one
    fenced = np.concatenate([[-np.inf], points, [np.inf]])
    before = np.empty(len(cumulated), dtype=np.int64)
    np.multiply(cumulated, n, out=before, casting="unsafe")  # as many, or one more or less
    before -= fenced[before] >= cumulated
    before += fenced[1:][before] < cumulated
    return np.cumsum(np.bincount(before, minlength=n)[:n])
