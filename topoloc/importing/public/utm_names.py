"""Folders of pictures whose names tell UTM positions: ``@easting@northing@zone@letter@...@heading@...@time@...@.jpg``.

The format of the benchmarks of visual place recognition that VPR-datasets-downloader writes (``util.py``); the eighth
field after northing is the heading, the twelfth the time ``YYYYMMDD_hhmmss``; both may be empty.

unverified: that headings are degrees clockwise from north, as a compass has them.
"""

from __future__ import annotations

from collections import Counter
from datetime import UTC, datetime
from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.files import PICTURE_ENDINGS
from topoloc.geometry import Floats
from topoloc.importing.public.heading_check import heading_note
from topoloc.importing.public.origin import Origin, poses_from_utm
from topoloc.importing.public.sequence import Drive, Shot

EASTING, NORTHING, ZONE, LETTER, HEADING, TIME = 1, 2, 3, 4, 9, 13
"""Fields of a name between its ``@``."""
STEP_M = 0.3


def holds_utm_names(folder: Path) -> bool:
    """Whether some picture in the folder, or in one below, is named so."""
    return next(folder.rglob("@*@*"), None) is not None


def read_utm_names(folder: Path, origin: Origin | None = None) -> tuple[Drive, Origin]:
    """The pictures of a folder and those below as one drive, in the order of their names, and the origin.

    Args:
        folder: such as ``images/test/database``.
        origin: None: the first picture's place.

    Raises:
        InputError: no name tells a position.
    """
    paths = sorted(path for path in folder.rglob("*") if path.suffix.lower() in PICTURE_ENDINGS)
    fields = [_fields(path) for path in paths]
    named = [(path, words) for path, words in zip(paths, fields, strict=True) if words]
    if not named:
        raise InputError(
            folder, "no name tells easting and northing", "names look like @620000.00@5735000.00@30@U@...@.jpg"
        )
    zone = (named[0][1][ZONE : LETTER + 1]) if len(named[0][1]) > LETTER else []
    kept = [(path, words) for path, words in named if words[ZONE : LETTER + 1] == zone]
    easting = np.array([float(words[EASTING]) for _, words in kept])
    northing = np.array([float(words[NORTHING]) for _, words in kept])
    start = origin or Origin(float(easting[0]), float(northing[0]))
    clockwise, notes = _headings([words for _, words in kept], easting, northing)
    times, clock = _times([words for _, words in kept])
    poses = poses_from_utm(easting, northing, clockwise, start)
    order = np.argsort(times, kind="stable")
    shots = [Shot(float(times[i]), kept[i][0], poses[i]) for i in order.tolist()]
    notes = [*notes, clock, *filter(None, [heading_note(shots, STEP_M)])]
    lost = Counter("its name tells no easting and northing" for words in fields if not words)
    lost.update("it lies in another zone of UTM" for _ in range(len(named) - len(kept)))
    return Drive(folder.resolve().name, "rgb", shots, notes=tuple(notes), dropped=dict(lost)), start


def _fields(path: Path) -> list[str]:
    """The fields of a name; none where it tells no position."""
    words = path.name.split("@")
    try:
        told = len(words) > NORTHING and bool(np.isfinite([float(words[EASTING]), float(words[NORTHING])]).all())
    except ValueError:
        told = False
    return words if told else []


def _headings(fields: list[list[str]], easting: Floats, northing: Floats) -> tuple[Floats, list[str]]:
    """(N,) headings clockwise from north [rad]; the direction of travel where the names tell none."""
    told = [words[HEADING] if len(words) > HEADING else "" for words in fields]
    try:
        return np.deg2rad(np.array(told).astype(np.float64)), ["headings: of the names, clockwise from north"]
    except ValueError:
        pass
    steps = np.column_stack([np.diff(easting), np.diff(northing)])
    along = np.arctan2(steps[:, 0], steps[:, 1]) if len(steps) else np.zeros(1)
    return np.append(along, along[-1])[: len(fields)], ["headings: none in all names; taken from picture to picture"]


def _times(fields: list[list[str]]) -> tuple[Floats, str]:
    """(N,) times [s]: of the names where all tell one and none twice, else a second from one to the next."""
    told = [words[TIME] if len(words) > TIME else "" for words in fields]
    try:
        times = [datetime.strptime(word, "%Y%m%d_%H%M%S").replace(tzinfo=UTC).timestamp() for word in told]
    except ValueError:
        times = []
    if times and len(set(times)) == len(times):
        return np.array(times), "times: of the names"
    return np.arange(len(fields), dtype=np.float64), "times: none in the names; a second from picture to picture"
