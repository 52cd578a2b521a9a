"""A layout of images from their distances alone: springs, all at once or image by image (third seed, section 3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from itertools import islice
from typing import Literal

import numpy as np

from topoloc.geometry import Floats
from topoloc.mapping.lengths import chained
from topoloc.mapping.springs import Springs
from topoloc.mapping.stiffness import stiffness_of

StiffnessName = Literal["constant", "inverse", "inverse-square", "linear", "exponential"]


@dataclass(frozen=True)
class LayoutConfig:
    """Settings of the springs. The unit is the median natural length above 0 of the springs so far.

    Attributes:
        stiffness: k of a spring of natural length d: constant, inverse (1/d), inverse-square, linear (1 - d/reach, not
            below 0) or exponential (exp(-d/reach)).
        reach: of the linear and the exponential law [units].
        neighbours: natural lengths are sums of image distances along chains of images, each joined with so many
            nearest ones; 0: the image distances themselves, as in the seed.
        damping: share of about critical damping.
        step: share of the longest time step that is stable without dampers; 0.5 is stable with them.
        tolerance: the springs rest when no image moves farther than this in a step [units].
        iterations: steps at most: of all springs in the batch method, after the last image in the incremental one.
        iterations_each: steps at most after each other image, incremental method.
        beside: how far from the image before it an image starts, incremental method [units].
    """

    stiffness: StiffnessName = "constant"
    reach: float = 2.0
    neighbours: int = 3
    damping: float = 1.0
    step: float = 0.5
    tolerance: float = 0.001
    iterations: int = 1000
    iterations_each: int = 30
    beside: float = 0.1

    def __post_init__(self) -> None:
        for name in ("reach", "damping", "step", "tolerance", "beside"):
            if not 0.0 < getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be positive and finite")
        if self.step > 0.5:
            raise ValueError(f"step is {self.step}; above 0.5 the springs may fly apart")
        if self.step * self.damping > 0.5:
            raise ValueError(f"step x damping is {self.step * self.damping:g}; above 0.5 the springs may fly apart")
        if self.iterations < 1 or self.iterations_each < 1:
            raise ValueError("iterations and iterations_each must be at least 1")
        if self.neighbours < 0:
            raise ValueError(f"neighbours is {self.neighbours}; write 1 or more, or 0 for image distances as they are")


@dataclass(frozen=True)
class LayoutStep:
    """Where the images are after a step.

    Attributes:
        positions: (M, 2) of the first M images, as many as there are so far; scale, place, turn and reflection mean
            nothing.
        iterations: of the springs so far.
        rests: whether they have come to rest within the tolerance; if not, the iterations ran out, or they go on.
    """

    positions: Floats
    iterations: int
    rests: bool


Steps = Callable[[Floats, LayoutConfig, np.random.Generator], Iterator[LayoutStep]]
"""A method: distances (N, N), settings and random numbers -> steps; the last one has all images."""


def batch(distances: Floats, config: LayoutConfig, rng: np.random.Generator) -> Iterator[LayoutStep]:
    """All images at once from random places in a square (third seed, section 3.1): a step for each iteration.

    Args:
        distances: (N, N) between the images, symmetric, zero diagonal, not all 0.
        config: settings.
        rng: draws the places.
    """
    lengths, unit = _lengths(distances, config)
    start = rng.uniform(-unit, unit, (len(distances), 2))
    yield LayoutStep(start, 0, False)
    yield from _relaxed(start, lengths, unit, config, config.iterations)


def incremental(distances: Floats, config: LayoutConfig, rng: np.random.Generator) -> Iterator[LayoutStep]:
    """Image by image, each starting beside the one before it (third seed, section 3.2): a step for each image.

    What is done for an image uses no distance to later ones.

    Args:
        distances: (N, N) between the images in the order of their capture, symmetric, zero diagonal, not all 0.
        config: settings.
        rng: draws the direction in which each image starts.
    """
    positions, done = np.zeros((1, 2)), 0
    yield LayoutStep(positions, 0, True)
    for count in range(2, len(distances) + 1):
        lengths, unit = _lengths(distances[:count, :count], config)
        angle = rng.uniform(0.0, 2.0 * np.pi)
        beside = positions[-1] + config.beside * unit * np.array([np.cos(angle), np.sin(angle)])
        most = config.iterations if count == len(distances) else config.iterations_each
        *_, last = _relaxed(np.vstack([positions, beside]), lengths, unit, config, most)
        positions, done = last.positions, done + last.iterations
        yield LayoutStep(positions, done, last.rests)


METHODS: Mapping[str, Steps] = {"batch": batch, "incremental": incremental}


def laid_out(method: str, distances: Floats, config: LayoutConfig, rng: np.random.Generator) -> LayoutStep:
    """The last step of a method, one of ``METHODS``, for image distances (N, N); the arguments are the method's."""
    *_, last = METHODS[method](distances, config, rng)
    return last


def _lengths(distances: Floats, config: LayoutConfig) -> tuple[Floats, float]:
    """Natural lengths (N, N), and the unit: the median of those above 0."""
    lengths = chained(distances, config.neighbours)
    springs = lengths[np.triu_indices(len(lengths), 1)]
    unit = float(np.median(springs[springs > 0.0])) if (springs > 0.0).any() else 0.0
    return lengths, max(unit, np.finfo(np.float64).tiny)


def _relaxed(start: Floats, lengths: Floats, unit: float, config: LayoutConfig, most: int) -> Iterator[LayoutStep]:
    """A step for each iteration, from rest at ``start`` (N, 2) until the springs rest, ``most`` at most."""
    stiff = stiffness_of(config.stiffness, lengths, unit, config.reach)
    springs = Springs.of(lengths, stiff, config.damping, config.step)
    for number, (positions, velocities) in enumerate(islice(springs.moves(start), most), start=1):
        rests = bool(np.abs(velocities).max() * springs.time_step <= config.tolerance * unit)
        yield LayoutStep(positions, number, rests)
        if rests:
            return
