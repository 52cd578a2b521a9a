"""A CSV file of numbers: its separator is found, its columns have names with units, and errors name line and column."""

from __future__ import annotations

import csv
import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NoReturn

import numpy as np

from topoloc.errors import InputError
from topoloc.files import read_text
from topoloc.geometry import Floats

SPELLINGS = {
    "s": ("s", "sec", "second", "seconds"),
    "ms": ("ms", "msec", "millisecond", "milliseconds"),
    "us": ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
    "ns": ("ns", "nsec", "nanosecond", "nanoseconds"),
    "m": ("m", "metre", "metres", "meter", "meters"),
    "cm": ("cm",),
    "mm": ("mm",),
    "rad": ("rad", "radian", "radians"),
    "deg": ("deg", "degree", "degrees", "°"),
    "ticks": ("tick", "ticks"),
    "m_s": ("m_s", "m/s", "mps"),
    "cm_s": ("cm_s", "cm/s"),
    "mm_s": ("mm_s", "mm/s"),
    "rad_s": ("rad_s", "rad/s"),
    "deg_s": ("deg_s", "deg/s", "°/s"),
}
"""Units, and how they may be written."""
UNITS = {spelling: unit for unit, spellings in SPELLINGS.items() for spelling in spellings}
BRACKETS = re.compile(r"(?P<quantity>.+?)\s*[\[(]\s*(?P<unit>[^\])]+?)\s*[\])]")


@dataclass(frozen=True)
class Column:
    """What a column's name says.

    Attributes:
        index: of the column, from 0.
        name: as it stands in the file.
        quantity: the name in small letters and without its unit.
        unit: one of ``SPELLINGS``, what stands in its brackets where that is none, or None where it names none.
    """

    index: int
    name: str
    quantity: str
    unit: str | None


@dataclass(frozen=True)
class CsvTable:
    """The cells of a CSV file.

    Attributes:
        path: of the file.
        columns: as its first line names them.
        lines: (N,) 1-based line of each row.
        rows: (N,) the cells of each row, one a column.
    """

    path: Path
    columns: tuple[Column, ...]
    lines: Sequence[int]
    rows: Sequence[Sequence[str]]

    def words(self, column: Column) -> list[str]:
        """(N,) cells of a column as they stand there."""
        return [row[column.index] for row in self.rows]

    def numbers(self, column: Column) -> Floats:
        """(N,) finite numbers of a column. Raises ``InputError`` naming the first cell that is none."""
        words = self.words(column)
        try:
            values = np.array(words).astype(np.float64)
        except ValueError:
            values = np.array([_number(word) for word in words])
        wrong = np.flatnonzero(~np.isfinite(values))
        if wrong.size:
            self.refuse(column, int(wrong[0]))
        return values

    def refuse(self, column: Column, row: int) -> NoReturn:
        """Raise ``InputError`` for a cell that is no finite number."""
        word = self.rows[row][column.index].strip()
        line = self.lines[row]
        if re.fullmatch(r"[+-]?\d+,\d+", word):
            point = word.replace(",", ".")
            raise InputError(self.path, f"column {column.name!r}: {word!r} has a decimal comma", f"write {point}", line)
        problem = f"column {column.name!r}: {word!r} is not a finite number" if word else f"no {column.name!r}"
        raise InputError(self.path, problem, "correct or delete the line", line)


def _number(word: str) -> float:
    try:
        return float(word)
    except ValueError:
        return math.nan


def read_table(path: Path, example: str) -> CsvTable:
    """Read a CSV file whose first line names its columns; ``,`` ``;`` tab and blanks separate.

    Lines that begin with ``#`` are comments; where there are some before the first row, the last of them names the
    columns, as in TUM's files.

    Args:
        path: of the file, UTF-8, with or without a byte order mark.
        example: of a first line, for the error that misses it.

    Raises:
        InputError: no rows, no names, or a row of another number of cells; names file and line.
    """
    texts = read_text(path, f"export it as CSV in UTF-8, first line {example}").splitlines()
    filled = [(line, text) for line, text in enumerate(texts, start=1) if text.strip(" \t;,")]
    head = _header(filled)
    body = [(line, text) for line, text in filled[head + 1 :] if not _comment(text)]
    if not body:
        raise InputError(path, "holds no rows", f"write a line of names such as {example}, and below it the numbers")
    head_line, header = filled[head]
    separator = separator_of(header)
    names = cells_of(header.lstrip(" #"), separator)
    if _has_numbers(header):
        raise InputError(path, "names no columns", f"write a line above it such as {example}", head_line)
    columns = tuple(column_of(i, name) for i, name in enumerate(names) if name)
    rows = [_row(path, line, cells_of(text, separator), len(names)) for line, text in body]
    return CsvTable(path, columns, [line for line, _ in body], rows)


def _header(filled: Sequence[tuple[int, str]]) -> int:
    """Which of the lines names the columns: the first that is no comment, or, if that is numbers, the one above it."""
    first = next((i for i, (_, text) in enumerate(filled) if not _comment(text)), 0)
    return first - 1 if first and _has_numbers(filled[first][1]) else first


def _comment(text: str) -> bool:
    return text.lstrip().startswith("#")


def _has_numbers(text: str) -> bool:
    return any(math.isfinite(_number(cell)) for cell in cells_of(text.lstrip(" #"), separator_of(text)))


def separator_of(header: str) -> str | None:
    """What separates the cells; None: blanks."""
    return next((mark for mark in ("\t", ";", ",") if mark in header), None)


def cells_of(text: str, separator: str | None) -> list[str]:
    """The cells of a line, stripped; a separator of None stands for blanks."""
    if separator is None:
        return text.split()
    if '"' not in text:
        return [cell.strip() for cell in text.split(separator)]
    try:
        return [cell.strip() for cell in next(csv.reader([text], delimiter=separator, skipinitialspace=True))]
    except csv.Error:  # a cell too long to be one
        return [text]


def _row(path: Path, line: int, cells: list[str], count: int) -> list[str]:
    """The cells of a row; empty ones beyond the last column do no harm."""
    if len(cells) < count or any(cells[count:]):
        raise InputError(
            path, f"{len(cells)} cells for {count} columns", "write one a column, decimals with a point", line
        )
    return cells[:count]


def column_of(index: int, name: str) -> Column:
    """A column's quantity and unit: ``x_mm``, ``x [mm]`` and ``x (mm)`` are one thing."""
    lower = name.strip().lower()
    brackets = BRACKETS.fullmatch(lower)
    if brackets:
        return Column(index, name, _plain(brackets["quantity"]), UNITS.get(brackets["unit"], brackets["unit"]))
    parts = lower.split("_")
    for count in (2, 1):  # m_s before s
        unit = UNITS.get("_".join(parts[-count:]))
        if unit is not None and any(parts[:-count]):
            return Column(index, name, _plain("_".join(parts[:-count])), unit)
    return Column(index, name, _plain(lower), None)


def _plain(quantity: str) -> str:
    """``pose.pose.position.x`` and ``/odom/pose/position/x`` as ``position.x``."""
    return ".".join(quantity.replace("/", ".").split(".")[-2:]).replace(" ", "_")
