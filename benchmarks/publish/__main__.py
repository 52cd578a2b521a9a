"""``python -m benchmarks.publish RUN``; a user's mistake is one line and exit code 2."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from benchmarks.publish.pages import publish
from topoloc.cli.main import EXIT_USER_ERROR
from topoloc.errors import UserError, one_line


def main(arguments: Sequence[str] | None = None) -> int:
    """Write both pages and name them; returns the exit code."""
    about = "Write the benchmark's report and the README's table from a finished run."
    parser = argparse.ArgumentParser(prog="python -m benchmarks.publish", description=about)
    parser.add_argument("folder", type=Path, help="of the run")
    parser.add_argument("--times", type=Path, help="of another run, alone on its machine, that times are taken from")
    given = parser.parse_args(arguments)
    try:
        for path in publish(given.folder, given.times):
            print(path)
    except UserError as error:
        print(f"publish: {one_line(error)}", file=sys.stderr)
        return EXIT_USER_ERROR
    return 0


if __name__ == "__main__":
    sys.exit(main())
