"""The camera of a map that is built: what the recording, or its owner, tells of it."""

from __future__ import annotations

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.mapping.building.config import BuildConfig
from topoloc.mapping.building.way import Way
from topoloc.topo_map import Camera


def camera_of(way: Way, config: BuildConfig) -> Camera:
    """The camera of a map: with the field of view that is told, of the pictures' size, or the one they are scaled to.

    Raises:
        UserError: nobody tells the field of view, or two do and differ, or the size has another aspect ratio.
    """
    told, place = way.recording.camera, way.recording.folder / "camera.toml"
    hfov_deg = config.hfov_deg if told is None else told.hfov_deg
    if hfov_deg is None:
        remedy = "give --hfov-deg, or let 'topoloc camera turn' estimate it"
        raise InputError(place, "the horizontal field of view is not told", remedy)
    if config.hfov_deg is not None and abs(config.hfov_deg - hfov_deg) > 0.02 * hfov_deg:
        problem = f"hfov_deg is {hfov_deg:g}, but --hfov-deg says {config.hfov_deg:g}"
        raise InputError(place, problem, "correct the one that is wrong")
    rows, columns = way.size
    if way.recording.kind == "omni":
        columns = round(columns * hfov_deg / 360.0)
    camera = Camera(hfov_deg, columns, rows)
    if config.view_size is None:
        return camera
    width, height = config.view_size
    if width > columns or not camera.fits(np.empty((height, width), dtype=np.uint8)):
        problem = f"view_size is {width}x{height}, but the pictures are {columns}x{rows}"
        raise UserError(f"{problem}; scale them down, and keep the aspect ratio")
    return Camera(hfov_deg, width, height)
