"""Panorama reconstruction from a turn of overlapping snapshots: the thesis's variant of IMA (2.2, Code 2.3)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from sensors.ima import IMAConfig, make_reference, slot_values
from sensors.images import clahe, grey, resize
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera
from topoloc.types import Image, Ints


@dataclass(frozen=True)
class PanoramaConfig:
    """Settings of the reconstruction.

    Attributes:
        slots: slots of IMA; more align better (5.1.2, 5.1.3).
        clahe: filter the snapshots with CLAHE, and write the panorama filtered, grey.
        scale_columns: columns of a snapshot while it is aligned.
        clahe_clip_limit: OpenCV's clip limit.
        clahe_tiles: tiles along each side of a snapshot.
        hfov_deg: horizontal field of view of a snapshot, degrees.
        start_deg: heading of the first snapshot's optical axis, degrees counter-clockwise.
    """

    slots: int = THESIS.panorama_slots
    clahe: bool = THESIS.clahe
    scale_columns: int = THESIS.scale_columns
    clahe_clip_limit: float = THESIS.clahe_clip_limit
    clahe_tiles: int = THESIS.clahe_tiles
    hfov_deg: float = Camera.hfov_deg
    start_deg: float = 0.0

    def __post_init__(self) -> None:
        if not 1 <= self.slots <= self.scale_columns:
            raise ValueError(f"slots is {self.slots}; it must lie between 1 and {self.scale_columns}")
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {self.hfov_deg}; it must lie between 0 and 180")
        if self.clahe_tiles < 1 or self.clahe_clip_limit <= 0.0:
            raise ValueError("clahe_tiles must be at least 1, and clahe_clip_limit positive")


@dataclass(frozen=True)
class Panorama:
    """A reconstructed circle.

    Attributes:
        image: uint8 (rows, columns[, 3]) at the snapshots' full size; black where nothing was inserted.
        columns: (S,) left column of each snapshot on ``image``, in the order given.
        headings: (S,) heading of each snapshot's optical axis [rad, ccw].
        heading: of the left edge of the first column [rad, ccw], as ``nodes.csv`` wants it.
        filled: share of the columns that some snapshot covers.
    """

    image: Image
    columns: Ints
    headings: Floats
    heading: float
    filled: float


class ThesisReconstruction:
    """The published method: IMA with Code 2.3, each snapshot placed where it matches what stands already.

    The search knows neither the step angle nor the odometry, so on real photographs it drifts wherever the exposure
    changes between neighbours.
    """

    Config = PanoramaConfig

    def __init__(self, config: PanoramaConfig | None = None) -> None:
        self.config = config or PanoramaConfig()

    def reconstruct(self, snapshots: Sequence[Image], progress: Callable[[int], None] | None = None) -> Panorama:
        """Align snapshots one after the other and paste them into a circle; each covers what it overlaps.

        Args:
            snapshots: RGB or grey, of one size, in the order they were taken, turning clockwise.
            progress: called with the number of snapshots done.

        Raises:
            UserError: no snapshots, or snapshots of different sizes.
        """
        _check(snapshots)
        rows, columns = snapshots[0].shape[:2]
        scale = self.config.scale_columns
        camera = Camera(self.config.hfov_deg, columns, rows)
        pictures = [_filtered(snapshot, self.config) for snapshot in snapshots]
        small_rows = round(scale * rows / columns)
        canvas = _Canvas.empty(small_rows, camera.panorama_columns(scale))
        lefts = []
        for done, picture in enumerate(pictures, start=1):
            small = resize(grey(picture), scale, small_rows).astype(np.float64)
            left = best_column(small, canvas, self.config.slots)
            canvas.insert(small, left)
            lefts.append(left)
            if progress is not None:
                progress(done)
        return _paste(pictures, np.array(lefts), canvas, camera, self.config.start_deg)


@dataclass
class _Canvas:
    """The circle while it grows: grey levels (rows, columns) at the matching scale, and which columns are filled."""

    pixels: Floats
    filled: np.ndarray

    @classmethod
    def empty(cls, rows: int, columns: int) -> _Canvas:
        """A circle on which nothing stands yet."""
        return cls(np.zeros((rows, columns)), np.zeros(columns, dtype=bool))

    def insert(self, picture: Floats, left: int) -> None:
        """Paste a picture with its left edge at a column; it covers what stands there."""
        at = (left + np.arange(picture.shape[1])) % self.pixels.shape[1]
        self.pixels[:, at] = picture
        self.filled[at] = True


def best_column(picture: Floats, canvas: _Canvas, slots: int) -> int:
    """Left column (0-based) of the best match of a picture on a growing circle: Code 2.1, then Code 2.3.

    Code 2.3 recognises black by a match of exactly 0.5; this asks whether the region is filled yet, as it means
    (EQUATIONS.md, 1): a slot over such a region counts as the mean of the slots to its left. A departure: a region
    that is filled in part counts as not filled, since the edge to the black would be matched as if it were seen.
    """
    if not canvas.filled.any():
        return 0  # "the first normal image is inserted on the very left" (2.2.1)
    width = picture.shape[1] // slots
    flat_variance = IMAConfig.flat_variance
    reference = make_reference(canvas.pixels[None], width, flat_variance, circular=True)
    value = slot_values(picture, reference, slots, flat_variance)[0]  # (columns, N_s)
    known = _windows_filled(canvas.filled, width)
    kept = np.where(np.arange(slots) == value.argmax(axis=1)[:, None], value, 0.0)
    total = np.zeros(len(known))
    for n in range(slots):
        at_slot = np.roll(kept[:, n], -n * width)
        mean_so_far = total / n if n else total
        total = total + np.where(np.roll(known, -n * width), at_slot, mean_so_far)
    return int(total.argmax())


def _windows_filled(filled: np.ndarray, width: int) -> np.ndarray:
    """Whether all columns of the slot-wide region that begins at each column are filled, around the circle."""
    return np.asarray(np.logical_and.reduce([np.roll(filled, -k) for k in range(width)]))


def _check(snapshots: Sequence[Image]) -> None:
    if not snapshots:
        raise UserError("a panorama needs snapshots; give at least two that overlap")
    sizes = {snapshot.shape[:2] for snapshot in snapshots}
    if len(sizes) > 1:
        listed = ", ".join(f"{columns}x{rows}" for rows, columns in sorted(sizes))
        raise UserError(f"the snapshots have different sizes ({listed}); scale them to one size")


def _filtered(snapshot: Image, config: PanoramaConfig) -> Image:
    if not config.clahe:
        return snapshot
    return clahe(grey(snapshot), config.clahe_clip_limit, config.clahe_tiles)


def _paste(pictures: list[Image], lefts: Ints, canvas: _Canvas, camera: Camera, start_deg: float) -> Panorama:
    """Paste the full-size pictures where their small ones matched, and turn columns into headings (2.2)."""
    columns = camera.panorama_columns()
    full = np.round(lefts * columns / len(canvas.filled)).astype(np.int64) % columns
    image = np.zeros((pictures[0].shape[0], columns, *pictures[0].shape[2:]), dtype=np.uint8)
    for picture, left in zip(pictures, full, strict=True):
        image[:, (left + np.arange(camera.width)) % columns] = picture
    per_column = 2.0 * np.pi / columns
    heading = np.deg2rad(start_deg) + (full[0] + camera.width / 2.0) * per_column
    headings = wrap(heading - (full + camera.width / 2.0) * per_column)
    return Panorama(image, full, headings, float(wrap(heading)), float(canvas.filled.mean()))
