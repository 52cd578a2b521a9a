"""What two benchmark runs must agree in: rows but for what tells of the machine, and the files beside them."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from benchmarks.results import COLUMNS, COSTS, Row


def without_costs(rows: Sequence[Row]) -> list[dict[str, str]]:
    """The cells of rows by column, times and memory left out."""
    tables = [dict(zip(COLUMNS, row.cells(), strict=True)) for row in rows]
    return [{name: cell for name, cell in table.items() if name not in COSTS} for table in tables]


def files_of(folder: Path) -> dict[str, bytes]:
    """What lies under steps/ and replay/, hidden files among it."""
    kept = [path for name in ("steps", "replay") for path in (folder / name).rglob("*") if path.is_file()]
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in kept}
