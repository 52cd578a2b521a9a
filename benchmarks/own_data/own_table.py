"""What all of these tables have in common: figures of some rows for each seed, their mean and spread in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from textwrap import fill

from benchmarks.drives import one_thread
from benchmarks.publish.markdown import table
from benchmarks.results import OK, Summary
from topoloc.cli.progress import bar

Figures = Mapping[str, float]
"""By column; a column that a row has no figure for is left out."""
Form = Callable[[Sequence[float]], str]
"""Writes the figures of one cell, one of each seed."""
PAGE_WIDTH = 125
"""Of lines of text in ``docs``, characters."""


@dataclass(frozen=True)
class OwnTable:
    """A table of a page in ``docs``.

    Attributes:
        name: as the command line and the page's markers have it.
        page: file in ``docs``.
        about: what was measured, in words, without the seeds.
        seeds: that the page tells of.
        heads: of the columns that say what a row is.
        rows: what each row is, a cell for each of ``heads``.
        columns: of figures, and how they are written.
        measure: gives the figures of a seed, row by row.
    """

    name: str
    page: str
    about: str
    seeds: tuple[int, ...]
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    columns: Mapping[str, Form]
    measure: Callable[[int], Iterator[Figures]]

    def measured(self, seeds: Sequence[int]) -> str:
        """Measure all rows on each seed, one after the other; the text between the page's markers."""
        by_seed: list[list[Figures]] = []
        with one_thread(), bar() as progress:
            task = progress.add_task(f"measuring {self.name}", total=len(seeds) * len(self.rows))
            for seed in seeds:
                by_seed.append([])
                for figures in self.measure(seed):
                    by_seed[-1].append(figures)
                    progress.advance(task)
        return self.text(seeds, by_seed)

    def text(self, seeds: Sequence[int], by_seed: Sequence[Sequence[Figures]]) -> str:
        """What was measured, which seeds, and the table; figures are of each seed and each row."""
        listed = f"Seed {seeds[0]}" if len(seeds) == 1 else f"Seeds {', '.join(map(str, seeds))}"
        spread = "" if len(seeds) == 1 else "; mean ± standard deviation over them"
        body = [
            (*row, *(form([one[name] for one in figures if name in one]) for name, form in self.columns.items()))
            for row, *figures in zip(self.rows, *by_seed, strict=True)
        ]
        words = fill(f"{self.about} {listed}{spread}.", PAGE_WIDTH)
        return f"{words}\n\n{table((*self.heads, *self.columns), body)}\n"


def mean(digits: int, unit: str = "") -> Form:
    """Mean and sample standard deviation; a dash where there are no figures."""
    return lambda values: Summary(tuple(values), OK, "").text(digits, unit)


def each(values: Sequence[float]) -> str:
    """Whole numbers, in the order of the seeds, or a single one where all are the same; a dash where there are none."""
    told = [f"{value:.0f}" for value in values]
    return ", ".join(told[:1] if len(set(told)) == 1 else told) or "-"


def span(values: Sequence[float]) -> str:
    """The least and the most, whole numbers with their sign; a dash where there are none."""
    return " to ".join(f"{value:+.0f}" for value in sorted({min(values), max(values)})) if values else "-"


def how_many(values: Sequence[float]) -> str:
    """How many are not 0, and of how many; a dash where there are none."""
    return f"{sum(value != 0.0 for value in values)} of {len(values)}" if values else "-"
