"""Several sensors as one: the product of what they say, or its weighted sum (second seed, section 5).

The evidence of each is a mixture L_a = f_a + sum_m w_m K_m h_m (EQUATIONS.md, 4), K a Gaussian of peak 1 in position,
h a von Mises of mean 1 in heading. Conjunctive (7), L = L_a L_b, multiplied out:

    f_a f_b + f_b sum_m w_m K_m h_m + f_a sum_n w_n K_n h_n + sum_mn w_m w_n K_m K_n h_m h_n,

and products of two Gaussians, and of two von Mises, are one again (``_pairs``), so that this is such a mixture, too.
Disjunctive (8): L = sum_i omega_i L_i, where (8) of the seed has no floors. A part that is blind contributes 1.

Match and distance are no likelihoods, and are joined per node (``_judged``); that is ours, the seed has none.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import i0e, logsumexp

from topoloc.geometry import Floats, wrap
from topoloc.interfaces import Sensor
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Ints

NodeOf = Callable[[ArrayLike], Ints]
"""Positions (P, 2) [m] -> index (P,) of the node nearest to each."""


@dataclass(frozen=True)
class ProductConfig:
    """Settings of the product of sensors.

    Attributes:
        tolerance: hypotheses are left out as long as that changes the log-likelihood by less than this at every pose;
            0: only those of weight zero.
        most: hypotheses that are kept at most, of each sensor and of the product, those that hold most probability;
            what goes beyond is left out whatever it changes.
    """

    tolerance: float = 1e-3
    most: int = 500

    def __post_init__(self) -> None:
        if self.tolerance < 0.0:
            raise ValueError(f"tolerance is {self.tolerance:g}; it must not be negative")
        if self.most < 1:
            raise ValueError(f"most is {self.most}; it must be at least 1")


@dataclass(frozen=True)
class MixConfig:
    """Settings of the weighted sum of sensors.

    Attributes:
        weights: how much each sensor counts, in their order, in any common unit; none: all the same.
    """

    weights: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if any(weight <= 0.0 for weight in self.weights):
            raise ValueError(f"weights are {', '.join(map(str, self.weights))}; each must be positive")


class Fusion(ABC):
    """Sensors that look at the same frame, and how what they say becomes one evidence.

    Args:
        parts: two sensors or more.
        config: settings.
    """

    Config: ClassVar[type]

    def __init__(self, parts: Sequence[Sensor], config: Any = None) -> None:
        if len(parts) < 2:
            raise ValueError(f"{len(parts)} sensors are given; it takes two or more")
        self.parts = tuple(parts)
        self.config: Any = self.Config() if config is None else config

    @property
    def needs(self) -> frozenset[str]:
        """What any of the sensors needs."""
        return frozenset[str]().union(*(part.needs for part in self.parts))

    def fit(self, topo_map: TopoMap) -> None:
        """Fit each sensor. Raises ``UserError`` where the map lacks what one of them needs."""
        for part in self.parts:
            part.fit(topo_map)

    def observe(self, frame: Frame) -> Evidence:
        """What they say together; blind where all are."""
        return self._fused([part.observe(frame) for part in self.parts])

    @abstractmethod
    def _fused(self, parts: Sequence[Evidence]) -> Evidence:
        """One evidence for those of all sensors."""


class Product(Fusion):
    """All of several sensors must agree: their likelihoods multiplied, eq. (7) of the second seed."""

    Config = ProductConfig

    def fit(self, topo_map: TopoMap) -> None:
        """Fit each sensor. Raises ``UserError`` where the map lacks what one of them needs."""
        super().fit(topo_map)
        self._node_of = topo_map.nearest_node

    def _fused(self, parts: Sequence[Evidence]) -> Evidence:
        return product_of(parts, self._node_of, self.config)


class Mix(Fusion):
    """Any of several sensors may be right: the weighted sum of their likelihoods, eq. (8) of the second seed."""

    Config = MixConfig

    def __init__(self, parts: Sequence[Sensor], config: MixConfig | None = None) -> None:
        super().__init__(parts, config)
        weights = self.config.weights or (1.0,) * len(self.parts)
        if len(weights) != len(self.parts):
            raise ValueError(f"weights has {len(weights)} values for {len(self.parts)} sensors")
        self._weights = weights

    def _fused(self, parts: Sequence[Evidence]) -> Evidence:
        return mixture_of(parts, self._weights)


def product_of(parts: Sequence[Evidence], node_of: NodeOf, config: ProductConfig) -> Evidence:
    """The product (7) of what several sensors say: their log-likelihoods added, up to ``tolerance`` and ``most``.

    With more than ``most`` hypotheses of weight in a part, as where a sensor names all views of a large map, the
    lightest are left out whatever that changes: some nats at poses that only those explain.

    Hypotheses of one sensor keep their node, those that two agree on belong to the node nearest to where they do. The
    match of a node is the geometric mean of the sensors' best there, its distance the mean of their least.

    Args:
        parts: of each sensor, about the same camera; a blind one contributes 1.
        node_of: nearest nodes.
        config: settings.
    """
    seeing = [part for part in parts if not part.is_blind]
    if len(seeing) < 2:
        return seeing[0] if seeing else Evidence.blind()
    # Each part is pruned once, each product twice; what these do to the logarithm adds up.
    tolerance = config.tolerance / (3 * len(seeing) - 2)
    whole, *others = (_pruned(_Terms.of(part), tolerance, config.most) for part in seeing)
    for other in others:
        whole = _pruned(_multiplied(whole, other, tolerance), tolerance, config.most)
    agreed = whole.nodes == _AGREED
    nodes = whole.nodes.copy()
    nodes[agreed] = node_of(whole.poses[agreed, :2])
    whole = replace(whole, nodes=nodes)
    return _judged(whole, seeing, _geometric_mean, lambda distances: np.mean(distances, axis=0))


def mixture_of(parts: Sequence[Evidence], weights: Sequence[float]) -> Evidence:
    """The weighted sum (8) of what several sensors say.

    Hypotheses keep their nodes. The match of a node is the best of any sensor's there, its distance the least, whatever
    the weights: any of them may be right.

    Args:
        parts: of each sensor, about the same camera; a blind one contributes its weight.
        weights: of each, positive, of any sum.
    """
    share = np.asarray(weights, dtype=np.float64) / np.sum(weights)
    sees = np.array([not part.is_blind for part in parts])
    if not sees.any():
        return Evidence.blind()
    floors = [part.log_floor if see else 0.0 for part, see in zip(parts, sees, strict=True)]
    seeing = [part for part in parts if not part.is_blind]
    terms = [_Terms.of(part).times(float(np.log(one))) for part, one in zip(seeing, share[sees], strict=True)]
    whole = _pruned(_Terms.sum_of(terms, float(logsumexp(np.log(share) + floors))), 0.0)
    return _judged(whole, seeing, lambda matches: np.max(matches, axis=0), lambda distances: np.min(distances, axis=0))


_TINY = float(np.finfo(float).tiny)
_AGREED = -1
"""Instead of the node of a term that stands between two others; of most of them nobody has to know it."""


@dataclass(frozen=True)
class _Terms:
    """A mixture as ``Evidence`` has it, without what is said of nodes.

    Attributes:
        poses: (M, 3).
        nodes: (M,).
        log_weights: (M,), the evidence's log-likelihoods.
        sigma: (M,) [m].
        kappa: (M,).
        log_floor: of the whole.
    """

    poses: Floats
    nodes: Ints
    log_weights: Floats
    sigma: Floats
    kappa: Floats
    log_floor: float
    OF_EACH: ClassVar = ("poses", "nodes", "log_weights", "sigma", "kappa")

    @classmethod
    def of(cls, evidence: Evidence) -> _Terms:
        return cls(
            evidence.poses, evidence.nodes, evidence.log_likelihoods, evidence.sigma, evidence.kappa, evidence.log_floor
        )

    @classmethod
    def sum_of(cls, parts: Sequence[_Terms], log_floor: float) -> _Terms:
        """The terms of all parts, over a floor of their own."""
        joined = {name: np.concatenate([getattr(part, name) for part in parts]) for name in cls.OF_EACH}
        return cls(**joined, log_floor=log_floor)

    def times(self, log_factor: float) -> _Terms:
        """With all weights multiplied."""
        return replace(self, log_weights=self.log_weights + log_factor)

    def only(self, chosen: Ints) -> _Terms:
        """Those of the indices (N,) alone."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in self.OF_EACH})

    @property
    def log_masses(self) -> Floats:
        """(M,) integrals over the plane, heading averaged, up to a constant: the probability that each holds."""
        return np.asarray(self.log_weights + 2.0 * np.log(self.sigma))

    @property
    def log_peaks(self) -> Floats:
        """(M,) largest value of each term."""
        return np.asarray(self.log_weights - np.log(i0e(self.kappa)))


