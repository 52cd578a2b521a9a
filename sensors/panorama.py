"""Panoramas from a turn of overlapping snapshots (thesis 2.2, 4.1.2): what the methods of reconstruction share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np

from sensors.images import clahe, grey
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera
from topoloc.types import Image, Ints, Pixels


@dataclass(frozen=True)
class PanoramaConfig:
    """Settings that every method of reconstruction has.

    Attributes:
        hfov_deg: horizontal field of view of a snapshot, degrees.
        start_deg: heading of the first snapshot's optical axis, degrees counter-clockwise.
        clahe: filter the snapshots with CLAHE (2.2.2), and write the panorama filtered, grey.
        clahe_clip_limit: OpenCV's clip limit.
        clahe_tiles: tiles along each side of a snapshot.
    """

    hfov_deg: float = Camera.hfov_deg
    start_deg: float = 0.0
    clahe: bool = THESIS.clahe
    clahe_clip_limit: float = THESIS.clahe_clip_limit
    clahe_tiles: int = THESIS.clahe_tiles

    def __post_init__(self) -> None:
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {self.hfov_deg}; it must lie between 0 and 180")
        if not np.isfinite(self.start_deg):
            raise ValueError(f"start_deg is {self.start_deg}; it must be a number of degrees")
        if self.clahe_tiles < 1 or self.clahe_clip_limit <= 0.0:
            raise ValueError("clahe_tiles must be at least 1, and clahe_clip_limit positive")


@dataclass(frozen=True)
class Insertion:
    """Why a snapshot stands where it does, for whoever looks for the reason of a failure (4.1.2).

    Attributes:
        before: number of the snapshot that it was matched with, 0-based; None: with all that stood already.
        angles_deg: (C,) candidates: clockwise angle to the axis of ``before``, or from the first column [degrees].
        score: (C,) how well the pictures match there.
        prior: (C,) what speaks for a candidate without looking, to be added; None where nothing does.
        chosen_deg: the candidate taken.
        slots: (N_s,) match of each slot of IMA where it was inserted: 0 where another slot fits better, NaN over what
            is not filled yet; None where nothing was matched by slots.
    """

    before: int | None
    angles_deg: Floats
    score: Floats
    prior: Floats | None
    chosen_deg: float
    slots: Floats | None = None


@dataclass(frozen=True)
class Panorama:
    """A reconstructed circle.

    Attributes:
        image: uint8 (rows, columns[, 3]) at the snapshots' full size; black where nothing was inserted.
        columns: (S,) left column of each snapshot on ``image``, in the order given.
        headings: (S,) heading of each snapshot's optical axis [rad, ccw].
        heading: of the left edge of the first column [rad, ccw], as ``nodes.csv`` wants it.
        filled: share of the columns that some snapshot covers.
        gaps: (i, j, degrees) for snapshots i and j, 0-based, j next to i clockwise, that leave columns between them
            unseen; empty where the circle is closed.
        notes: what the user should know of it, a sentence each.
        insertions: (S,) the reason of each place.
    """

    image: Image
    columns: Ints
    headings: Floats
    heading: float
    filled: float
    gaps: tuple[tuple[int, int, float], ...] = ()
    notes: tuple[str, ...] = ()
    insertions: tuple[Insertion, ...] = ()


class GapTooWide(UserError):
    """Two neighbouring snapshots leave more unseen between them than a panorama may lack.

    Attributes:
        pair: their numbers, 0-based; the second lies clockwise of the first.
        panorama: what was reconstructed, with the gap, so that it can be looked at.
    """

    def __init__(self, pair: tuple[int, int], names: Sequence[str], panorama: Panorama, hint: str = "") -> None:
        self.pair, self.panorama = pair, panorama
        width = next(gap for first, second, gap in panorama.gaps if (first, second) == pair)
        super().__init__(
            f"{names[pair[0]]} and {names[pair[1]]} leave {width:.0f} degrees between them unseen, more than half a "
            f"view; take snapshots between them, or correct the field of view and the nominal step{hint}"
        )


def named(snapshots: Sequence[Image], names: Sequence[str] | None) -> Sequence[str]:
    """The names that messages use: those given, or the numbers from 1."""
    return names if names is not None else [f"snapshot {number}" for number in range(1, len(snapshots) + 1)]


def refuse_unusable(snapshots: Sequence[Image]) -> None:
    """Raise ``UserError`` where there are no snapshots, or where they differ in size or colour."""
    if not snapshots:
        raise UserError("a panorama needs snapshots; give at least two that overlap")
    sizes = {snapshot.shape[:2] for snapshot in snapshots}
    if len(sizes) > 1:
        listed = ", ".join(f"{columns}x{rows}" for rows, columns in sorted(sizes))
        raise UserError(f"the snapshots have different sizes ({listed}); scale them to one size")
    if len({snapshot.shape[2:] for snapshot in snapshots}) > 1:
        raise UserError("some snapshots are grey and others have colours; make all of them grey, or none")


def filtered(snapshot: Image, config: PanoramaConfig) -> Image:
    """A snapshot as it goes into the panorama: with CLAHE and grey (2.2.2), or as it is."""
    if not config.clahe:
        return snapshot
    return clahe(grey(snapshot), config.clahe_clip_limit, config.clahe_tiles)


def on_cylinder(picture: Pixels, hfov_deg: float, shape: tuple[int, int], per_rad: tuple[float, float]) -> Pixels:
    """A pinhole camera's picture on a cylinder around it, so that its columns are linear in angle.

    Args:
        picture: (rows, columns[, 3]) uint8 or float32; so is the result.
        hfov_deg: horizontal field of view, degrees.
        shape: rows and columns of the result, about the optical axis; what the camera did not see repeats its edge.
        per_rad: rows and columns of the result a radian.
    """
    rows, columns = picture.shape[:2]
    focal = columns / 2.0 / np.tan(np.deg2rad(hfov_deg) / 2.0)
    height, angle = ((np.arange(n) + 0.5 - n / 2.0) / scale for n, scale in zip(shape, per_rad, strict=True))
    x = np.broadcast_to(focal * np.tan(angle) + columns / 2.0 - 0.5, shape).astype(np.float32)
    y = (focal * height[:, None] / np.cos(angle) + rows / 2.0 - 0.5).astype(np.float32)
    return np.asarray(cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE))


def covering(pictures: Sequence[Image], lefts: Ints, columns: int) -> Image:
    """A circle on which each picture covers those before it (2.2.1): (rows, columns[, 3]).

    Args:
        pictures: (rows, width[, 3]).
        lefts: (S,) left column of each.
        columns: of the circle.
    """
    image = np.zeros((pictures[0].shape[0], columns, *pictures[0].shape[2:]), dtype=np.uint8)
    for picture, left in zip(pictures, lefts, strict=True):
        image[:, (left + np.arange(picture.shape[1])) % columns] = picture
    return image


def feathered(pictures: Sequence[Image], lefts: Ints, columns: int) -> Image:
    """A circle on which neighbours fade into each other linearly, all across their overlap: (rows, columns[, 3]).

    A picture weighs as much as its nearer edge is far; seams, which lower the match (5.1.2), vanish.

    Args:
        pictures: (rows, width[, 3]).
        lefts: (S,) left column of each.
        columns: of the circle.
    """
    width = pictures[0].shape[1]
    nearer_edge = np.minimum(np.arange(width), np.arange(width)[::-1]) + 0.5
    weight = nearer_edge.reshape(1, width, *(1,) * (pictures[0].ndim - 2)).astype(np.float32)
    levels = np.zeros((pictures[0].shape[0], columns, *pictures[0].shape[2:]), dtype=np.float32)
    total = np.zeros((1, columns, *(1,) * (pictures[0].ndim - 2)), dtype=np.float32)
    for picture, left in zip(pictures, lefts, strict=True):
        at = (left + np.arange(width)) % columns
        levels[:, at] += picture * weight
        total[:, at] += weight
    return np.rint(levels / np.maximum(total, 0.5)).astype(np.uint8)


def filled_columns(lefts: Ints, width: int, columns: int) -> np.ndarray:
    """Which columns (columns,) of a circle some picture ``width`` columns wide covers."""
    filled = np.zeros(columns, dtype=bool)
    filled[(lefts[:, None] + np.arange(width)) % columns] = True
    return filled


def gaps_between(headings: Floats, hfov_deg: float) -> tuple[tuple[int, int, float], ...]:
    """Neighbours around the circle that do not overlap: both their numbers, and the degrees between their views.

    Args:
        headings: (S,) of the optical axes [rad, ccw], in any order.
        hfov_deg: horizontal field of view of each, degrees.
    """
    clockwise = np.argsort(-wrap(headings), kind="stable")
    following = np.roll(clockwise, -1)
    apart = np.rad2deg(-np.diff(np.append(wrap(headings)[clockwise], wrap(headings)[clockwise[0]] - 2.0 * np.pi)))
    unseen = apart - hfov_deg
    return tuple(
        (int(first), int(second), float(gap))
        for first, second, gap in zip(clockwise, following, unseen, strict=True)
        if gap > 0.0
    )
