"""Pictures whose names tell time, pose and sometimes the room: ``t1152886490.040076_x0.205_y0.001_a0.003.jpeg``."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.files import pictures_in
from topoloc.geometry import wrap
from topoloc.importing.public.sequence import Shot

NUMBER = re.compile(r"([txya])([+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?)")
ROOM = re.compile(r"[a-z]?([A-Z0-9][A-Za-z0-9-]*)")
"""A word that is no number names the room; a small letter before it says that it does."""
MOST_RAD = 2.0 * np.pi + 0.01
"""Angles beyond this are degrees."""


@dataclass(frozen=True)
class PoseName:
    """What a name tells: time [s], x, y [m], angle as it stands there, and the room or None."""

    time: float
    x: float
    y: float
    angle: float
    room: str | None


def read_pose_name(stem: str) -> PoseName | None:
    """What the name of a picture, without its ending, tells; None where it lacks time, x, y or angle."""
    values: dict[str, float] = {}
    room: str | None = None
    for word in stem.split("_"):
        number, name = NUMBER.fullmatch(word), ROOM.fullmatch(word)
        if number:
            values[number[1]] = float(number[2])
        elif name:
            room = name[1]
        else:
            return None
    if set(values) != set("txya"):
        return None
    return PoseName(values["t"], values["x"], values["y"], values["a"], room)


def named_shots(
    folder: Path, room_at: Callable[[float], str | None] = lambda _: None
) -> tuple[list[Shot], dict[str, int], bool]:
    """The pictures of a folder, in time; angles in degrees are recognised by their size.

    Args:
        folder: of the pictures.
        room_at: the room at a time [s], for names that tell none.

    Returns:
        The shots, how many pictures were left out by reason, and whether the angles are degrees.

    Raises:
        InputError: there are no pictures, or no name of them tells a pose.
    """
    paths = pictures_in(folder)
    read = [(path, read_pose_name(path.stem)) for path in paths]
    named = sorted(((path, name) for path, name in read if name is not None), key=lambda item: item[1].time)
    if not named:
        found = f"{paths[0].name} tells no pose" if paths else "holds no pictures"
        remedy = "names look like t<seconds>_x<metres>_y<metres>_a<radians>.jpeg; unpack the set again"
        raise InputError(folder, found, remedy)
    degrees = max(abs(name.angle) for _, name in named) > MOST_RAD
    shots = [
        Shot(name.time, path, _pose(name, degrees), name.room if name.room is not None else room_at(name.time))
        for path, name in named
    ]
    lost = Counter("its name tells no time and pose" for _, name in read if name is None)
    return shots, dict(lost), degrees


def _pose(name: PoseName, degrees: bool) -> np.ndarray:
    angle = np.deg2rad(name.angle) if degrees else name.angle
    return np.array([name.x, name.y, float(wrap(angle))])
