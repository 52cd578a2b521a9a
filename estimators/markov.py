"""Full Markov localization on a grid of poses: thesis section 3.1, equations (3.9) to (3.12)."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from estimators.free_area import FreeArea
from estimators.likelihood_field import LikelihoodField
from estimators.shifting import CellMotion
from estimators.windows import Window, reachable, tiles
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats, rotate, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

NEGLIGIBLE = 1e-3
"""Cells that together weigh less than this are left out of the belief that is handed out."""
CACHED = 32_768
"""Cells that an update works on at a time, where layers are not larger: a quarter of a megabyte."""
MANY = 60
"""More hypotheses than this are looked for tile by tile, for few reach each: measured."""


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
        self._motion: CellMotion
        self._tiles: list[Window]  # of the cells, all of them
        self._reachable: list[Window]  # the same, or the whole where little would be left out
        self._headings: Floats  # (H,) that the layers stand for now [rad]
        self._offsets: Floats  # (H, 2) of the layers from the cells' centres, at most half a cell [m]
        self._mass: Floats  # (H, X, Y), sums to one

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh. A prior of None, or one that lies outside the free area, is uniform over it. Draws nothing."""
        self._area = FreeArea(topo_map, self.config.resolution_m, self.config.reach_m)
        self._free = self._area.free
        self._headings = wrap(np.arange(self.config.headings) * self._heading_step)
        self._offsets = np.zeros((self.config.headings, 2))
        self._motion = CellMotion(self._area)
        self._tiles, self._reachable = tiles(self._free), reachable(self._free)
        empty = np.zeros((self.config.headings, *self._free.shape))
        self._mass = empty if prior is None else self._deposited(prior)
        self._normalise()

    def predict(self, motion: Motion) -> None:
        """P'(s) = sum P(s | s_before, a) Bel(s_before), equation (3.10)."""
        size = self.config.resolution_m
        moved = self._offsets + rotate(motion.delta[:2], self._headings)
        cells = np.rint(moved / size)
        self._offsets = moved - cells * size
        variances = _map_variances(motion.covariance[:2, :2], self._headings) / size**2
        turn = motion.covariance[2, 2] / self._heading_step**2
        self._motion.move(self._mass, cells, variances, turn)
        self._normalise()
        self._headings = wrap(self._headings + motion.delta[2])

    def update(self, evidence: Evidence) -> float | None:
        """P''(s) = P(v | s) P'(s), equation (3.11), normalised, (3.12); together (3.9), with recovery.

        Returns:
            log sum P(v | s) P'(s), the denominator of (3.9); None for a blind frame. -inf for a frame that is
            possible nowhere: the belief stays as predicted.
        """
        if evidence.is_blind:
            return None
        likelihood = LikelihoodField.of(evidence)
        return self._update_in_logs(evidence) if likelihood is None else self._multiply(likelihood)

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

    def _multiply(self, likelihood: LikelihoodField) -> float:
        """The update in place, by windows and layers that stay in the cache. Nothing underflows: there is a floor."""
        recovery, xs, ys = self.config.recovery, self._area.xs, self._area.ys
        anywhere = recovery / (len(self._mass) * len(self._area.centres)) / (1.0 - recovery)
        total = 0.0
        for columns, rows in self._tiles if len(likelihood.weights) > MANY else self._reachable:
            near = likelihood.near(xs[columns], ys[rows], self.config.resolution_m / 2.0)  # offsets are no longer
            evenly = self._free[columns, rows] * anywhere
            step = max(1, CACHED // evenly.size)
            for layers in (slice(first, first + step) for first in range(0, len(self._mass), step)):
                offsets, mass = self._offsets[layers], self._mass[layers, columns, rows]
                mass += evenly
                mass *= near.at(xs[columns] + offsets[:, :1], ys[rows] + offsets[:, 1:], self._headings[layers])
                total += float(mass.sum())
        self._divide(total)
        return likelihood.log_unit + float(np.log((1.0 - recovery) * total))

    def _update_in_logs(self, evidence: Evidence) -> float:
        """The update where likelihoods may be smaller than any number: a logarithm and an exponential for each cell."""
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

    def _normalise(self) -> None:
        """Make the mass sum to one; even over the free cells where there is none."""
        total = sum(float(part.sum()) for part in self._parts)
        if total < np.finfo(np.float64).tiny:
            self._mass[:] = self._free
            total = float(self._mass.sum())
        self._divide(total)

    def _divide(self, total: float) -> None:
        """Divide the mass by its sum, in place."""
        for part in self._parts:
            np.divide(part, total, out=part)

    @property
    def _parts(self) -> list[Floats]:
        """Where the mass is: views of it."""
        return [self._mass[:, columns, rows] for columns, rows in self._reachable]

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
        self._motion.move(mass, still, variances, float(heading))
        return mass


def _map_variances(covariance: Floats, headings: Floats) -> Floats:
    """Variances (H, 2) along x and y of the map, of a covariance (2, 2) in the frame of a robot with headings (H,)."""
    cos, sin = np.cos(headings), np.sin(headings)
    along, across, both = covariance[0, 0], covariance[1, 1], 2.0 * cos * sin * covariance[0, 1]
    x = cos**2 * along + sin**2 * across - both
    y = sin**2 * along + cos**2 * across + both
    return np.column_stack([x, y]).clip(min=0.0)  # a singular covariance may round below zero
