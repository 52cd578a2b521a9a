"""From a sensor's own distance to ``match`` and log-likelihood: one way for all sensors that compare with views.

Match (DESIGN.md, "Values"): 1 is an identical image, and 0.5 is what 95 % of held-out views of wrong places stay below.
Every view of the map, or a part of them, is a query once; what stands at least ``WRONG_M`` away is a wrong place.

Log-likelihood: every view is a query once more, held out together with all views from about its position, so that its
true pose is known and what is left stands beside it. With the score s_j of the J nearest of the others the evidence is
the mixture of EQUATIONS.md, 4,

    L(x) = f + sum_j exp(slope s_j + level - log density_j) K(x - x_j) h(theta - theta_j),

and slope, f, sigma and kappa are those that make the true poses likeliest: they maximize the mean of log L(x_q) / Z_q,
Z_q the mean of L over the map. ``level`` makes that mean 1 in the geometric mean over the queries. A held-out view is
farther from its neighbours than a robot usually is from a map's views, so that what is fitted claims rather too little;
and a frame that matches better than three in four of them is taken to be no surer than those.

Views cut from a panorama match themselves perfectly, so a map of panoramas only cannot be held out: there the scale
is the one that the sensor's settings name, found in calibration worlds (``benchmarks/calibration.py``).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.optimize import minimize
from scipy.spatial import cKDTree
from scipy.spatial.distance import cdist
from scipy.special import i0e

from sensors.nearest import smallest_of
from topoloc.geometry import Floats
from topoloc.types import Ints

WRONG_QUANTILE = 0.05
"""Share of wrong places whose distance is smaller than that of a match of 0.5."""
WRONG_M = 1.0
"""A view of a place at least so far away is one of a wrong place, as in the truth of a node [m]."""
BEST_QUANTILE = 0.75
"""Of the best scores of held-out views: beyond, nothing is known."""
MOST_QUERIES, MOST_PAIRS = 256, 4_000_000
"""Views that are held out, at equal distances through the list, more tell hardly more; and pairs with others."""
ALL_PAIRS, LEFT_OUT, PART = 4000, 1e-12, 64
"""Of the density: views of which all pairs are counted, as the last bit can move what is fitted by a per cent where
kappa reaches its bound; share of more that may be left out; and views that are counted around together."""
FEWEST_POSITIONS = 6
"""Of views, for anything to be told from those that are left when one is held out."""
SAME_PLACE = 0.3
"""Views nearer to each other than this share of the spacing are from one position."""
SAME_HEADING = np.deg2rad(1.0)
"""Headings of a position nearer to each other than this are one [rad]."""
KAPPAS = 0.5, 400.0
"""Concentrations that can be told from a map's views."""
Free = Literal["slope", "sigma_m", "kappa"]
PRIORS: dict[Free, float] = {"slope": 2e-2, "sigma_m": 1e-4, "kappa": 1e-4}
"""Weights of the squared distance of their logarithms from the start: what the queries do not tell stays where it was.
The slope is held more: the map's own views know nothing of other light."""
FLOOR_PRIOR, FLOOR_START = 1e-4, -2.0
"""The same of the floor, below the middle of the weights."""


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
        turn: (Q, J) from the true heading to the hypothesis's [rad]; None where hypotheses tell no heading.
    """

    score: Floats
    log_density: Floats
    distance_m: Floats
    turn: Floats | None


def spread_out(count: int, most: int = MOST_QUERIES) -> Ints:
    """Indices at equal distances: ``most`` of ``count`` at most, and fewer where they would make too many pairs."""
    most = max(min(most, MOST_PAIRS // count), 1)
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
        Where wrong places look just the same, the smallest distance of those that do not.
    """
    order = np.argsort(nodes, kind="stable")
    first = np.flatnonzero(np.diff(nodes[order], prepend=-1))
    nearest = np.minimum.reduceat(distances[:, order], first, axis=1)  # (Q, K)
    away = np.minimum.reduceat(apart[:, order], first, axis=1)
    wrong = next((nearest[far] for far in (away >= WRONG_M * (1.0 - 1e-9), away > 0.0) if far.any()), distances)
    quantile = float(np.quantile(wrong, WRONG_QUANTILE))
    different = distances[distances > 0.0]
    return quantile if quantile > 0.0 else float(different.min(initial=np.inf)) if len(different) else 1.0


