"""Keypoints of pictures, which of them are the same in two pictures, and the turn that most of these agree on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.images import grey
from topoloc.geometry import Floats, wrap
from topoloc.types import Image, Ints

Kind = Literal["sift", "orb"]
Descriptors = NDArray[np.float32]
Mask = NDArray[np.bool_]
BINS_PER_WINDOW = 3
"""Votes are counted in bins; so many neighbouring ones are what counts as agreeing."""
BLOCK = 8192
"""Keypoints of pictures that a frame's are compared with at a time: 20 MB of products for a frame of 600."""
SEAM = 0.02
"""Share of a full circle that is repeated at its end, so that keypoints on the seam are found."""


@dataclass(frozen=True)
class Keypoints:
    """N keypoints of a picture.

    Attributes:
        descriptors: (N, D) of length one, so that their products tell how alike they are.
        angles: (N,) where each is seen, counter-clockwise [rad]: from the optical axis, or from the first column of a
            full circle.
    """

    descriptors: Descriptors
    angles: Floats

    def __len__(self) -> int:
        return len(self.angles)


class Detector:
    """Keypoints by OpenCV: SIFT (Lowe, 2004) or ORB (Rublee et al., 2011).

    Args:
        kind: which.
        most: keypoints of a frame, those of the strongest response; a full circle has as many more as it is wider.
    """

    def __init__(self, kind: Kind, most: int) -> None:
        self.kind, self.most = kind, most

    def of_frame(self, image: Image, hfov_deg: float) -> Keypoints:
        """Of a frame as a pin-hole camera sees it."""
        columns, descriptors = self._found(grey(image), self.most)
        middle = image.shape[1] / 2.0
        focal = middle / np.tan(np.deg2rad(hfov_deg) / 2.0)
        return Keypoints(descriptors, np.arctan2(middle - columns, focal))

    def of_circle(self, panorama: Image, hfov_deg: float) -> Keypoints:
        """Of a panorama, a full circle whose columns run clockwise and are linear in angle; it has no seam."""
        plain, width = grey(panorama), panorama.shape[1]
        margin = round(SEAM * width)
        around = np.concatenate([plain[:, -margin:], plain, plain[:, :margin]], axis=1)
        columns, descriptors = self._found(around, round(self.most * 360.0 / hfov_deg))
        inside = (columns >= margin) & (columns < margin + width)
        return Keypoints(descriptors[inside], (margin - columns[inside]) * 2.0 * np.pi / width)

    def _found(self, plain: Image, most: int) -> tuple[Floats, Descriptors]:
        """Columns (N,) and descriptors (N, D) of a grey picture's keypoints; N may be 0."""
        detector = cv2.SIFT.create(most) if self.kind == "sift" else cv2.ORB.create(most)
        points, raw = detector.detectAndCompute(np.ascontiguousarray(plain), None)
        if raw is None or len(points) == 0:
            return np.zeros(0), np.zeros((0, detector.descriptorSize() * (1 if self.kind == "sift" else 8)), np.float32)
        columns = np.array([point.pt[0] + 0.5 for point in points])  # OpenCV counts from the middle of a pixel
        if self.kind == "orb":
            raw = (
                2.0 * np.unpackbits(np.asarray(raw, dtype=np.uint8), axis=1) - 1.0
            )  # a product of signs falls linearly with the Hamming distance
        unit = raw / np.maximum(np.linalg.norm(raw, axis=1, keepdims=True), 1e-12)
        return columns, np.asarray(unit, dtype=np.float32)


class References:
    """Keypoints of V pictures of a map, ready to be compared with those of a frame.

    Args:
        pictures: their keypoints.
        headings: (V,) what the angles of each count from [rad].
        kind: of keypoints.
        ratio: a match counts where the second nearest keypoint of the picture is farther by at least this factor.
    """

    def __init__(self, pictures: Sequence[Keypoints], headings: Floats, kind: Kind, ratio: float) -> None:
        counts = np.array([len(picture) for picture in pictures])
        self._angles = np.zeros((len(pictures), counts.max(initial=2)))
        for row, picture, heading in zip(self._angles, pictures, headings, strict=True):
            row[: len(picture)] = heading + picture.angles
        self._enough = counts >= 2
        # 1 - product is half the squared Euclid distance of SIFT, and the Hamming distance of ORB in units of half of D
        self._ratio = ratio**2 if kind == "sift" else ratio
        self._blocks: list[tuple[Ints, Descriptors]] = []
        left = np.argsort(-counts, kind="stable")  # alike many together, so that little of a block is empty
        while len(left):
            width = max(2, int(counts[left[0]]))
            some, left = np.split(left, [max(1, BLOCK // width)])
            block = np.zeros((len(some), width, pictures[0].descriptors.shape[1]), np.float32)
            for filled, index in zip(block, some, strict=True):
                filled[: counts[index]] = pictures[index].descriptors
            self._blocks.append((some, block))

    def __len__(self) -> int:
        return len(self._angles)

    def matches(self, seen: Keypoints) -> tuple[Floats, Mask]:
        """By how much the picture of each match says that the camera is turned.

        Returns:
            Headings (V, N) of the optical axis [rad], and which of them are matches: (V, N), by the ratio test.
        """
        count, pictures = len(seen), len(self)
        best, passed = np.empty((count, pictures), np.int64), np.empty((count, pictures), np.bool_)
        for some, block in self._blocks:
            products = (seen.descriptors @ block.reshape(-1, block.shape[2]).T).reshape(count, *block.shape[:2])
            at = products.argmax(axis=2)[..., None]
            nearest = np.take_along_axis(products, at, axis=2)[..., 0]
            np.put_along_axis(products, at, -1.0, axis=2)
            best[:, some] = at[..., 0]
            passed[:, some] = 1.0 - nearest < self._ratio * (1.0 - products.max(axis=2))
        angles = self._angles[np.arange(pictures), best]
        return np.asarray((angles - seen.angles[:, None]).T), (passed & self._enough).T


def agreed(headings: Floats, counts: Mask, window: float) -> tuple[Floats, Floats]:
    """The heading that most matches agree on, to within a window.

    Args:
        headings: (V, N) [rad], a vote each.
        counts: (V, N) which votes count.
        window: how far votes that agree may lie apart [rad].

    Returns:
        The mean (V,) of the votes that agree [rad], -pi to pi, and how many they are (V,).
    """
    bins = max(BINS_PER_WINDOW, round(2.0 * np.pi / window * BINS_PER_WINDOW))
    size = 2.0 * np.pi / bins
    cell = np.floor(np.mod(headings, 2.0 * np.pi) / size).astype(np.int64) % bins
    row, column = np.nonzero(counts)
    flat = np.bincount(row * bins + cell[row, column], minlength=len(headings) * bins).reshape(-1, bins)
    reach = BINS_PER_WINDOW // 2
    best = np.sum([np.roll(flat, shift, axis=1) for shift in range(-reach, reach + 1)], axis=0).argmax(axis=1)
    middle = (best[:, None] + 0.5) * size
    off = wrap(headings - middle)
    near = counts & (np.abs(off) <= (reach + 0.5) * size)
    votes = near.sum(axis=1)
    mean = (off * near).sum(axis=1) / np.maximum(votes, 1)
    return wrap(middle[:, 0] + mean), votes.astype(np.float64)
