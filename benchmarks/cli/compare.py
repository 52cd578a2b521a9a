"""``topoloc compare``: two benchmark runs side by side, or two pairs of sensor and estimator."""

from __future__ import annotations

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from topoloc.errors import UserError

if TYPE_CHECKING:
    from rich.table import Table

    from benchmarks.compare import Line

METRICS = ("node_accuracy", "position_median_m")
MOST_WARNINGS = 10
FILE_WIDTH = 120
"""Of tables that go to no terminal [characters]."""
LONGEST_WORD = len("difference")
"""Of what B is: broken between words only."""


def compare(
    run: Annotated[Path, Parameter(help="Folder of a benchmark run: A.")],
    other: Annotated[Path | None, Parameter(help="Folder of another one: B; without it, --pairs of the first.")] = None,
    /,
    *,
    metric: Annotated[
        tuple[str, ...],
        Parameter(consume_multiple=True, negative_iterable=(), help="Columns of results.csv."),
    ] = METRICS,
    pairs: Annotated[
        tuple[str, str] | None,
        Parameter(negative_iterable=(), help="SENSOR/ESTIMATOR of A, and that of B: a line for each scenario."),
    ] = None,
    as_json: Annotated[bool, Parameter(name="--json", help="Print a list of lines instead.", negative="")] = False,
) -> None:
    """Compare two runs, or two pairs of sensor and estimator, over the drives and seeds that both have.

    Example: ``topoloc compare runs/old runs/new``, ``topoloc compare runs/new --pairs ima/activity pca/particle``

    Settings that differ are told on the error stream.
    """
    from benchmarks.compare import compare_pairs, compare_runs, notes, pair_of, read_run, warnings

    if other is None and pairs is None:
        raise UserError("one run needs --pairs ima/activity pca/particle, say; or name a second run")
    a = read_run(run)
    b = a if other is None else read_run(other)
    chosen = None if pairs is None else (pair_of(pairs[0]), pair_of(pairs[1]))
    metrics = list(dict.fromkeys(metric))
    compared = [compare_runs(a, b, m) if chosen is None else compare_pairs(a, b, m, chosen) for m in metrics]
    lines = [line for part in compared for line in part]
    _warn([*warnings(a, b, metrics, chosen), *notes(a, b, lines)])
    if as_json:
        print(json.dumps([line.row() for line in lines], indent=2))
        return
    for letter, folder, pair in zip("AB", (a.folder, b.folder), chosen or (None, None), strict=True):
        print(f"{letter}: {folder}" if pair is None else f"{letter}: {'/'.join(pair)} in {folder}")
    _print_tables(compared, by_scenario=chosen is None)


def _warn(found: Sequence[str]) -> None:
    """The first ones, and how many more there are."""
    for text in found[:MOST_WARNINGS]:
        print(f"warning: {text}", file=sys.stderr)
    if len(found) > MOST_WARNINGS:
        print(f"warning: and {len(found) - MOST_WARNINGS} more", file=sys.stderr)


def _print_tables(compared: Sequence[Sequence[Line]], by_scenario: bool) -> None:
    """A table for each metric, of one line for each scenario, or one for each scenario; and how to read them."""
    from rich.console import Console

    from benchmarks.spread import FEWEST_PAIRS

    console = Console(markup=False, emoji=False, highlight=False, width=None if sys.stdout.isatty() else FILE_WIDTH)
    for lines in compared:
        if not by_scenario:
            console.print(_table(lines, ("scenario",), [(line.scenario,) for line in lines]))
            continue
        for scenario in dict.fromkeys(line.scenario for line in lines):
            own = [line for line in lines if line.scenario == scenario]
            console.print(_table(own, ("sensor", "estimator"), [line.a for line in own], f", {scenario}"))
    console.print(
        "B - A: mean over the pairs (same drive, same seed) and its 95 % bootstrap interval. It is called a difference "
        f"where that excludes zero, from {FEWEST_PAIRS} pairs on (of fewer the interval is too narrow); of equal ones "
        "about one in 20 is called so by chance."
    )


def _table(lines: Sequence[Line], heads: Sequence[str], names: Sequence[Sequence[str]], of_what: str = "") -> Table:
    """Of lines in one metric; each begins with its names."""
    from rich import box
    from rich.table import Table

    from benchmarks.spread import better

    metric = lines[0].metric
    way = better(metric)
    title = f"{metric}{of_what}" + ("" if way == "neither" else f" ({way} is better)")
    table = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0))
    for head in heads:
        table.add_column(head, overflow="fold")
    for head in ("A", "B", "B - A of |value - 3|" if way == "near 3" else "B - A", "pairs"):
        table.add_column(head, justify="right", no_wrap=True)
    table.add_column("B is", min_width=LONGEST_WORD)
    for name, line in zip(names, lines, strict=True):
        table.add_row(*name, *_cells(line))
    return table


def _cells(line: Line) -> tuple[str, ...]:
    difference, interval = line.difference, line.difference.interval
    spread = "" if interval is None else f" ({_digits(interval.low)} to {_digits(interval.high)})"
    left_out = f" ({difference.left_out} left out)" if difference.left_out else ""
    means = (_digits(line.mean_a), _digits(line.mean_b))
    return (*means, f"{_digits(difference.mean)}{spread}", f"{difference.pairs}{left_out}", line.verdict)


def _digits(value: float | None) -> str:
    """Three places below 10, fewer above; a dash for no value."""
    if value is None:
        return "-"
    places = 3 if abs(value) < 10.0 else 1 if abs(value) < 1000.0 else 0
    return f"{round(value, places) + 0.0:.{places}f}"  # plus zero: no minus before a rounded nothing
