"""Full Markov localization on a grid of poses: thesis section 3.1, equations (3.9) to (3.12)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from itertools import product

import numpy as np
from scipy.linalg.blas import daxpy

from estimators.free_area import FreeArea
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats, rotate, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

NEGLIGIBLE = 1e-3
"""Cells that together weigh less than this are left out of the belief that is handed out."""


@dataclass(frozen=True)
class MarkovGridConfig:
    """Settings of the grid.

    Attributes:
        resolution_m: side of a cell [m].
        reach_m: how far from a node or an edge the robot may be [m].
        headings: layers of heading around the circle; 24 are 15 degrees each.
        recovery: probability, at each update, that the robot is anywhere in the free area instead: that share of the
            belief is spread over all of it, so that a robot that was carried off, or a belief that went wrong, is found
            again.
    """

    resolution_m: float = 0.25
    reach_m: float = 0.75
    headings: int = 24
    recovery: float = 0.02

    def __post_init__(self) -> None:
        if not 0.0 < self.resolution_m <= self.reach_m:
            raise ValueError(f"resolution_m is {self.resolution_m}; it must be positive and at most reach_m")
        if not 0.0 <= self.recovery <= 0.5:
            raise ValueError(f"recovery is {self.recovery}; it must lie in [0, 0.5]")
        if self.headings < 4:
            raise ValueError(f"headings is {self.headings}; it must be at least 4")


class MarkovGrid:
    """The belief as a mass for every cell (x, y, heading) of the free area.

    The layers of heading ride on the odometry: a turn changes the heading that a layer stands for, and a move is kept
    as an offset of the layer until it makes a whole cell. So motion itself blurs nothing, however small the steps;
    bilinear shifts would add 0.1 m per step of 0.3 m at the default resolution, and 7 degrees per turn of 10.

    Approximations: the motion's variances along x and y of the map are right for every layer, but the correlations
    between x, y and heading are dropped (x and y have none where odometry errs alike along and across); mass that
    changes its layer keeps its cell, so it is displaced by less than a cell.
    Mass that leaves the free area or would cross a wall (``estimators.walls``) is lost and the rest renormalised; where
    nothing is left, it is spread evenly.
    """

    Config = MarkovGridConfig
    estimate_rule = EstimateRule(
        bias=1.24, gain=0.52, evidence_gain=0.25, agreement_gain=0.29
    )  # benchmarks/calibration.py

    def __init__(self, config: MarkovGridConfig | None = None) -> None:
        self.config = config or MarkovGridConfig()
        self._area: FreeArea
        self._free: np.ndarray  # (X, Y) bool
        self._headings: Floats  # (H,) that the layers stand for now [rad]
        self._offsets: Floats  # (H, 2) of the layers from the cells' centres, at most half a cell [m]
        self._mass: Floats  # (H, X, Y), sums to one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh. A prior of None, or one that lies outside the free area, is uniform over it. Draws nothing."""
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        self._free = self._area.free
        self._headings = wrap(np.arange(self.config.headings) * self._heading_step)
        self._offsets = np.zeros((self.config.headings, 2))
        if prior is None:
            self._mass = self._normalised(np.zeros((self.config.headings, *self._free.shape)))
        else:
            self._mass = self._normalised(self._deposited(prior))

    def predict(self, motion: Motion) -> None:
        """P'(s) = sum P(s | s_before, a) Bel(s_before), equation (3.10)."""
        size = self.config.resolution_m
        moved = self._offsets + rotate(motion.delta[:2], self._headings)
        cells = np.rint(moved / size)
        self._offsets = moved - cells * size
        variances = _map_variances(motion.covariance[:2, :2], self._headings) / size**2
        turn = motion.covariance[2, 2] / self._heading_step**2
        self._mass = self._normalised(_moved(self._mass, cells, variances, turn, self._area))
        self._headings = wrap(self._headings + motion.delta[2])

    def update(self, evidence: Evidence) -> float | None:
        """P''(s) = P(v | s) P'(s), equation (3.11), normalised, (3.12); together (3.9), with recovery.

        Returns:
            log sum P(v | s) P'(s), the denominator of (3.9); None for a blind frame. -inf for a frame that is
            possible nowhere: the belief stays as predicted.
        """
        if evidence.is_blind:
            return None
        joint = self._log_joint(evidence)
        peak = float(joint.max())
        if not np.isfinite(peak):
            return peak
        joint -= peak
        np.exp(joint, out=joint)
        total = float(joint.sum())
        joint /= total
        self._mass = joint
        return peak + float(np.log(total))

    @property
    def belief(self) -> WeightedPoses:
        """The cells that have a mass worth naming; the spread is a cell's own."""
        named = np.flatnonzero(self._mass >= NEGLIGIBLE / (len(self._mass) * len(self._area.centres)))
        layers, columns, rows = np.unravel_index(named, self._mass.shape)
        place = np.column_stack([self._area.xs[columns], self._area.ys[rows]]) + self._offsets[layers]
        sides = np.array([self.config.resolution_m, self.config.resolution_m, self._heading_step])
        poses = np.column_stack([place, self._headings[layers]])
        return WeightedPoses(poses, np.log(self._mass.ravel()[named]), sides**2 / 12.0)

    @property
    def _heading_step(self) -> float:
        return 2.0 * np.pi / self.config.headings

    def _log_joint(self, evidence: Evidence) -> Floats:
        """(H, X, Y) log of P(v | s) P'(s), the recovery in P'; a layer at a time, which stays in the cache."""
        recovery, xs, ys = self.config.recovery, self._area.xs, self._area.ys
        anywhere = self._free * (recovery / (len(self._mass) * len(self._area.centres)))
        log_joint = np.empty_like(self._mass)
        with np.errstate(divide="ignore"):  # cells without mass: log 0 is meant
            for layer, (offset, heading) in enumerate(zip(self._offsets, self._headings, strict=True)):
                np.log((1.0 - recovery) * self._mass[layer] + anywhere, out=log_joint[layer])
                log_joint[layer] += evidence.log_likelihood_on_grid(xs + offset[0], ys + offset[1], float(heading))
        return log_joint

    def _normalised(self, mass: Floats) -> Floats:
        """Mass (H, X, Y) of the free cells, in place, summing to one; even where there is none."""
        total = float(mass.sum())
        if total < np.finfo(np.float64).tiny:
            mass[:] = self._free
            total = float(mass.sum())
        mass /= total
        return mass

    def _deposited(self, prior: WeightedPoses) -> Floats:
        """A prior as mass (H, X, Y): each pose is shared among the 8 cells around it, which keeps the mean."""
        size = np.array([self._heading_step, self.config.resolution_m, self.config.resolution_m])
        shape = np.array([self.config.headings, *self._free.shape])
        first = np.array([self._area.xs[0], self._area.ys[0]])
        heading = (prior.poses[:, 2] / size[0]) % self.config.headings
        place = np.clip((prior.poses[:, :2] - first) / size[1:], -2.0, shape[1:] + 1.0)
        at = np.column_stack([heading, place])
        low = np.floor(at).astype(np.int64)
        mass = np.zeros(tuple(shape))
        for corner in product((0, 1), repeat=3):
            cell = low + np.array(corner)
            cell[:, 0] %= self.config.headings
            weight = prior.weights * np.prod(np.where(corner, at - low, 1.0 - (at - low)), axis=1)
            inside = ((cell >= 0) & (cell < shape)).all(axis=1)
            np.add.at(mass, tuple(cell[inside].T), weight[inside])
        heading, *place = prior.spread[[2, 0, 1]] / size**2
        still, variances = (np.tile(values, (self.config.headings, 1)) for values in ([0.0, 0.0], place))
        return _moved(mass, still, variances, float(heading), self._area)


