"""Disparity of a rectified stereo pair by OpenCV's block matching, with what cannot be told left out.

The second seed's stereo system (section 5) passes over pixels on low texture and filters the matches, so that the map
of disparities is sparse. Here: semi-global matching, then uniqueness, agreement of left with right, size of patches,
and the texture around a pixel. What is left out is NaN, and never filled.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.images import grey
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.types import Image

STEPS_PER_PX = 16
"""OpenCV's disparities are whole sixteenths of a pixel."""
RANGE_STEP = 16
"""And it searches multiples of so many pixels."""
SMALL_JUMP, LARGE_JUMP = 8, 32
"""What a change of disparity between neighbours costs, by a pixel and by more, for each pixel of a window; OpenCV's."""
LEFT_RIGHT_PX = 1
"""By how much the disparities from left to right and from right to left may differ [px]."""
PATCH_STEP_PX = 1
"""By how much disparity may change from pixel to pixel within a patch [px]."""

Disparities = NDArray[np.float32]


@dataclass(frozen=True)
class BlockMatchingConfig:
    """Settings of the search for disparities.

    Attributes:
        range_share: largest disparity, as a share of the picture's width: what is nearer than baseline * focal length /
            range is not found. Rounded up to 16 pixels.
        window: side of the blocks that are compared, odd [px].
        uniqueness: by how many per cent the best match must beat the others.
        texture: least mean change of grey from column to column around a pixel; less is left out [grey levels / px].
        patch_px: connected patches of fewer pixels are left out.
    """

    range_share: float = 0.2
    window: int = 7
    uniqueness: int = 10
    texture: float = 1.5
    patch_px: int = 50

    def __post_init__(self) -> None:
        if not 0.0 < self.range_share <= 1.0:
            raise ValueError(f"range_share is {self.range_share}; it must lie above 0, and at 1 at most")
        if self.window < 1 or self.window % 2 == 0:
            raise ValueError(f"window is {self.window}; it must be odd")
        if self.uniqueness < 0 or self.texture < 0.0 or self.patch_px < 0:
            raise ValueError("uniqueness, texture and patch_px must not be negative")


def disparities(left: Image, right: Image, config: BlockMatchingConfig) -> Disparities:
    """How far to the left things lie on the right picture of a rectified pair.

    Args:
        left: uint8 (rows, cols[, 3]).
        right: of the same size, from a camera straight to the right.
        config: settings.

    Returns:
        (rows, cols) [px], above 0; NaN where unknown.

    Raises:
        UserError: the pictures differ in size.
    """
    first, second = grey(left), grey(right)
    if first.shape != second.shape:
        sizes = " and ".join(f"{image.shape[1]}x{image.shape[0]}" for image in (first, second))
        raise UserError(f"left and right picture of a stereo pair are {sizes}; scale them to one size")
    reach = RANGE_STEP * max(1, int(np.ceil(config.range_share * first.shape[1] / RANGE_STEP)))
    matcher = cv2.StereoSGBM.create(
        numDisparities=reach,
        blockSize=config.window,
        P1=SMALL_JUMP * config.window**2,
        P2=LARGE_JUMP * config.window**2,
        disp12MaxDiff=LEFT_RIGHT_PX,
        uniquenessRatio=config.uniqueness,
        speckleWindowSize=config.patch_px,
        speckleRange=PATCH_STEP_PX,
        mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
    )
    # OpenCV leaves the first columns out, as far as the range reaches; beside a margin it does not
    pair = (cv2.copyMakeBorder(image, 0, 0, reach, 0, cv2.BORDER_REPLICATE) for image in (first, second))
    found = matcher.compute(*pair)[:, reach:].astype(np.float32) / np.float32(STEPS_PER_PX)
    on_margin = found > np.arange(first.shape[1], dtype=np.float32)
    found[(found <= 0.0) | on_margin | (texture(first, config.window) < config.texture)] = np.nan
    return np.asarray(found)


def texture(image: Image, window: int) -> Disparities:
    """Mean size (rows, cols) of the change of grey from column to column in windows around each pixel [1 / px]."""
    across = cv2.Sobel(image, cv2.CV_32F, 1, 0, ksize=3, scale=1.0 / 8.0)
    return np.asarray(cv2.blur(np.abs(across), (window, window)), dtype=np.float32)


def averaged(found: Disparities, columns: int, rows: int, least_known: float) -> Floats:
    """Disparities scaled down: each cell is the mean of its known pixels.

    Args:
        found: (R, C), NaN where unknown.
        columns: of the result.
        rows: of the result.
        least_known: share of a cell's pixels that must be known.

    Returns:
        (rows, columns); NaN where fewer are.
    """
    known = np.isfinite(found)
    share = cv2.resize(known.astype(np.float32), (columns, rows), interpolation=cv2.INTER_AREA)
    total = cv2.resize(np.where(known, found, np.float32(0.0)), (columns, rows), interpolation=cv2.INTER_AREA)
    enough = share >= max(least_known, 1e-6)
    return np.where(enough, total / np.where(enough, share, 1.0), np.nan).astype(np.float64)
