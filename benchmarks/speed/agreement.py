"""Whether two implementations give the same answer: exactly, for the same random numbers, or in distribution."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np
from numpy.random.mtrand import get_bit_generator, set_bit_generator
from scipy.stats import ttest_ind

from topoloc.geometry import Floats

SIGNIFICANT = 1e-5
"""Answers that differ so much that chance alone does so less often than this are not the same."""
SAME_MASSES = 2e-3
"""Largest total variation distance of two beliefs that are called the same; a grid's belief leaves out half of it."""


@contextmanager
def global_numbers_from(seed: int) -> Iterator[None]:
    """Let numpy's global generator, which the peers draw from, give the numbers of ``same_numbers(seed)``."""
    before = get_bit_generator()
    set_bit_generator(np.random.MT19937(seed))
    try:
        yield
    finally:
        set_bit_generator(before)


def same_numbers(seed: int) -> np.random.Generator:
    """A generator whose ``random`` gives the numbers that the peers draw within ``global_numbers_from(seed)``."""
    return np.random.Generator(np.random.MT19937(seed))


def same_in_distribution(ours: Callable[[int], Floats], peers: Callable[[int], Floats], runs: int) -> bool:
    """Whether figures of independent runs have the same means, by Welch's t-test.

    Args:
        ours: seed -> figures (D,) of one run of ours.
        peers: the same of the peer's.
        runs: of each; no two have the same seed, so that all are independent.
    """
    drawn_ours = np.array([ours(seed) for seed in range(runs)])
    drawn_peers = np.array([peers(seed) for seed in range(runs, 2 * runs)])
    if not (np.isfinite(drawn_ours).all() and np.isfinite(drawn_peers).all()):
        return False
    probabilities = ttest_ind(drawn_ours, drawn_peers, equal_var=False).pvalue
    return bool((probabilities > SIGNIFICANT).all())


def same_masses(ours: Floats, peers: Floats) -> bool:
    """Whether two beliefs over the same cells, each summing to one, are the same."""
    return bool(0.5 * np.abs(ours - peers).sum() < SAME_MASSES)
