"""Digital zoom (thesis 2.4.2, 4.1.5): the frame or the reference zoomed in, and the best of the combinations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sensors.images import crop_centre, resize
from sensors.slot_matching import Matches
from topoloc.geometry import Floats
from topoloc.types import Image


def advances_of(zoom: float, steps: int) -> Floats:
    """Displacements 1 - 1 / rho (2.5) of the zooms each way, smallest first, in distances of the scene.

    Args:
        zoom: the largest that is tried.
        steps: zooms each way, spaced so that each stands for the same further displacement (2.5).
    """
    farthest = 1.0 - 1.0 / zoom
    numbers = np.arange(1, steps + 1) if farthest > 0.0 else np.zeros(0)
    return np.asarray(farthest * numbers / steps)


def scaled(picture: Image, columns: int, rows: int, zoom_columns: float = 1.0, zoom_rows: float = 1.0) -> Image:
    """Grey levels (rows, columns * zoom_rows / zoom_columns) of a grey picture whose outer parts are cropped.

    A frame is zoomed in both ways: cropped to 1 / zoom of its columns and rows, and scaled back to its size. A
    reference keeps its full width (``zoom_columns`` 1): it is cropped in height only and grows wider.
    """
    kept = crop_centre(picture, 1.0 / zoom_columns, 1.0 / zoom_rows)
    return resize(kept, round(columns * zoom_rows / zoom_columns), rows)


def best_of(found: Sequence[Matches], advances: Floats) -> Matches:
    """The best of several zooms (Z) for each of K references; its displacement is refined by a parabola.

    Args:
        found: Z matches, the plain one first.
        advances: (Z,) displacements that they stand for, evenly spaced when sorted.
    """
    values = np.stack([matches.value for matches in found])
    best, of_each = values.argmax(axis=0), np.arange(values.shape[1])
    order = np.argsort(advances)
    place = np.argsort(order)[best]  # of the best zoom among the sorted ones
    inner = (place > 0) & (place < len(order) - 1)
    before, after = (values[order[np.clip(place + side, 0, len(order) - 1)], of_each] for side in (-1, 1))
    peak = values[best, of_each]
    bend = before - 2.0 * peak + after
    shift = np.divide(before - after, 2.0 * bend, out=np.zeros_like(peak), where=inner & (bend < 0.0))
    step = advances[order[1]] - advances[order[0]] if len(order) > 1 else 0.0
    return Matches(
        peak,
        np.stack([matches.column for matches in found])[best, of_each],
        np.stack([matches.columns for matches in found])[best, of_each],
        advances[best] + step * shift,
    )
