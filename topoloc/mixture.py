"""The likelihood of a frame at poses: a sum of Gaussians times von Mises functions over a floor, fast."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import i0e, logsumexp

from topoloc.geometry import Floats, cos_sin
from topoloc.nearby import WIDE, Ints, Nearby, Tiles

TRUSTED = 1e-280
"""Sums of terms up to one that are at least this large have lost nothing to underflow, which starts at 1e-308."""
MULTIPLIED_OUT = 1e8
"""Squares may be multiplied out as long as their parts are no larger: what rounding loses is then below 1e-7."""
CACHED = 2**16
"""Terms that are worked on at a time: as many as stay in a core's cache."""
NEGLIGIBLE = 1e-15
"""Share of the floor that all terms together come to that are left out as out of reach."""
FEW_PAIRS = 2**18
"""Pairs of a pose and a hypothesis that are all looked at sooner than those in reach are found."""


@dataclass(frozen=True)
class Mixture:
    """The sum of ``Evidence.log_likelihood`` as products of matrices; the attributes are the evidence's, M > 0.

    The weights are scaled so that no term exceeds one. So nothing overflows, and what a sum loses to underflow tells
    only where the sum itself is tiny: no floor, or one far below the best hypothesis. There ``_exactly`` is asked.
    """

    poses: Floats
    log_likelihoods: Floats
    sigma: Floats
    kappa: Floats
    log_floor: float

    def at_poses(self, places: Floats, headings: Floats) -> Floats:
        """(N,) at places (N, 2), each with its own of the headings (N,): one matrix product gives all exponents."""
        if len(places) * len(self.poses) > FEW_PAIRS and self._in_reach is not None:
            sums = self._in_reach.sums(places, headings)
        elif np.abs(self._coefficients).max() > MULTIPLIED_OUT:
            return self._exactly(places, headings)
        else:
            sums = self._sums_of_all(places, headings)
        values, (lost,) = self._logs(sums)
        values[lost] = self._exactly(places[lost], headings[lost])
        return values

    def _sums_of_all(self, places: Floats, headings: Floats) -> Floats:
        """(N,) of all terms."""
        sums = np.empty(len(places))
        for block in self._blocks(len(places)):
            exponents = self._coefficients @ self._features(places[block], headings[block])
            sums[block] = self._weights @ np.exp(exponents, out=exponents)
        return sums

    def at_every_heading(self, places: Floats, headings: Floats) -> Floats:
        """(P, H) at places (P, 2) with each of the headings (H,): position and heading apart, then their product."""
        sums = np.empty((len(places), len(headings)))
        around = self._weights[:, None] * self._around(headings)
        for block in self._blocks(len(places)):
            np.matmul(np.exp(self._log_positions(places[block])), around, out=sums[block])
        values, (place, heading) = self._logs(sums)
        values[place, heading] = self._exactly(places[place], headings[heading])
        return values

    def on_grid(self, xs: Floats, ys: Floats, heading: float) -> Floats:
        """(X, Y) at xs (X,) crossed with ys (Y,): x, y and heading apart, then their product."""
        along_x, along_y = (
            np.exp(-((line[:, None] - middle) ** 2) * self._narrowness)
            for line, middle in ((xs, self.poses[:, 0]), (ys, self.poses[:, 1]))
        )
        weights = self._weights * self._around(np.array([heading]))[:, 0]
        values, (column, row) = self._logs((along_x * weights) @ along_y.T)
        values[column, row] = self._exactly(np.column_stack([xs[column], ys[row]]), np.full(len(column), heading))
        return values

    def _blocks(self, count: int) -> list[slice]:
        """Parts of ``count`` poses that are small enough for the cache, and for memory where hypotheses are many."""
        step = max(1, CACHED // len(self.poses))
        return [slice(first, first + step) for first in range(0, count, step)]

    def _logs(self, sums: Floats) -> tuple[Floats, tuple[Ints, ...]]:
        """Log of floor + sums, of any shape, at their true scale, in place; indices of those that are not trusted."""
        sums += np.exp(self.log_floor - self._scale)
        lost = np.unravel_index(np.flatnonzero(~(sums >= TRUSTED)), sums.shape)  # NaN, too
        sums[lost] = 1.0
        np.log(sums, out=sums)
        sums += self._scale
        return sums, lost

    def _exactly(self, places: Floats, headings: Floats) -> Floats:
        """(N,) at places (N, 2) with headings (N,), each sum scaled by its own largest term."""
        values = np.empty(len(places))
        for block in self._blocks(len(places)):
            turned = np.cos(headings[block, None] - self.poses[:, 2])
            terms = self._log_peaks + self._log_positions(places[block]) + self.kappa * (turned - 1.0)  # (N, M)
            values[block] = np.logaddexp(self.log_floor, logsumexp(terms, axis=1))
        return values

    def _log_positions(self, places: Floats) -> Floats:
        """(N, M) log K at places (N, 2)."""
        squared = (places[:, :1] - self.poses[:, 0]) ** 2 + (places[:, 1:] - self.poses[:, 1]) ** 2
        return np.asarray(-squared * self._narrowness)

    def _around(self, headings: Floats) -> Floats:
        """(M, H) von Mises factors at headings (H,), scaled to one at their peak."""
        turned = np.cos(headings - self.poses[:, 2:])
        return np.asarray(np.exp(self.kappa[:, None] * (turned - 1.0)))

    def _features(self, places: Floats, headings: Floats) -> Floats:
        """(6, N) of places (N, 2) with headings (N,); ``_coefficients`` @ them are the exponents of all terms."""
        x, y = places[:, 0] - self._centre[0], places[:, 1] - self._centre[1]
        return np.stack([x * x + y * y, x, y, *cos_sin(headings), np.ones(len(x))])

    @cached_property
    def _coefficients(self) -> Floats:
        """(M, 6): -|p - p_m|^2 / (2 sigma^2) + kappa (cos(theta - theta_m) - 1), multiplied out."""
        (x, y), narrowness = (self.poses[:, :2] - self._centre).T, self._narrowness
        cos, sin = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        constant = -narrowness * (x * x + y * y) - self.kappa
        return np.column_stack(
            [-narrowness, 2.0 * narrowness * x, 2.0 * narrowness * y, self.kappa * cos, self.kappa * sin, constant]
        )

    @cached_property
    def _in_reach(self) -> _InReach | None:
        """The terms by place, where they are many and most are out of reach of any one place; else None."""
        if self.log_floor == -np.inf:
            return None
        reach = reach_of(self._log_peaks, self.log_floor, self.sigma)
        nearby = Nearby.worthwhile(self.poses[:, :2], reach)
        if nearby is None or max(self._narrowness.max() * (WIDE * reach) ** 2, self.kappa.max()) > MULTIPLIED_OUT:
            return None
        return _InReach(nearby, self.poses, self._narrowness, self.kappa, self._weights)

    @cached_property
    def _centre(self) -> Floats:
        """(2,) of the hypotheses: squares of map coordinates would be large beside their differences."""
        return np.asarray(self.poses[:, :2].mean(axis=0))

    @cached_property
    def _narrowness(self) -> Floats:
        """(M,) 1 / (2 sigma^2)."""
        return 0.5 / self.sigma**2

    @cached_property
    def _log_peaks(self) -> Floats:
        """(M,) log of w_m times the peak of h."""
        return np.asarray(self.log_likelihoods - np.log(i0e(self.kappa)))

    @cached_property
    def _scale(self) -> float:
        """Log of the largest that a term can be; 0 where all are zero."""
        largest = max(float(self._log_peaks.max()), self.log_floor)
        return largest if largest > -np.inf else 0.0

    @cached_property
    def _weights(self) -> Floats:
        """(M,) at most one."""
        return np.asarray(np.exp(self._log_peaks - self._scale))


def reach_of(log_peaks: Floats, log_floor: float, sigma: Floats) -> float:
    """Distance [m] beyond which Gaussians (M,) of such peaks and widths vanish beside a floor above zero."""
    least = log_floor + np.log(NEGLIGIBLE / len(log_peaks))
    return float((sigma * np.sqrt(2.0 * np.maximum(log_peaks - least, 0.0))).max())


class _InReach:
    """The sum over those terms only that are in reach of a place.

    All is reckoned from the middle of the tile that a place is in, where squares lose hardly any digits.

    Args:
        nearby: of the hypotheses' places.
        poses: (M, 3) of the hypotheses.
        narrowness, kappa, weights: (M,) of the same.
    """

    def __init__(self, nearby: Nearby, poses: Floats, narrowness: Floats, kappa: Floats, weights: Floats) -> None:
        self._nearby = nearby
        x, y = (poses[:, :2] - nearby.corner).T
        cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
        terms = np.stack([x, y, narrowness, kappa * cos, kappa * sin, kappa, weights])
        self._terms = np.pad(terms, ((0, 0), (0, 1)))  # (7, M + 1), the last weighs nothing

    def sums(self, places: Floats, headings: Floats) -> Floats:
        """(N,) at places (N, 2) with headings (N,)."""
        sums, seen, (cos, sin) = np.empty(len(places)), places - self._nearby.corner, cos_sin(headings)
        for tiles in self._nearby.tiles(places):
            at = tiles.places  # (T, n)
            x, y = (seen[at] - tiles.centres[:, None]).transpose(2, 0, 1)
            features = np.stack([x * x + y * y, x, y, cos[at], sin[at], np.ones(at.shape)], axis=2)  # (T, n, 6)
            exponents = features @ self._coefficients(tiles)
            weights = self._terms[-1].take(tiles.points)[:, :, None]
            sums[at] = (np.exp(exponents, out=exponents) @ weights)[:, :, 0]
        return sums

    def _coefficients(self, tiles: Tiles) -> Floats:
        """(T, 6, K) as ``Mixture._coefficients``, of the hypotheses that are near, seen from the tiles' centres."""
        x, y, narrowness, cos, sin, kappa = self._terms[:-1].take(tiles.points, axis=1)
        x, y = x - tiles.centres[:, :1], y - tiles.centres[:, 1:]
        constant = -narrowness * (x * x + y * y) - kappa
        return np.stack([-narrowness, 2.0 * narrowness * x, 2.0 * narrowness * y, cos, sin, constant], axis=1)
