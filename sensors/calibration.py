"""From a sensor's own distance to ``match`` and log-likelihood: one way for all sensors that compare with views.

Match (DESIGN.md, "Values"): 1 is an identical image, and 0.5 is what 95 % of held-out views of wrong places stay below.
Every view of the map, or a part of them, is a query once; what stands at least ``WRONG_M`` away is a wrong place.

Log-likelihood: every view is a query once more, held out together with all views from its position, so that its true
pose is known and what is left stands beside it. With the score s_j of the J nearest of the others the evidence is the
mixture of EQUATIONS.md, 4,

    L(x) = f + sum_j exp(slope s_j + level - log density_j) K(x - x_j) h(theta - theta_j),

and slope, f, sigma and kappa are those that make the true poses likeliest: they maximize the mean of log L(x_q) / Z_q,
Z_q the mean of L over the map. ``level`` makes that mean 1 in the geometric mean over the queries. A held-out view is
farther from its neighbours than a robot usually is from a map's views, so that what is fitted claims rather too little;
and a frame that matches better than three in four of them is taken to be no surer than those.

Views cut from a panorama match themselves perfectly, so a map of panoramas only cannot be held out: there the scale
is the one that the sensor's settings name, found in calibration worlds (``benchmarks/calibration.py``).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.special import i0e

from topoloc.geometry import Floats
from topoloc.types import Ints

WRONG_QUANTILE = 0.05
"""Share of wrong places whose distance is smaller than that of a match of 0.5."""
WRONG_M = 1.0
"""A view of a place at least so far away is one of a wrong place, as in the truth of a node [m]."""
BEST_QUANTILE = 0.75
"""Of the best scores of held-out views: beyond, nothing is known."""
MOST_QUERIES = 256
"""Views that are held out, at equal distances through the list; more take longer and tell hardly more."""
FEWEST_POSITIONS = 6
"""Of views, for anything to be told from those that are left when one is held out."""
SAME_PLACE = 0.1
"""Views nearer than this share of the spacing to each other are from one position."""
KAPPAS = 0.5, 400.0
"""Concentrations that can be told from a map's views."""
PRIORS = np.array([2e-2, 1e-4, 1e-4, 1e-4])
"""Weights of the squared distance from the start, of log slope, log sigma, log kappa and floor: what the queries do not
tell stays where it was. The slope is held more: the map's own views know nothing of other light."""


@dataclass(frozen=True)
class Scale:
    """What a sensor's scores say of the pose.

    Attributes:
        slope: log-likelihood ratio per unit of the score.
        level: log-likelihood ratio at score 0.
        sigma_m: how far around a view it holds [m].
        kappa: concentration of the heading around a view's.
        log_floor: log-likelihood ratio that remains far from every hypothesis.
        best: the best score that is known of; a frame that has a better one is no surer than that.
    """

    slope: float
    level: float
    sigma_m: float
    kappa: float
    log_floor: float
    best: float = np.inf

    def log_ratio(self, score: Floats) -> Floats:
        """Log-likelihood ratios (J,) of the hypotheses of one frame, their density not yet taken out."""
        return np.asarray(self.slope * (score - max(0.0, score.max() - self.best)) + self.level)


@dataclass(frozen=True)
class Queries:
    """Q looks from known poses, and the J hypotheses that each made.

    Attributes:
        score: (Q, J) the better, the larger.
        log_density: (Q, J) log of the views that stand around each hypothesis.
        distance_m: (Q, J) from the true position to the hypothesis [m].
        turn: (Q, J) from the true heading to the hypothesis's [rad].
    """

    score: Floats
    log_density: Floats
    distance_m: Floats
    turn: Floats


