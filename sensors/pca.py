"""The appearance map of the second seed: views projected on their principal components; the nearest are evidence."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from sensors.images import MOST_COLUMNS, PREPROCESSING, grey, resize
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import View
from topoloc.types import Image

if TYPE_CHECKING:
    from sklearn.decomposition import PCA, IncrementalPCA

Preprocessing = Literal["plain", "equalised", "gradient", "clahe"]
BATCH = 256
"""Views that the incremental PCA takes in at a time."""


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
    _basis: PCA | IncrementalPCA | None = None
    _shape: tuple[int, int]

    @property
    def basis(self) -> PCA | IncrementalPCA:
        """scikit-learn's, once fitted: ``components_`` (features, pixels), ``mean_`` (pixels,)."""
        if self._basis is None:
            raise RuntimeError("PCAMap knows no views yet: call fit(topo_map) first")
        return self._basis

    def describe(self, pictures: Pictures) -> Floats:
        """Features (features,) of a frame's picture: its projection (1), the views' mean taken off."""
        return np.asarray(self._projected(self._prepared(pictures)[None])[0])

    def distances(self, queries: Floats, others: Floats) -> Floats:
        """Euclidean distances (Q, V) between features (Q, features) and (V, features)."""
        return np.asarray(cdist(queries, others))

    def extend(self, views: Sequence[View]) -> None:
        """Take in further views of the fitted map while the robot drives; the basis moves along.

        The seed leaves this as further work (7). Features of earlier views are carried over to the new basis from the
        old one, without their pictures; what the old basis left out of them stays lost.
        """
        if self._views is None or self._topo_map is None:
            raise RuntimeError("PCAMap knows no map yet: call fit(topo_map) before extend(views)")
        if self._views.on_nodes:
            raise UserError(f"map {self._topo_map.name!r} has panoramas only; views can be added to views, not to cuts")
        if not views:
            return
        pictures: list[Pictures] = [{"rgb": view.image} for view in views]
        old, grown = self.basis, _as_incremental(self.basis)
        for batch in _batches(pictures):
            grown.partial_fit(np.stack([self._prepared(one) for one in batch]))
        self._basis = grown
        kept = self._projected(old.inverse_transform(self._descriptors))
        self._descriptors = np.concatenate([kept, *(self.describe(one)[None] for one in pictures)])
        self._settle(self._topo_map, self._views.and_more(views))

    def _learn(self, views: Sequence[Pictures]) -> Floats:
        from sklearn.decomposition import PCA, IncrementalPCA

        first = grey(np.asarray(views[0]["rgb"], dtype=np.uint8))
        self._shape = (max(4, round(self.config.columns * first.shape[0] / first.shape[1])), self.config.columns)
        features = min(self.config.features, len(views), int(np.prod(self._shape)))
        if 4e-6 * len(views) * np.prod(self._shape) <= self.config.memory_mb:
            prepared = np.stack([self._prepared(one) for one in views])
            with np.errstate(invalid="ignore"):  # a single view has no variance
                self._basis = PCA(features, random_state=0).fit(prepared)
            return self._projected(prepared)
        self._basis = IncrementalPCA(features)
        for batch in _batches(views, at_least=features):
            self._basis.partial_fit(np.stack([self._prepared(one) for one in batch]))
        return np.stack([self.describe(one) for one in views])

    def _projected(self, prepared: NDArray[Any]) -> Floats:
        """Features (N, features) of prepared views (N, pixels); in float32 equal ones would differ by rounding."""
        middle, rows = self.basis.mean_.astype(np.float64), self.basis.components_.astype(np.float64)
        parts = np.array_split(prepared, max(1, len(prepared) // BATCH))
        return np.concatenate([(part - middle) @ rows.T for part in parts])

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


def _as_incremental(basis: PCA | IncrementalPCA) -> IncrementalPCA:
    """The same basis as one that can take in more: its state is what both publish of a fit."""
    from sklearn.decomposition import IncrementalPCA

    grown = IncrementalPCA(basis.n_components_)
    for name in ("components_", "singular_values_", "mean_", "explained_variance_", "explained_variance_ratio_"):
        setattr(grown, name, np.array(getattr(basis, name)))
    seen = getattr(basis, "n_samples_seen_", None) or basis.n_samples_
    grown.n_components_, grown.n_samples_seen_ = basis.n_components_, np.int64(seen)
    grown.noise_variance_ = basis.noise_variance_
    grown.var_ = getattr(basis, "var_", np.zeros_like(basis.mean_))  # of the pixels; nothing that is used depends on it
    return grown