def _multiplied(one: _Terms, other: _Terms, tolerance: float) -> _Terms:
    """(7): each term of one with the other's floor, and each with each; pairs that cannot count are left out."""
    terms = [one.times(other.log_floor), other.times(one.log_floor), _pairs(one, other, tolerance)]
    return _Terms.sum_of(terms, one.log_floor + other.log_floor)


def _pairs(one: _Terms, other: _Terms, tolerance: float) -> _Terms:
    """Each term of one times each of the other, in closed form; their floor is the product's.

    Nearly all pairs are far apart. Those left out are together at most ``tolerance`` times the floor.

    Gaussians of peak 1 and widths s, t at a, b: exp(-|a - b|^2 / (2 (s^2 + t^2))) times one of peak 1 and width
    s t / sqrt(s^2 + t^2) at (t^2 a + s^2 b) / (s^2 + t^2). Von Mises of mean 1: I0(k) / (I0(k1) I0(k2)) times one,
    k exp(i mu) = k1 exp(i mu1) + k2 exp(i mu2); and I0(k) = i0e(k) exp(k), so that nothing overflows.
    """
    squared = np.sum((one.poses[:, None, :2] - other.poses[:, :2]) ** 2, axis=2)
    apart = squared / (2.0 * (one.sigma[:, None] ** 2 + other.sigma**2))
    log_floor = one.log_floor + other.log_floor
    limit = log_floor + (np.log(tolerance / apart.size) if tolerance > 0.0 else -np.inf)
    i, j = np.nonzero(one.log_peaks[:, None] + other.log_peaks - apart > limit)
    (a, b), (s, t) = (one.poses[i], other.poses[j]), (one.sigma[i] ** 2, other.sigma[j] ** 2)
    place = (t[:, None] * a[:, :2] + s[:, None] * b[:, :2]) / (s + t)[:, None]
    k1, k2 = one.kappa[i], other.kappa[j]
    x, y = k1 * np.cos(a[:, 2]) + k2 * np.cos(b[:, 2]), k1 * np.sin(a[:, 2]) + k2 * np.sin(b[:, 2])
    k = np.hypot(x, y)
    # k - k1 - k2, which are nearly the same where the headings agree
    lost = 2.0 * k1 * k2 * (np.cos(a[:, 2] - b[:, 2]) - 1.0) / np.maximum(k + k1 + k2, _TINY)
    heading = lost + np.log(i0e(k) / (i0e(k1) * i0e(k2)))
    log_weights = one.log_weights[i] + other.log_weights[j] - apart[i, j] + heading
    poses = np.column_stack([place, wrap(np.arctan2(y, x))])
    nodes = np.full(len(poses), _AGREED)
    return _Terms(poses, nodes, log_weights, np.sqrt(s * t / (s + t)), k, log_floor)


