"""Odometry as lines of text: a robot's driver pipes it into ``topoloc run MAP --odometry -``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from threading import Event

import numpy as np

from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.importing import csv_table
from topoloc.importing.odometry_csv import EXAMPLE, QUANTITIES
from topoloc.importing.time_units import unit_by_size
from topoloc.live.engine import LiveLocalizer

COLUMNS = ("time", "x", "y", "heading")
WAYS = f"write 'time x y theta' lines in seconds, metres and radians, or a first line such as {EXAMPLE}"

Parse = Callable[[str], tuple[float, Floats]]
"""A line as time [s] and pose (3,). Raises ``ValueError`` for one that is no reading."""


class LineFeed:
    """Hands on the readings in lines of text, as they come.

    Args:
        lines: numbers, separated by blanks or commas; the first one, or a comment right above them, may name the
            columns with their units, by the rules of ``topoloc.importing.csv_table``.
    """

    def __init__(self, lines: Iterable[str]) -> None:
        self._lines = lines

    def __call__(self, live: LiveLocalizer, stop: Event) -> None:
        """Hand on readings until the lines end. A line that is none is counted as bad.

        Raises:
            UserError: the first line neither is a reading nor names the columns.
        """
        parse: Parse | None = None
        comment = ""
        for line in self._lines:
            if stop.is_set():
                return
            text = line.strip().lstrip("\ufeff")
            if not text or text.startswith("#"):
                comment = text.lstrip("# ") or comment
                continue
            if parse is None and not _is_number(_cells(text)[0]):
                parse = _by_header(text)
                continue
            if parse is None and not _lacking(_columns(comment)):
                parse = _by_header(comment)
            if parse is None:
                parse = _plain
                _check(text)
            try:
                live.on_odometry(*parse(text))
            except (ValueError, IndexError):
                live.on_odometry(np.nan, np.full(3, np.nan))


def _cells(text: str) -> list[str]:
    return text.replace(",", " ").replace(";", " ").split() or [""]


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _plain(text: str) -> tuple[float, Floats]:
    time, *pose = (float(word) for word in _cells(text))
    return time, np.array(pose)


def _check(text: str) -> None:
    if len(_cells(text)) != 4 or not all(map(_is_number, _cells(text))):
        raise UserError(f"--odometry -: the first line is {text[:60]!r}; {WAYS}")


def _split(line: str) -> list[str]:
    """The cells of a header, or of a line below it; empty ones keep their place."""
    return csv_table.cells_of(line, csv_table.separator_of(line))


def _columns(header: str) -> dict[str, csv_table.Column]:
    """The columns that a line names, by quantity."""
    columns = [csv_table.column_of(i, name) for i, name in enumerate(_split(header)) if name]
    return {what: column for column in columns for what in COLUMNS if column.quantity in QUANTITIES[what].names}


def _lacking(found: Mapping[str, csv_table.Column]) -> list[str]:
    """The quantities that no column tells in a unit of theirs; some have one by default, times show it."""
    units = {what: column.unit or QUANTITIES[what].default for what, column in found.items()}
    timeless = {"time"} if "time" in units and units["time"] is None else set()
    return [what for what in COLUMNS if units.get(what) not in QUANTITIES[what].units and what not in timeless]


def _by_header(text: str) -> Parse:
    """How to read lines below a line that names the columns."""
    found, count = _columns(text), len(_split(text))
    missing = _lacking(found)
    if missing:
        raise UserError(f"--odometry -: the first line {text[:60]!r} names no {', '.join(missing)} with a unit; {WAYS}")
    units = {what: column.unit or QUANTITIES[what].default for what, column in found.items()}

    def parse(line: str) -> tuple[float, Floats]:
        cells = _split(line)
        if any(cells[count:]):  # decimal commas make more cells
            raise ValueError
        values = np.array([float(cells[found[what].index]) for what in COLUMNS])
        if units["time"] is None and np.isfinite(values[0]):
            units["time"] = unit_by_size(float(values[0]))
        values *= [QUANTITIES[what].units[units[what] or "s"] for what in COLUMNS]
        return float(values[0]), values[1:]

    return parse
