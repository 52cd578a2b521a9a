"""Any descriptor of a picture as a sensor: a function, a network, vectors computed beforehand, or a small grey picture.

Who has a place-recognition model gets every estimator, by a function in Python,

    Descriptor(function=lambda picture: model(picture))

by an ONNX file, ``model=FILE``, or by vectors that were computed elsewhere: ``map_vectors=FILE``, a row for each of the
map's training views in their order (``views.csv``), or for a map of panoramas for each view that is cut from them
(``sensors.images.views_of``); and ``frame_vectors=FILE``, a row for each frame, whose times stand in the same order in
``frame_times=FILE``: the recording's own ``rgb.txt`` will do.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import ArrayLike

from sensors.images import MOST_COLUMNS, Views, grey, resize
from sensors.nearest import Cosine, Euclid, Search
from sensors.onnx_model import OnnxModel, Runtime
from sensors.precomputed import FrameVectors, read_vectors
from sensors.view_sensor import Pictures, ViewConfig, ViewSensor
from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image

VECTOR = "vector"
"""Beside the kinds of images: a picture's vector, where it was computed beforehand."""


@dataclass(frozen=True)
class DescriptorConfig(ViewConfig):
    """Settings of the descriptor sensor.

    Attributes:
        distance: ``cosine``: 1 less the cosine of the angle between two vectors; ``euclidean``.
        columns: of the small grey picture that is the descriptor where nothing else is set; its rows keep the aspect.
        model: ONNX file of a network, one picture in and one vector out.
        width, height: that pictures are scaled to for the model; 0: what the file says.
        mean, std: taken off the model's pictures by channel (red, green, blue), and divided by, where levels run from
            0 to 1; one value or three; none: 0 and 1.
        runtime: that runs the model: ``opencv``, or ``onnxruntime``, which is to be installed.
        map_vectors: .npy file of a row for each view of the map, in their order.
        frame_vectors: .npy file of a row for each frame of the recording.
        frame_times: text file of a line for each of these rows, its first word the frame's time [s]: rgb.txt.
    """

    slope: float = 18.0
    margin: float = -0.107
    log_floor: float = -2.12
    distance: Literal["cosine", "euclidean"] = "cosine"
    columns: int = 32
    model: str = ""
    width: int = 0
    height: int = 0
    mean: tuple[float, ...] = ()
    std: tuple[float, ...] = ()
    runtime: Runtime = "opencv"
    map_vectors: str = ""
    frame_vectors: str = ""
    frame_times: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 2 <= self.columns <= MOST_COLUMNS:
            raise ValueError(f"columns is {self.columns}; it must lie between 2 and {MOST_COLUMNS}")
        if self.width < 0 or self.height < 0:
            raise ValueError("width and height must not be negative")
        if any(value <= 0.0 for value in self.std):
            raise ValueError("std must be positive")
        files = [bool(name) for name in (self.map_vectors, self.frame_vectors, self.frame_times)]
        if any(files) and not all(files):
            raise ValueError("map_vectors, frame_vectors and frame_times belong together; set all three")
        if not self.model and (self.width or self.height or self.mean or self.std):
            raise ValueError("width, height, mean and std are a model's; set model, too")
        if self.model and any(files):
            raise ValueError("model and map_vectors are both set; choose one")


