"""What a cheap camera does to a picture: exposure, noise, blur, vignette, glare."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from topoloc.types import Image

_NOISE_SAMPLES = 1 << 21


@dataclass(frozen=True)
class SensorEffects:
    """What a cheap camera does to the picture.

    Attributes:
        exposure_sd: standard deviation of the exposure gain from frame to frame, as a share.
        noise_grey: standard deviation of the noise of a pixel, grey levels of 255.
        blur_px: standard deviation of the lens's blur, pixels; it also softens the edges that the caster leaves sharp.
        vignette: share of the light that the corners lose.
        glare: share of the picture's light that bright places spill over their surroundings.
    """

    exposure_sd: float = 0.06
    noise_grey: float = 3.0
    blur_px: float = 0.7
    vignette: float = 0.15
    glare: float = 0.06

    def __post_init__(self) -> None:
        if min(self.exposure_sd, self.noise_grey, self.blur_px) < 0.0:
            raise ValueError("exposure_sd, noise_grey and blur_px must not be negative")
        if not (0.0 <= self.vignette <= 1.0 and 0.0 <= self.glare <= 1.0):
            raise ValueError("vignette and glare must lie between 0 and 1")


def sense(image: Image, effects: SensorEffects, rng: np.random.Generator) -> Image:
    """The picture (rows, cols, 3) as the sensor delivers it; same shape."""
    rows, columns = image.shape[:2]
    gain = float(np.exp(rng.normal(0.0, effects.exposure_sd)))
    picture = cv2.GaussianBlur(image, (3, 3), effects.blur_px) if effects.blur_px > 0.0 else image
    if effects.glare > 0.0:
        small = cv2.resize(picture, (columns // 16, rows // 16), interpolation=cv2.INTER_AREA)
        veil = cv2.resize(cv2.blur(small, (9, 9)), (columns, rows), interpolation=cv2.INTER_LINEAR)
        picture = cv2.addWeighted(picture, 1.0 - effects.glare, veil, effects.glare, 0.0)
    light = _vignette(rows, columns, effects.vignette) * np.float32(gain)
    bright = cv2.multiply(picture, light, dtype=cv2.CV_32F)
    bank = _noise_bank()
    first = int(rng.integers(0, len(bank) - image.size))
    noise = bank[first : first + image.size].reshape(image.shape)
    return np.asarray(cv2.scaleAdd(noise, effects.noise_grey, bright).clip(0.0, 255.0).astype(np.uint8))


@lru_cache(maxsize=4)
def _vignette(rows: int, columns: int, share: float) -> NDArray[np.float32]:
    """Light left at each pixel, (rows, columns, 3): 1 in the middle, 1 - share in the corners."""
    y, x = np.linspace(-1.0, 1.0, rows)[:, None], np.linspace(-1.0, 1.0, columns)
    light = 1.0 - share * (x**2 + y**2) / 2.0
    return np.repeat(light[:, :, None], 3, axis=2).astype(np.float32)


@lru_cache(maxsize=1)
def _noise_bank() -> NDArray[np.float32]:
    """Normal noise to cut pieces from: drawing fresh noise would take longer than the picture."""
    return np.random.default_rng(0).standard_normal(_NOISE_SAMPLES, dtype=np.float32)
