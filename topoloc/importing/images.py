"""A folder of pictures as a recording: those that decode, copied to the byte."""

from __future__ import annotations

import io
import struct
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from topoloc.errors import InputError
from topoloc.files import PICTURE_ENDINGS, pictures_in
from topoloc.importing.alongside import Alongside
from topoloc.importing.picture_times import Dated, Shot, time_taken
from topoloc.importing.recording_sink import RecordingSink

EXIF_TABLE, EXIF_ORIENTATION = 0x8769, 0x0112
"""Numbers of EXIF: the table of what the camera noted, and how the picture lies."""
LYING = (5, 6, 7, 8)
"""Orientations of EXIF that exchange rows and columns."""


def find_pictures(folder: Path, pattern: str) -> list[Path]:
    """The pictures of a folder whose names fit a pattern such as ``*_left*``, 2.jpg before 10.jpg.

    Raises:
        InputError: no such folder, or none of these in it.
    """
    if not folder.is_dir():
        remedy = "'topoloc import video' takes a video" if folder.is_file() else "name a folder of pictures"
        raise InputError(folder, "is a file" if folder.is_file() else "no such folder", remedy)
    found = [path for path in pictures_in(folder) if path.match(pattern)]
    if not found:
        below = sorted({path.parent.name for path in folder.glob("*/*") if path.suffix.lower() in PICTURE_ENDINGS})
        remedy = f"name one of its folders: {', '.join(below[:5])}" if below else "name the folder they lie in"
        raise InputError(folder, f"holds no pictures called {pattern!r}", remedy)
    return found


def look_at(paths: Iterable[Path], sink: RecordingSink) -> list[Shot]:
    """The pictures that decode and are of the size that most have; the others are left out, and noted as that."""
    shots: list[Shot] = []
    broken: dict[str, list[str]] = {}
    for path in paths:
        shot = _look(path)
        if isinstance(shot, str):
            broken.setdefault(shot, []).append(path.name)
        else:
            shots.append(shot)
    for why, names in broken.items():
        sink.drop("picture", f"{why}, such as {names[0]}", len(names))
    if not shots:
        return []
    usual = Counter(shot.size for shot in shots).most_common(1)[0][0]
    same = [shot for shot in shots if shot.size == usual]
    sink.drop("picture", f"is not {usual[0]}x{usual[1]} as most are", len(shots) - len(same))
    return same


def _look(path: Path) -> Shot | str:
    """What a picture tells of itself, or what is wrong with it."""
    from PIL import Image as Pictures

    try:
        with Pictures.open(io.BytesIO(path.read_bytes())) as picture:
            width, height = picture.size
            orientation, notes = _exif(picture)
            picture.draft("L", (max(1, width // 8), max(1, height // 8)))  # of a JPEG an eighth is decoded, and quickly
            picture.load()
    except OSError as error:
        return f"cannot be read ({error.strerror})" if error.strerror else "does not decode as a picture"
    except (ValueError, SyntaxError, Pictures.DecompressionBombError):
        return "does not decode as a picture"
    return Shot(path, (height, width) if orientation in LYING else (width, height), time_taken(notes))


def _exif(picture: Any) -> tuple[int | None, Mapping[int, Any]]:
    """The orientation of a PIL picture, and what its camera noted; nothing where that is damaged."""
    try:
        exif = picture.getexif()
        return exif.get(EXIF_ORIENTATION), exif.get_ifd(EXIF_TABLE)
    except (OSError, ValueError, SyntaxError, struct.error):
        return None, {}


def import_pictures(
    dated: Dated,
    sink: RecordingSink,
    alongside: Alongside,
    offset_s: float = 0.0,
    progress: Callable[[], object] = lambda: None,
) -> None:
    """Put pictures into a recording, to the byte, and the tracks beside them.

    Args:
        dated: the pictures.
        sink: pictures without a place on the tracks are noted there.
        alongside: the tracks.
        offset_s: added to the pictures' times to have the tracks' clock [s].
        progress: called for each picture.

    Raises:
        UserError: tracks and pictures have no moment in common.
    """
    if dated.times:
        alongside.refuse_apart(min(dated.times) + offset_s, max(dated.times) + offset_s)
    for shot, time in zip(dated.shots, dated.times, strict=True):
        progress()
        why = alongside.lack(time + offset_s)
        if why is None:
            sink.picture("rgb", time + offset_s, shot.path.read_bytes(), shot.path.suffix.lower())
        else:
            sink.drop("picture", why)
    alongside.write(sink)