def _pruned(terms: _Terms, tolerance: float, most: int | None = None) -> _Terms:
    """The terms that count; one at least, since evidence without any would be blind.

    Terms whose peaks together are at most ``tolerance`` times the floor change the sum, which is nowhere below the
    floor, by that share at most, and its logarithm by less.
    """
    peaks = terms.log_peaks
    order = np.argsort(peaks, kind="stable")
    limit = terms.log_floor + (np.log(tolerance) if tolerance > 0.0 else -np.inf)
    kept = order[int(np.searchsorted(np.logaddexp.accumulate(peaks[order]), limit, side="right")) :]
    if len(kept) == 0:
        kept = order[-1:]
    if most is not None and len(kept) > most:
        kept = kept[np.argsort(-terms.log_masses[kept], kind="stable")[:most]]
    return terms.only(np.sort(kept))


def _geometric_mean(values: Floats) -> Floats:
    """(K,) of values (S, K), not negative."""
    return np.asarray(np.exp(np.mean(np.log(np.maximum(values, _TINY)), axis=0)))


def _judged(
    whole: _Terms,
    parts: Sequence[Evidence],
    match_of: Callable[[Floats], Floats],
    distance_of: Callable[[Floats], Floats],
) -> Evidence:
    """Evidence of the terms, with match and distance by node.

    The term of a node that holds most probability has the node's match; the others have less by their share of its
    probability, to the power of one over the number of parts, as geometric means have it where log-likelihoods add
    up. A halved match is one more unit of distance, as for sensors that compare views (``calibration.match_of``).

    Args:
        whole: the fused mixture.
        parts: what was fused, none of them blind.
        match_of: the match (K,) of nodes from those of the parts (S, K).
        distance_of: the same of distances.
    """
    count = 1 + max(int(nodes.max()) for nodes in (whole.nodes, *(part.nodes for part in parts)))
    match = np.array([_largest_by_node(part.nodes, part.match, count) for part in parts])
    distance = np.array([-_largest_by_node(part.nodes, -part.distance, count) for part in parts])
    masses = whole.log_masses
    heaviest = np.full(count, -np.inf)
    np.maximum.at(heaviest, whole.nodes, masses)
    below = np.where(np.isfinite(masses), masses, 0.0) - np.where(np.isfinite(masses), heaviest[whole.nodes], 0.0)
    below /= len(parts)
    return Evidence(
        poses=whole.poses,
        nodes=whole.nodes,
        match=np.minimum(match_of(match)[whole.nodes] * np.exp(below), 1.0),
        distance=distance_of(distance)[whole.nodes] - below / np.log(2.0),
        log_likelihoods=whole.log_weights,
        sigma=whole.sigma,
        kappa=whole.kappa,
        log_floor=whole.log_floor,
    )


def _largest_by_node(nodes: Ints, values: Floats, count: int) -> Floats:
    """(K,) the largest of the values (M,) at each node; at a node that a sensor does not name, its least of all."""
    found = np.full(count, values.min())
    np.maximum.at(found, nodes, values)
    return found