def _map_variances(covariance: Floats, headings: Floats) -> Floats:
    """Variances (H, 2) along x and y of the map, of a covariance (2, 2) in the frame of a robot with headings (H,)."""
    cos, sin = np.cos(headings), np.sin(headings)
    along, across, both = covariance[0, 0], covariance[1, 1], 2.0 * cos * sin * covariance[0, 1]
    x = cos**2 * along + sin**2 * across - both
    y = sin**2 * along + cos**2 * across + both
    return np.column_stack([x, y]).clip(min=0.0)  # a singular covariance may round below zero


def _moved(mass: Floats, cells: Floats, variances: Floats, turn: float, area: FreeArea) -> Floats:
    """Mass (H, X, Y) after each layer's own shift (H, 2) [cells] and blur (H, 2) [cells^2], and a blur of the heading.

    What leaves the free area or would cross a wall is lost. The heading's variance ``turn`` is in layers^2.
    """
    shape = np.array(area.free.shape)
    shifts = np.clip(cells, -shape, shape).astype(np.int64).tolist()
    taps_x, taps_y = (_taps(variances[:, axis], shape[axis] - 1) for axis in (0, 1))
    around = [(layers, share) for layers, share in enumerate(_ring(turn, len(mass)).tolist()) if share > 0.0]
    lines, free = _Lines(area, gap=taps_y.shape[1] - 1), area.free.astype(np.float64)
    moved = np.zeros((len(mass), free.size))
    for layer, shift in enumerate(shifts):
        line = lines.shifted(mass[layer], *shift)
        line = lines.blurred(line, taps_x[layer], 0)
        line = lines.blurred(line, taps_y[layer], 1)
        arrived = (lines.layer(line) * free).reshape(-1)
        for layers, share in around:
            daxpy(arrived, moved[(layer + layers) % len(mass)], a=share)
    return moved.reshape(mass.shape)


