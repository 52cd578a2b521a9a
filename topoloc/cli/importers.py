"""``topoloc import``: others' formats into ours."""

from __future__ import annotations

from inspect import getdoc

from cyclopts import App

from topoloc.cli.group import fill

IMPORTERS = "topoloc.importers"
"""Entry points of the commands below ``topoloc import``."""


class ImportCommands(App):
    """Bring others' formats into ours: bags, videos, pictures, text maps, public data sets.

    Example: ``topoloc import bag drive.bag -o drive``
    """


importers = fill(ImportCommands(help=getdoc(ImportCommands)), IMPORTERS)
