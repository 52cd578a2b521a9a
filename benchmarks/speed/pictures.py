"""Pictures to measure time with: blurred noise, cheap to make by the thousand and nowhere flat.

What they show hardly matters to the time of a look.
"""

from __future__ import annotations

import cv2
import numpy as np

from topoloc.types import Image

BLUR = 6
"""Pixels from one grain of the noise to the next."""


def noise_pictures(rng: np.random.Generator, count: int, rows: int, columns: int, channels: int = 1) -> Image:
    """Pictures that close a circle and are never flat: uint8 (count, rows, columns[, channels]).

    Args:
        rng: random numbers.
        count: of the pictures.
        rows: of each.
        columns: of each.
        channels: 1 for grey.
    """
    shape = (rows, columns) if channels == 1 else (rows, columns, channels)
    pictures = np.empty((count, *shape), dtype=np.uint8)
    for picture in pictures:
        grains = rng.integers(0, 256, (-(-rows // BLUR), -(-columns // BLUR), channels), dtype=np.uint8)
        around = np.concatenate([grains[:, -1:], grains, grains[:, :1]], axis=1)
        blurred = cv2.resize(around, (columns + 2 * BLUR, rows), interpolation=cv2.INTER_CUBIC)
        picture[...] = blurred[:, BLUR : BLUR + columns].reshape(shape)
    return pictures
