"""The panorama of a turn on the spot, for a map that is built."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from topoloc import plugins
from topoloc.errors import UnreadableImage, UserError, one_line
from topoloc.geometry import circular_mean, wrap
from topoloc.mapping.building.frame_picture import FramePictures
from topoloc.mapping.building.pasting import LEFT_EDGE, beginning, pasted
from topoloc.mapping.building.turns import Turn
from topoloc.mapping.building.way import Way
from topoloc.topo_map import Camera
from topoloc.types import Image

MOST_MISSING_DEG = 20.0
"""A turn that lacks more of the circle makes no panorama; what it lacks stays black [degrees]."""
ASTRAY_DEG = 15.0
"""Headings that the pictures tell are not believed where one lies so far from what the poses say [degrees]."""
FLAT = 2.0
"""Grey levels of a picture that deviate less show nothing: a covered lens."""


@dataclass(frozen=True)
class Circle:
    """A panorama.

    Attributes:
        image: uint8 (rows, columns[, 3]).
        heading: of its left edge [rad].
        missing_deg: that nobody saw, and that stay black [degrees].
        doubt: why its pictures were not believed, and its frames stand where the poses say; empty: they were, or need
            not be.
    """

    image: Image
    heading: float
    missing_deg: float
    doubt: str = ""


def circle_of(turn: Turn, way: Way, camera: Camera, pictures: FramePictures, by: str) -> Circle | str:
    """The panorama of a turn, or why there is none.

    Args:
        turn: on that way.
        way: of the recording.
        camera: that the pictures have once they are read.
        pictures: reads them.
        by: ``headings`` or ``circle``, see ``BuildConfig.panoramas``.
    """
    if turn.missing_deg <= MOST_MISSING_DEG:
        frames, turn = _looked_at(turn, way, camera, pictures)
    if turn.missing_deg > MOST_MISSING_DEG:
        return f"{turn.missing_deg:.0f} degrees of the circle were not seen"
    headings = way.cameras[turn.frames, 2]
    if by == "headings":
        return Circle(pasted(frames, headings, camera), LEFT_EDGE, turn.missing_deg)
    names = [way.pictures[frame].path.name for frame in turn.frames.tolist()]
    step_deg = float(np.rad2deg(np.diff(turn.clockwise).mean()))
    settings = {"hfov_deg": camera.hfov_deg, "step_deg": step_deg, "clahe": False}
    why = ""
    try:
        made: Any = plugins.make(plugins.PANORAMAS, "circle", settings).reconstruct(frames, names=names)
        astray = wrap(headings - made.headings)
        offset = circular_mean(astray)
        off = np.rad2deg(np.abs(wrap(astray - offset)))
        if off.max() > ASTRAY_DEG:
            why = f"by what it shows {names[int(off.argmax())]} lies {off.max():.0f} degrees off"
    except UserError as error:
        why = one_line(error).partition(";")[0]
    if why:
        return Circle(pasted(frames, headings, camera), LEFT_EDGE, turn.missing_deg, why)
    shift, begins = beginning(made.image.shape[1], float(made.heading + offset))
    return Circle(np.roll(made.image, -shift, axis=1), begins, turn.missing_deg)


def _looked_at(turn: Turn, way: Way, camera: Camera, pictures: FramePictures) -> tuple[list[Image], Turn]:
    """The snapshots of a turn that show something, and the turn with those only."""
    frames, bad = [], []
    for frame in turn.frames.tolist():
        try:
            image = pictures.read(way.pictures[frame], "rgb", (camera.height, camera.width))
        except UnreadableImage:
            bad.append(True)
            continue
        bad.append(is_flat(image))
        if not bad[-1]:
            frames.append(image)
    if all(bad):
        return [], Turn(turn.first, turn.position, turn.frames, turn.clockwise, 360.0)
    return frames, turn.without(np.array(bad), float(np.deg2rad(camera.hfov_deg))) if any(bad) else turn


def is_flat(image: Image) -> bool:
    """Whether a picture shows nothing."""
    return float(image[::4, ::4].std()) < FLAT
