"""``results.csv``: a row per run, appended and synced as each finishes, so that a killed benchmark loses nothing."""

from __future__ import annotations

import csv
import io
import os
import statistics
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import TracebackType
from typing import Self

from topoloc.errors import InputError, UserError
from topoloc.files import read_text, write_text
from topoloc.metrics import METRICS

OK, FAILED, UNAVAILABLE = "ok", "failed", "unavailable"
VALUES = tuple(metric.name for metric in METRICS)
COSTS = tuple(metric.name for metric in METRICS if metric.of_machine)
"""Columns that another run of the same settings may fill otherwise."""
COLUMNS = ("scenario", "sensor", "estimator", "seed", "status", "reason", *VALUES)

Key = tuple[str, str, str, int]


@dataclass(frozen=True)
class Row:
    """One run: a sensor and an estimator on one drive of a scenario.

    Attributes:
        scenario, sensor, estimator, seed: which run.
        status: ``ok``, ``failed`` (it crashed) or ``unavailable`` (the scenario cannot feed it, a package is missing).
        reason: one line, where the status is not ``ok``.
        values: metrics and costs by column; None where undefined.
    """

    scenario: str
    sensor: str
    estimator: str
    seed: int
    status: str = OK
    reason: str = ""
    values: Mapping[str, float | None] = field(default_factory=dict)

    @property
    def key(self) -> Key:
        """What no two rows of a benchmark share, and what they are sorted by."""
        return self.scenario, self.sensor, self.estimator, self.seed

    def cells(self) -> list[str]:
        """Its cells in the order of ``COLUMNS``."""
        head = [self.scenario, self.sensor, self.estimator, str(self.seed), self.status, self.reason]
        return head + [_cell(self.values.get(name)) for name in VALUES]


@dataclass(frozen=True)
class Summary:
    """A pair's value of one column over the seeds of a scenario.

    Attributes:
        values: of the seeds that have one.
        status: ``ok`` if any run came to an end, else that of the first.
        reason: of the first run that is not ``ok``.
    """

    values: tuple[float, ...]
    status: str
    reason: str

    @property
    def mean(self) -> float | None:
        """Over the seeds; None where there is no value."""
        return statistics.fmean(self.values) if self.values else None

    @property
    def deviation(self) -> float | None:
        """Sample standard deviation over the seeds; None where there are fewer than two values."""
        return statistics.stdev(self.values) if len(self.values) > 1 else None

    def text(self, digits: int = 2, unit: str = "") -> str:
        """Mean and sample standard deviation over the seeds; the status, or a dash, where there is no value."""
        if self.mean is None:
            return "-" if self.status == OK else self.status
        spread = "" if self.deviation is None else f" ± {self.deviation:.{digits}f}"
        return f"{self.mean:.{digits}f}{spread}{unit}"


def summarize(rows: Iterable[Row], column: str) -> dict[tuple[str, str, str], Summary]:
    """One column over the seeds, by scenario, sensor and estimator."""
    groups: dict[tuple[str, str, str], list[Row]] = {}
    for row in rows:
        groups.setdefault((row.scenario, row.sensor, row.estimator), []).append(row)
    summaries = {}
    for key, group in groups.items():
        values = tuple(value for row in group if (value := row.values.get(column)) is not None)
        bad = [row for row in group if row.status != OK]
        status = bad[0].status if len(bad) == len(group) else OK
        summaries[key] = Summary(values, status, bad[0].reason if bad else "")
    return summaries


def _cell(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _line(cells: Sequence[str]) -> str:
    buffer = io.StringIO(newline="")
    csv.writer(buffer, lineterminator="\n").writerow(cells)
    return buffer.getvalue()


def read_results(path: Path) -> list[Row]:
    """The rows of a ``results.csv``; a last line that was only half written when the power went is left out.

    Raises:
        InputError: the file is missing, or is no such table.
    """
    remedy = "name the folder of a benchmark run, or restore the file"
    text = read_text(path, remedy)
    whole = text[: text.rfind("\n") + 1]
    lines = list(csv.reader(io.StringIO(whole)))
    if lines and tuple(lines[0]) != COLUMNS:
        raise InputError(path, "does not have the columns of a results.csv of this version", remedy, line=1)
    rows = []
    for number, cells in enumerate(lines[1:], start=2):
        try:
            rows.append(_row(cells))
        except ValueError:
            raise InputError(path, "is not a row of results", "delete the line", line=number) from None
    return rows


def _row(cells: Sequence[str]) -> Row:
    if len(cells) != len(COLUMNS):
        raise ValueError("another number of cells than columns")
    scenario, sensor, estimator, seed, status, reason, *rest = cells
    values = {name: float(cell) if cell else None for name, cell in zip(VALUES, rest, strict=True)}
    return Row(scenario, sensor, estimator, int(seed), status, reason, values)


class ResultsFile:
    """The ``results.csv`` of a running benchmark; as a context manager it sorts the rows at the end, come what may.

    Args:
        path: of the file; rewritten whole with ``rows``.
        rows: that are there already.
    """

    def __init__(self, path: Path, rows: Iterable[Row] = ()) -> None:
        self.path, self.rows = path, list(rows)
        self._write(self.rows)

    def append(self, row: Row) -> None:
        """Add a row; when this returns it is on the disk."""
        self.rows.append(row)  # first: after a Ctrl-C in the midst of what follows, all of them are written at the end
        try:
            with self.path.open("a", encoding="utf-8", newline="") as file:
                file.write(_line(row.cells()))
                file.flush()
                os.fsync(file.fileno())
        except OSError as error:
            reason = f"{self.path}: cannot be written ({error.strerror})"
            raise UserError(f"{reason}; make room, then continue with --resume {self.path.parent}") from error

    def _write(self, rows: Iterable[Row]) -> None:
        write_text(self.path, "".join([_line(COLUMNS), *(_line(row.cells()) for row in rows)]))

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.rows.sort(key=lambda row: row.key)
        if not isinstance(error, UserError):  # a full disk: the rows lie there unsorted, and --resume reads them so
            self._write(self.rows)
