"""``topoloc list``: what can be named on the command line, with its options."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import asdict, is_dataclass
from typing import Annotated, Any, Literal

from cyclopts import Parameter

Kind = Literal["sensors", "estimators", "worlds", "panoramas", "commands"]


def _flat(settings: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """``key=value`` words as ``--set`` takes them; a nested table's keys follow its name and a dot."""
    for key, value in settings.items():
        if is_dataclass(value) and not isinstance(value, type):
            yield from _flat(asdict(value), f"{prefix}{key}.")
        elif isinstance(value, tuple):
            yield f"{prefix}{key}={','.join(map(str, value))}"
        else:
            yield f"{prefix}{key}={value:g}" if isinstance(value, float) else f"{prefix}{key}={value}"


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
        table = Table("name", "what it is", title=title, title_justify="left")
        table.add_column("settings and defaults", overflow="fold")
        for name in plugins.names(group):
            thing = plugins.load(group, name)
            summary = (thing.__doc__ or "").strip().partition("\n")[0]
            settings = plugins.options(thing) if title != "commands" else {}
            table.add_row(name, summary, "  ".join(_flat(settings)))
        console.print(table)
