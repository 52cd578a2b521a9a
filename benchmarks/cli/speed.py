"""``topoloc speed``: our steps beside other people's libraries, in one run."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from topoloc.errors import UnknownName, UserError

if TYPE_CHECKING:
    from benchmarks.speed.case import Case, Result

REPEATS = 21
EXIT_ANSWERS_DIFFER = 1


def speed(
    what: Annotated[str | None, Parameter(help="Only this work, or group such as estimators.")] = None,
    *,
    repeats: Annotated[int, Parameter(help="Samples of ours and of the peer's.")] = REPEATS,
    as_json: Annotated[bool, Parameter(name="--json", help="Print a list of rows instead.", negative="")] = False,
) -> int:
    """Time our steps beside libraries that do the same, and check that both give the same answer.

    Example: ``topoloc speed estimators``, ``topoloc speed resampling --json``

    The exit code is 1 where answers differ.
    """
    from benchmarks import speed as registry
    from benchmarks.speed.case import choose, measure, names
    from topoloc.cli.progress import track

    if repeats < 1:
        raise UserError(f"--repeats is {repeats}; give a whole number from 1 on")
    cases = list(registry.CASES) if what is None else choose(registry.CASES, what)
    if what is not None and not cases:
        raise UnknownName("comparison", what, names(registry.CASES))
    _tell_missing(cases)
    able = [case for case in cases if not case.missing]
    results = [measure(case, repeats) for case in track(able, "measuring")]
    if as_json:
        print(json.dumps([result.row() for result in results], indent=2))
    else:
        _print_tables(results, repeats)
    return 0 if all(result.agree for result in results) else EXIT_ANSWERS_DIFFER


def _tell_missing(cases: Sequence[Case]) -> None:
    """A line for each package that is not installed, beside the output."""
    for package, count in Counter(package for case in cases for package in case.missing).items():
        print(f"{package}: not installed; make speed installs it; left out: {count} of {len(cases)}", file=sys.stderr)


def _print_tables(results: Sequence[Result], repeats: int) -> None:
    """A table for each kind of work."""
    from rich import box
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, emoji=False, highlight=False)
    for what in dict.fromkeys(result.case.what for result in results):
        table = Table("size", "beside", title=what, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0))
        for name in ("ours", "peer", "ratio"):
            table.add_column(name, justify="right", no_wrap=True)
        table.add_column("agree")
        for result in results:
            if result.case.what == what:
                table.add_row(*_cells(result))
        console.print(table)
    if results:
        console.print(f"Times in ms, medians of {repeats} samples by turns, on one thread.")
        console.print("Ratio: the peer's time by ours, median (quartiles).")


def _cells(result: Result) -> tuple[str, ...]:
    ratio = f"{_digits(result.ratio)} ({_digits(result.ratio_low)} to {_digits(result.ratio_high)})"
    times = (_digits(result.ours_ms), _digits(result.peer_ms))
    return (result.case.size, result.case.peer, *times, ratio, "yes" if result.agree else "no")


def _digits(value: float) -> str:
    """At least two digits that count, and two places at most."""
    return f"{value:.2f}" if value < 10.0 else f"{value:.1f}" if value < 100.0 else f"{value:.0f}"
