"""The likelihood of a frame at the cells of a grid, by the hypotheses that reach them: EQUATIONS.md, 4 (ours)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import i0e

from topoloc.geometry import Floats
from topoloc.types import Evidence

LEFT_OUT = 1e-12
"""What hypotheses out of reach may add to a cell's likelihood, all together, as a share of the floor."""
LOWEST_FLOOR = 1e-200
"""As a share of the largest that a likelihood can be: above it nothing that counts is lost to underflow."""


@dataclass(frozen=True)
class LikelihoodField:
    """A likelihood as floor + sum_m w_m K(|p - p_m|) h(theta - theta_m), in the unit exp(``log_unit``).

    Unlike logs of likelihoods it costs no logarithm and no exponential a cell: in a layer of one heading x, y and
    heading are factors of each term, and their sum over the hypotheses is a product of matrices.

    Attributes:
        poses: (M, 3) of the hypotheses.
        weights: (M,) w_m times the peak of h, at most one.
        sigma: (M,) [m].
        kappa: (M,).
        reach: (M,) farther from it along x or y a hypothesis adds next to nothing [m].
        floor: at most one.
        log_unit: what is to be added to the log of a value.
    """

    poses: Floats
    weights: Floats
    sigma: Floats
    kappa: Floats
    reach: Floats
    floor: float
    log_unit: float

    @classmethod
    def of(cls, evidence: Evidence) -> LikelihoodField | None:
        """The likelihood that an evidence gives; None where it has no floor that is worth the name."""
        log_peaks = evidence.log_likelihoods - np.log(i0e(evidence.kappa))
        log_unit = max(float(log_peaks.max()), evidence.log_floor)
        if not evidence.log_floor > log_unit + np.log(LOWEST_FLOOR):
            return None
        log_least = evidence.log_floor + np.log(LEFT_OUT / len(log_peaks))
        reach = evidence.sigma * np.sqrt(2.0 * np.maximum(log_peaks - log_least, 0.0))
        floor = float(np.exp(evidence.log_floor - log_unit))
        weights = np.exp(log_peaks - log_unit)
        return cls(evidence.poses, weights, evidence.sigma, evidence.kappa, reach, floor, log_unit)

    def near(self, xs: Floats, ys: Floats, margin: float) -> LikelihoodField:
        """The same without the hypotheses that do not reach a rectangle.

        Args:
            xs: (X,) along x, ascending [m].
            ys: (Y,) along y, ascending [m].
            margin: that it is wider on each side [m].
        """
        reach, near = self.reach + margin, np.ones(len(self.poses), dtype=bool)
        for line, middle in ((xs, self.poses[:, 0]), (ys, self.poses[:, 1])):
            near &= (middle > line[0] - reach) & (middle < line[-1] + reach)
        parts = {name: getattr(self, name)[near] for name in ("poses", "weights", "sigma", "kappa", "reach")}
        return replace(self, **parts)

    def at(self, xs: Floats, ys: Floats, headings: Floats) -> Floats:
        """Values (B, X, Y) at the crossings of xs (B, X) and ys (B, Y) [m] in layers of headings (B,) [rad]."""
        along_x, along_y = (
            np.exp(-(((line[:, :, None] - middle) / self.sigma) ** 2) / 2.0)
            for line, middle in ((xs, self.poses[:, 0]), (ys, self.poses[:, 1]))
        )
        turned = np.cos(headings[:, None] - self.poses[:, 2]) - 1.0
        along_x *= (self.weights * np.exp(self.kappa * turned))[:, None]
        values = along_x @ along_y.mT
        values += self.floor
        return np.asarray(values)
