"""Pieces of Markdown that the report and the README's table are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.results import Summary
from benchmarks.spread import Interval, Pair

NARROW = ((10.0, 2), (100.0, 1))
"""Below a mean of so much, so many digits behind the point; none from the last on."""


def table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table; cells are Markdown already."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def code(word: str) -> str:
    """A name as one types it."""
    return f"`{word}`"


def pair_name(pair: Pair) -> str:
    """Sensor and estimator."""
    return f"{code(pair[0])} with {code(pair[1])}"


def spread(summary: Summary) -> str:
    """Mean and standard deviation over the seeds, with the fewer digits the larger the mean is."""
    size = abs(summary.mean or 0.0)
    return summary.text(next((digits for limit, digits in NARROW if size < limit), 0))


def percent(mean: float, interval: Interval | None) -> str:
    """A share and its interval, ``97 (95 to 99)``."""
    ends = "" if interval is None else f" ({100.0 * interval.low:.0f} to {100.0 * interval.high:.0f})"
    return f"{100.0 * mean:.0f}{ends}"
