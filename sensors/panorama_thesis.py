"""Panorama reconstruction as published: the thesis's variant of IMA (2.2.1, Code 2.3)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from sensors.ima import IMAConfig
from sensors.images import grey, resize
from sensors.panorama import (
    Insertion,
    Panorama,
    PanoramaConfig,
    covering,
    filtered,
    gaps_between,
    refuse_unusable,
)
from sensors.slot_correlation import make_reference
from sensors.slot_matching import slot_values
from topoloc.geometry import Floats, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera
from topoloc.types import Image


@dataclass(frozen=True)
class ThesisConfig(PanoramaConfig):
    """Settings of the published method, beside those that every method has.

    Attributes:
        slots: slots of IMA; more align better (5.1.2, 5.1.3).
        scale_columns: columns of a snapshot while it is aligned.
    """

    slots: int = THESIS.panorama_slots
    scale_columns: int = THESIS.scale_columns

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 1 <= self.slots <= self.scale_columns:
            raise ValueError(f"slots is {self.slots}; it must lie between 1 and {self.scale_columns}")


class ThesisReconstruction:
    """The published method: IMA with Code 2.3, each snapshot placed where it matches what stands already.

    The search knows neither the step angle nor the odometry, so on real photographs it drifts wherever the exposure
    changes between neighbours.
    """

    Config = ThesisConfig

    def __init__(self, config: ThesisConfig | None = None) -> None:
        self.config = config or ThesisConfig()

    def reconstruct(
        self,
        snapshots: Sequence[Image],
        progress: Callable[[int], None] | None = None,
        names: Sequence[str] | None = None,
    ) -> Panorama:
        """Align snapshots one after the other and paste them into a circle; each covers what it overlaps.

        Args:
            snapshots: RGB or grey, of one size, in the order they were taken, turning clockwise.
            progress: called with the number of snapshots done.
            names: of the snapshots; no message of this method's needs them.

        Raises:
            UserError: no snapshots, or snapshots of different sizes.
        """
        refuse_unusable(snapshots)
        rows, columns = snapshots[0].shape[:2]
        scale = self.config.scale_columns
        camera = Camera(self.config.hfov_deg, columns, rows)
        pictures = [filtered(snapshot, self.config) for snapshot in snapshots]
        small_rows = round(scale * rows / columns)
        canvas = _Canvas.empty(small_rows, camera.panorama_columns(scale))
        lefts, insertions = [], []
        for done, picture in enumerate(pictures, start=1):
            small = resize(grey(picture), scale, small_rows).astype(np.float64)
            total, kept = column_values(small, canvas, self.config.slots)
            left = int(total.argmax())
            canvas.insert(small, left)
            lefts.append(left)
            insertions.append(_insertion(total, kept, left))
            if progress is not None:
                progress(done)
        return _paste(pictures, np.array(lefts), canvas, camera, self.config.start_deg, tuple(insertions))

    def explain(self, snapshots: Sequence[Image], made: Panorama, names: Sequence[str]) -> Iterator[tuple[str, bytes]]:
        """Pictures of every insertion (4.1.2): see ``sensors.panorama_pictures``."""
        from sensors.panorama_pictures import insertion_pictures

        pictures = [filtered(snapshot, self.config) for snapshot in snapshots]
        return insertion_pictures(pictures, made, names, covering)


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


def column_values(picture: Floats, canvas: _Canvas, slots: int) -> tuple[Floats, Floats]:
    """SUM of Code 2.3 for a picture at each left column of a growing circle, and what each slot adds to it.

    Code 2.3 recognises black by a match of exactly 0.5; this asks whether the region is filled yet, as it means
    (EQUATIONS.md, 1): a slot over such a region counts as the mean of the slots to its left. A departure: a region
    that is filled in part counts as not filled, since the edge to the black would be matched as if it were seen.

    Args:
        picture: (rows, width) grey levels.
        canvas: the circle, C columns.
        slots: N_s.

    Returns:
        SUM (C,), 0 on an empty circle: "the first normal image is inserted on the very left" (2.2.1); and the match of
        each slot (C, N_s), NaN where it lies over what is not filled.
    """
    columns = len(canvas.filled)
    if not canvas.filled.any():
        return np.zeros(columns), np.full((columns, slots), np.nan)
    width = picture.shape[1] // slots
    flat_variance = IMAConfig.flat_variance
    reference = make_reference(canvas.pixels[None], width, flat_variance, circular=True)
    value = slot_values(picture, reference, slots, flat_variance)[0]  # (columns, N_s)
    known = _windows_filled(canvas.filled, width)
    kept = np.where(np.arange(slots) == value.argmax(axis=1)[:, None], value, 0.0)
    total, at_slots = np.zeros(columns), np.full((columns, slots), np.nan)
    for n in range(slots):
        seen = np.roll(known, -n * width)
        at_slots[seen, n] = np.roll(kept[:, n], -n * width)[seen]
        mean_so_far = total / n if n else total
        total = total + np.where(seen, at_slots[:, n], mean_so_far)
    return total, at_slots


def _windows_filled(filled: np.ndarray, width: int) -> np.ndarray:
    """Whether all columns of the slot-wide region that begins at each column are filled, around the circle."""
    return np.asarray(np.logical_and.reduce([np.roll(filled, -k) for k in range(width)]))


def _insertion(total: Floats, kept: Floats, left: int) -> Insertion:
    angles = np.linspace(0.0, 360.0, len(total), endpoint=False)
    return Insertion(None, angles, total, None, float(angles[left]), kept[left])


def _paste(
    pictures: list[Image],
    lefts: np.ndarray,
    canvas: _Canvas,
    camera: Camera,
    start_deg: float,
    insertions: tuple[Insertion, ...],
) -> Panorama:
    """Paste the full-size pictures where their small ones matched, and turn columns into headings (2.2)."""
    columns = camera.panorama_columns()
    full = np.round(lefts * columns / len(canvas.filled)).astype(np.int64) % columns
    per_column = 2.0 * np.pi / columns
    heading = np.deg2rad(start_deg) + (full[0] + camera.width / 2.0) * per_column
    headings = wrap(heading - (full + camera.width / 2.0) * per_column)
    filled = float(canvas.filled.mean())
    return Panorama(
        covering(pictures, full, columns),
        full,
        headings,
        float(wrap(heading)),
        filled,
        gaps_between(headings, camera.hfov_deg),
        () if filled == 1.0 else (_note_on_gaps(filled),),
        insertions,
    )


def _note_on_gaps(filled: float) -> str:
    return (
        f"{(1.0 - filled) * 360.0:.0f} degrees of the circle stay empty: the snapshots do not close it, or some were "
        f"placed wrongly; look at the picture, or take the method 'circle'"
    )
