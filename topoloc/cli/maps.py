"""``topoloc map``: what can be done with maps."""

from __future__ import annotations

from inspect import getdoc

from cyclopts import App

from topoloc.cli.group import fill

MAP_COMMANDS = "topoloc.map_commands"
"""Entry points of the commands below ``topoloc map``."""


class MapCommands(App):
    """What can be done with maps: build one from a recording, show it, lay one out from images alone.

    Example: ``topoloc map build drive -o map``
    """


maps = fill(MapCommands(help=getdoc(MapCommands)), MAP_COMMANDS)
