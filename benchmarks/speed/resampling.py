"""Resampling alone: weights -> indices.

filterpy's ``residual_resample`` is no peer: it draws the rest from ``weights - copies`` where it should be
``n * weights - copies``, and so gives other counts than n w.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.speed.agreement import global_numbers_from, same_in_distribution, same_numbers
from benchmarks.speed.case import Case, Pair
from estimators.resampling import RESAMPLERS
from topoloc.geometry import Floats
from topoloc.types import Ints

PeerResampler = Callable[[Floats], Ints]
"""Weights (N,) that sum to one -> indices (N,); draws from numpy's global generator."""
CHECKED_SEEDS, CHECKED_RUNS = 5, 50
PARTS = 20
"""Counts are compared over this many parts of the particles."""


def filterpy_resampling(name: str, count: int) -> Case:
    """Ours beside filterpy, which for the same random numbers must give the same indices.

    The multinomial's are drawn in another order, and so only in distribution the same.
    """
    same = same_counts if name == "multinomial" else same_indices
    prepare = partial(_filterpy, name, count, same)
    return Case("estimators", "resampling", _size(name, count), "filterpy", ("filterpy",), prepare)


def particles_resampling(name: str, count: int, same_algorithm: bool) -> Case:
    """Ours beside ``particles``; where the algorithms differ only the distribution of the counts is the same."""
    prepare = partial(_particles, name, count, same_algorithm)
    return Case("estimators", "resampling", _size(name, count), "particles", ("particles", "numba"), prepare)


def _size(name: str, count: int) -> str:
    return f"{count:,}, {name}"


def _filterpy(name: str, count: int, same: Callable[[str, PeerResampler, Floats], bool]) -> Pair:
    from filterpy import monte_carlo

    return _pair(name, getattr(monte_carlo, f"{name}_resample"), count, same)


def _particles(name: str, count: int, same_algorithm: bool) -> Pair:
    from particles.resampling import rs_funcs

    return _pair(name, rs_funcs[name], count, same_indices if same_algorithm else same_counts)


def _pair(name: str, peer: PeerResampler, count: int, same: Callable[[str, PeerResampler, Floats], bool]) -> Pair:
    rng, weights = np.random.default_rng(0), some_weights(count)
    return Pair(
        partial(RESAMPLERS[name], weights, count, rng), partial(peer, weights), partial(same, name, peer, weights)
    )


def some_weights(count: int) -> Floats:
    """Weights (N,) as uneven as after looking: log-normal, summing to one."""
    weights = np.exp(np.random.default_rng(1).normal(size=count))
    return np.asarray(weights / weights.sum())


def same_indices(name: str, peer: PeerResampler, weights: Floats) -> bool:
    """Whether the same random numbers give the same indices."""
    for seed in range(CHECKED_SEEDS):
        with global_numbers_from(seed):
            theirs = peer(weights)
        if not np.array_equal(RESAMPLERS[name](weights, len(weights), same_numbers(seed)), theirs):
            return False
    return True


def same_counts(name: str, peer: PeerResampler, weights: Floats) -> bool:
    """Whether the counts have the same means, over parts of the particles, and stray as far from n w."""

    def ours(seed: int) -> Floats:
        return _count_figures(RESAMPLERS[name](weights, len(weights), same_numbers(seed)), weights)

    def peers(seed: int) -> Floats:
        with global_numbers_from(seed):
            return _count_figures(peer(weights), weights)

    return same_in_distribution(ours, peers, CHECKED_RUNS)


def _count_figures(indices: Ints, weights: Floats) -> Floats:
    """(PARTS + 1,): counts of the parts, and the squared deviation of all counts from n w."""
    count = len(weights)
    counts = np.bincount(indices, minlength=count)
    parts = np.bincount(np.arange(count) * PARTS // count, weights=counts)
    return np.append(parts, ((counts - count * weights) ** 2).sum())
