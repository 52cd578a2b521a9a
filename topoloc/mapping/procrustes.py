"""How alike two layouts are in shape, and the transformation that puts one onto the other (third seed, section 3.3)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topoloc.geometry import Floats


@dataclass(frozen=True)
class Similarity:
    """A scaling, a turn that may be a reflection as well, and a shift.

    Attributes:
        scale: factor.
        turn: (2, 2) orthogonal.
        shift: (2,), added last.
    """

    scale: float
    turn: Floats
    shift: Floats

    def apply(self, points: Floats) -> Floats:
        """Points (P, 2), moved."""
        return np.asarray(self.scale * points @ self.turn + self.shift)


def shape_error(truth: Floats, layout: Floats) -> float:
    """Procrustes mu in [0, 1]: sum of squared errors once place, size, turn and reflection are taken out.

    Both are centred and brought to unit Frobenius norm; with X'Y = U S V', mu = 1 - (tr S)^2 (EQUATIONS.md, 3).
    0 is the same shape. It equals that of ``scipy.spatial.procrustes``.

    Args:
        truth: (N, 2).
        layout: (N, 2), the same points in the same order.

    Raises:
        ValueError: in one of the two all points are on one spot.
    """
    singular = np.linalg.svd(_unit(truth).T @ _unit(layout), compute_uv=False)
    return float(max(0.0, 1.0 - singular.sum() ** 2))


def onto(truth: Floats, layout: Floats) -> Similarity:
    """The similarity that puts a layout (N, 2) onto the truth (N, 2) with the least sum of squared errors.

    Raises:
        ValueError: in one of the two all points are on one spot.
    """
    left, singular, right = np.linalg.svd(_unit(layout).T @ _unit(truth))
    turn = np.asarray(left @ right)
    scale = float(singular.sum() * np.linalg.norm(_centred(truth)) / np.linalg.norm(_centred(layout)))
    return Similarity(scale, turn, np.asarray(truth.mean(axis=0) - scale * layout.mean(axis=0) @ turn))


def _centred(points: Floats) -> Floats:
    return np.asarray(points - points.mean(axis=0))


def _unit(points: Floats) -> Floats:
    centred = _centred(points)
    size = float(np.linalg.norm(centred))
    if not size > 0.0:
        raise ValueError("all points are on one spot; a shape needs two that differ")
    return np.asarray(centred / size)
