"""``topoloc list``: what can be named on the command line, with its options."""

from __future__ import annotations

from typing import Annotated, Literal

from cyclopts import Parameter

Kind = Literal["sensors", "estimators", "worlds", "panoramas", "commands"]


def list_names(kind: Annotated[Kind | None, Parameter(help="Show only these.")] = None) -> None:
    """List sensors, estimators, worlds and panorama methods, with their settings and defaults.

    Example: ``topoloc list sensors``
    """
    from rich.console import Console
    from rich.table import Table

    from topoloc import plugins

    console = Console()
    groups = {name: f"topoloc.{name}" for name in ("sensors", "estimators", "worlds", "panoramas", "commands")}
    for title, group in groups.items():
        if kind not in (None, title):
            continue
        table = Table("name", "what it is", "settings and defaults", title=title, title_justify="left")
        for name in plugins.names(group):
            thing = plugins.load(group, name)
            summary = (thing.__doc__ or "").strip().partition("\n")[0]
            settings = plugins.options(thing) if title != "commands" else {}
            table.add_row(name, summary, "  ".join(f"{key}={value}" for key, value in settings.items()))
        console.print(table)