def match_of(distance: Floats, wrong: float) -> Floats:
    """Match in [0, 1]: 1 for an identical image, 0.5 at the distance ``wrong`` > 0, halved by each such distance."""
    return np.asarray(0.5 ** (distance / wrong))


def log_density(poses: Floats, sigma: float, kappa: float) -> Floats:
    """Log of how many views (V, 3) stand around each of them, itself included: taken out of the log-likelihoods.

    So a corner photographed twice changes nothing (EQUATIONS.md, 4). That text asks for a mean of 1 as well; but then
    copies of some views would scale all the others, so the constant stays in, for the level to absorb.

    Of more than ``ALL_PAIRS`` views those out of reach are left out, all together less than ``LEFT_OUT`` of what is
    around any view, which has at least itself: so time goes with the views in reach, not with all pairs.

    Args:
        poses: (V, 3).
        sigma: width of the position kernel [m].
        kappa: concentration of the heading kernel.
    """
    around = _around_in_reach if len(poses) > ALL_PAIRS else _around
    return np.asarray(np.log(around(poses, sigma, kappa)))


def _around(poses: Floats, sigma: float, kappa: float) -> Floats:
    """Sums (V,) of both kernels over all views, as they stand."""
    around = np.empty(len(poses))
    step = max(1, MOST_PAIRS // len(poses))
    for first in range(0, len(poses), step):
        some = poses[first : first + step]
        exponents = cdist(some[:, :2], poses[:, :2], "sqeuclidean") / (-2.0 * sigma**2)
        if kappa > 0.0:
            exponents += kappa * (np.cos(some[:, None, 2] - poses[None, :, 2]) - 1.0)
        around[first : first + step] = np.exp(exponents).sum(axis=1)
    return around


def _around_in_reach(poses: Floats, sigma: float, kappa: float) -> Floats:
    """The same over the views in reach: for points in four dimensions both kernels together are exp(-|apart|^2 / 2)."""
    turned = np.sqrt(kappa) * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    points = np.concatenate([(poses[:, :2] - poses[:, :2].mean(axis=0)) / sigma, turned], axis=1)
    reach = np.sqrt(2.0 * np.log(len(points) / LEFT_OUT))
    tree = cKDTree(points, leafsize=PART)
    around = np.empty(len(points))
    for first in range(0, len(points), PART):
        part = tree.indices[first : first + PART]  # in the order of the leaves: views that stand together
        middle = points[part].mean(axis=0)
        radius = np.linalg.norm(points[part] - middle, axis=1).max()
        near = np.sort(tree.query_ball_point(middle, radius + reach))
        around[part] = np.exp(-0.5 * cdist(points[part], points[near], "sqeuclidean")).sum(axis=1)
    return around


def log_density_of_cuts(poses: Floats, sigma: float, kappa: float) -> Floats:
    """``log_density`` (V,) of views that are cut at the same headings, at equal steps, at each position (V, 3).

    Then places and headings are factors; of 10,000 panoramas there are a quarter of a million cuts.
    """
    places, place = np.unique(poses[:, :2], axis=0, return_inverse=True)
    around = log_density(np.column_stack([places, np.zeros(len(places))]), sigma, 0.0)
    here = poses[place.reshape(-1) == place.reshape(-1)[0], 2]
    headings = np.exp(kappa * (np.cos(here - here[0]) - 1.0)).sum()
    return np.asarray(around[place.reshape(-1)] + np.log(headings))


def spacing_of(positions: Floats) -> float:
    """Median distance [m] from a position (P, 2) to the nearest other one; 0 where there is no other."""
    distinct = np.unique(positions, axis=0)
    return float(np.median(cKDTree(distinct).query(distinct, k=2)[0][:, 1])) if len(distinct) > 1 else 0.0


def kappa_of(headings: Floats, nodes: Ints) -> float | None:
    """Concentration of a heading that is known as well as the headings at one place are close.

    1 / step^2, as a von Mises whose standard deviation is the median step has it.

    Args:
        headings: (V,) of the map's views [rad].
        nodes: (V,) their places.

    Returns:
        None where no place has two headings.
    """
    order = np.lexsort((np.mod(headings, 2.0 * np.pi), nodes))
    sorted_headings, place = np.mod(headings, 2.0 * np.pi)[order], nodes[order]
    first = np.flatnonzero(np.diff(place, prepend=-1))
    following = np.roll(sorted_headings, -1)
    following[np.append(first[1:], len(place)) - 1] = sorted_headings[first] + 2.0 * np.pi  # round the circle
    steps = following - sorted_headings
    steps = steps[(steps > SAME_HEADING) & (steps < 2.0 * np.pi - SAME_HEADING)]
    return float(np.clip(1.0 / np.median(steps) ** 2, *KAPPAS)) if len(steps) else None


def held_out(
    poses: Floats, rows: Ints, distances: Floats, score: Callable[[Floats], Floats], neighbours: int, spacing_m: float
) -> tuple[Ints, Queries] | None:
    """Views of the map as looks from known poses, with what is left of the map without their positions.

    Args:
        poses: (V, 3) of the views.
        rows: (Q,) which of them are queries.
        distances: (Q, V) of descriptors.
        score: (Q, J) of the distances of the J nearest, nearest first.
        neighbours: J; 0: all.
        spacing_m: of the positions [m].

    Returns:
        Indices (Q, J) of the neighbours, and the queries, densities still 0; None where nothing is left.
    """
    apart = cdist(poses[rows, :2], poses[:, :2])
    own = apart < SAME_PLACE * spacing_m
    count = min(neighbours or len(poses), int((~own).sum(axis=1).min()))
    if count < 1:
        return None
    left = np.where(own, np.inf, distances)
    nearest, smallest = smallest_of(left, count)
    scores = score(smallest)
    away, turn = np.take_along_axis(apart, nearest, axis=1), poses[nearest, 2] - poses[rows, None, 2]
    return nearest, Queries(scores, np.zeros(scores.shape), away, turn)


def likeliest_scale(queries: Queries, area_m2: float, start: Scale, free: Sequence[Free]) -> Scale:
    """The scale under which the true poses are likeliest; see the top of this file.

    Args:
        queries: looks from known poses.
        area_m2: that the map covers [m^2].
        start: where the search begins, and what is kept; level and floor are always found.
        free: what else is found. Held-out views have just the headings of the others, so kappa is at most what headings
            anywhere within a step of them have: 12 times ``kappa_of``, with which the search begins.
    """
    sharpest = min(12.0 * start.kappa, KAPPAS[1])
    middle = float(queries.score.mean())  # slope and floor are then told apart more easily
    first = np.array([*(np.log(getattr(start, name)) for name in free), FLOOR_START])
    priors = np.array([*(PRIORS[name] for name in free), FLOOR_PRIOR])

    def scale_of(parameters: Floats) -> Scale:
        found = dict(zip(free, np.exp(parameters[:-1]).tolist(), strict=True))
        if "kappa" in found:
            found["kappa"] = float(np.clip(found["kappa"], KAPPAS[0], sharpest))
        scale = replace(start, log_floor=float(parameters[-1]), **found)
        return replace(scale, level=-scale.slope * middle)

    def loss(parameters: Floats) -> float:
        there, mean = _logs(queries, area_m2, scale_of(parameters))
        return float(np.mean(mean - there) + priors @ (parameters - first) ** 2)

    found = scale_of(minimize(loss, first, method="BFGS").x)
    to_one = -float(np.mean(_logs(queries, area_m2, found)[1]))
    best = float(np.quantile(queries.score.max(axis=1), BEST_QUANTILE))
    return replace(found, level=found.level + to_one, log_floor=found.log_floor + to_one, best=best)


def _logs(queries: Queries, area_m2: float, scale: Scale) -> tuple[Floats, Floats]:
    """Log of L at the true poses (Q,), and of its mean over the map (Q,)."""
    log_weights = scale.slope * queries.score + scale.level - queries.log_density
    log_kernels = -0.5 * (queries.distance_m / scale.sigma_m) ** 2
    if queries.turn is not None:
        log_kernels = log_kernels + scale.kappa * (np.cos(queries.turn) - 1.0) - np.log(i0e(scale.kappa))
    there = np.logaddexp.reduce(log_weights + log_kernels, axis=1)
    mass = np.logaddexp.reduce(log_weights, axis=1) + np.log(2.0 * np.pi * scale.sigma_m**2 / area_m2)
    return np.logaddexp(scale.log_floor, there), np.logaddexp(scale.log_floor, mass)
