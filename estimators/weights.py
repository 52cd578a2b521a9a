"""Particle weights PW1 to PW7 of the third seed (section 4), each a function of the evidence and the particles.

The seed's formulas were lost; all seven are rebuilt around its words (EQUATIONS.md, 3). With the offsets
v_j = l_j - (x, y) [m] and g_j = wrap(theta_j - theta) [rad] of the B nearest map images j from a particle, and the
distances h_j of their descriptors from the current one, E(u) = exp(-u^2 / (2 sd^2)) with the sd of the quantity u.

Only PW1, PW3 and PW7 are mixtures: only they keep two look-alike places apart. PW2 and PW4 pull towards the middle of
the B images, whatever their h_j, which cancel on normalisation; PW5 and PW6 towards their centre of mass.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps

import numpy as np
from scipy.special import logsumexp

from topoloc.geometry import Floats, wrap
from topoloc.types import Evidence, Ints

IDENTICAL = 1e-9
"""Descriptors nearer to each other than this are those of one image: PW5's masses 1 / h_j stay finite."""


@dataclass(frozen=True)
class WeightingConfig:
    """Settings of the particle weights; the seed names the parameters, their values are ours.

    Attributes:
        neighbours: B, how many map images weigh a particle: those of the smallest descriptor distance. The mixtures
            do better with more of them, the others with few.
        position_sd_m: of the distance from a particle to an image, of PW5's centre and of PW6's force [m].
        descriptor_sd: of the descriptor distance h_j, in the sensor's own scale (``Evidence.distance``).
        heading_sd_deg: of the heading, in PW3 and PW4 [deg].
        reach_m: L of PW7, the distance from an image where its triangle ends [m].
    """

    neighbours: int = 5
    position_sd_m: float = 0.4
    descriptor_sd: float = 0.15
    heading_sd_deg: float = 15.0
    reach_m: float = 1.0

    def __post_init__(self) -> None:
        if self.neighbours < 1:
            raise ValueError(f"neighbours is {self.neighbours}; it must be at least 1")
        for name in ("position_sd_m", "descriptor_sd", "heading_sd_deg", "reach_m"):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise ValueError(f"{name} is {value}; it must be positive and finite")


@dataclass(frozen=True)
class Neighbours:
    """The B nearest map images, as N particles see them.

    Attributes:
        offset: (N, B, 2) v_j [m].
        turn: (N, B) g_j [rad]; 0 where an image's heading is unknown.
        distance: (B,) h_j.
        match: (B,) s_j of PW7; 1 is an identical image.
    """

    offset: Floats
    turn: Floats
    distance: Floats
    match: Floats

    @classmethod
    def of(cls, evidence: Evidence, poses: Floats, count: int) -> Neighbours:
        """The ``count`` hypotheses of the smallest distance, seen from poses (N, 3)."""
        near = _nearest(evidence, count)
        known = evidence.kappa[near] > 0.0
        turn = np.where(known, wrap(evidence.poses[near, 2] - poses[:, 2:]), 0.0)
        return cls(evidence.poses[near, :2] - poses[:, None, :2], turn, evidence.distance[near], evidence.match[near])


Formula = Callable[[Neighbours, WeightingConfig], Floats]
Weighting = Callable[[Evidence, Floats, WeightingConfig], Floats]
"""Evidence, poses (N, 3) of the particles and settings -> log weights (N,) up to a constant; -inf is weight zero.

All are zero for a blind frame.
"""


def _weighting(formula: Formula) -> Weighting:
    """A formula over neighbours as a function of the evidence; a blind frame has none, and weighs nothing."""

    @wraps(formula)
    def weigh(evidence: Evidence, poses: Floats, config: WeightingConfig) -> Floats:
        if evidence.is_blind:
            return np.zeros(len(poses))
        return formula(Neighbours.of(evidence, poses, config.neighbours), config)

    return weigh


@_weighting
def pw1(near: Neighbours, config: WeightingConfig) -> Floats:
    """Sum over the images of E(v_j) E(h_j) (third seed, PW1; rebuilt)."""
    return np.asarray(logsumexp(_log_place(near, config) + _log_descriptor(near, config), axis=1))


