"""What a cheap camera does to a picture: blur, glare, vignette, exposure, noise, compression."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from topoloc.geometry import Floats
from topoloc.types import Image

MID_GREY = 118.0
"""Mean that automatic exposure aims at, grey levels of 255."""
MOST_GAIN = 4.0
"""Automatic exposure brightens and darkens by this factor at most: a covered camera stays dark."""
BRIGHT_GREY = 200
"""Only what is brighter than this spills its light, grey levels of 255."""
GLARE_STEP = 16
"""Glare is smooth: it is computed on a picture this many times smaller."""
_NOISE_SAMPLES = 1 << 21


@dataclass(frozen=True)
class SensorEffects:
    """What a cheap camera does to the picture.

    Attributes:
        exposure_sd: standard deviation of the exposure gain from frame to frame, as a share.
        noise_grey: standard deviation of a pixel's noise, grey levels of 255; times automatic gain above 1.
        blur_px: standard deviation of the lens's blur, pixels; it also softens the edges that the caster leaves sharp.
        vignette: share of the light that the corners lose, 0 to 1.
        glare: share of the light of places brighter than 200 grey that spills over their surroundings, 0 to 1.
        motion_blur_px: mean length of the sideways streak of a moving camera, pixels; a frame's is 0 to twice that.
        jpeg_quality: quality of the compression, 0 to 100; 0 is not compressed.
        auto_exposure: share of the way to mid grey that automatic exposure brings the mean, 0 to 1; 0 is fixed.
    """

    exposure_sd: float = 0.06
    noise_grey: float = 3.0
    blur_px: float = 0.7
    vignette: float = 0.15
    glare: float = 0.06
    motion_blur_px: float = 1.5
    jpeg_quality: int = 80
    auto_exposure: float = 0.5

    def __post_init__(self) -> None:
        for name in ("exposure_sd", "noise_grey", "blur_px", "motion_blur_px"):
            if not 0.0 <= getattr(self, name) < np.inf:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative, and finite")
        for name, most in (("vignette", 1), ("glare", 1), ("auto_exposure", 1), ("jpeg_quality", 100)):
            if not 0.0 <= getattr(self, name) <= most:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and {most}")

    @classmethod
    def none(cls) -> SensorEffects:
        """A perfect camera: the picture stays as it is."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0, 0.0)


def sense(
    image: Image,
    effects: SensorEffects,
    rng: np.random.Generator,
    tint: tuple[float, float, float] = (1.0, 1.0, 1.0),
    still: bool = False,
    noise_rng: np.random.Generator | None = None,
) -> Image:
    """The picture as the sensor delivers it.

    Args:
        image: (rows, cols, 3) uint8 RGB.
        effects: what the camera does to it.
        rng: the same number of draws is taken whatever the effects, so that one can be changed alone.
        tint: colour of the light, a factor of red, green and blue.
        still: the camera stands: no motion blur.
        noise_rng: draws the noise; None: ``rng`` does. Two eyes of one body share all but this.

    Returns:
        (rows, cols, 3) uint8 RGB.
    """
    chance = float(np.exp(effects.exposure_sd * rng.standard_normal()))
    streak = 2.0 * effects.motion_blur_px * rng.random() * (not still)
    bank = _noise_bank(max(_NOISE_SAMPLES, 2 * image.size))
    first = int((noise_rng or rng).integers(0, len(bank) - image.size))
    noise = bank[first : first + image.size].reshape(image.shape)
    picture = _with_glare(_blurred(image, effects.blur_px, streak), effects.glare)
    light = _vignette(*image.shape[:2], effects.vignette, tint)
    lit = cv2.multiply(picture, light, dtype=cv2.CV_32F)
    gain = _automatic_gain(float(np.mean(cv2.mean(lit)[:3])), effects.auto_exposure)
    noise_grey = effects.noise_grey * max(gain, 1.0)
    exposed = cv2.addWeighted(lit, gain * chance, noise, noise_grey, 0.0, dtype=cv2.CV_8U)
    return _compressed(np.asarray(exposed, dtype=np.uint8), effects.jpeg_quality)


