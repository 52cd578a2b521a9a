"""A coarse stage before IMA on large maps (ours): which panoramas are worth to be matched slot by slot.

Frame and panoramas are made as small as stamps, their contrast is made alike all over, and the stamp of the frame is
correlated with every place of every panorama's, as one slot; both also zoomed in by as much as IMA zooms.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sensors.digital_zoom import scaled
from sensors.local_contrast import local_contrast
from sensors.slot_correlation import Reference, make_reference
from sensors.slot_matching import match_frames, sums_within
from topoloc.map_store import precomputed
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Image, Ints, Pixels

COLUMNS = 24
"""Of a frame's stamp."""
CONTRAST_SHARE, CONTRAST_GREY = 1.0 / 12.0, 3.0
"""Window that contrast is measured in, as a share of a frame's width, and contrast that stays as it is [grey levels];
the robust IMA's (``sensors.robust_ima``)."""
FLAT = 1e-3
"""Variance of contrast below which a place says nothing."""
TOGETHER = 256
"""Panoramas whose stamps are matched together."""
KEPT_MB = 256.0
"""For transforms of stamps at one zoom: those of some 13,000 panoramas [MB]."""


@dataclass(frozen=True)
class CoarseStage:
    """Stamps of a map's panoramas, and which of them a frame is like.

    Attributes:
        camera: of map and frames.
        zooms: of the panoramas: 1, and the farthest that IMA tries.
        references: the stamps of all panoramas for each zoom.
    """

    camera: Camera
    zooms: Sequence[float]
    references: Sequence[Reference]

    @classmethod
    def fitted(
        cls, topo_map: TopoMap, zoom: float, circle_of: Callable[[Node], Image], filtering: tuple[object, ...]
    ) -> CoarseStage:
        """A coarse stage for a map; its stamps are kept beside the map (``topoloc.map_store``).

        Args:
            topo_map: with a panorama at each node.
            zoom: the farthest that IMA tries, of panoramas.
            circle_of: the panorama of a node, grey and filtered.
            filtering: what ``circle_of`` depends on besides the node.
        """
        zooms = [1.0, zoom] if zoom > 1.0 else [1.0]
        key = COLUMNS, CONTRAST_SHARE, CONTRAST_GREY, FLAT, zooms, filtering
        known = precomputed(topo_map, "stamps", key, lambda: _stamps_of(topo_map, zooms, circle_of))
        references = [
            Reference(known[f"stamps_{number}"], known[f"scales_{number}"], COLUMNS, True, KEPT_MB, TOGETHER)
            for number in range(len(zooms))
        ]
        return cls(topo_map.camera, zooms, references)

    def candidates(self, picture: Image, count: int) -> Ints:
        """Indices (count,) of the panoramas that a frame is most like, ascending.

        Args:
            picture: the frame, grey, at full size, filtered as the panoramas are.
            count: at most the number of panoramas.
        """
        frames = [frame_stamp(picture, self.camera, 1.0 / (2.0 - zoom)) for zoom in self.zooms]
        sums = partial(sums_within, slack=0)
        found = match_frames(frames, self.references[0], 1, FLAT, sums)
        for wider in self.references[1:]:
            found += match_frames(frames[:1], wider, 1, FLAT, sums)
        value = np.max([matches.value for matches in found], axis=0)
        return np.sort(np.argpartition(-value, count - 1)[:count])

    def put(self, index: int, circle: Image) -> None:
        """Give a panorama, by index, another picture: grey, filtered."""
        for zoom, reference in zip(self.zooms, self.references, strict=True):
            stamp = circle_stamp(circle, self.camera, zoom)
            reference.put(index, make_reference(stamp[None], reference.slot_width, FLAT, circular=True))


def _stamps_of(topo_map: TopoMap, zooms: Sequence[float], circle_of: Callable[[Node], Image]) -> dict[str, Pixels]:
    """Stamps of all panoramas and their scales, by name; a panorama at a time is in memory at full size."""
    made: list[list[Pixels]] = [[] for _ in zooms]
    for node in topo_map.nodes:
        circle = circle_of(node)
        for stamps, zoom in zip(made, zooms, strict=True):
            stamps.append(circle_stamp(circle, topo_map.camera, zoom))
    arrays: dict[str, Pixels] = {}
    for number, stamps in enumerate(made):
        together = arrays[f"stamps_{number}"] = np.stack(stamps)
        arrays[f"scales_{number}"] = make_reference(together, COLUMNS, FLAT, circular=True).scales
    return arrays


def _rows(camera: Camera) -> int:
    return max(1, round(COLUMNS * camera.height / camera.width))


def frame_stamp(picture: Image, camera: Camera, zoom: float) -> NDArray[np.float16]:
    """(rows, ``COLUMNS``) of a frame, grey and filtered, zoomed in."""
    return _even(scaled(picture, COLUMNS, _rows(camera), zoom, zoom), circular=False)


def circle_stamp(circle: Image, camera: Camera, zoom: float) -> NDArray[np.float16]:
    """(rows, columns) of a panorama, grey and filtered, zoomed in: it is cropped in height and grows wider."""
    return _even(scaled(circle, camera.panorama_columns(COLUMNS), _rows(camera), 1.0, zoom), circular=True)


def _even(stamp: Image, circular: bool) -> NDArray[np.float16]:
    return local_contrast(stamp, CONTRAST_SHARE * COLUMNS, CONTRAST_GREY, circular).astype(np.float16)
