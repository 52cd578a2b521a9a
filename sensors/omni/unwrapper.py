"""Omnidirectional pictures -> panoramas on the map's cylinder, by one look-up table a camera."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.omni.pictures import OmniModel, from_table
from topoloc.geometry import Floats
from topoloc.topo_map import Camera
from topoloc.types import Image

MOST_SAMPLES = 3
"""A pixel of the panorama averages at most so many samples a side."""
LONGEST_SIDE = 32766
"""``cv2.remap`` takes pictures up to this many pixels a side."""


class Unwrapper:
    """Unwraps the pictures of one omnidirectional camera into panoramas of a map's camera.

    The panorama is a cylinder: columns run clockwise and linear in angle; rows are those of a pin-hole frame of the
    map's camera, square pixels, horizon in the middle: row r is at elevation atan((height / 2 - r - 0.5) / f), f =
    width / 2 / tan(hfov / 2). So a frame fits it exactly in the frame's middle column (away from it, a pin-hole frame
    bends what a cylinder keeps level).

    Args:
        model: of the omnidirectional camera.
        camera: of the map.
        width: columns of the camera's pictures.
        height: their rows.
        heading: of the panorama's left edge, in the camera's frame [rad, ccw]; 0, as a recording has it.

    Attributes:
        seen: bool (rows, columns), where the panorama has a picture; it is black elsewhere.

    Raises:
        ValueError: no part of the panorama is seen, or it has too many columns.
    """

    def __init__(self, model: OmniModel, camera: Camera, width: int, height: int, heading: float = 0.0) -> None:
        if max(camera.panorama_columns(), width, height) > LONGEST_SIDE:
            raise ValueError(f"pictures and panoramas may have {LONGEST_SIDE} pixels a side; scale them down")
        self._camera, self._size = camera, (height, width)
        x, y = _look_up(model, camera, width, height, heading, 1)
        if not np.isfinite(x).any():
            raise ValueError("the picture shows no part of the panorama; look at its centre, rim and elevations")
        samples = min(_samples_needed(x, y), LONGEST_SIDE // camera.panorama_columns())
        if samples > 1:
            x, y = _look_up(model, camera, width, height, heading, samples)
        rows, columns = camera.height, camera.panorama_columns()
        seen = np.isfinite(x).reshape(rows, samples, columns, samples).all(axis=(1, 3))
        self.seen: NDArray[np.bool_] = np.asarray(seen)
        # cv2.remap counts from the middle of the first pixel; what is not seen may come from anywhere
        self._x, self._y = (np.nan_to_num(part - 0.5).astype(np.float32) for part in (x, y))

    @property
    def seen_share(self) -> float:
        """Share of the panorama that has a picture."""
        return float(self.seen.mean())

    def unwrap(self, image: Image) -> Image:
        """The panorama, uint8 (map camera's height, panorama_columns()[, 3]), of a picture uint8 (rows, cols[, 3]).

        Raises:
            ValueError: the picture is of another size than this was made for.
        """
        if image.shape[:2] != self._size:
            rows, columns = image.shape[:2]
            raise ValueError(f"the picture is {columns}x{rows}, not {self._size[1]}x{self._size[0]}")
        circle = cv2.remap(image, self._x, self._y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)  # a seam is none
        if circle.shape[:2] != self.seen.shape:
            circle = cv2.resize(circle, self.seen.shape[::-1], interpolation=cv2.INTER_AREA)
        circle[~self.seen] = 0
        return np.asarray(circle, dtype=np.uint8)


def _look_up(
    model: OmniModel, camera: Camera, width: int, height: int, heading: float, samples: int
) -> tuple[Floats, Floats]:
    """Where in the picture each pixel of the panorama is seen, ``samples`` a side: x and y as the model gives them."""
    columns, rows = camera.panorama_columns() * samples, camera.height * samples
    focal = camera.width / 2.0 / np.tan(np.deg2rad(camera.hfov_deg) / 2.0)
    headings = heading - (np.arange(columns) + 0.5) * 2.0 * np.pi / columns
    elevations = np.arctan((camera.height / 2.0 - (np.arange(rows) + 0.5) / samples) / focal)
    return model.locate(headings[None, :], elevations[:, None], width, height)


def _samples_needed(x: Floats, y: Floats) -> int:
    """Samples a side that a pixel of the panorama needs, so that no pixel of a finer picture is skipped."""
    steps = [np.hypot(np.diff(x, axis=axis), np.diff(y, axis=axis)) for axis in (0, 1)]
    known = [step[np.isfinite(step)] for step in steps]
    pixels = max((float(np.median(step)) for step in known if step.size), default=1.0)
    return int(np.clip(round(pixels), 1, MOST_SAMPLES))


def unwrapper_of(
    table: Mapping[str, Any], where: str, camera: Camera, width: int, height: int, heading: float = 0.0
) -> Unwrapper:
    """An unwrapper as ``camera.toml`` describes the camera.

    Args:
        table: ``[omni]``, see ``from_table``.
        where: it stands, for errors.
        camera: of the map.
        width: columns of the camera's pictures.
        height: their rows.
        heading: of the panorama's left edge, in the camera's frame [rad, ccw].

    Raises:
        UserError: the table.
        ValueError: see ``Unwrapper``.
    """
    return Unwrapper(from_table(table, where), camera, width, height, heading)
