"""Pictures held against each other by SIFT keypoints: which way round they are, and where a frame lies on a circle."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from topoloc.geometry import Floats
from topoloc.types import Image

MOST_KEYPOINTS = 800
RATIO = 0.75
"""A keypoint is found again where the second best is farther by this factor (Lowe's test)."""
ANGLE_DEG = 25.0
"""Orientations of the same keypoint in two pictures agree to so much, but for a picture that stands on its head."""
LEAST_SUPPORT = 15
"""Fewer keypoints found again tell nothing."""
MAJORITY = 3.0
"""One way round must find so many times more of them than any other."""

WayRound = Literal["same", "mirrored", "rotated by 180 degrees", "upside down"]
"""How one picture lies to another: as it is, flipped left to right, turned by half a turn, flipped top to bottom."""


@dataclass(frozen=True)
class Keypoints:
    """SIFT keypoints of a picture.

    Attributes:
        places: (K, 2) column and row, pixels.
        angles: (K,) orientations, degrees.
        descriptors: (K, 128).
    """

    places: Floats
    angles: Floats
    descriptors: Any

    @classmethod
    def of(cls, picture: Image) -> Keypoints:
        """Those of a picture, grey or RGB."""
        import cv2

        grey = picture if picture.ndim == 2 else cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY)
        found, descriptors = cv2.SIFT.create(MOST_KEYPOINTS).detectAndCompute(grey, None)
        places = np.array([point.pt for point in found], dtype=np.float64).reshape(-1, 2)
        angles = np.array([point.angle for point in found], dtype=np.float64)
        return cls(places, angles, np.zeros((0, 128), dtype=np.float32) if descriptors is None else descriptors)


@dataclass(frozen=True)
class Pairs:
    """Keypoints of one picture found again in another: indices (M,) of both, and the turn (M,) of each, degrees."""

    first: np.ndarray
    second: np.ndarray
    turns: Floats

    def near(self, turn: float) -> np.ndarray:
        """Which of them are turned by about so many degrees."""
        return np.asarray(np.abs((self.turns - turn + 180.0) % 360.0 - 180.0) < ANGLE_DEG)


def pairs_of(first: Keypoints, second: Keypoints) -> Pairs:
    """Keypoints found again, each the other's nearest, and much nearer than the second one."""
    import cv2

    if min(len(first.angles), len(second.angles)) < 2:
        none = np.zeros(0, dtype=np.int64)
        return Pairs(none, none, np.zeros(0))
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    back = {match.queryIdx: match.trainIdx for match in matcher.match(second.descriptors, first.descriptors)}
    kept = [
        (best.queryIdx, best.trainIdx)
        for best, other in matcher.knnMatch(first.descriptors, second.descriptors, k=2)
        if best.distance < RATIO * other.distance and back[best.trainIdx] == best.queryIdx
    ]
    one, two = np.array(kept, dtype=np.int64).reshape(-1, 2).T
    return Pairs(one, two, second.angles[two] - first.angles[one])


def mirrored(picture: Image) -> Image:
    """A picture flipped left to right."""
    return np.ascontiguousarray(picture[:, ::-1])


def way_round(first: Keypoints, second: Keypoints, second_mirrored: Keypoints) -> tuple[WayRound | None, int]:
    """How the second picture lies to the first, by what is found again; None where that does not tell.

    Args:
        first: of one picture.
        second: of another that shows some of the same things.
        second_mirrored: of that one, flipped left to right: SIFT does not know things in a mirror again.

    Returns:
        The way round, and how many keypoints speak for it.
    """
    straight, flipped = pairs_of(first, second), pairs_of(first, second_mirrored)
    counts: dict[WayRound, int] = {
        "same": int(straight.near(0.0).sum()),
        "mirrored": int(flipped.near(0.0).sum()),
        "rotated by 180 degrees": int(straight.near(180.0).sum()),
        "upside down": int(flipped.near(180.0).sum()),
    }
    best, *others = sorted(counts, key=lambda name: -counts[name])
    sure = counts[best] >= LEAST_SUPPORT and counts[best] >= MAJORITY * max(1, counts[others[0]])
    return (best if sure else None), counts[best]
