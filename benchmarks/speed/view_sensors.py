"""The ten nearest views of a map for frames that were seen at once, by their descriptors alone.

Descriptors are drawn, simulated: the views' change little by little along a way, as a robot's do, and a frame's is that
of some view, changed. So the nearest are nearer than the rest, as in a map where the robot is at home.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.spatial.distance import cdist

from benchmarks.speed.case import Case, Pair
from sensors.histogram import BANDS, Jeffrey, described
from sensors.nearest import Euclid, Search
from topoloc.geometry import Floats
from topoloc.types import Ints

NEAREST = 10
FEATURES = 20
"""Of ``pca`` as it is set."""
BINS = 24
"""Of a band of ``histogram`` as it is set."""
SMOOTHING = 0.05
APART = 20
"""Views from one landmark of the way to the next."""
SAME_DISTANCE = 1e-3
"""Distances of the ten, squared, that differ by less than this share of the largest are the same: faiss has float32."""

Drawn = tuple[Floats, Floats]
"""Descriptors of the frames (Q, D), and of the views (V, D)."""
PeerSearch = Callable[[Floats, Floats], Callable[[], tuple[Ints, Floats]]]
"""Descriptors (Q, D) and (V, D), set up -> a call that gives the nearest (Q, J) and their distances."""


def some_features(frames: int, views: int) -> Drawn:
    """Normal, with the variances of principal components, which fall."""
    rng = np.random.default_rng(0)
    scale = 1.0 / np.sqrt(np.arange(1.0, FEATURES + 1.0))
    known = along_a_way(scale * rng.normal(size=(views // APART + 2, FEATURES)), views)
    return known[rng.integers(0, views, frames)] + 0.3 * scale * rng.normal(size=(frames, FEATURES)), known


def some_histograms(frames: int, views: int) -> Drawn:
    """A few bins of each band hold most; each band sums to 1."""
    rng = np.random.default_rng(0)
    alone = partial(rng.dirichlet, np.full(BINS, 0.3))
    known = along_a_way(alone((views // APART + 2, BANDS)), views)
    seen = 0.8 * known[rng.integers(0, views, frames)] + 0.2 * alone((frames, BANDS))
    smooth = ((1.0 - SMOOTHING) * drawn + SMOOTHING / BINS for drawn in (seen, known))
    first, second = (drawn.reshape(len(drawn), -1) for drawn in smooth)
    return first, second


def along_a_way(landmarks: Floats, views: int) -> Floats:
    """(V, ...) from one landmark (L, ...) to the next, in ``APART`` views each."""
    way = np.arange(views) / APART
    before = way.astype(int)
    share = (way - before).reshape(-1, *[1] * (landmarks.ndim - 1))
    return np.asarray((1.0 - share) * landmarks[before] + share * landmarks[before + 1])


def scipy_euclid(seen: Floats, known: Floats) -> Callable[[], tuple[Ints, Floats]]:
    """All distances by ``cdist``, then the smallest."""
    return lambda: smallest(cdist(seen, known))


def sklearn_euclid(seen: Floats, known: Floats) -> Callable[[], tuple[Ints, Floats]]:
    """scikit-learn's ``NearestNeighbors`` by brute force."""
    from sklearn.neighbors import NearestNeighbors

    index = NearestNeighbors(n_neighbors=NEAREST, algorithm="brute").fit(known)

    def search() -> tuple[Ints, Floats]:
        distances, views = index.kneighbors(seen)
        return views, distances

    return search


def faiss_euclid(seen: Floats, known: Floats) -> Callable[[], tuple[Ints, Floats]]:
    """The exact index of faiss, in float32."""
    import faiss

    faiss.omp_set_num_threads(1)
    index = faiss.IndexFlatL2(known.shape[1])
    index.add(known.astype(np.float32))
    queries = seen.astype(np.float32)

    def search() -> tuple[Ints, Floats]:
        squares, views = index.search(queries, NEAREST)
        return views, np.sqrt(squares)

    return search


