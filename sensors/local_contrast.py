"""Contrast made alike all over a picture, so that light and shade count for little (ours)."""

from __future__ import annotations

import cv2
import numpy as np

from topoloc.geometry import Floats
from topoloc.types import Pixels


def local_contrast(picture: Pixels, window: float, grey: float, circular: bool) -> Floats:
    """Grey levels less their local mean, divided by one more than their local deviation in units of ``grey``.

    Args:
        picture: (rows, columns) grey levels.
        window: standard deviation of the Gaussian window, columns.
        grey: deviation that is about halved [grey levels]; much less stays as it is, much more comes out alike.
        circular: the columns close a circle.
    """
    margin = min(2 * int(np.ceil(4.0 * window)), picture.shape[1]) if circular else 0  # blurred twice
    parts = [picture[:, picture.shape[1] - margin :], picture, picture[:, :margin]]
    wide = np.concatenate(parts, axis=1, dtype=np.float64)
    deviation = wide - _blurred(wide, window)
    spread = np.sqrt(_blurred(deviation**2, window))
    return np.asarray((deviation / (1.0 + spread / grey))[:, margin : margin + picture.shape[1]])


def _blurred(picture: Floats, window: float) -> Floats:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), window, borderType=cv2.BORDER_REFLECT), dtype=np.float64)