def _blurred(image: Image, blur_px: float, streak_px: float) -> Image:
    """The picture behind a lens that blurs, of a camera that turns: one pass for both."""
    if blur_px == 0.0 and streak_px == 0.0:
        return image
    lens = cv2.getGaussianKernel(2 * max(1, round(2.0 * blur_px)) + 1, blur_px)[:, 0] if blur_px > 0.0 else np.ones(1)
    across = np.convolve(lens, streak_kernel(streak_px))
    return np.asarray(cv2.sepFilter2D(image, -1, across, lens, borderType=cv2.BORDER_REPLICATE), dtype=np.uint8)


def streak_kernel(length_px: float) -> Floats:
    """Weights (K,), K odd, of the pixels over which a point moves evenly, read linearly between them; any length."""
    if length_px == 0.0:
        return np.ones(1)
    half = length_px / 2.0
    reach = int(np.ceil(half))
    offset = np.arange(-reach, reach + 1)
    weights = np.diff(_below(np.stack([-half - offset, half - offset])), axis=0)[0]
    return np.asarray(weights / weights.sum())


def _below(position: Floats) -> Floats:
    """Share of a hat of width 2 and area 1, around 0, that lies below a position."""
    place = np.clip(position, -1.0, 1.0)
    return np.asarray(0.5 + place - place * np.abs(place) / 2.0)


def _with_glare(picture: Image, share: float) -> NDArray[np.uint8] | NDArray[np.float32]:
    """The picture with the light that bright places spill; float where there is any."""
    if share == 0.0:
        return picture
    rows, columns = picture.shape[:2]
    small = (max(1, columns // GLARE_STEP), max(1, rows // GLARE_STEP))
    excess = np.maximum(picture, np.uint8(BRIGHT_GREY)) - np.uint8(BRIGHT_GREY)
    source = cv2.resize(excess, small, interpolation=cv2.INTER_AREA).astype(np.float32)
    spread = cv2.GaussianBlur(source, (0, 0), max(small) / 8.0, borderType=cv2.BORDER_CONSTANT)
    veil = cv2.resize(spread * np.float32(share * 255.0 / (255 - BRIGHT_GREY)), (columns, rows))
    return np.asarray(cv2.add(picture, veil, dtype=cv2.CV_32F), dtype=np.float32)


def _automatic_gain(mean_grey: float, share: float) -> float:
    """What automatic exposure multiplies a picture by."""
    return float(np.clip(MID_GREY / max(mean_grey, 1.0), 1.0 / MOST_GAIN, MOST_GAIN) ** share)


def _compressed(image: Image, quality: int) -> Image:
    """The picture after JPEG; 0 leaves it as it is."""
    if quality == 0:
        return image
    _, data = cv2.imencode(".jpg", cv2.cvtColor(image, cv2.COLOR_RGB2BGR), [cv2.IMWRITE_JPEG_QUALITY, int(quality)])
    decoded = np.asarray(cv2.imdecode(data, cv2.IMREAD_COLOR), dtype=np.uint8)
    return np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB), dtype=np.uint8)


@lru_cache(maxsize=16)
def _vignette(rows: int, columns: int, share: float, tint: tuple[float, float, float]) -> NDArray[np.float32]:
    """Light at each pixel, (rows, columns, 3): the tint in the middle, 1 - share of it in the corners."""
    y, x = np.linspace(-1.0, 1.0, rows)[:, None], np.linspace(-1.0, 1.0, columns)
    light = 1.0 - share * (x**2 + y**2) / 2.0
    return np.asarray(light.astype(np.float32)[:, :, None] * np.array(tint, dtype=np.float32))


@lru_cache(maxsize=2)
def _noise_bank(samples: int) -> NDArray[np.float32]:
    """Normal noise to cut pieces from: drawing fresh noise would take longer than the picture."""
    return np.random.default_rng(0).standard_normal(samples, dtype=np.float32)
