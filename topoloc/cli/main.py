"""The one error boundary: commands come from entry points; a user's mistake is one line and exit code 2."""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Sequence

from cyclopts import App, CycloptsError

from topoloc import __version__
from topoloc.cli.group import fill
from topoloc.errors import UserError, one_line
from topoloc.plugins import COMMANDS

ABOUT = """Where a robot with one camera and wheel odometry is on a topological map.

Every command tells its options and an example with --help. Example: ``topoloc simulate lab -o lab``
"""
EXIT_USER_ERROR, EXIT_DEFECT, EXIT_INTERRUPTED = 2, 70, 130


def build_app() -> App:
    """The command line with every command that is installed."""
    app = App(
        name="topoloc",
        help=ABOUT,
        version=__version__,
        suppress_keyboard_interrupt=False,
    )
    return fill(app, COMMANDS)


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line and exit: 0 done, 1 findings of ``check``, 2 a user's mistake, 70 a defect, 130 Ctrl-C."""
    sys.exit(run(sys.argv[1:] if arguments is None else list(arguments)))


def run(arguments: list[str]) -> int:
    """Run the command line; returns the exit code."""
    try:
        result = build_app()(arguments, exit_on_error=False, print_error=False, result_action="return_value")
        return result if isinstance(result, int) else 0
    except CycloptsError as error:
        words = " ".join(["topoloc", *(error.command_chain or ())])
        return _complain(f"{one_line(str(error))} See '{words} --help'.")
    except UserError as error:
        return _complain(one_line(str(error)))
    except OSError as error:
        return _system_says(error)
    except KeyboardInterrupt:
        print("topoloc: stopped", file=sys.stderr)
        return EXIT_INTERRUPTED
    except Exception:
        traceback.print_exc()
        print("topoloc: this is a defect of topoloc, not of your data; please report the lines above", file=sys.stderr)
        return EXIT_DEFECT


def _system_says(error: OSError) -> int:
    """What the system refuses in a place that no command foresaw: a full disk, a closed door, a reader that left."""
    if isinstance(error, BrokenPipeError):  # as after "| head"
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    place = f"{error.filename}: " if error.filename else ""
    return _complain(f"{place}{error.strerror or error}; look at the place, its room and its permissions")


def _complain(text: str) -> int:
    print(f"topoloc: {text}", file=sys.stderr)
    return EXIT_USER_ERROR
