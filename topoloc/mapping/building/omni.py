"""Unwrapped omnidirectional pictures of a recording as panoramas of a map that is built."""

from __future__ import annotations

from typing import Any

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.mapping.building.frame_picture import FramePictures
from topoloc.mapping.building.pasting import beginning
from topoloc.mapping.building.way import Way
from topoloc.recording import Recording
from topoloc.topo_map import Camera
from topoloc.types import Image


def has_panoramas(recording: Recording) -> bool:
    """Whether every frame may have a panorama.

    Raises:
        InputError: it has nothing but omnidirectional pictures that are not unwrapped.
    """
    if recording.kind == "omni" and not recording.panorama:
        remedy = "make panoramas with 'topoloc unwrap', list them in omni.txt, and write panorama = true in camera.toml"
        raise InputError(recording.folder / "omni.txt", "its pictures are not unwrapped", remedy)
    return recording.panorama and "omni" in recording.pictures


def panorama_at(way: Way, frame: int, camera: Camera, pictures: FramePictures, scaled: bool) -> tuple[Any, float]:
    """The panorama that a frame of a way has, and its left edge's heading [rad].

    Args:
        way: of the recording.
        frame: index on it.
        camera: of the map.
        pictures: of the recording.
        scaled: to the camera's height; else it is as large as it was recorded.

    Returns:
        A lazy picture, rolled so that all begin at one heading, and the heading; None in place of the picture where
        the frame has none.
    """
    picture, heading = way.pictures[frame], float(way.cameras[frame, 2])
    if "omni" not in way.recording.frame(picture).images:
        return None, 0.0
    recorded = pictures.read(picture, "omni")
    if not camera.fits_panorama(recorded):
        rows, columns = recorded.shape[:2]
        wanted = f"a camera of {camera.width}x{camera.height} and {camera.hfov_deg:g} degrees gives "
        wanted += f"{camera.panorama_columns()}x{camera.height}"
        raise UserError(f"{way.recording.folder}: panoramas are {columns}x{rows}, but {wanted}; correct hfov_deg")
    size = (camera.height, camera.panorama_columns()) if scaled else recorded.shape[:2]
    shift, begins = beginning(size[1], heading)

    def read() -> Image:
        return np.roll(pictures.read(picture, "omni", size), -shift, axis=1)

    return pictures.lazy(picture, "omni", size, read), begins
