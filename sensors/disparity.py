"""Disparity as an appearance: stereo pairs by the principal components of their sparse disparities (second seed, 5).

What is near and what far hardly depends on the light, while the picture itself does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import numpy as np
from scipy.spatial.distance import cdist

from sensors.block_matching import BlockMatchingConfig, averaged, disparities
from sensors.images import Views
from sensors.missing_pca import MissingPCA, MissingPCAConfig, missing_pca
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Image

MOST_CELLS = 256
"""Across: more would have no disparities to be averaged in them."""


@dataclass(frozen=True)
class DisparityConfig(ViewConfig):
    """Settings of the disparity sensor.

    Attributes:
        features: principal components that are kept.
        columns: disparities are averaged down to so many cells across; as many rows as the pictures' aspect asks for.
        least_known: share of a cell's pixels whose disparity must be known.
        least_cells: share of the cells that must be known; with fewer a frame is blind.
        matching: the search for disparities.
        missing: principal components in spite of missing cells.
    """

    features: int = 20
    columns: int = 24
    least_known: float = 0.3
    least_cells: float = 0.1
    matching: BlockMatchingConfig = field(default_factory=BlockMatchingConfig)
    missing: MissingPCAConfig = field(default_factory=MissingPCAConfig)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.features < 1:
            raise ValueError(f"features is {self.features}; it must be at least 1")
        if not 4 <= self.columns <= MOST_CELLS:
            raise ValueError(f"columns is {self.columns}; it must lie between 4 and {MOST_CELLS}")
        for name in ("least_known", "least_cells"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and 1")


@dataclass(frozen=True)
class StereoViews(Views):
    """Training views that are stereo pairs.

    Attributes:
        rights: the right pictures, V of them.
    """

    rights: list[Image]


class Disparity(ViewSensor):
    """Second seed, 5: features of sparse disparities; the J views nearest in feature space become hypotheses.

    A feature is the mean of its posterior given the cells that are known, times the root of its component's length.
    That lies halfway between features that all count alike and features in pixels of disparity, where those of near
    things outweigh all others. Chosen on seeds from 1000 on, where it told the place best; how well a feature is known
    was left out of the distance: with it, views that know little won and lost for that alone.
    """

    Config = DisparityConfig
    name = "disparity"
    config: DisparityConfig
    needs = frozenset({"rgb", "right"})
    _basis: MissingPCA | None = None
    _shape: tuple[int, int]

    @property
    def basis(self) -> MissingPCA:
        """Of the disparities of the map's views, row by row, once fitted."""
        if self._basis is None:
            raise RuntimeError("Disparity knows no views yet: call fit(topo_map) first")
        return self._basis

    def describe(self, pictures: Pictures) -> Floats:
        """Features (features,) of a frame's stereo pair."""
        features: Floats = self._features(self.basis, self._cells(pictures)[None])[0]
        return features

    def distances(self, queries: Floats, others: Floats) -> Floats:
        """Euclidean distances (Q, V) between features (Q, features) and (V, features)."""
        return np.asarray(cdist(queries, others))

    def distances_between(self, images: Sequence[Image]) -> NoReturn:
        """Single pictures have no disparity. Raises ``UserError``."""
        raise UserError("disparity compares stereo pairs, and these are single pictures; choose another sensor")

    def _views_of(self, topo_map: TopoMap) -> Views:
        rights = [view.right for view in topo_map.views if view.right is not None]
        if not topo_map.views or len(rights) < len(topo_map.views):
            lack = f"{len(topo_map.views) - len(rights)} of its views lack it" if topo_map.views else "it has no views"
            raise UserError(
                f"map {topo_map.name!r}: {self.name} needs training views with a right picture each, and {lack}; "
                "name them in the column 'right' of views.csv, or choose another sensor"
            )
        views = super()._views_of(topo_map)
        return StereoViews(views.poses, views.images, views.on_nodes, rights)

    def _pictures(self, views: Views, index: int) -> Pictures:
        assert isinstance(views, StereoViews)
        return {"rgb": views.images[index], "right": views.rights[index]}

    def _learn(self, views: Sequence[Pictures]) -> Floats:
        rows, columns = views[0]["rgb"].shape[:2]
        self._shape = (max(3, round(self.config.columns * rows / columns)), self.config.columns)
        cells = np.stack([self._cells(pictures) for pictures in views])
        try:
            self._basis = missing_pca(cells, self.config.features, self.config.missing)
        except ValueError as error:
            raise UserError(f"{self.name}: {error}; take fewer features, more views, or a lower texture") from None
        return self._features(self._basis, cells)

    def _seen(self, pictures: Pictures) -> Floats | None:
        if self._is_blind(pictures):
            return None
        cells = self._cells(pictures)
        if np.isfinite(cells[np.isfinite(self.basis.mean)]).mean() < self.config.least_cells:
            return None
        features: Floats = self._features(self.basis, cells[None])[0]
        return features

    def _cells(self, pictures: Pictures) -> Floats:
        """Disparity of each cell (rows * columns,), per cent of the picture's width; NaN where unknown."""
        left, right = pictures["rgb"], pictures["right"]
        rows, columns = self._shape
        found = disparities(left, right, self.config.matching)
        cells = averaged(found, columns, rows, self.config.least_known).reshape(-1)
        return np.asarray(cells * (100.0 / left.shape[1]))

    @staticmethod
    def _features(basis: MissingPCA, cells: Floats) -> Floats:
        features: Floats = basis.project(cells)[0] * np.sqrt(basis.lengths)
        return features
