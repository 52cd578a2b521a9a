"""A group of commands that come from entry points, such as ``topoloc map`` and all that is below it."""

from __future__ import annotations

import sys

from cyclopts import App

from topoloc.errors import UserError, one_line
from topoloc.plugins import load, names


def fill(app: App, group: str) -> App:
    """Add every command of a group of entry points; one that cannot be loaded must not take the others with it."""
    for name in names(group):
        try:
            app.command(load(group, name), name=name)
        except UserError as error:
            print(f"topoloc: the command {name!r} is left out: {one_line(str(error))}", file=sys.stderr)
    return app
