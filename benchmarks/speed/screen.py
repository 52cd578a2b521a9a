"""What ``topoloc speed`` shows on the screen: a table for each kind of work, for each that grows, for each profile."""

from __future__ import annotations

import math
import shutil
import sys
from collections.abc import Sequence

from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks.speed.case import Result
from benchmarks.speed.growth import Growth, Point
from benchmarks.speed.machine import Limits
from benchmarks.speed.profile import Part, Profiled

WIDTH, LEAST_WIDTH = 110, 80
"""Columns of the tables in a file or a pipe, and on a terminal at least: figures stay whole where lines break."""
NAMED = 0.03
"""Functions with a smaller share of the update are told together."""


def make_console() -> Console:
    """Plain text: names may hold brackets, and numbers need no colours; wide where no terminal says how wide."""
    width = max(shutil.get_terminal_size().columns, LEAST_WIDTH) if sys.stdout.isatty() else WIDTH
    return Console(markup=False, emoji=False, highlight=False, width=width)


def _table(title: str, *heads: str, right: Sequence[str] = ()) -> Table:
    """Words wrap where the screen is narrow; figures, to the right of their columns, are never cut."""
    table = Table(title=title, title_justify="left", box=box.SIMPLE, padding=(0, 1, 0, 0))
    for head in heads:
        table.add_column(head, justify="right" if head in right else "left", no_wrap=head in right, overflow="fold")
    return table


def print_results(console: Console, results: Sequence[Result]) -> None:
    """A table for each kind of work beside its peers."""
    for what in dict.fromkeys(result.case.what for result in results):
        numbers = ("ours", "peer", "ratio", "samples")
        table = _table(what, "size", "beside", *numbers, "agree", right=numbers)
        for result in results:
            if result.case.what == what:
                table.add_row(*_result_cells(result))
        console.print(table)
    if results:
        _say(
            console,
            "Processor times in ms on one thread, medians of samples by turns; the longer the work, the fewer samples. "
            "Ratio: the peer's time by ours, median (quartiles).",
        )


def _result_cells(result: Result) -> tuple[str, ...]:
    ratio = f"{digits(result.ratio)} ({digits(result.ratio_low)} to {digits(result.ratio_high)})"
    times = (digits(result.ours_ms), digits(result.peer_ms))
    return (result.case.size, result.case.peer, *times, ratio, str(result.samples), "yes" if result.agree else "no")


def print_growths(console: Console, growths: Sequence[Growth]) -> None:
    """A table for each row of points, with its exponents and what was left out."""
    numbers = ("ms", "fit s", "kept MB", "peak MB")
    for growth in growths:
        grower = growth.grower
        table = _table(f"{grower.name}, by {grower.by}", grower.by, *numbers, right=(grower.by, *numbers))
        for point in growth.points:
            table.add_row(*_point_cells(point))
        console.print(table)
        whole, last = _exponent(growth.exponent), _exponent(growth.last_tenfold)
        _say(console, f"  exponent of {grower.by}: {whole}; over the last factor of ten {last}")
        for size, reason in growth.left_out:
            _say(console, f"  {size:,} {grower.by} left out: {reason}")
    if growths:
        _say(
            console,
            "Processor times of a look, or of an update with its motion, on one thread: median (quartiles). "
            "Exponents k of time ~ size^k, by least squares over logarithms, ± standard error. Memory as tracemalloc "
            "sees it: kept by sensor or estimator, and at the peak of a look or update above that.",
        )


def _point_cells(point: Point) -> tuple[str, ...]:
    times = f"{digits(point.ms)} ({digits(point.ms_low)} to {digits(point.ms_high)})"
    return (f"{point.size:,}", times, digits(point.fit_s), digits(point.kept_mb), digits(point.peak_mb))


def _exponent(figures: tuple[float, float]) -> str:
    slope, error = figures
    if not math.isfinite(slope):
        return "?"
    return f"{slope:.2f} ± {error:.2f}" if math.isfinite(error) else f"{slope:.2f}"


def print_profiles(console: Console, profiles: Sequence[Profiled], limits: Limits) -> None:
    """A table for each: its parts, and within them the functions that take most; then the least work of each part."""
    for profile in profiles:
        title = f"{profile.name}: {digits(profile.ms)} ms"
        table = _table(title, "part", "ms", "share", "at the limits", "what", right=("ms", "share", "at the limits"))
        for part in profile.parts:
            share = f"{100.0 * part.ms / profile.ms:.0f} %"
            table.add_row(part.name, digits(part.ms), share, _at_limits(part, limits), "")
            for name, taken, what in _functions(part, NAMED * profile.ms):
                table.add_row(f"  {name}", digits(taken), f"{100.0 * taken / profile.ms:.0f} %", "", what)
        console.print(table)
        for part in profile.parts:
            if part.work is not None:
                _say(console, f"  {part.name}, least work: {part.work}")
    if profiles:
        _say(
            console,
            "At the limits: what the part's least bytes and operations take at the rates below, and how many times "
            "that it takes; filtering, scaling, exponentials and the calls themselves are not in it.",
        )


def print_limits(console: Console, limits: Limits) -> None:
    """What the machine can do."""
    _say(console, str(limits))


def _say(console: Console, text: str) -> None:
    """A sentence; where the output is no terminal, on one line."""
    console.print(text, soft_wrap=not console.is_terminal)


def _at_limits(part: Part, limits: Limits) -> str:
    if part.work is None:
        return ""
    least = part.work.ms(limits)
    times = part.ms / least
    return f"{digits(least) if least >= 1.0 else f'{least:.4f}'} (x {times:.{1 if times < 10.0 else 0}f})"


def _functions(part: Part, least_ms: float) -> list[tuple[str, float, str]]:
    """Name, ms, and what it does, of the functions that take as much; then of the others together, if they do."""
    taken = [(function, share * part.ms) for function, share in part.shares]
    rows = [(_short(function.name), ms, function.what) for function, ms in taken if ms >= least_ms]
    others = sum(ms for _, ms in taken if ms < least_ms)
    return [*rows, ("others", others, "")] if rows and others >= least_ms else rows


def _short(name: str) -> str:
    """A function without room and module, a method with its class."""
    return ".".join(name.split(".")[2:])


def digits(value: float) -> str:
    """At least two digits that count, and two places at most."""
    return f"{value:.2f}" if value < 10.0 else f"{value:.1f}" if value < 100.0 else f"{value:.0f}"
