"""The appearance map of the second seed: views projected on their principal components; the nearest are evidence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from sensors.images import MOST_COLUMNS, PREPROCESSING, grey, resize
from sensors.nearest import Euclid, Search
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.array_folder import Arrays
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import View
from topoloc.types import Image

if TYPE_CHECKING:
    from sklearn.decomposition import PCA, IncrementalPCA

Preprocessing = Literal["plain", "equalised", "gradient", "clahe"]
BATCH = 256
"""Views that the incremental PCA takes in at a time."""
STATE = (
    *("components_", "mean_", "singular_values_", "explained_variance_", "explained_variance_ratio_"),
    *("noise_variance_", "n_components_", "n_samples_seen_", "var_"),
)
"""Attributes of a fitted basis."""


@dataclass(frozen=True)
class PCAMapConfig(ViewConfig):
    """Settings of the appearance map.

    Attributes:
        features: principal components that are kept (second seed, 2 and 6.1: about 20, or 5).
        preprocessing: of the grey picture: ``plain``, ``equalised``, ``gradient`` or ``clahe``.
        columns: pictures are scaled down to so many; as many rows as their aspect asks for.
        memory_mb: prepared views that would take more are learnt from in batches [MB].
    """

    features: int = 20
    preprocessing: Preprocessing = "equalised"
    columns: int = 64
    memory_mb: float = 1000.0
    slope: float = 20.0
    margin: float = -0.084
    log_floor: float = -1.86

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.features < 1:
            raise ValueError(f"features is {self.features}; it must be at least 1")
        if not 4 <= self.columns <= MOST_COLUMNS:
            raise ValueError(f"columns is {self.columns}; it must lie between 4 and {MOST_COLUMNS}")
        if self.memory_mb <= 0.0:
            raise ValueError(f"memory_mb is {self.memory_mb}; it must be above 0")
        if self.preprocessing not in PREPROCESSING:
            raise ValueError(f"preprocessing is {self.preprocessing!r}; choose from: {', '.join(PREPROCESSING)}")


class PCAMap(ViewSensor):
    """Whole views by their principal components: the appearance map of the second seed (2 and 3).

    y = W z (1), the rows of W the leading principal components of the map's views z.
    The J views nearest in feature space become hypotheses. ``weighting=rank`` weighs them by their rank, as the seed's
    sensor model does; the default weighs them by their match, so that a frame that fits nowhere says less.
    """

    Config = PCAMapConfig
    name = "pca"
    config: PCAMapConfig
    _shape: tuple[int, int]
    _learnt: Arrays | None = None

    @property
    def basis(self) -> IncrementalPCA:
        """scikit-learn's, once fitted: ``components_`` (features, pixels), ``mean_`` (pixels,)."""
        if self._learnt is None:
            raise RuntimeError("PCAMap knows no views yet: call fit(topo_map) first")
        return _basis_of(self._learnt)

    def describe(self, pictures: Pictures) -> Floats:
        """Features (features,) of a frame's picture: its projection (1), the views' mean taken off."""
        return np.asarray(self._projected(self._prepared(pictures)[None])[0])

    def distances(self, queries: Floats, others: Floats) -> Floats:
        """Euclidean distances (Q, V) between features (Q, features) and (V, features)."""
        return np.asarray(cdist(queries, others))

    def _search_of(self, descriptors: Floats) -> Search:
        return Euclid(descriptors)

    def _seen_many(self, looks: Sequence[Pictures]) -> list[Floats | None]:
        """All pictures are projected by one product."""
        readable = [not self._is_blind(pictures) for pictures in looks]
        prepared = [self._prepared(pictures) for pictures, told in zip(looks, readable, strict=True) if told]
        features = iter(self._projected(np.stack(prepared)) if prepared else ())
        return [next(features) if told else None for told in readable]

    def extend(self, views: Sequence[View]) -> None:
        """Take in further views of the fitted map while the robot drives; the basis moves along.

        The seed leaves this as further work (7). Features of earlier views are carried over to the new basis from the
        old one, without their pictures; what the old basis left out of them stays lost.

        Raises:
            UserError: the map has panoramas only.
        """
        if self._views is None or self._topo_map is None:
            raise RuntimeError("PCAMap knows no map yet: call fit(topo_map) before extend(views)")
        if self._views.on_nodes:
            raise UserError(f"map {self._topo_map.name!r} has panoramas only; views can be added to views, not to cuts")
        if not views:
            return
        pictures: list[Pictures] = [{"rgb": view.image} for view in views]
        old, grown = self.basis, self.basis
        for batch in _batches(pictures):
            grown.partial_fit(self._all_prepared(batch))
        self._take(_state_of(grown))
        kept = self._projected(old.inverse_transform(self._descriptors))
        self._descriptors = np.concatenate([kept, self._projected(self._all_prepared(pictures))])
        self._settle(self._topo_map, self._views.and_more(views))

    def _key(self) -> object:
        config = self.config
        versions = 1, version("scikit-learn")
        return versions, config.features, config.preprocessing, config.columns, config.memory_mb

    def _learn(self, views: Sequence[Pictures]) -> Floats:
        from sklearn.decomposition import PCA, IncrementalPCA

        first = grey(np.asarray(views[0]["rgb"], dtype=np.uint8))
        self._shape = (max(4, round(self.config.columns * first.shape[0] / first.shape[1])), self.config.columns)
        features = min(self.config.features, len(views), int(np.prod(self._shape)))
        if 4e-6 * len(views) * np.prod(self._shape) <= self.config.memory_mb:
            prepared = self._all_prepared(views)
            with np.errstate(invalid="ignore"):  # a single view has no variance
                self._take(_state_of(PCA(features, random_state=0).fit(prepared)))
            return self._projected(prepared)
        basis = IncrementalPCA(features)
        for batch in _batches(views, at_least=features):
            basis.partial_fit(self._all_prepared(batch))
        self._take(_state_of(basis))
        return np.concatenate([self._projected(self._all_prepared(batch)) for batch in _batches(views)])

    def _state(self) -> Arrays:
        assert self._learnt is not None  # _learn has run
        return {**self._learnt, "shape": np.array(self._shape)}

    def _restore(self, known: Arrays) -> None:
        super()._restore(known)
        self._shape = (int(known["shape"][0]), int(known["shape"][1]))
        self._take({name: known[name] for name in STATE})

    def _take(self, learnt: Arrays) -> None:
        """Project on this basis from now on; in float32 equal pictures would differ by rounding."""
        self._learnt = learnt
        self._middle, self._rows = (learnt[name].astype(np.float64) for name in ("mean_", "components_"))

    def _projected(self, prepared: NDArray[Any]) -> Floats:
        """Features (N, features) of prepared views (N, pixels)."""
        parts = np.array_split(prepared, max(1, len(prepared) // BATCH))
        return np.concatenate([(part - self._middle) @ self._rows.T for part in parts])

    def _all_prepared(self, views: Sequence[Pictures]) -> NDArray[np.float32]:
        """Of all views (N, pixels), without a second copy of them."""
        prepared = np.empty((len(views), self._shape[0] * self._shape[1]), dtype=np.float32)
        for row, pictures in zip(prepared, views, strict=True):
            row[:] = self._prepared(pictures)
        return prepared

    def _prepared(self, pictures: Pictures) -> NDArray[np.float32]:
        """The picture as a vector z (pixels,), float32, grey levels from 0 to 1."""
        image: Image = grey(np.asarray(pictures["rgb"], dtype=np.uint8))
        rows, columns = self._shape
        small = resize(PREPROCESSING[self.config.preprocessing](image), columns, rows)
        return np.asarray(small.reshape(-1), dtype=np.float32) / np.float32(255.0)


def _batches(views: Sequence[Pictures], at_least: int = 1) -> Iterator[Sequence[Pictures]]:
    """The views in parts of ``BATCH``; none is smaller than ``at_least``, as the first fit asks for."""
    parts = max(1, len(views) // max(BATCH, at_least))
    edges = np.linspace(0, len(views), parts + 1).round().astype(int)
    for first, last in pairwise(edges):
        yield views[first:last]


def _state_of(basis: PCA | IncrementalPCA) -> Arrays:
    """All that can be projected on, and go on from, as both classes publish it."""
    state = {name: np.array(getattr(basis, name)) for name in STATE if name not in ("n_samples_seen_", "var_")}
    seen = getattr(basis, "n_samples_seen_", None) or basis.n_samples_
    varied = getattr(basis, "var_", np.zeros_like(basis.mean_))  # of the pixels; nothing that is used depends on it
    return {**state, "n_samples_seen_": np.array(seen), "var_": np.array(varied)}


def _basis_of(state: Arrays) -> IncrementalPCA:
    """The same as one that can take in more."""
    from sklearn.decomposition import IncrementalPCA

    basis = IncrementalPCA(int(state["n_components_"]))
    for name in STATE:
        setattr(basis, name, state[name].copy()[()])  # without dimensions: a number
    return basis
