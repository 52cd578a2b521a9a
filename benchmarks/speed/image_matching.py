"""IMA, one frame against many panoramas, beside template matching of other libraries used as the thesis says.

Code 2.1 and 2.2: each slot of the frame is correlated with each panorama, every column keeps its best slot, and the
slots are added up in order. That ours and the library's answers can be compared at all, no picture has a flat region:
for a flat slot OpenCV answers 1 everywhere and scikit-image 0, where c* is 0.5.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.speed.case import Case, Pair
from benchmarks.speed.pictures import noise_pictures
from sensors.slot_correlation import make_reference
from sensors.slot_matching import match_slots
from topoloc.geometry import Floats
from topoloc.types import Image, Ints

ROWS, COLUMNS, FRAME_COLUMNS, SLOTS = 54, 648, 72, 8
"""Of a scaled panorama and frame (4.1.1)."""
SLOT_COLUMNS = FRAME_COLUMNS // SLOTS
FLAT_VARIANCE = 1.0 / 12.0
"""As ``IMAConfig`` has it [grey level^2]; no picture here has a region that is so flat."""
SAME_VALUE = 1e-4
"""Values that differ by less are the same, and so are columns whose sums do."""
SAME_SLOT = 1e-5
"""A slot that beats the others by less at a column is drawn by rounding; such a panorama is not compared."""
MOST_DRAWN = 0.2
"""Share of the panoramas that may be left out of the comparison so."""
TURNED = 200
"""Column of the panorama that the frame was cut from."""

Singles = NDArray[np.float32]
Correlate = Callable[[Singles, Singles], Floats]
"""(picture (rows, N), slot (rows, w)) -> correlation coefficients (N - w + 1,)."""


@dataclass(frozen=True)
class Scene:
    """A frame, and panoramas of which it shows a part of the last.

    Attributes:
        count: K, panoramas.
    """

    count: int

    @cached_property
    def panoramas(self) -> Image:
        """(K, rows, columns)."""
        return noise_pictures(np.random.default_rng(self.count), self.count, ROWS, COLUMNS)

    @cached_property
    def frame(self) -> Image:
        """(rows, columns of a frame): darker than the panorama, with less contrast, and noisy."""
        cut = self.panoramas[-1][:, TURNED : TURNED + FRAME_COLUMNS].astype(np.float64)
        noisy = 20.0 + 0.7 * cut + np.random.default_rng(0).normal(0.0, 5.0, cut.shape)
        return np.asarray(np.clip(np.rint(noisy), 0, 255), dtype=np.uint8)


@dataclass(frozen=True)
class Found:
    """What a peer answers.

    Attributes:
        sums: (K, columns) SUM of Code 2.2, by N_s.
        leads: (K,) by how much the best slot beats the second at the column where that is least.
    """

    sums: Floats
    leads: Floats


def opencv_correlation(picture: Singles, slot: Singles) -> Floats:
    """By ``matchTemplate``."""
    import cv2

    return np.asarray(cv2.matchTemplate(picture, slot, cv2.TM_CCOEFF_NORMED)[0])


def skimage_correlation(picture: Singles, slot: Singles) -> Floats:
    """By ``match_template``, which without ``pad_input`` gives the places where the slot lies within the picture."""
    from skimage import feature

    match: Correlate = feature.match_template
    return np.asarray(match(picture, slot)[0])


class TemplateMatching:
    """The peer: a call of the library for each panorama and slot, the second step in plain numpy.

    Its panoramas have been continued beyond their ends, so that a slot can lie across them.
    """

    def __init__(self, scene: Scene, correlate: Correlate) -> None:
        panoramas, frame = scene.panoramas.astype(np.float32), scene.frame.astype(np.float32)  # OpenCV likes it best
        self._circles = np.concatenate([panoramas, panoramas[:, :, : SLOT_COLUMNS - 1]], axis=2)
        self._slots = [np.ascontiguousarray(slot) for slot in np.split(frame, SLOTS, axis=1)]
        self._correlate = correlate

    def find(self) -> tuple[Floats, Ints]:
        """MAX and COL of each panorama, (K,) each."""
        sums = np.stack([self._sums(self._values(circle)) for circle in self._circles])
        return sums.max(axis=1), sums.argmax(axis=1)

    def explained(self) -> Found:
        """The same with what is needed to compare."""
        values = [self._values(circle) for circle in self._circles]
        ordered = (np.partition(value, SLOTS - 2, axis=0) for value in values)
        leads = np.array([(best[-1] - best[-2]).min() for best in ordered])
        return Found(np.stack([self._sums(value) for value in values]), leads)

    def _values(self, circle: Singles) -> Floats:
        """(N_s, columns) c* of Code 2.1."""
        return 0.5 + 0.5 * np.stack([self._correlate(circle, slot) for slot in self._slots])

    def _sums(self, values: Floats) -> Floats:
        """(columns,) of Code 2.2, by N_s."""
        kept = np.where(np.arange(SLOTS)[:, None] == values.argmax(axis=0), values, 0.0)
        return np.asarray(sum(np.roll(kept[n], -n * SLOT_COLUMNS) for n in range(SLOTS))) / SLOTS


def ima_match(count: int, peer: str, correlate: Correlate, packages: tuple[str, ...] = ()) -> Case:
    """Ours beside a library's template matching.

    Args:
        count: panoramas.
        peer: the library, for people.
        correlate: its template matching.
        packages: that it needs, by the names they are imported by.
    """
    size = f"{count:,} panoramas x {SLOTS} slots"
    return Case("sensors", "ima", size, peer, packages, partial(_pair, Scene(count), correlate))


def _pair(scene: Scene, correlate: Correlate) -> Pair:
    ours = _ours(scene)
    peers = TemplateMatching(scene, correlate)
    return Pair(ours, peers.find, lambda: same_matches(*ours(), peers.explained()))


def _ours(scene: Scene) -> Callable[[], tuple[Floats, Ints]]:
    reference = make_reference(scene.panoramas, SLOT_COLUMNS, FLAT_VARIANCE, circular=True)

    def find() -> tuple[Floats, Ints]:
        matches = match_slots(scene.frame, reference, SLOTS, FLAT_VARIANCE)
        return matches.value, matches.column

    return find


def same_matches(value: Floats, column: Ints, peers: Found) -> bool:
    """Whether values (K,) and columns (K,) are the peer's, wherever rounding does not draw the slot of a column."""
    clear = peers.leads > SAME_SLOT
    best, there = peers.sums.max(axis=1), np.take_along_axis(peers.sums, column[:, None], axis=1)[:, 0]
    same = (np.abs(value - best) < SAME_VALUE) & (best - there < SAME_VALUE)
    return bool(same[clear].all() and clear.mean() >= 1.0 - MOST_DRAWN)
