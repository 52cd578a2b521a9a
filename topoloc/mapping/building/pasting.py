"""A panorama of frames whose headings are known: each bent onto the cylinder, neighbours fading into each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera
from topoloc.types import Image

LEFT_EDGE = -np.pi
"""Panoramas begin at this heading, so that their middle looks along x [rad]."""


def pasted(frames: Sequence[Image], headings: Floats, camera: Camera) -> Image:
    """A full circle, (rows, camera.panorama_columns()[, 3]), its left edge at ``LEFT_EDGE``; black where nobody looks.

    Columns are linear in angle, and so within each frame; rows are scaled between a frame's middle and its mean, as
    ``topoloc.panoramas`` "circle" does it. A frame weighs as much as its nearer edge is far.

    Args:
        frames: of the camera's size.
        headings: (S,) of their optical axes [rad].
        camera: pinhole.
    """
    import cv2

    rows, width = frames[0].shape[:2]
    columns = camera.panorama_columns(width)
    hfov = np.deg2rad(camera.hfov_deg)
    focal = width / 2.0 / np.tan(hfov / 2.0)
    row = (np.arange(rows) + 0.5 - rows / 2.0)[:, None] * np.sqrt(focal * hfov / width)
    looks = LEFT_EDGE - (np.arange(columns) + 0.5) * 2.0 * np.pi / columns
    levels = np.zeros((rows, columns, *frames[0].shape[2:]), dtype=np.float32)
    total = np.zeros(columns, dtype=np.float32)
    shape = (1, -1, *(1,) * (frames[0].ndim - 2))
    for frame, heading in zip(frames, headings, strict=True):
        right = wrap(heading - looks)
        seen = np.flatnonzero(np.abs(right) < hfov / 2.0)
        angle = right[seen]
        x = np.broadcast_to(focal * np.tan(angle) + width / 2.0 - 0.5, (rows, len(seen))).astype(np.float32)
        y = (row / np.cos(angle) + rows / 2.0 - 0.5).astype(np.float32)
        bent = cv2.remap(frame, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        weight = (hfov / 2.0 - np.abs(angle)).astype(np.float32) + 1e-4
        levels[:, seen] += bent * weight.reshape(shape)
        total[seen] += weight
    return np.rint(levels / np.maximum(total, 1e-5).reshape(shape)).astype(np.uint8)


def beginning(columns: int, heading: float) -> tuple[int, float]:
    """How many columns to take from the left of a panorama to its right so that it begins at ``LEFT_EDGE``.

    Args:
        columns: of the panorama.
        heading: of its left edge [rad].

    Returns:
        Whole columns, and the heading of the left edge then, ``LEFT_EDGE`` but for a part of a column [rad].
    """
    column = 2.0 * np.pi / columns
    shift = round(float(heading - LEFT_EDGE) / column)
    return shift, float(wrap(heading - shift * column))
