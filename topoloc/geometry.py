"""SE(2): poses as arrays (..., 3) of x [m], y [m], theta [rad, -pi <= theta < pi], counter-clockwise (REP 103)."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


def wrap(angle: ArrayLike) -> Floats:
    """Angles (...) [rad] brought into -pi <= angle < pi, elementwise; those that are there stay exactly."""
    angles = np.asarray(angle, dtype=np.float64)
    wrapped = angles - 2.0 * np.pi * np.floor((angles + np.pi) / (2.0 * np.pi))
    return np.asarray(np.where((wrapped < -np.pi) | (wrapped >= np.pi), -np.pi, wrapped))  # off by rounding only


def cos_sin(angles: Floats) -> tuple[Floats, Floats]:
    """Cosines and sines of angles [rad] by the tangents of their halves, of which numpy is faster at one than at both.

    Off by 4e-16 at most.
    """
    half = np.tan(0.5 * angles)  # finite: no float64 is a whole odd number of right angles
    squared = half * half
    share = 1.0 / (1.0 + squared)
    return np.asarray((1.0 - squared) * share), np.asarray(2.0 * half * share)


def rotate(vectors: ArrayLike, angle: ArrayLike) -> Floats:
    """Turn vectors (..., 2) counter-clockwise by angle (...) [rad]; the two broadcast."""
    vector, angles = np.asarray(vectors, dtype=np.float64), np.asarray(angle, dtype=np.float64)
    cos, sin = np.cos(angles), np.sin(angles)
    x, y = vector[..., 0], vector[..., 1]
    return np.stack([cos * x - sin * y, sin * x + cos * y], axis=-1)


def compose(first: ArrayLike, second: ArrayLike) -> Floats:
    """Pose reached from ``first`` by the relative pose ``second``; shapes (..., 3) broadcast."""
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    position = a[..., :2] + rotate(b[..., :2], a[..., 2])
    return np.concatenate([position, wrap(a[..., 2] + b[..., 2])[..., None]], axis=-1)


def inverse(pose: ArrayLike) -> Floats:
    """The relative pose that undoes ``pose``: ``compose(pose, inverse(pose))`` is the origin."""
    a = np.asarray(pose, dtype=np.float64)
    position = rotate(-a[..., :2], -a[..., 2])
    return np.concatenate([position, wrap(-a[..., 2])[..., None]], axis=-1)


def between(start: ArrayLike, end: ArrayLike) -> Floats:
    """Relative pose that leads from ``start`` to ``end``, in the frame of ``start``; shapes (..., 3) broadcast."""
    return compose(inverse(start), end)


def nearest_on_segment(points: ArrayLike, start: ArrayLike, end: ArrayLike) -> Floats:
    """Points (P, 2) of segments, each the nearest to one of ``points`` (P, 2).

    Args:
        points: (P, 2).
        start: (2,) of one segment, or (P, 2) of one for each point.
        end: alike.
    """
    point, a = np.asarray(points, dtype=np.float64), np.asarray(start, dtype=np.float64)
    along = np.asarray(end, dtype=np.float64) - a
    length = np.maximum((along**2).sum(axis=-1), 1e-12)  # of a segment that is one point: any share of it will do
    share = np.clip(((point - a) * along).sum(axis=-1) / length, 0.0, 1.0)
    return np.asarray(a + share[..., None] * along)


def circular_mean(angles: ArrayLike, weights: ArrayLike | None = None) -> float:
    """Direction [rad] of the (weighted) mean of unit vectors; 0 where they cancel exactly."""
    angle = np.asarray(angles, dtype=np.float64)
    weight = np.ones_like(angle) if weights is None else np.asarray(weights, dtype=np.float64)
    return float(wrap(np.arctan2(np.sum(weight * np.sin(angle)), np.sum(weight * np.cos(angle)))))


def covariance_root(covariance: Floats) -> Floats:
    """A matrix R (D, D) with R R' = covariance (D, D), which may be singular."""
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