def scipy_jeffrey(seen: Floats, known: Floats) -> Callable[[], tuple[Ints, Floats]]:
    """By scipy's Jensen-Shannon distance: over bands that each weigh a sixth, twice its square is our divergence."""
    return lambda: smallest(2.0 * cdist(seen / BANDS, known / BANDS, "jensenshannon") ** 2)


def numpy_jeffrey(seen: Floats, known: Floats) -> Callable[[], tuple[Ints, Floats]]:
    """By its formula in numpy, a frame at a time."""

    def divergences(one: Floats) -> Floats:
        mean = (one + known) / 2.0
        return np.asarray((one * np.log(one / mean) + known * np.log(known / mean)).sum(axis=1) / BANDS)

    return lambda: smallest(np.stack([divergences(one) for one in seen]))


def smallest(distances: Floats) -> tuple[Ints, Floats]:
    """The nearest views (Q, J), nearest first, and their distances, of all distances (Q, V)."""
    some = np.argpartition(distances, NEAREST - 1, axis=1)[:, :NEAREST]
    near = np.take_along_axis(distances, some, axis=1)
    order = np.argsort(near, axis=1)
    return np.take_along_axis(some, order, axis=1), np.take_along_axis(near, order, axis=1)


def nearest_by_features(frames: int, views: int, peer: str, search: PeerSearch, packages: tuple[str, ...] = ()) -> Case:
    """``pca``'s search beside a peer's."""
    prepare = partial(_pair, some_features, frames, views, lambda known: (Euclid(known), np.asarray), search)
    return Case("sensors", "nearest-pca", _size(frames, views), peer, packages, prepare)


def nearest_by_histograms(frames: int, views: int, peer: str, search: PeerSearch) -> Case:
    """``histogram``'s search beside a peer's."""
    prepare = partial(_pair, some_histograms, frames, views, lambda known: (Jeffrey(_as_ours(known)), _as_ours), search)
    return Case("sensors", "nearest-histogram", _size(frames, views), peer, (), prepare)


def _size(frames: int, views: int) -> str:
    return f"{frames} {'frame' if frames == 1 else 'frames'} x {views:,} views"


def _as_ours(histograms: Floats) -> Floats:
    return np.stack([described(bands) for bands in histograms.reshape(len(histograms), BANDS, BINS)])


def _pair(
    draw: Callable[[int, int], Drawn],
    frames: int,
    views: int,
    ours: Callable[[Floats], tuple[Search, Callable[[Floats], Floats]]],
    search: PeerSearch,
) -> Pair:
    seen, known = draw(frames, views)
    index, prepared = ours(known)
    queries = prepared(seen)
    own, peers = partial(index.nearest, queries, NEAREST), search(seen, known)
    return Pair(own, peers, lambda: same_nearest(own(), peers()))


def same_nearest(ours: tuple[Ints, Floats], peers: tuple[Ints, Floats]) -> bool:
    """Whether the same ten views are found, nearly in the same order: distances that agree may change places."""
    squares, others = ours[1] ** 2, np.asarray(peers[1], dtype=np.float64) ** 2
    close = bool((np.abs(squares - others) <= SAME_DISTANCE * squares.max(axis=1, keepdims=True)).all())
    shared = [len(np.intersect1d(one, other)) for one, other in zip(ours[0], peers[0], strict=True)]
    return close and min(shared) >= NEAREST - 1 and float(np.mean(shared)) > NEAREST - 0.1


SIZES = [(frames, views) for frames in (1, 100) for views in (1_000, 4_000, 40_000)]

CASES: tuple[Case, ...] = (
    *(nearest_by_features(*size, "scipy cdist", scipy_euclid) for size in SIZES),
    *(nearest_by_features(*size, "faiss", faiss_euclid, ("faiss",)) for size in SIZES),
    *(nearest_by_features(*size, "scikit-learn", sklearn_euclid) for size in SIZES),
    *(nearest_by_histograms(*size, "numpy, plain", numpy_jeffrey) for size in SIZES[:5]),
    *(nearest_by_histograms(*size, "scipy cdist", scipy_jeffrey) for size in SIZES[:2]),
)
