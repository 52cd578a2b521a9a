"""Full Markov localization on a grid of poses: thesis section 3.1, equations (3.9) to (3.12)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.special import logsumexp

from estimators.free_area import FreeArea
from estimators.recovery import RECOVERY, RECOVERY_BLIND, check_recovery
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats, rotate, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses

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
        recovery_blind: the same at the first update after blind ones, when it is likelier that it was carried off.
    """

    resolution_m: float = 0.25
    reach_m: float = 0.75
    headings: int = 24
    recovery: float = RECOVERY
    recovery_blind: float = RECOVERY_BLIND

    def __post_init__(self) -> None:
        if not 0.0 < self.resolution_m <= self.reach_m:
            raise ValueError(f"resolution_m is {self.resolution_m}; it must be positive and at most reach_m")
        check_recovery(self.recovery, self.recovery_blind)
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
    estimate_rule = EstimateRule(bias=1.33, gain=0.46, evidence_gain=0.45)  # benchmarks/calibration.py

    def __init__(self, config: MarkovGridConfig | None = None) -> None:
        self.config = config or MarkovGridConfig()
        self._area: FreeArea
        self._free: np.ndarray  # (X, Y) bool
        self._centres: Floats  # (P, 2) of the free cells [m]
        self._headings: Floats  # (H,) that the layers stand for now [rad]
        self._offsets: Floats  # (H, 2) of the layers from the cells' centres, at most half a cell [m]
        self._mass: Floats  # (H, X, Y), sums to one
        self._was_blind = False

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh. A prior of None, or one that lies outside the free area, is uniform over it. Draws nothing."""
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        self._free, self._centres = self._area.free, self._area.centres
        self._headings = wrap(np.arange(self.config.headings) * self._heading_step)
        self._offsets = np.zeros((self.config.headings, 2))
        self._was_blind = False
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
        mass = _shifted(self._mass, cells.astype(np.int64))
        variances = _map_variances(motion.covariance[:2, :2], self._headings) / size**2
        if self._area.has_walls:
            mass *= np.stack([self._area.passage(int(x), int(y)) for x, y in cells])
        for axis in (0, 1):
            mass = _blurred(mass, variances[:, axis], axis + 1, self._area)
        self._mass = self._normalised(_blurred_headings(mass, motion.covariance[2, 2] / self._heading_step**2))
        self._headings = wrap(self._headings + motion.delta[2])

    def update(self, evidence: Evidence) -> float | None:
        """P''(s) = P(v | s) P'(s), equation (3.11), normalised, (3.12); together (3.9), with recovery.

        Returns:
            log sum P(v | s) P'(s), the denominator of (3.9); None for a blind frame. -inf for a frame that is
            possible nowhere: the belief stays as predicted.
        """
        share = self.config.recovery_blind if self._was_blind else self.config.recovery
        self._was_blind = evidence.is_blind
        if evidence.is_blind:
            return None
        predicted = self._mass[:, self._free]  # (H, P)
        recovered = (1.0 - share) * predicted + share / predicted.size
        with np.errstate(divide="ignore"):  # cells without mass: log 0 is meant
            log_joint = np.log(recovered) + self._log_likelihoods(evidence)
        log_evidence = float(logsumexp(log_joint))
        if np.isfinite(log_evidence):
            self._mass[:, self._free] = np.exp(log_joint - log_evidence)
        return log_evidence

    @property
    def belief(self) -> WeightedPoses:
        """The cells that have a mass worth naming; the spread is a cell's own."""
        mass = self._mass[:, self._free]
        layers, cells = np.nonzero(mass >= NEGLIGIBLE / mass.size)
        poses = np.column_stack([self._centres[cells] + self._offsets[layers], self._headings[layers]])
        sides = np.array([self.config.resolution_m, self.config.resolution_m, self._heading_step])
        return WeightedPoses(poses, np.log(mass[layers, cells]), sides**2 / 12.0)

    @property
    def _heading_step(self) -> float:
        return 2.0 * np.pi / self.config.headings

    def _log_likelihoods(self, evidence: Evidence) -> Floats:
        """(H, P) at the free cells."""
        layers = zip(self._offsets, self._headings, strict=True)
        xs, ys = self._area.xs, self._area.ys
        return np.stack([evidence.log_likelihood_on_grid(xs + x, ys + y, t)[self._free] for (x, y), t in layers])

    def _normalised(self, mass: Floats) -> Floats:
        """Mass (H, X, Y) kept on the free cells, summing to one; even where there is none."""
        kept = mass * self._free
        total = float(kept.sum())
        if total < np.finfo(np.float64).tiny:
            kept = np.broadcast_to(self._free, mass.shape).astype(np.float64)
            total = float(kept.sum())
        return np.asarray(kept / total)

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
        variances = np.broadcast_to(prior.spread[[2, 0, 1]] / size**2, (self.config.headings, 3))
        for axis in (1, 2):
            mass = _blurred(mass, variances[:, axis], axis, self._area)
        return _blurred_headings(mass, float(variances[0, 0]))