def spread_out(count: int, most: int = MOST_QUERIES) -> Ints:
    """At most so many of ``count`` indices, at equal distances."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(np.int64))


def wrong_distance(distances: Floats, apart: Floats, nodes: Ints) -> float:
    """Distance of descriptors that 95 % of wrong places exceed.

    Args:
        distances: (Q, V) from some of the map's views to all of them.
        apart: (Q, V) between their positions [m].
        nodes: (V,) node of each view.

    Returns:
        The quantile over each query's nearest view of every wrong node: one none of whose views stands nearer than
        ``WRONG_M``, or where the map is too small for that, any but its own. Over all pairs where there is one node.
    """
    order = np.argsort(nodes, kind="stable")
    first = np.flatnonzero(np.diff(nodes[order], prepend=-1))
    nearest = np.minimum.reduceat(distances[:, order], first, axis=1)  # (Q, K)
    away = np.minimum.reduceat(apart[:, order], first, axis=1)
    for wrong in (away >= WRONG_M * (1.0 - 1e-9), away > 0.0):
        if wrong.any():
            return float(np.quantile(nearest[wrong], WRONG_QUANTILE))
    pairs = distances[distances > 0.0]
    return float(np.quantile(pairs, WRONG_QUANTILE)) if len(pairs) else 1.0


def match_of(distance: Floats, wrong: float) -> Floats:
    """Match in [0, 1]: 1 for an identical image, 0.5 at the distance ``wrong``, halved by each such distance."""
    return np.asarray(0.5 ** (distance / max(wrong, np.finfo(float).tiny)))


def log_density(poses: Floats, sigma: float, kappa: float) -> Floats:
    """Log of how many views (V, 3) stand around each of them, itself included: taken out of the log-likelihoods.

    So a corner photographed twice changes nothing (EQUATIONS.md, 4). That text asks for a mean of 1 as well; but then
    copies of some views would scale all the others, so the constant stays in, for the level to absorb.

    Args:
        poses: (V, 3).
        sigma: width of the position kernel [m].
        kappa: concentration of the heading kernel.
    """
    around = np.empty(len(poses))
    for first in range(0, len(poses), MOST_QUERIES):  # so that memory grows with the views, not with their square
        some = poses[first : first + MOST_QUERIES]
        squared = np.sum((some[:, None, :2] - poses[None, :, :2]) ** 2, axis=2)
        turned = np.cos(some[:, None, 2] - poses[None, :, 2]) - 1.0
        around[first : first + MOST_QUERIES] = np.exp(-squared / (2.0 * sigma**2) + kappa * turned).sum(axis=1)
    return np.asarray(np.log(around))


def spacing_of(positions: Floats) -> float:
    """Median distance [m] from a position (V, 2) to the nearest other one; 0 where there is no other."""
    distinct = np.unique(np.round(positions, 6), axis=0)
    return float(np.median(cKDTree(distinct).query(distinct, k=2)[0][:, 1])) if len(distinct) > 1 else 0.0


def held_out(
    poses: Floats, rows: Ints, distances: Floats, score: Callable[[Floats], Floats], neighbours: int
) -> Queries | None:
    """Views of the map as looks from known poses, with what is left of the map without their positions.

    Args:
        poses: (V, 3) of the views.
        rows: (Q,) which of them are queries.
        distances: (Q, V) of descriptors.
        score: (Q, J) of the distances of the J nearest, nearest first.
        neighbours: J.

    Returns:
        None where the map is too small.
    """
    spacing = spacing_of(poses[:, :2])
    positions = len(np.unique(np.round(poses[:, :2], 6), axis=0))
    apart = np.linalg.norm(poses[rows, None, :2] - poses[None, :, :2], axis=2)
    own = apart < SAME_PLACE * spacing
    count = min(neighbours or len(poses), int((~own).sum(axis=1).min()))
    if positions < FEWEST_POSITIONS or count < 1:
        return None
    left = np.where(own, np.inf, distances)
    nearest = np.argsort(left, axis=1, kind="stable")[:, :count]
    turn = poses[nearest, 2] - poses[rows, None, 2]
    return Queries(
        score(np.take_along_axis(left, nearest, axis=1)),
        log_density(poses, spacing, kappa_of(poses))[nearest],
        np.take_along_axis(apart, nearest, axis=1),
        turn,
    )


def kappa_of(poses: Floats) -> float:
    """Concentration of a heading that is known as well as a map's views (V, 3) are close in heading.

    1 / step^2, for headings that stand a step apart at one position, as a von Mises of that standard deviation has it.
    """
    near = np.linalg.norm(poses[:, :2] - poses[0, :2], axis=1) < 1e-6
    headings = np.unique(np.round(np.mod(poses[near, 2], 2.0 * np.pi), 6))
    step = float(np.min(np.diff(headings))) if len(headings) > 1 else np.pi / 2.0
    return float(np.clip(1.0 / step**2, *KAPPAS))


def likeliest_scale(queries: Queries, area_m2: float, start: Scale, with_slope: bool, with_heading: bool) -> Scale:
    """The scale under which the true poses are likeliest; see the top of this file.

    Args:
        queries: looks from known poses.
        area_m2: that the map covers [m^2].
        start: where the search begins; its level does not count.
        with_slope: whether the slope is to be found as well; else it is kept.
        with_heading: whether the hypotheses tell headings; else kappa is kept. Held-out views have just the headings
            of the others, so kappa is at most what headings anywhere within a step of them have: 12 times ``kappa_of``,
            with which the search begins.
    """
    sharpest = min(12.0 * start.kappa, KAPPAS[1])

    def parts(parameters: Floats) -> tuple[float, float, float, float]:
        slope = float(np.exp(parameters[0])) if with_slope else start.slope
        kappa = float(np.exp(np.clip(parameters[2], np.log(KAPPAS[0]), np.log(sharpest)))) if with_heading else 0.0
        return slope, float(np.exp(parameters[1])), kappa, float(parameters[3])

    def logs(parameters: Floats) -> tuple[Floats, Floats]:
        slope, sigma, kappa, log_floor = parts(parameters)
        log_weights = slope * (queries.score - middle) - queries.log_density
        squared = (queries.distance_m / sigma) ** 2
        heading = kappa * (np.cos(queries.turn) - 1.0) - np.log(i0e(kappa))
        there = np.logaddexp(log_floor, np.logaddexp.reduce(log_weights - squared / 2.0 + heading, axis=1))
        mass = np.logaddexp.reduce(log_weights, axis=1) + np.log(2.0 * np.pi * sigma**2 / area_m2)
        return there, np.logaddexp(log_floor, mass)

    def loss(parameters: Floats) -> float:
        there, mean = logs(parameters)
        return float(np.mean(mean - there)) + float(PRIORS @ (parameters - first) ** 2)

    middle = float(queries.score.mean())  # slope and floor are then told apart more easily
    first = np.array([np.log(max(start.slope, 1e-3)), np.log(start.sigma_m), np.log(max(start.kappa, 1.0)), -2.0])
    found = minimize(loss, first, method="BFGS").x
    slope, sigma, kappa, log_floor = parts(found)
    to_one = -float(np.mean(logs(found)[1]))
    best = float(np.quantile(queries.score.max(axis=1), BEST_QUANTILE))
    return Scale(
        slope, to_one - slope * middle, sigma, kappa if with_heading else start.kappa, log_floor + to_one, best
    )
