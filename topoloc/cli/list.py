"""``topoloc list``: what can be named on the command line, with its settings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal, get_args

from cyclopts import Parameter

if TYPE_CHECKING:
    from rich.console import Console

    from topoloc.settings import Setting

Kind = Literal[
    "sensors", "fusions", "estimators", "scenarios", "worlds", "panoramas", "upkeeps", "experiments", "commands"
]
FEWEST_SHARED = 6
"""Fewer settings that all things of a kind share are not worth a table of their own."""


def list_names(
    kind: Annotated[Kind | None, Parameter(help="Show only these.")] = None,
    name: Annotated[str | None, Parameter(help="Show only this one of them.")] = None,
) -> None:
    """List what can be named: sensors, estimators, worlds and the like with their settings, experiments, commands.

    Example: ``topoloc list worlds``, ``topoloc list worlds lab``
    """
    from rich.console import Console

    from topoloc import plugins

    console = Console(markup=False, emoji=False, highlight=False)  # "[m]" is a unit
    for title in get_args(Kind) if kind is None else (kind,):
        group = f"topoloc.{title}"
        chosen = plugins.names(group) if name is None else [name]
        things = {one: plugins.load(group, one) for one in chosen}
        console.print(title, style="bold")
        if title == "commands":
            _print_summaries(console, {name: _summary(thing) for name, thing in things.items()})
        elif title == "scenarios":
            _print_summaries(console, {name: thing.description for name, thing in things.items()})
        elif title == "experiments":
            _print_summaries(console, {name: f"{thing.title} ({thing.source})" for name, thing in things.items()})
        else:
            _print_things(console, title, things)


def _print_summaries(console: Console, summaries: Mapping[str, str]) -> None:
    from rich.table import Table

    table = Table("name", "what it is")
    for name, summary in summaries.items():
        table.add_row(name, summary)
    console.print(table)


def _print_things(console: Console, kind: str, things: Mapping[str, Any]) -> None:
    """Each thing with its settings; what is the same for all of a kind comes once, at the end."""
    from rich.text import Text

    from topoloc import plugins

    settings = {name: plugins.settings_of(thing) for name, thing in things.items()}
    shared = _shared(list(settings.values()))
    for name, thing in things.items():
        console.print()
        console.print(Text.assemble((name, "bold"), ": ", _summary(thing)))
        if kind == "sensors":
            console.print(f"  needs images: {', '.join(sorted(thing.needs))}")
        own = [setting for setting in settings[name] if setting not in shared]
        if own:
            _print_settings(console, own)
        else:
            console.print("  no settings of its own" if shared else "  no settings")
    if shared:
        console.print(f"\nsettings of every {kind.removesuffix('s')}; what is told above goes before", style="bold")
        _print_settings(console, shared)


def _shared(of_things: list[list[Setting]]) -> list[Setting]:
    """Settings that all have, as more than half of them have and tell them; none if they are few."""
    if len(of_things) < 2:
        return []
    count = Counter(setting for settings in of_things for setting in settings)
    having = Counter(setting.name for setting in count.elements())
    shared = [
        setting for setting in count if having[setting.name] == len(of_things) and 2 * count[setting] > len(of_things)
    ]
    place = {setting.name: number for number, setting in enumerate(of_things[0])}
    shared.sort(key=lambda setting: place[setting.name])
    return shared if len(shared) >= FEWEST_SHARED else []


def _print_settings(console: Console, settings: Iterable[Setting]) -> None:
    from rich.table import Table

    table = Table(show_edge=False, pad_edge=True)
    table.add_column("setting", overflow="fold")
    table.add_column("default", overflow="fold")
    table.add_column("what it is")
    for setting in settings:
        table.add_row(setting.name, setting.default, _plain(setting.text))
    console.print(table)


def _summary(thing: Any) -> str:
    """The first line of a docstring."""
    return _plain((thing.__doc__ or "").strip().partition("\n")[0])


def _plain(text: str) -> str:
    """A docstring's text without the marks of code."""
    return text.replace("``", "")
