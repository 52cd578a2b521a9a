"""``python -m benchmarks.large_map make``, ``measure`` or ``check``; a user's mistake is one line and exit code 2."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from itertools import chain
from pathlib import Path

import cv2
from threadpoolctl import threadpool_limits

from benchmarks.large_map import fidelity
from benchmarks.large_map.folder import load, make_in
from benchmarks.large_map.making import QUERIES, Plan
from benchmarks.large_map.measuring import Result, results
from benchmarks.large_map.tables import agreement_table, cost_table, fidelity_table, growth_line
from topoloc.cli.main import EXIT_USER_ERROR
from topoloc.cli.progress import bar
from topoloc.errors import UserError, one_line
from topoloc.files import write_text


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; returns the exit code."""
    given = _parser().parse_args(arguments)
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            given.run(given)
    except UserError as error:
        print(f"large_map: {one_line(error)}", file=sys.stderr)
        return EXIT_USER_ERROR
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.large_map", description="Large maps for IMA.")
    commands = parser.add_subparsers(required=True)
    make = commands.add_parser("make", help="make a map, or go on with one; it can be broken off at any time")
    make.add_argument("--nodes", type=int, default=10_000)
    make.add_argument("--seed", type=int, default=1)
    make.add_argument("--queries", type=int, default=QUERIES, help="on nodes and as many off them, for each size")
    make.add_argument("-o", "--out", type=Path, required=True, help="folder to make")
    make.set_defaults(run=_make)
    measure = commands.add_parser("measure", help="IMA with a coarse stage beside exact IMA")
    measure.add_argument("folder", type=Path, help="that 'make' made")
    measure.add_argument("--candidates", type=int, nargs="+", default=[0], help="0 is exact IMA beside itself")
    measure.add_argument("--nodes", type=int, nargs="+", help="sizes of maps; all that there are queries for")
    measure.add_argument("--queries", type=int, help="on nodes and as many off them, for each size; all, if left out")
    measure.add_argument("--json", type=Path, help="file to write the results to as well")
    measure.set_defaults(run=_measure)
    check = commands.add_parser("check", help="large maps' pictures beside full-size ones, on one floor")
    check.set_defaults(run=_check)
    return parser


def _make(given: argparse.Namespace) -> None:
    plan = Plan(given.nodes, given.seed, given.queries)
    with bar() as progress:
        task = progress.add_task("rendering panoramas", total=plan.nodes)
        make_in(given.out, plan, lambda done: progress.advance(task, done))
    large = load(given.out)
    print(f"{given.out}: {large.topo_map.name}, {plan.nodes} nodes, {len(large.frames)} queries")


def _measure(given: argparse.Namespace) -> None:
    large = load(given.folder)
    sizes = sorted(given.nodes or {int(size) for size in large.drawn_from})
    maps = [large.subset(size, given.queries) for size in sizes]
    measured: list[Result] = []
    with bar() as progress:
        task = progress.add_task("measuring", total=len(maps) * len(given.candidates))
        for result in chain.from_iterable(results(one, given.candidates) for one in maps):
            measured.append(result)
            progress.advance(task)
            if given.json:  # each time: the next size may take an hour
                write_text(given.json, json.dumps([one.row() for one in measured], indent=2) + "\n")
    print(f"{large.topo_map.name}; looks by turns, one thread")
    print(agreement_table(measured))
    print()
    print(cost_table(measured))
    print(growth_line(measured))


def _check(given: argparse.Namespace) -> None:
    del given
    print(fidelity_table(fidelity.rows()))


if __name__ == "__main__":
    sys.exit(main())
