"""A finished run that is written about."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks.choice import REMEDY, Choice, read_choice
from benchmarks.compare import BenchRun, read_run
from benchmarks.results import Row
from topoloc.errors import InputError

NEEDED = {"run": ("started",), "machine": ("system", "processor", "cores")}
"""Keys of ``config.toml`` that the report tells, beside those of the choice."""


@dataclass(frozen=True)
class Published:
    """A finished run.

    Attributes:
        run: its folder, settings and rows.
        choice: what it was started with.
    """

    run: BenchRun
    choice: Choice

    @classmethod
    def of(cls, folder: Path) -> Published:
        """Read a run. Raises ``InputError`` where it is none, or is not finished."""
        run = read_run(folder)
        for name, keys in NEEDED.items():
            lacking = [key for key in keys if key not in run.table(name)]
            if lacking:
                raise InputError(folder / "config.toml", f"[{name}] has no {lacking[0]}", REMEDY)
        if run.missing:
            problem = f"is not finished: lacks {run.missing} of {run.missing + len(run.rows)} rows"
            raise InputError(folder, problem, f"continue it: topoloc bench --resume {folder}")
        return cls(run, read_choice(folder))

    @property
    def date(self) -> str:
        """When it was started: year, month and day."""
        return str(self.run.table("run")["started"])[:10]

    @property
    def machine(self) -> Mapping[str, Any]:
        """What it ran on."""
        return self.run.table("machine")

    def names(self, what: str) -> list[str]:
        """Names of its ``scenarios``, ``sensors`` or ``estimators``, as they were asked for."""
        return list(self.run.table(what))

    def rows_of(self, scenario: str) -> list[Row]:
        """Rows of one scenario."""
        return [row for row in self.run.rows if row.scenario == scenario]
