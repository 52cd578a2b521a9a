"""Progress with time left on a terminal, silence elsewhere."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TypeVar

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

T = TypeVar("T")
SPEED_FROM_S = 600.0
"""The time left is told from the progress of so long: a benchmark's rows come in batches [s]."""


def bar() -> Progress:
    """A progress bar on the error stream, so that the output can be piped; silent when that is no terminal."""
    console = Console(stderr=True)
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    return Progress(
        *columns,
        console=console,
        disable=not console.is_terminal,
        transient=True,
        speed_estimate_period=SPEED_FROM_S,
    )


def track(items: Sequence[T], what: str) -> Iterator[T]:
    """The items, one by one, with a progress bar."""
    with bar() as progress:
        yield from progress.track(items, description=what)
