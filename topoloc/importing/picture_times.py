"""When pictures were taken: by a list, by the times in their names, by the camera's own note, or by a steady rate."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.importing.csv_table import read_table
from topoloc.importing.name_times import name_times
from topoloc.importing.recording_sink import RecordingSink
from topoloc.importing.time_units import NAME_THE_UNIT, TIME_UNITS, unclear_step, unit_by_size

EXIF_TAKEN, EXIF_FRACTION, EXIF_ZONE = 36867, 37521, 36881
"""Numbers of EXIF's DateTimeOriginal, SubSecTimeOriginal and OffsetTimeOriginal."""


@dataclass(frozen=True)
class Shot:
    """What a picture file tells of itself.

    Attributes:
        path: of the file.
        size: columns and rows, upright.
        exif_s: when it was taken [s since 1970], where the camera noted it; in its own time zone where it noted none.
    """

    path: Path
    size: tuple[int, int]
    exif_s: float | None


@dataclass(frozen=True)
class Dated:
    """Pictures with their times.

    Attributes:
        shots: the pictures.
        times: (N,) of each [s].
        how: what the times are from, as a user is told.
    """

    shots: Sequence[Shot]
    times: Sequence[float]
    how: str


def date(shots: Sequence[Shot], fps: float | None, times: Path | None, sink: RecordingSink) -> Dated:
    """When each picture was taken.

    Args:
        shots: in the order of their files.
        fps: a steady rate, pictures a second; None: not told.
        times: a CSV file with the columns ``file`` and ``time_s``; None: not told. Without both, times are looked for
            in the files' names, then in EXIF.
        sink: pictures without a time are noted there.

    Raises:
        UserError: both are told, or none tells a time.
    """
    if fps is not None and times is not None:
        raise UserError("--fps and --times both tell when the pictures were taken; give one of the two")
    if fps is not None:
        if not 0.0 < fps < np.inf:
            raise UserError(f"--fps is {fps:g}; give pictures a second, above 0")
        return Dated(shots, [i / fps for i in range(len(shots))], f"{fps:g} pictures a second, in the files' order")
    if times is not None:
        listed = _listed(times)
        return _where(shots, lambda shot: listed.get(shot.path.name), f"from {times}", f"is not in {times.name}", sink)
    named = name_times([shot.path.stem for shot in shots])
    if named is not None:
        in_name = {shot.path: time for shot, time in zip(shots, named.times, strict=True)}
        why_not = "has no time in its name, as most have"
        dated = _where(shots, lambda shot: in_name[shot.path], "from the files' names", why_not, sink)
        how = f"{dated.how}, such as {dated.shots[0].path.name}"
        if named.whole_seconds:
            return replace(_spread(dated), how=f"{how}; those of one second are spread evenly over it")
        return replace(dated, how=how)
    if 2 * sum(shot.exif_s is not None for shot in shots) > len(shots):
        how = "as the camera noted them (EXIF); those of one second are spread evenly over it"
        return _spread(_where(shots, lambda shot: shot.exif_s, how, "has no time in its EXIF, as most have", sink))
    remedy = "give --fps, how many were taken a second, or --times, a CSV with the columns file,time_s"
    raise UserError(f"neither the names nor the EXIF of the pictures tell when they were taken; {remedy}")


def _where(
    shots: Sequence[Shot], time_of: Callable[[Shot], float | None], how: str, why_not: str, sink: RecordingSink
) -> Dated:
    """The pictures that have a time; the others are noted as left out."""
    dated = [(shot, time) for shot, time in ((shot, time_of(shot)) for shot in shots) if time is not None]
    sink.drop("picture", why_not, len(shots) - len(dated))
    return Dated([shot for shot, _ in dated], [time for _, time in dated], how)


def _spread(dated: Dated) -> Dated:
    """Pictures of equal times, where only the second is known, at even steps within it, in the files' order."""
    count = Counter(dated.times)
    seen: Counter[float] = Counter()
    times = []
    for time in dated.times:
        times.append(time + seen[time] / count[time])
        seen[time] += 1
    return Dated(dated.shots, times, dated.how)


def _listed(path: Path) -> dict[str, float]:
    """Times [s] by file name. Raises ``InputError`` naming what the CSV file lacks."""
    table = read_table(path, "file,time_s")
    named = {column.quantity: column for column in table.columns}
    file = next((named[name] for name in ("file", "filename", "path", "image", "name") if name in named), None)
    time = next((named[name] for name in ("time", "timestamp", "t", "stamp") if name in named), None)
    if file is None or time is None:
        lacks = "file" if file is None else "time_s"
        raise InputError(path, f"has no column {lacks!r}", "name its columns file,time_s")
    values = table.numbers(time)
    unit = time.unit or unit_by_size(float(values[0]))
    if unit not in TIME_UNITS:
        raise InputError(path, f"the column {time.name!r} is in {unit!r}", f"write one of: {', '.join(TIME_UNITS)}")
    if time.unit is None and (step := unclear_step(values)) is not None:
        raise InputError(path, f"column {time.name!r} has no unit, and steps by {step:g}", NAME_THE_UNIT)
    return {
        Path(name).name: float(value * TIME_UNITS[unit]) for name, value in zip(table.words(file), values, strict=True)
    }


def time_taken(notes: Mapping[int, Any]) -> float | None:
    """When a picture was taken [s since 1970], as EXIF notes it; None where it does not."""
    zone = str(notes.get(EXIF_ZONE, "+00:00")).strip("\0 ")
    try:
        moment = datetime.strptime(str(notes[EXIF_TAKEN]).strip("\0 ") + zone, "%Y:%m:%d %H:%M:%S%z")
    except (KeyError, ValueError):
        return None
    digits = str(notes.get(EXIF_FRACTION, "")).strip("\0 ")
    return moment.astimezone(UTC).timestamp() + (float(f"0.{digits}") if digits.isdecimal() else 0.0)
