"""The nearest views by a product of matrices: the same as by all distances, whatever the rounding."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.distance import cdist

from sensors import nearest
from sensors.histogram import BANDS, Jeffrey, described, divergences
from sensors.nearest import Cosine, Euclid, Plain, Search, bound, smallest_of
from topoloc.geometry import Floats
from topoloc.types import Ints


def literal(distances: Floats, count: int) -> tuple[Ints, Floats]:
    """Sorted whole, ties by index."""
    order = np.argsort(distances, axis=1, kind="stable")[:, :count]
    return order, np.take_along_axis(distances, order, axis=1)


def same(search: Search, queries: Any, distances: Floats, count: int = 10, relative: float = 1e-12) -> None:
    views, found = search.nearest(queries, count)
    expected, known = literal(distances, count)
    np.testing.assert_array_equal(views, expected)
    np.testing.assert_allclose(found, known, rtol=relative, atol=relative * distances.max())


def unit(vectors: Floats) -> Any:
    return (vectors / np.linalg.norm(vectors, axis=1, keepdims=True)).astype(np.float32)


def histograms(rng: np.random.Generator, count: int, bins: int = 24) -> Floats:
    return np.asarray(0.95 * rng.dirichlet(np.full(bins, 0.3), (count, BANDS)) + 0.05 / bins)


def jeffrey(one: Any, others: Any) -> Floats:
    return np.stack([divergences(query, others) for query in one])


@given(st.integers(0, 10_000), st.integers(1, 900), st.integers(1, 30), st.sampled_from([0.0, 1e3, 1e7]))
@settings(max_examples=40, deadline=None)
def test_euclid_is_cdist_however_far_the_views_are_from_zero(seed: int, views: int, width: int, off: float) -> None:
    rng = np.random.default_rng(seed)
    known = rng.normal(size=(views, width)) + off
    queries = rng.normal(size=(5, width)) + off
    count = int(rng.integers(1, views + 1))
    same(Euclid(known), queries, cdist(queries, known), count)


def test_views_that_single_precision_cannot_tell_apart_are_told_apart() -> None:
    rng = np.random.default_rng(0)
    known = rng.normal(size=(1, 20)) + 1e-9 * rng.normal(size=(2000, 20))
    known[0] += 50.0  # so that the others are one point to the product
    queries = known[5:8] + 1e-9 * rng.normal(size=(3, 20))
    same(Euclid(known), queries, cdist(queries, known), relative=1e-6)


def test_equal_views_come_by_index_and_no_distance_is_left_over() -> None:
    known = np.repeat(np.random.default_rng(1).normal(size=(30, 6)), 40, axis=0)
    views, found = Euclid(known).nearest(known[[80, 0]], 10)
    np.testing.assert_array_equal(views, [np.arange(80, 90), np.arange(10)])
    assert not found.any()
    same(Euclid(np.ones((50, 3))), np.ones((2, 3)), np.zeros((2, 50)))


def test_cosine_is_the_plain_product() -> None:
    rng = np.random.default_rng(2)
    known, queries = unit(rng.normal(size=(3000, 200))), unit(rng.normal(size=(7, 200)))
    known[100:140] = known[99]
    queries[0] = known[99]
    plain = np.maximum(1.0 - queries.astype(np.float64) @ known.T.astype(np.float64), 0.0)
    same(Cosine(known), queries[1:], plain[1:])
    views, found = Cosine(known).nearest(queries[:1], 10)
    np.testing.assert_array_equal(views[0], np.arange(99, 109))
    assert found.max() < 1e-7


@pytest.mark.parametrize("bins", [2, 24, 300])
def test_jeffrey_is_the_divergence_of_all(bins: int) -> None:
    rng = np.random.default_rng(bins)
    known = np.stack([described(one) for one in histograms(rng, 800, bins)])
    queries = np.stack([described(one) for one in 0.7 * histograms(rng, 6, bins) + 0.3 / bins])
    queries[0] = known[17]
    same(Jeffrey(known), queries, jeffrey(queries, known))


def test_the_square_roots_bound_the_divergence_of_two_histograms() -> None:
    """log 2 times at least, once at most: from nearly equal ones to such that share no bin."""
    rng = np.random.default_rng(3)
    ratio = np.exp(rng.uniform(-40.0, 40.0, 5000))
    one, other = np.ones_like(ratio), ratio
    mean = 0.5 * (one + other)
    divergence = one * np.log(one / mean) + other * np.log(other / mean)
    square = (np.sqrt(one) - np.sqrt(other)) ** 2
    told = square > 1e-3
    assert (divergence[told] <= square[told] * (1.0 + 1e-9)).all()
    assert (divergence[told] >= np.log(2.0) * square[told] * (1.0 - 1e-9)).all()
    assert (divergence / square).min() < np.log(2.0) + 1e-3, "no larger bound holds"


def test_hardly_any_view_is_compared_exactly(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(4)
    compared: list[int] = []
    exact = Euclid.exact

    def counted(self: Euclid, queries: Any, views: Ints) -> Floats:
        compared.append(len(views))
        return exact(self, queries, views)

    monkeypatch.setattr(Euclid, "exact", counted)
    Euclid(rng.normal(size=(5000, 20))).nearest(rng.normal(size=(20, 20)), 10)
    assert sum(compared) < 20 * 14


@pytest.mark.parametrize("make", [Euclid, Plain])
def test_the_parts_that_fit_into_memory_do_not_matter(make: Callable[..., Search], monkeypatch: Any) -> None:
    rng = np.random.default_rng(5)
    known, queries = rng.normal(size=(300, 4)), rng.normal(size=(23, 4))
    search = Euclid(known) if make is Euclid else Plain(cdist, known)
    whole = search.nearest(queries, 7)
    monkeypatch.setattr(nearest, "MOST_FIGURES", 900)
    monkeypatch.setattr(nearest, "MOST_NUMBERS", 40)
    for one, other in zip(whole, search.nearest(queries, 7), strict=True):
        np.testing.assert_array_equal(one, other)
    same(search, queries, cdist(queries, known), 7)


def test_the_bound_is_reached_by_as_many_as_asked_for() -> None:
    figures = np.random.default_rng(6).normal(size=(4, 5000))
    for count in (1, 10, 77, 5000):
        assert ((figures <= bound(figures, count)[:, None]).sum(axis=1) >= count).all()


def test_what_is_no_number_comes_last() -> None:
    distances = np.array([[np.nan, 2.0, 1.0, np.nan, 1.0]])
    for count in (1, 2, 4, 5):
        views, _ = smallest_of(distances, count)
        np.testing.assert_array_equal(views[0], [2, 4, 1, 0, 3][:count])