def _map_variances(covariance: Floats, headings: Floats) -> Floats:
    """Variances (H, 2) along x and y of the map, of a covariance (2, 2) in the frame of a robot with headings (H,)."""
    cos, sin = np.cos(headings), np.sin(headings)
    along, across, both = covariance[0, 0], covariance[1, 1], 2.0 * cos * sin * covariance[0, 1]
    x = cos**2 * along + sin**2 * across - both
    y = sin**2 * along + cos**2 * across + both
    return np.column_stack([x, y]).clip(min=0.0)  # a singular covariance may round below zero


def _shifted(mass: Floats, cells: Ints) -> Floats:
    """Every layer of mass (H, X, Y) moved by whole cells (H, 2); what leaves the grid is lost."""
    layers, columns, rows = mass.shape
    x, y = np.arange(columns) - cells[:, :1], np.arange(rows) - cells[:, 1:]  # (H, X), (H, Y): where it comes from
    inside = ((x >= 0) & (x < columns))[:, :, None] & ((y >= 0) & (y < rows))[:, None, :]
    x, y = np.clip(x, 0, columns - 1), np.clip(y, 0, rows - 1)
    return np.where(inside, mass[np.arange(layers)[:, None, None], x[:, :, None], y[:, None, :]], 0.0)


def _taps(variances: Floats, longest: int) -> Floats:
    """Symmetric kernels (H, 2 R + 1), R <= max(longest, 1), with variances (H,) in cells^2.

    Sampled Gaussians; below half a cell^2, where sampling would miss the variance, the three taps that have it.
    """
    reach = int(np.clip(np.ceil(4.0 * np.sqrt(variances.max())), 1, max(longest, 1)))
    lags = np.arange(-reach, reach + 1)
    variance = variances[:, None]
    three = np.where(lags == 0, 1.0 - variance, np.where(np.abs(lags) == 1, variance / 2.0, 0.0))
    gauss = np.exp(-(lags**2) / (2.0 * np.maximum(variance, 0.5)))
    return np.where(variance < 0.5, three, gauss / gauss.sum(axis=1, keepdims=True))


def _blurred(mass: Floats, variances: Floats, axis: int, area: FreeArea) -> Floats:
    """Mass (H, X, Y) blurred along axis 1 or 2, not through walls; each layer has its own variance (H,) in cells^2."""
    taps = _taps(variances, mass.shape[axis] - 1)
    reach = taps.shape[1] // 2
    padded = np.pad(mass, [(0, 0)] + [(reach, reach) if axis == other else (0, 0) for other in (1, 2)])
    blurred = np.zeros_like(mass)
    for lag in range(taps.shape[1]):
        part = (slice(None),) * axis + (slice(lag, lag + mass.shape[axis]),)
        spread = taps[:, lag, None, None] * padded[part]
        if area.has_walls:  # what lay ``lag - reach`` cells further on came back as many
            back = reach - lag
            spread *= area.passage(back, 0) if axis == 1 else area.passage(0, back)
        blurred += spread
    return blurred


def _blurred_headings(mass: Floats, variance: float) -> Floats:
    """Mass (H, X, Y) blurred around the circle of layers; variance in layers^2."""
    count = len(mass)
    taps = _taps(np.array([min(variance, float(count) ** 2)]), 4 * count)[0]  # at a full circle all is even anyway
    lags = np.arange(len(taps)) - len(taps) // 2
    ring = np.bincount(lags % count, weights=taps, minlength=count)
    layers = np.arange(count)
    circulant = ring[(layers[:, None] - layers) % count]
    blurred: Floats = circulant @ mass.reshape(count, -1)
    return blurred.reshape(mass.shape)
