"""The views nearest to many queries: one product of matrices says which can be, exact distances which are.

The product gives a figure for each query and view, rounded to float32, which bounds their distance from both sides. Any
J figures bound the J nearest distances; every view whose own bounds leave it a chance is then compared exactly. So the
answer is that of comparing all with all, ties by index: it depends neither on the rounding of the product nor on how
many queries are asked at a time.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from topoloc.geometry import Floats
from topoloc.types import Ints

Floats32 = NDArray[np.float32]
UNIT = 2.0**-24
"""Relative error of a number rounded to float32."""
MOST_FIGURES, MOST_NUMBERS = 4_000_000, 2_000_000
"""That are in memory at a time: of queries and views, and of descriptors that are compared exactly."""
GROUP = 32
"""Views a group; the bound is taken from the smallest figure of each, as good unless near views share one."""


class Search(Protocol):
    """Views of a map, ready to be searched."""

    def nearest(self, queries: Any, count: int) -> tuple[Ints, Floats]:
        """The views (Q, J) nearest to descriptors (Q, ...), nearest first, and their distances (Q, J)."""


class Plain:
    """All distances: for whatever has one.

    Args:
        distances: (Q, V) of descriptors (Q, ...) and (V, ...).
        views: (V, ...).
    """

    def __init__(self, distances: Callable[[Any, Any], Floats], views: Any) -> None:
        self._distances, self._views = distances, views

    def nearest(self, queries: Any, count: int) -> tuple[Ints, Floats]:
        """See ``Search``."""
        return smallest_of(self._distances(queries, self._views), count)


class ByProduct(ABC):
    """Views (V, D) of which a product of matrices tells nearly how far queries are.

    Args:
        right: (K, V), the views' side of the product.
    """

    def __init__(self, right: Floats32) -> None:
        self._right = right

    @abstractmethod
    def left(self, queries: Any) -> Floats32:
        """(Q, K), the side of the product of queries (Q, D)."""

    @abstractmethod
    def reach(self, queries: Any, figure: Floats) -> Floats:
        """The largest figures (Q,) of views that may be as near to queries (Q, D) as one of ``figure`` (Q,) is."""

    @abstractmethod
    def exact(self, queries: Any, views: Ints) -> Floats:
        """Distances (N,) of queries (N, D) to one view (N,) each; they depend on nothing but the two descriptors."""

    def nearest(self, queries: Any, count: int) -> tuple[Ints, Floats]:
        """See ``Search``."""
        step = max(1, MOST_FIGURES // self._right.shape[1])
        parts = [self._nearest(queries[first : first + step], count) for first in range(0, len(queries), step)]
        views, distances = zip(*parts, strict=True)
        return np.concatenate(views), np.concatenate(distances)

    def _nearest(self, queries: Any, count: int) -> tuple[Ints, Floats]:
        figures = self.left(queries) @ self._right
        reach = self.reach(queries, bound(figures, count)).astype(np.float32)
        query, view = pairs_up_to(np.nextafter(reach, np.float32(np.inf)), figures)
        step = max(1, MOST_NUMBERS // queries.shape[1])
        parts = range(0, len(query), step)
        distance = np.concatenate([self.exact(queries[query[at : at + step]], view[at : at + step]) for at in parts])
        return in_order(query, view, distance, count)


class Euclid(ByProduct):
    """By Euclid's distance: |q - v|^2 less |q|^2 is |v|^2 - 2 q v.

    Args:
        views: (V, D), kept as they are.
    """

    def __init__(self, views: NDArray[Any]) -> None:
        self._views = views
        self._middle = views.mean(axis=0, dtype=np.float64)  # products of what is left lose fewer digits
        right = np.empty((views.shape[1] + 1, len(views)), dtype=np.float32)
        centred = views.T - self._middle[:, None]
        self._largest = float(np.sqrt((centred * centred).sum(axis=0).max())) or 1.0
        right[:-1] = centred / self._largest
        right[-1] = (right[:-1] * right[:-1]).sum(axis=0)
        right[:-1] *= -2.0
        super().__init__(right)

    def left(self, queries: NDArray[Any]) -> Floats32:
        """See ``ByProduct``."""
        sides = np.ones((len(queries), len(self._right)), dtype=np.float32)
        sides[:, :-1] = (queries - self._middle) / self._largest
        return sides

    def reach(self, queries: NDArray[Any], figure: Floats) -> Floats:
        """See ``ByProduct``.

        A figure of D + 1 terms is off by at most D + 4 units of what their sizes add up to, for the terms, their sum,
        and what was rounded before; no view is farther from the middle than 1.
        """
        sizes = 2.0 * np.linalg.norm((queries - self._middle) / self._largest, axis=1) + 1.0
        return np.asarray(figure + 2.0 * (queries.shape[1] + 4) * UNIT * sizes)

    def exact(self, queries: NDArray[Any], views: Ints) -> Floats:
        """See ``ByProduct``: by differences, in double precision."""
        apart = queries - self._views[views].astype(np.float64)
        return np.asarray(np.sqrt((apart * apart).sum(axis=1)))

    def roughly(self, queries: NDArray[Any]) -> Floats:
        """Distances (Q, V) of queries (Q, D) by the product alone: to 1e-3 of the largest, for small ones."""
        left = self.left(queries)
        squares = left @ self._right + (left[:, :-1] * left[:, :-1]).sum(axis=1, keepdims=True)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0), dtype=np.float64) * self._largest)


class Cosine(ByProduct):
    """By 1 less the cosine, of vectors of length 1.

    Args:
        views: (V, D), float32, kept as they are.
    """

    def __init__(self, views: Floats32) -> None:
        self._views = views
        super().__init__(views.T)

    def left(self, queries: Floats32) -> Floats32:
        """See ``ByProduct``."""
        return -queries

    def reach(self, queries: Floats32, figure: Floats) -> Floats:
        """See ``ByProduct``: D terms whose sizes add up to 1 at most."""
        return np.asarray(figure + 2.0 * (queries.shape[1] + 4) * UNIT)

    def exact(self, queries: Floats32, views: Ints) -> Floats:
        """See ``ByProduct``: in double precision."""
        products = (queries.astype(np.float64) * self._views[views]).sum(axis=1)
        return np.asarray(np.maximum(1.0 - products, 0.0))


def smallest_of(distances: Floats, count: int) -> tuple[Ints, Floats]:
    """Of distances (Q, V) the ``count`` smallest of each query: views (Q, J), ties by index, and distances (Q, J)."""
    query, view = pairs_up_to(np.partition(distances, count - 1, axis=1)[:, count - 1], distances)
    return in_order(query, view, distances[query, view], count)


def bound(figures: NDArray[Any], count: int) -> Floats:
    """(Q,) that at least ``count`` of the figures (Q, V) of each query do not exceed, and hardly more do."""
    groups = figures.shape[1] // GROUP
    if groups > 2 * count:
        figures = figures[:, : groups * GROUP].reshape(len(figures), GROUP, groups).min(axis=1)
    return np.asarray(np.partition(figures, count - 1, axis=1)[:, count - 1], dtype=np.float64)


def pairs_up_to(most: NDArray[Any], figures: NDArray[Any]) -> tuple[Ints, Ints]:
    """Queries and views (N,) whose figure (Q, V) is not above ``most`` (Q,), in order; what is no number is not."""
    chosen = np.flatnonzero(~(figures > most[:, None]))  # a tenth of the time of numpy.nonzero
    query, view = np.divmod(chosen, figures.shape[1])
    return query, view


def in_order(query: Ints, view: Ints, distance: Floats, count: int) -> tuple[Ints, Floats]:
    """Of pairs (N,), whose queries are in order, the ``count`` of smallest distance: views and distances (Q, J)."""
    order = np.lexsort((view, distance, query))
    first = np.searchsorted(query, np.arange(query[-1] + 1))
    chosen = order[first[:, None] + np.arange(count)]
    return view[chosen], distance[chosen]
