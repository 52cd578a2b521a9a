"""``python -m benchmarks.own_data [TABLE ...] [--seeds 0 1 2] [--write]``; a mistake is one line and exit code 2."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.own_data.page import DOCS, around, write
from benchmarks.own_data.tables import TABLES
from topoloc.cli.main import EXIT_USER_ERROR
from topoloc.errors import UserError, one_line


def main(arguments: Sequence[str] | None = None, docs: Path = DOCS) -> int:
    """Measure tables and print them; with --write, put each into its page. Returns the exit code."""
    about = "Measure the tables of the pages about data of one's own again. All drives are simulated."
    parser = argparse.ArgumentParser(prog="python -m benchmarks.own_data", description=about)
    parser.add_argument("tables", nargs="*", metavar="TABLE", help=f"of {', '.join(TABLES)}; all, if left out")
    parser.add_argument("--seeds", type=int, nargs="+", help="of buildings and drives; each table's own, if left out")
    parser.add_argument("--write", action="store_true", help="put each table between its markers in docs")
    given = parser.parse_args(arguments)
    try:
        _measure(given.tables or list(TABLES), given.seeds, docs if given.write else None)
    except UserError as error:
        print(f"own_data: {one_line(error)}", file=sys.stderr)
        return EXIT_USER_ERROR
    return 0


def _measure(names: Sequence[str], seeds: Sequence[int] | None, docs: Path | None) -> None:
    """Measure tables and print them, and write them where a folder is named."""
    unknown = [name for name in names if name not in TABLES]
    if unknown:
        raise UserError(f"there is no table {unknown[0]!r}; choose from: {', '.join(TABLES)}")
    if any(seed < 0 for seed in seeds or ()):
        raise UserError("a seed is negative; give 0 or more")
    chosen = [TABLES[name] for name in dict.fromkeys(names)]
    if docs is not None:
        for one in chosen:
            around(one, docs)  # minutes of measuring would be in vain
    for one in chosen:
        text = one.measured(seeds or one.seeds)
        print(f"{one.name}\n\n{text}")
        if docs is not None:
            print(f"{write(one, text, docs)}\n")


if __name__ == "__main__":
    sys.exit(main())
