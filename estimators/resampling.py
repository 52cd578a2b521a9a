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

CACHED = 2**13
"""Weights that are worked on at a time."""
BELOW_ONE = float(np.nextafter(1.0, 0.0))
Resampler = Callable[[ArrayLike, int, np.random.Generator], Ints]
"""(weights (N,) up to a factor, n, rng) -> indices (n,) into the weights."""


def systematic(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """One random number: n points at equal distances along the cumulated weights. Indices (n,), ascending."""
    return _at_one_in_each_part(rng.random(), n, weights)


def stratified(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """One random point in each n-th part of the cumulated weights. Indices (n,), ascending."""
    return _at_one_in_each_part(rng.random(n), n, weights)


def multinomial(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """Independent draws. Indices (n,), ascending: neighbouring points are found several times as fast."""
    return _at(_ordered_points(n, rng), _cumulated(weights)[0])


def residual(weights: ArrayLike, n: int, rng: np.random.Generator) -> Ints:
    """floor(n w_i) copies of each particle for certain, the rest drawn from what is left over. Indices (n,)."""
    left = np.asarray(weights, dtype=np.float64) * n
    left /= _cumulated(weights)[1]
    certain = left.astype(np.int64)
    left -= certain
    copies = np.repeat(np.arange(len(certain)), certain)
    missing = n - len(copies)
    if missing <= 0:
        return np.asarray(copies[:n], dtype=np.int64)
    return np.concatenate([copies, multinomial(left, missing, rng)])


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


def _ordered_points(n: int, rng: np.random.Generator) -> Floats:
    """Independent points (n,) of [0, 1), ascending: the arrivals of a Poisson process, without any sorting."""
    arrivals = np.cumsum(rng.standard_exponential(n + 1))
    points = arrivals[:-1]
    points /= arrivals[-1]
    return np.asarray(np.minimum(points, BELOW_ONE, out=points))


def _at(points: Floats, cumulated: Floats) -> Ints:
    """The particles (n,) in whose share of the cumulated weights (N,) the points (n,) of [0, 1) fall."""
    # side="right" steps over particles of weight zero: their share of the line is empty
    return np.asarray(np.searchsorted(cumulated, points, side="right"), dtype=np.int64)


def _at_one_in_each_part(places: float | Floats, n: int, weights: ArrayLike) -> Ints:
    """What ``_at`` gives for one point in each n-th part of the line, at ``places`` in it, (n,) or one for all.

    The points before the end of each share are counted, which is faster than searching for each point's share. A part
    of the weights at a time: memory that stays in the cache need not be asked for again.
    """
    cumulated, _ = _cumulated(weights)
    if n == 0:
        return np.zeros(0, dtype=np.int64)
    indices = np.zeros(n + 2, dtype=np.int64)
    for first in range(0, len(cumulated), CACHED):
        ends = cumulated[first : first + CACHED]
        before = (ends * n).astype(np.int64)  # as many, or one more or less
        before -= _points(before - 1, places, n) >= ends
        before += _points(before, places, n) < ends
        counts = np.bincount(before - before[0])
        indices[before[0] : before[0] + len(counts)] += counts
    return np.cumsum(indices[:n], out=indices[:n])


def _points(parts: Ints, places: float | Floats, n: int) -> Floats:
    """The points (P,) of [0, 1) in so manieth parts (P,) of n; one part too far in either direction does no harm."""
    points = parts + (places if isinstance(places, float) else places.take(parts, mode="clip"))
    points /= n
    return np.asarray(np.minimum(points, BELOW_ONE, out=points))  # (n - 1 + 0.999...) / n may round up to one