class _Lines:
    """Layers (X, Y) as lines, which take part in a sum as a whole, however they are shifted.

    In a line a gap of empty cells follows each row, so that along y nothing runs over into the next row: a blur along
    y ends in the gap, so it comes last. A step along y is one cell of the line, a step along x a row and its gap.

    Args:
        area: whose walls count.
        gap: the longest step along y that a blur takes [cells].
    """

    def __init__(self, area: FreeArea, gap: int) -> None:
        self._area = area
        self._columns, self._rows = area.free.shape
        self._gap = gap
        self._passages = cache(self._passage)

    def shifted(self, layer: Floats, columns: int, rows: int) -> Floats:
        """The line of a layer (X, Y) moved by whole cells, not through walls; what leaves the grid is lost."""
        line = np.zeros((self._columns, self._rows + self._gap))
        line[_into(columns), : self._rows][:, _into(rows)] = layer[_into(-columns), _into(-rows)]
        if self._area.has_walls and (columns or rows):
            line[:, : self._rows] *= self._area.passage(columns, rows)
        return line.reshape(-1)

    def blurred(self, line: Floats, taps: Floats, axis: int) -> Floats:
        """A line blurred along x (0) or y (1), not through walls, by half a symmetric kernel, its middle first."""
        blurred: Floats = taps[0] * line
        for lag in (np.flatnonzero(taps[1:]) + 1).tolist():
            step = lag * (self._rows + self._gap if axis == 0 else 1)
            ahead, back = line[:-step], line[step:]
            if self._area.has_walls:
                ahead = ahead * self._passages(lag, axis)[step:]
                back = back * self._passages(-lag, axis)[:-step]
            daxpy(ahead, blurred[step:], a=taps[lag])
            daxpy(back, blurred[:-step], a=taps[lag])
        return blurred

    def layer(self, line: Floats) -> Floats:
        """The layer (X, Y) of a line."""
        layer: Floats = line.reshape(self._columns, -1)[:, : self._rows]
        return layer

    def _passage(self, lag: int, axis: int) -> np.ndarray:
        """Which cells of a line a step along an axis can reach."""
        passage = self._area.passage(*((lag, 0) if axis == 0 else (0, lag)))
        return np.pad(passage, ((0, 0), (0, self._gap))).reshape(-1)


def _into(cells: int) -> slice:
    """Where an axis lands that moves by whole cells; by the opposite: what of it does not leave."""
    return slice(max(cells, 0), min(cells, 0) or None)


def _taps(variances: Floats, longest: int) -> Floats:
    """Halves (H, R + 1), the middle first, of symmetric kernels with variances (H,) in cells^2; R <= longest.

    Sampled Gaussians; below half a cell^2, where sampling would miss the variance, the three taps that have it.
    """
    reach = int(np.clip(np.ceil(4.0 * np.sqrt(variances.max())), 1, longest))
    lags = np.arange(reach + 1)
    variance = variances[:, None]
    three = np.where(lags == 0, 1.0 - variance, np.where(lags == 1, variance / 2.0, 0.0))
    gauss = np.exp(-(lags**2) / (2.0 * np.maximum(variance, 0.5)))
    whole = 2.0 * gauss.sum(axis=1, keepdims=True) - 1.0
    return np.where(variance < 0.5, three, gauss / whole)


def _ring(variance: float, count: int) -> Floats:
    """Share (count,) of a layer's mass that a blur of the heading takes so many layers on; variance in layers^2."""
    taps = _taps(np.array([min(variance, float(count) ** 2)]), 4 * count)[0]  # at a full circle all is even anyway
    lags = np.arange(len(taps))
    ahead = np.bincount(lags % count, weights=taps, minlength=count)
    return np.asarray(ahead + np.bincount(-lags[1:] % count, weights=taps[1:], minlength=count))
