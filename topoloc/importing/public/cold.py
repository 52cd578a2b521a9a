"""COLD, the COsy Localization Database: offices in Freiburg, Saarbruecken and Ljubljana under clouds, sun, at night.

A. Pronobis, B. Caputo: COLD: The COsy Localization Database, International Journal of Robotics Research 28(5), 2009;
M. M. Ullah, A. Pronobis, B. Caputo, J. Luo, P. Jensfelt: The COLD Database, technical report, KTH, 2007.

A sequence is a folder such as ``seq1_cloudy1`` with ``std_cam/`` and ``omni_cam/`` (names tell time, x, y, angle),
``localization/places.lst`` (a picture and its room a line) and ``odom_scans/odom.tdf``. Seen in several published
loaders; which, in docs/public_sets.md.

unverified: that omnidirectional pictures carry the same kind of names; that every laboratory's camera has the field
of view of the report; the distortion of the lens, which is not told and left as it is.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Literal

import numpy as np

from topoloc.errors import InputError
from topoloc.files import read_text
from topoloc.geometry import Floats, wrap
from topoloc.importing.public.heading_check import heading_note
from topoloc.importing.public.levels import refuse_level
from topoloc.importing.public.pose_names import named_shots, read_pose_name
from topoloc.importing.public.sequence import Drive, camera_of
from topoloc.recording import Track
from topoloc.rig_file import Rig

ColdCamera = Literal["std", "omni"]
HFOV_DEG = 68.9
"""Horizontal field of view of the perspective camera [degrees]; 54.4 vertically, as 640x480 has it (Ullah, 2007)."""
FOLDERS = {"std": "std_cam", "omni": "omni_cam"}
INSIDE = tuple(FOLDERS.values())
LOOKS = "std_cam/, omni_cam/, localization/, odom_scans/"
ROOM_REACH_S = 0.5
"""A label holds for pictures within this [s]."""
STEP_M = 0.02
SECONDS, MICROSECONDS, X, Y, THETA = 3, 4, 8, 9, 11
"""Columns of ``odom.tdf``, from 0, as the reader by P. Jensfelt, who recorded it, has them."""


def read_cold(folder: Path, camera: ColdCamera = "std") -> Drive:
    """A sequence.

    Args:
        folder: of the sequence.
        camera: ``std``, the perspective one, or ``omni``, a mirror whose shape is not documented.

    Raises:
        InputError: no sequence, no pictures of this camera, or names that tell no pose.
    """
    if not any((folder / name).is_dir() for name in INSIDE):
        refuse_level(folder, INSIDE, LOOKS)
    pictures = folder / FOLDERS[camera]
    if not pictures.is_dir():
        other = "omni" if camera == "std" else "std"
        raise InputError(pictures, "no such folder", f"unpack it, or take --camera {other}")
    room_at, notes = _rooms(folder / "localization" / "places.lst")
    shots, dropped, degrees = named_shots(pictures, room_at)
    if degrees:
        notes.append("warning: the angles of the names are beyond a circle in radians; they were read as degrees")
    odometry = _odometry(folder / "odom_scans" / "odom.tdf")
    if odometry is None:
        notes.append("no odom_scans/odom.tdf: no odometry")
    notes += filter(None, [heading_note(shots, STEP_M)])
    if camera == "omni":
        notes.append("the mirror is not documented: 'topoloc unwrap' needs [omni] in camera.toml, see docs/omni.md")
        rig = Rig()
    else:
        rig = Rig(camera_of(HFOV_DEG, shots))
    kind = "rgb" if camera == "std" else "omni"
    return Drive(folder.resolve().name, kind, shots, rig, odometry, tuple(notes), dropped)


def _rooms(path: Path) -> tuple[Callable[[float], str | None], list[str]]:
    """The room at a time [s], and what is to be told where no labels are found."""
    if not path.exists():
        return lambda _: None, [f"no {path.parent.name}/{path.name}: no rooms"]
    labels = []
    for line, text in enumerate(read_text(path, "unpack it again").splitlines(), start=1):
        if not text.strip():
            continue
        words = text.rsplit(maxsplit=1)
        name = read_pose_name(Path(words[0]).stem)
        if len(words) != 2 or name is None:
            raise InputError(path, f"{text.strip()!r} is no picture and its room", "correct or delete the line", line)
        labels.append((name.time, words[1]))
    if not labels:
        return lambda _: None, [f"{path.name} is empty: no rooms"]
    labels.sort()
    times, rooms = np.array([time for time, _ in labels]), [room for _, room in labels]

    def room_at(time: float) -> str | None:
        nearest = int(np.abs(times - time).argmin())
        return rooms[nearest] if abs(times[nearest] - time) <= ROOM_REACH_S else None

    return room_at, []


def _odometry(path: Path) -> Track | None:
    """The odometer's track; None where there is none. Raises ``InputError`` for a file of another form."""
    if not path.exists():
        return None
    rows = [text.split() for text in read_text(path, "unpack it again").splitlines() if text.strip()]
    short = next((line for line, row in enumerate(rows, start=1) if len(row) <= THETA), None)
    if not rows or short is not None:
        raise InputError(path, f"has fewer than {THETA + 1} columns", "unpack it again, or take it away", short)
    try:
        table: Floats = np.array([row[: THETA + 1] for row in rows]).astype(np.float64)
    except ValueError as error:
        raise InputError(path, f"is no table of numbers ({error})", "unpack it again, or take it away") from None
    times = table[:, SECONDS] + 1e-6 * table[:, MICROSECONDS]
    times, first = np.unique(times, return_index=True)
    chosen = table[first]
    return Track(times, np.column_stack([chosen[:, X], chosen[:, Y], wrap(chosen[:, THETA])]))
