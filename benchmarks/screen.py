"""What a benchmark run shows on the screen when it ends."""

from __future__ import annotations

import json
from collections.abc import Collection, Sequence
from pathlib import Path

from rich import box
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from benchmarks.results import FAILED, OK, UNAVAILABLE, Row, Summary, summarize


def print_tables(rows: Sequence[Row], recorded: Collection[str]) -> None:
    """For each scenario sensors by estimators: node accuracy; sensors that gave nothing there are left out.

    Args:
        rows: of ``results.csv``.
        recorded: names of the scenarios that are not simulated.
    """
    console, accuracy = Console(), summarize(rows, "node_accuracy")
    for scenario in dict.fromkeys(row.scenario for row in rows):
        own = [row for row in rows if row.scenario == scenario]
        sensors = list(dict.fromkeys(row.sensor for row in own if row.status == OK))
        if not sensors:
            continue
        kind = "recorded" if scenario in recorded else "simulated"
        console.print(f"{escape(scenario)} ({kind}): node accuracy, %, mean ± standard deviation", style="italic")
        heads = (escape(name).replace("-", "-\n") for name in sensors)
        table = Table("", *heads, box=box.SIMPLE, padding=(0, 1, 0, 0))
        for estimator in dict.fromkeys(row.estimator for row in own):
            cells = (_cell(accuracy.get((scenario, sensor, estimator))) for sensor in sensors)
            table.add_row(escape(estimator), *cells)
        console.print(table)


def print_problems(rows: Sequence[Row]) -> None:
    """How many runs failed, or could not be fed, and the first reason of each kind; nothing where all is well."""
    for status in (FAILED, UNAVAILABLE):
        bad = [row for row in rows if row.status == status]
        if bad:
            first = f"{bad[0].sensor} with {bad[0].estimator} on {bad[0].scenario}, seed {bad[0].seed}"
            print(f"{len(bad)} of {len(rows)} runs {status}, the first {first}: {bad[0].reason}")


def print_json(folder: Path, rows: Sequence[Row], expected: int) -> None:
    """The same for machines: one object, the metrics of every row by name, null where undefined.

    Args:
        folder: of the run.
        rows: of ``results.csv``.
        expected: rows of the whole run.
    """
    told = [
        {
            "scenario": row.scenario,
            "sensor": row.sensor,
            "estimator": row.estimator,
            "seed": row.seed,
            "status": row.status,
            "reason": row.reason,
            **row.values,
        }
        for row in rows
    ]
    print(json.dumps({"folder": str(folder), "unfinished": expected - len(rows), "rows": told}, indent=1))


def _cell(accuracy: Summary | None) -> str:
    if accuracy is None:
        return ""
    if accuracy.mean is None:
        return accuracy.text()
    spread = "" if accuracy.deviation is None else f" ± {100 * accuracy.deviation:.0f}"
    return f"{100 * accuracy.mean:.0f}{spread}"