class Descriptor(ViewSensor):
    """Any function from picture to vector, compared by cosine or Euclid; the nearest views are the hypotheses.

    Args:
        config: settings.
        function: from a picture (rows, cols, 3), uint8, RGB, to a vector; any shape is flattened. It goes before what
            the settings name.

    Raises:
        UserError: a file that the settings name cannot be used.
    """

    Config = DescriptorConfig
    name = "descriptor"

    def __init__(
        self, config: DescriptorConfig | None = None, function: Callable[[Image], ArrayLike] | None = None
    ) -> None:
        super().__init__(config)
        settings: DescriptorConfig = self.config
        self._function: Callable[[Image], ArrayLike] = function or self._small
        self._aspect: float | None = None  # of the map's camera: views cut from panoramas are rounded
        self._map_rows: Floats | None = None
        if function is not None:
            return
        if settings.model:
            size = settings.width, settings.height
            self._function = OnnxModel(Path(settings.model), size, settings.mean, settings.std, settings.runtime)
        if settings.map_vectors:
            self._map_rows = read_vectors(Path(settings.map_vectors))
            self._frame_rows = FrameVectors.read(Path(settings.frame_vectors), Path(settings.frame_times))

    def fit(self, topo_map: TopoMap) -> None:
        """Vectors of the map's views, or of views cut from its panoramas, and the scale of their distances.

        Raises:
            UserError: the map has not what is needed, or vectors are not as many as its views.
        """
        self._aspect = topo_map.camera.height / topo_map.camera.width
        super().fit(topo_map)

    def describe(self, pictures: Pictures) -> Any:
        """A picture's vector (D,); for cosine float32 of length one, for Euclid float64.

        Raises:
            UserError: it is empty, or holds what is no finite number, or is of another length than the map's.
        """
        if self._map_rows is not None:
            if VECTOR not in pictures:
                raise UserError("map_vectors are of one map's views alone; for other pictures set model, or a function")
            return self._scaled(pictures[VECTOR])
        image = pictures["rgb"]
        colour: Any = image if image.ndim == 3 else cv2.cvtColor(image, cv2.COLOR_GRAY2RGB)
        vector = np.asarray(self._function(colour), dtype=np.float64).ravel()
        if not len(vector) or not np.isfinite(vector).all():
            what = "holds what is no finite number" if len(vector) else "is empty"
            raise UserError(f"the descriptor of a picture {what}; correct the function or the model")
        return self._scaled(vector)

    def distances(self, queries: Any, others: Any) -> Floats:
        """Distances (Q, V) between vectors (Q, D) and (V, D) as ``describe`` gives them: one product of matrices."""
        products = queries @ others.T
        if self.config.distance == "cosine":
            return np.asarray(np.maximum(1.0 - products.astype(np.float64), 0.0))
        squares = [np.einsum("nd,nd->n", some, some) for some in (queries, others)]
        return np.asarray(np.sqrt(np.maximum(squares[0][:, None] + squares[1] - 2.0 * products, 0.0)))

    def observe_many(self, frames: Sequence[Frame]) -> list[Evidence]:
        """What ``observe`` says of each frame, but for rounding; comparing all with the views at once is faster."""
        if self._map_rows is None or self._views is None:
            return super().observe_many(frames)
        return super().observe_many([self._with_vector(frame) for frame in frames])

    def _with_vector(self, frame: Frame) -> Frame:
        row = self._frame_rows.at(frame.timestamp)
        return replace(frame, images={"rgb": frame.images["rgb"], VECTOR: row})

    def _key(self) -> object:
        """Of the small grey picture: nobody knows what a function does, and a model's weights can lie anywhere."""
        return (1, self.config.distance, self.config.columns) if self._function == self._small else None

    def _search_of(self, descriptors: Any) -> Search:
        return Cosine(descriptors) if self.config.distance == "cosine" else Euclid(descriptors)

    def _seen(self, pictures: Pictures) -> Any:
        seen = super()._seen(pictures)
        if seen is not None and len(seen) != self._descriptors.shape[1]:
            raise UserError(
                f"a descriptor has {len(seen)} numbers, and those of the map's views {self._descriptors.shape[1]}; "
                "make both by the same model from pictures of one size"
            )
        return seen

    def _views_of(self, topo_map: TopoMap) -> Views:
        views = super()._views_of(topo_map)
        if self._map_rows is not None and len(self._map_rows) != len(views.images):
            kind = "views that are cut from its panoramas" if views.on_nodes else "training views"
            raise InputError(
                self.config.map_vectors,
                f"has {len(self._map_rows)} rows, and map {topo_map.name!r} {len(views.images)} {kind}",
                "write a row for each, in their order",
            )
        return views

    def _pictures(self, views: Views, index: int) -> Pictures:
        pictures = super()._pictures(views, index)
        return pictures if self._map_rows is None else {**pictures, VECTOR: self._map_rows[index]}

    def _learn(self, views: Sequence[Pictures]) -> Any:
        vectors = [self.describe(pictures) for pictures in views]
        lengths = sorted({len(vector) for vector in vectors})
        if len(lengths) > 1:
            raise UserError(f"descriptors have from {lengths[0]} to {lengths[-1]} numbers; they must have the same")
        return np.stack(vectors)

    def _scaled(self, vector: Floats) -> Any:
        """As it is compared. Squares of distances are differences of large numbers, for which float32 is too coarse."""
        plain = np.asarray(vector, dtype=np.float64)
        if self.config.distance == "euclidean":
            return plain
        return (plain / max(float(np.linalg.norm(plain)), np.finfo(float).tiny)).astype(np.float32)

    def _small(self, image: Image) -> Floats:
        """A small grey picture of mean 0 and norm 1: its cosine is the correlation of whole pictures."""
        aspect = self._aspect or image.shape[0] / image.shape[1]
        rows = max(1, round(self.config.columns * aspect))
        small = resize(grey(image), self.config.columns, rows).astype(np.float64).ravel()
        centred = small - small.mean()
        return np.asarray(centred / max(float(np.linalg.norm(centred)), np.finfo(float).tiny))
