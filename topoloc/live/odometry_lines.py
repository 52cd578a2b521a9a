"""Odometry as lines of text: a robot's driver pipes it into ``topoloc run MAP --odometry -``."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from threading import Event

import numpy as np

from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.importing.odometry_csv import EXAMPLE, QUANTITIES
from topoloc.live.engine import LiveLocalizer

COLUMNS = ("time", "x", "y", "heading")
WAYS = f"write 'time x y theta' lines in seconds, metres and radians, or a first line such as {EXAMPLE}"

Parse = Callable[[str], tuple[float, Floats]]
"""A line as time [s] and pose (3,). Raises ``ValueError`` for one that is no reading."""


class LineFeed:
    """Hands on the readings in lines of text, as they come.

    Args:
        lines: numbers, separated by blanks or commas; the first one may name the columns with their units.
    """

    def __init__(self, lines: Iterable[str]) -> None:
        self._lines = lines

    def __call__(self, live: LiveLocalizer, stop: Event) -> None:
        """Hand on readings until the lines end. A line that is none is counted as bad.

        Raises:
            UserError: the first line neither is a reading nor names the columns.
        """
        parse: Parse | None = None
        for line in self._lines:
            if stop.is_set():
                return
            text = line.strip().lstrip("\ufeff")
            if not text or text.startswith("#"):
                continue
            if parse is None and not _is_number(_cells(text)[0]):
                parse = _by_header(text)
                continue
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


def _by_header(text: str) -> Parse:
    """How to read lines below a first line that names the columns."""
    found: dict[str, tuple[int, float]] = {}
    for i, name in enumerate(_cells(text.lower())):
        stem, _, ending = name.rpartition("_")
        for what in COLUMNS:
            quantity = QUANTITIES[what]
            if stem in quantity.names and ending in quantity.units:
                found[what] = i, quantity.units[ending]
    missing = [what for what in COLUMNS if what not in found]
    if missing:
        raise UserError(f"--odometry -: the first line {text[:60]!r} names no {', '.join(missing)} with a unit; {WAYS}")
    places, units = zip(*(found[what] for what in COLUMNS), strict=True)

    def parse(line: str) -> tuple[float, Floats]:
        cells = _cells(line)
        values = np.array([float(cells[place]) for place in places]) * np.array(units)
        return float(values[0]), values[1:]

    return parse
