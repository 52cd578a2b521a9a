"""Keypoints of a recording's frames that are found again in others, in coordinates that no picture size changes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from topoloc.errors import UnreadableImage
from topoloc.geometry import Floats
from topoloc.keypoints import LEAST_SUPPORT, Keypoints, pairs_of
from topoloc.recording import Recording
from topoloc.types import Image

MOST_ROWS = 480
"""Pictures are reduced to so many rows: keypoints are found sooner."""
KEPT = 32
"""Frames whose keypoints are kept."""
LEAST_CONTRAST = 2.0
"""A picture whose grey levels deviate by less is covered or dark."""


@dataclass(frozen=True)
class Matches:
    """What two frames both show, in half-widths of the picture from its middle: x to the right, y down.

    Attributes:
        first: index of a frame of the recording.
        second: index of another.
        before: (M, 2) places in the first.
        after: (M, 2) places of the same things in the second.
    """

    first: int
    second: int
    before: Floats
    after: Floats


class Matcher:
    """Finds the keypoints of frames, and those of two frames that are the same.

    Args:
        recording: with ``rgb`` pictures; its lens is taken out when they are read.
    """

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._kept: OrderedDict[int, tuple[Keypoints, tuple[int, int]]] = OrderedDict()

    def match(self, first: int, second: int) -> Matches | None:
        """What two frames both show; None where that is too little to tell anything, or one cannot be read."""
        (one, size), (other, other_size) = self._keypoints(first), self._keypoints(second)
        if size != other_size:
            return None
        pairs = pairs_of(one, other)
        upright = pairs.near(0.0)
        if upright.sum() < LEAST_SUPPORT:
            return None
        before, after = one.places[pairs.first[upright]], other.places[pairs.second[upright]]
        return Matches(first, second, from_middle(before, size), from_middle(after, size))

    def _keypoints(self, number: int) -> tuple[Keypoints, tuple[int, int]]:
        """Keypoints of a frame, and the size (width, height) of the picture that they were found in."""
        if number not in self._kept:
            picture = self._picture(number)
            size = (0, 0) if picture is None else (picture.shape[1], picture.shape[0])
            none = Keypoints(np.zeros((0, 2)), np.zeros(0), np.zeros((0, 128), dtype=np.float32))
            self._kept[number] = (none if picture is None else Keypoints.of(picture), size)
            if len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        self._kept.move_to_end(number)
        return self._kept[number]

    def _picture(self, number: int) -> Image | None:
        try:
            picture = self._recording.frame(self._recording.pictures["rgb"][number]).images["rgb"]
        except UnreadableImage:
            return None
        return reduced(picture) if picture.std() >= LEAST_CONTRAST else None


def from_middle(places: Floats, size: Sequence[int]) -> Floats:
    """Places (M, 2) in pixels of a picture of that size (width, height), in half-widths from its middle."""
    width, height = size
    return np.asarray((places - (0.5 * (width - 1), 0.5 * (height - 1))) / (0.5 * width))


def reduced(picture: Image) -> Image:
    """A picture of at most ``MOST_ROWS`` rows."""
    import cv2

    scale = MOST_ROWS / len(picture)
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1.0 else picture
    return np.asarray(small)
