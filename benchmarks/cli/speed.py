"""``topoloc speed``: our steps beside other people's libraries, how they grow, where their time goes; in one run."""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from topoloc.errors import UnknownName, UserError

if TYPE_CHECKING:
    from benchmarks.speed.case import Case, Result
    from benchmarks.speed.growth import Growth
    from benchmarks.speed.machine import Limits
    from benchmarks.speed.profile import Profiled

REPEATS = 21
"""Samples of each, where no other number is asked for."""
EXIT_ANSWERS_DIFFER = 1
GROWTH, MACHINE, PROFILE = "growth", "machine", "profile"
"""What can be asked for beside the comparisons."""


def speed(
    what: Annotated[str | None, Parameter(help="Only this work or group, growth, machine, or profile.")] = None,
    *,
    repeats: Annotated[
        int | None,
        Parameter(help=f"Samples of ours and of the peer's, fewer where they take long [default: {REPEATS}]."),
    ] = None,
    full: Annotated[bool, Parameter(help="Growth up to the largest sizes: many minutes.", negative="")] = False,
    plot: Annotated[Path | None, Parameter(help="Draw growth into this new .png file.")] = None,
    as_json: Annotated[bool, Parameter(name="--json", help="Print a list of rows instead.", negative="")] = False,
) -> int:
    """Time our steps beside libraries that do the same, and check that both give the same answer.

    Also shown is how time and memory grow with nodes, particles and cells, and what the machine can do at best. Where
    the time of an update goes is told by ``profile`` only.

    Example: ``topoloc speed estimators``, ``topoloc speed growth --plot growth.png``, ``topoloc speed ima --json``

    The exit code is 1 where answers differ.
    """
    from benchmarks import speed as registry
    from benchmarks.speed.case import choose, names
    from benchmarks.speed.machine import limits

    _check(what, repeats, full, plot)
    cases = list(registry.CASES) if what is None else choose(registry.CASES, what)
    if not cases and what not in (None, GROWTH, MACHINE, PROFILE):
        raise UnknownName("comparison", what, [*names(registry.CASES), GROWTH, MACHINE, PROFILE])
    results = _compare(cases, REPEATS if repeats is None else repeats)
    growths = _grow(full) if what in (None, GROWTH) else []
    profiles = _profile() if what == PROFILE else []
    if plot is not None:
        _draw(plot, growths)
    told = [] if as_json and cases and what is not None else [limits()]  # single comparisons: rows of one kind
    if as_json:
        rows: list[Mapping[str, object]] = [result.row() for result in results]
        rows += [one.row() for one in told]
        rows += [row for growth in growths for row in growth.rows()]
        rows += [row for profile in profiles for row in profile.rows()]
        print(json.dumps(rows, indent=2))
    else:
        _print(results, growths, profiles, told[0])
    return 0 if all(result.agree for result in results) else EXIT_ANSWERS_DIFFER


def _check(what: str | None, repeats: int | None, full: bool, plot: Path | None) -> None:
    """Refuse what cannot be meant, before anything is measured."""
    from topoloc.files import refuse_to_overwrite

    if repeats is not None and repeats < 1:
        raise UserError(f"--repeats is {repeats}; give a whole number from 1 on")
    if repeats is not None and what in (GROWTH, MACHINE, PROFILE):
        raise UserError(f"--repeats is about comparisons, which 'topoloc speed {what}' leaves out; leave it away")
    if what not in (None, GROWTH) and (full or plot is not None):
        option = "--full" if full else "--plot"
        raise UserError(f"{option} is about growth, which 'topoloc speed {what}' leaves out; say topoloc speed growth")
    if plot is not None:
        if plot.suffix.lower() != ".png":
            raise UserError(f"--plot is {plot}; give a file that ends in .png")
        refuse_to_overwrite(plot)


def _compare(cases: Sequence[Case], repeats: int) -> list[Result]:
    """Results of the cases whose peers are installed; a line beside the output for each package that is not."""
    from benchmarks.speed.case import measure
    from topoloc.cli.progress import track

    for package, count in Counter(package for case in cases for package in case.missing).items():
        print(f"{package}: not installed; make speed installs it; left out: {count} of {len(cases)}", file=sys.stderr)
    able = [case for case in cases if not case.missing]
    if not able:
        return []  # and no bar
    return [measure(case, repeats) for case in track(able, "measuring")]


def _grow(full: bool) -> list[Growth]:
    from benchmarks.speed.growers import growers
    from benchmarks.speed.growth import grow
    from topoloc.cli.progress import bar

    rows = growers()
    if not full:
        seconds = sum(row.budget_s for row in rows)
        print(f"growth: {len(rows)} rows of about {seconds:.0f} s in all; --full measures all sizes", file=sys.stderr)
    growths = []
    with bar() as progress:
        task = progress.add_task("growing", total=sum(len(row.sizes) for row in rows))
        for row in rows:
            progress.update(task, description=row.name)
            growths.append(grow(row, float("inf") if full else row.budget_s, partial(progress.advance, task)))
    return growths


def _profile() -> list[Profiled]:
    from benchmarks.speed.profile import PAIRS, profile_pair
    from benchmarks.speed.profile_look import profile_look
    from topoloc.cli.progress import track

    calls: list[Callable[[], Profiled]] = [*(partial(profile_pair, *pair) for pair in PAIRS), profile_look]
    return [call() for call in track(calls, "profiling")]


def _draw(plot: Path, growths: Sequence[Growth]) -> None:
    from benchmarks.speed.growth_plot import draw_growth
    from topoloc.files import write_bytes
    from topoloc.plan import as_png

    write_bytes(plot, as_png(draw_growth(growths)))


def _print(results: Sequence[Result], growths: Sequence[Growth], profiles: Sequence[Profiled], machine: Limits) -> None:
    from benchmarks.speed.screen import make_console, print_growths, print_limits, print_profiles, print_results

    console = make_console()
    print_results(console, results)
    print_growths(console, growths)
    print_profiles(console, profiles, machine)
    print_limits(console, machine)