@_weighting
def pw2(near: Neighbours, config: WeightingConfig) -> Floats:
    """Product over the images of E(v_j) E(h_j) (third seed, PW2; rebuilt)."""
    return np.asarray((_log_place(near, config) + _log_descriptor(near, config)).sum(axis=1))


@_weighting
def pw3(near: Neighbours, config: WeightingConfig) -> Floats:
    """Sum over the images of E(v_j) E(h_j) E(g_j) (third seed, PW3; rebuilt)."""
    log_terms = _log_place(near, config) + _log_descriptor(near, config) + _log_heading(near, config)
    return np.asarray(logsumexp(log_terms, axis=1))


@_weighting
def pw4(near: Neighbours, config: WeightingConfig) -> Floats:
    """Product over the images of E(v_j) E(h_j) E(g_j) (third seed, PW4; rebuilt)."""
    return np.asarray(
        (_log_place(near, config) + _log_descriptor(near, config) + _log_heading(near, config)).sum(axis=1)
    )


@_weighting
def pw5(near: Neighbours, config: WeightingConfig) -> Floats:
    """E of the way to the images' centre of mass, sum m_j v_j / sum m_j with m_j = 1 / h_j (third seed, PW5; rebuilt).

    Where images are identical to the current one, the others' masses vanish beside theirs.
    """
    mass = 1.0 / np.maximum(near.distance, IDENTICAL)
    return _log_gauss_2d(np.einsum("b,nbd->nd", mass / mass.sum(), near.offset), config.position_sd_m)


@_weighting
def pw6(near: Neighbours, config: WeightingConfig) -> Floats:
    """E of the force of springs to the images, sum k_j v_j with k_j = 1 - h_j / h_max (third seed, PW6; rebuilt).

    It is PW5 with masses k_j and an sd of position_sd_m / sum k_j. The farthest descriptor never pulls: B = 1, or
    images that are all equally far, weigh nothing.
    """
    farthest = max(float(near.distance.max()), IDENTICAL)
    stiffness = 1.0 - near.distance / farthest
    return _log_gauss_2d(np.einsum("b,nbd->nd", stiffness, near.offset), config.position_sd_m)


@_weighting
def pw7(near: Neighbours, config: WeightingConfig) -> Floats:
    """Sum over the images of s_j max(0, 1 - |v_j| / L), s_j the match (third seed, PW7; rebuilt).

    A particle farther than L from every image has weight zero.
    """
    triangle = np.maximum(0.0, 1.0 - np.linalg.norm(near.offset, axis=2) / config.reach_m)
    with np.errstate(divide="ignore"):  # log 0 is meant
        return np.asarray(np.log(triangle @ near.match))


WEIGHTINGS: dict[str, Weighting] = {
    "pw1": pw1,
    "pw2": pw2,
    "pw3": pw3,
    "pw4": pw4,
    "pw5": pw5,
    "pw6": pw6,
    "pw7": pw7,
}


def _nearest(evidence: Evidence, count: int) -> Ints:
    """Indices of the smallest distances; of equal ones the lowest nodes, then the lowest poses, in whatever order."""
    distance = evidence.distance
    near = np.arange(len(distance))
    if count < len(distance):
        near = np.flatnonzero(distance <= np.partition(distance, count - 1)[count - 1])  # equal ones, too
    x, y, heading = evidence.poses[near].T
    return near[np.lexsort((heading, y, x, evidence.nodes[near], distance[near]))[:count]]


def _log_place(near: Neighbours, config: WeightingConfig) -> Floats:
    """(N, B) log E(v_j)."""
    return _log_gauss_2d(near.offset, config.position_sd_m)


def _log_descriptor(near: Neighbours, config: WeightingConfig) -> Floats:
    """(B,) log E(h_j)."""
    return np.asarray(-0.5 * (near.distance / config.descriptor_sd) ** 2)


def _log_heading(near: Neighbours, config: WeightingConfig) -> Floats:
    """(N, B) log E(g_j); 0 where an image's heading is unknown."""
    return np.asarray(-0.5 * (near.turn / np.deg2rad(config.heading_sd_deg)) ** 2)


def _log_gauss_2d(way: Floats, sd: float) -> Floats:
    """Log E of ways (..., 2)."""
    return np.asarray(-0.5 * (way**2).sum(axis=-1) / sd**2)
