"""How stiff the spring between two images is: the laws k_ij, by name."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from topoloc.geometry import Floats

LEAST_LENGTH = 0.05
"""Images nearer to each other than this, in units, have springs as stiff as those at it: 1 / d has no end."""

Law = Callable[[Floats, float], Floats]
"""Natural lengths (N, N) in units, and the reach in units -> stiffness (N, N), not negative."""


def _constant(lengths: Floats, reach: float) -> Floats:
    return np.ones_like(lengths)


def _inverse(lengths: Floats, reach: float) -> Floats:
    return np.asarray(1.0 / np.maximum(lengths, LEAST_LENGTH))


def _inverse_square(lengths: Floats, reach: float) -> Floats:
    return np.asarray(np.maximum(lengths, LEAST_LENGTH) ** -2.0)


def _linear(lengths: Floats, reach: float) -> Floats:
    return np.asarray(np.maximum(0.0, 1.0 - lengths / reach))


def _exponential(lengths: Floats, reach: float) -> Floats:
    return np.asarray(np.exp(-lengths / reach))


LAWS: Mapping[str, Law] = {
    "constant": _constant,
    "inverse": _inverse,
    "inverse-square": _inverse_square,
    "linear": _linear,
    "exponential": _exponential,
}
"""Constant, 1 / d, 1 / d^2, max(0, 1 - d / reach) and exp(-d / reach).

The third seed has the elastic constants depend on the distance between the images (section 3); its formulas are lost,
and these are rebuilt (EQUATIONS.md, 3).
"""


def stiffness_of(law: str, lengths: Floats, unit: float, reach: float) -> Floats:
    """Stiffness (N, N) of the springs; 0 on the diagonal.

    Args:
        law: one of ``LAWS``.
        lengths: (N, N) natural lengths.
        unit: a length; lengths and reach are counted in it, so that the law does not depend on the descriptor's scale.
        reach: of the linear and the exponential law, units.
    """
    stiff = LAWS[law](lengths / unit, reach)
    np.fill_diagonal(stiff, 0.0)
    return stiff
