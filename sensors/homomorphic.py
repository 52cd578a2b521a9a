"""Homomorphic filtering of panoramas: slow changes of the light are damped, edges kept (third seed, section 2)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from topoloc.types import Image

Pixels32 = NDArray[np.float32]


@dataclass(frozen=True)
class HomomorphicConfig:
    """Settings of the homomorphic filter; the seed names D0, g_l and g_h, their values are ours.

    Attributes:
        on: whether pictures are filtered at all, true or false.
        cutoff: D0, where low frequencies end, cycles per full circle, in rows and columns alike.
        low_gain: g_l, what is left of the lowest frequencies; at most 1.
        high_gain: g_h, by what the highest ones are multiplied; at least 1.
    """

    on: bool = True
    cutoff: float = 4.0
    low_gain: float = 0.1
    high_gain: float = 1.5

    def __post_init__(self) -> None:
        if not 0.0 < self.cutoff < np.inf:
            raise ValueError(f"cutoff is {self.cutoff}; it must be positive and finite")
        if not 0.0 <= self.low_gain <= 1.0 <= self.high_gain < np.inf:
            raise ValueError(
                f"low_gain is {self.low_gain} and high_gain {self.high_gain}; write 0 <= low_gain <= 1 <= high_gain"
            )


def homomorphic(panorama: Image, config: HomomorphicConfig) -> Pixels32:
    """Filter a panorama: the logarithm makes light times reflectance a sum, of which the filter damps the slow part.

    z = ln(f + 1), multiplied in the frequency domain by H_hp = (g_h - g_l)(1 - H_lp) + g_l with
    H_lp = exp(-D^2 / (2 D0^2)), and exp(z) - 1 of the result (EQUATIONS.md, 3; rebuilt around the seed's words).
    Columns close a circle; rows do not, so the picture is continued by its mirror image above and below.

    Args:
        panorama: (rows, columns) grey, a full circle.
        config: settings; ``on`` does not matter here.

    Returns:
        (rows, columns).
    """
    rows = panorama.shape[0]
    logs = np.log1p(panorama.astype(np.float32))
    spectrum = fft.rfft2(np.concatenate([logs, logs[::-1]]))
    spectrum *= _high_pass(*panorama.shape, config.cutoff, config.low_gain, config.high_gain)
    return np.asarray(np.expm1(fft.irfft2(spectrum, s=(2 * rows, panorama.shape[1]))[:rows]))


@lru_cache(maxsize=8)
def _high_pass(rows: int, columns: int, cutoff: float, low_gain: float, high_gain: float) -> Pixels32:
    """H_hp at the frequencies (2 rows, columns // 2 + 1) of a picture and its mirror image."""
    down = np.fft.fftfreq(2 * rows, d=1.0 / columns)  # a row is as high as a column is wide
    around = np.fft.rfftfreq(columns, d=1.0 / columns)
    squared = down[:, None] ** 2 + around**2
    low_pass = np.exp(-squared / (2.0 * cutoff**2))
    return np.asarray((high_gain - low_gain) * (1.0 - low_pass) + low_gain, dtype=np.float32)
