"""Where a table stands on its page: between two comments that name it."""

from __future__ import annotations

from pathlib import Path

from benchmarks.own_data.own_table import OwnTable
from topoloc.errors import InputError
from topoloc.files import read_text, write_text

DOCS = Path(__file__).parents[2] / "docs"


def markers(name: str) -> tuple[str, str]:
    """The lines around a table."""
    return f"<!-- written by python -m benchmarks.own_data {name} -->\n", f"<!-- end of {name} -->\n"


def around(one: OwnTable, docs: Path = DOCS) -> tuple[str, str]:
    """The page up to the table and from its end on, each with its marker.

    Raises:
        InputError: the page has no place for the table.
    """
    path, (begin, end) = docs / one.page, markers(one.name)
    before, found, rest = read_text(path, "run this in the project").partition(begin)
    _, closed, after = rest.partition(end)
    if not found or not closed:
        problem = f"has no place for the table {one.name}"
        raise InputError(path, problem, f"put {begin.strip()} and {end.strip()} around it")
    return before + begin, end + after


def write(one: OwnTable, text: str, docs: Path = DOCS) -> Path:
    """Put a table into its page, which is read anew: others may have changed it meanwhile. Returns the page."""
    before, after = around(one, docs)
    write_text(docs / one.page, before + text + after)
    return docs / one.page
