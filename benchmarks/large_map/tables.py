"""What was measured on large maps, as Markdown."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from benchmarks.large_map.agreement import Agreement, Share
from benchmarks.large_map.fidelity import Row
from benchmarks.large_map.measuring import Result, growth
from benchmarks.publish.markdown import table

AGREEMENT = (
    "nodes",
    "candidates",
    "robot",
    "same best node, %",
    "if above 0.5",
    "if right",
    "as mapped, old, lights",
    "match as good, %",
    "right, exact %",
    "right, coarse %",
)
COSTS = ("nodes", "candidates", "exact ms", "coarse ms", "times faster", "held MB, exact, coarse", "fit s, both")


def agreement_table(results: Sequence[Result]) -> str:
    """A row a size, number of candidates and place of the robot; shares in % with Wilson's 95 % interval."""
    return table(
        AGREEMENT,
        [(*_of(result), place, *_shares(one)) for result in results for place, one in result.agreements.items()],
    )


def cost_table(results: Sequence[Result]) -> str:
    """A row a size and number of candidates."""
    return table(COSTS, [(*_of(result), *_costs(result)) for result in results])


def _of(result: Result) -> tuple[str, str]:
    return str(result.nodes), str(result.candidates or "all")


def _shares(one: Agreement) -> tuple[str, ...]:
    return (
        _percent(one.same),
        _percent(one.same_if_sure),
        _percent(one.same_if_right),
        ", ".join(_bare(share) for share in one.same_under.values()),
        _percent(one.as_good),
        _percent(one.right_exact),
        _percent(one.right_coarse),
    )


def _costs(result: Result) -> tuple[str, ...]:
    middle, low, high = result.ratio
    return (
        f"{result.exact_ms:.2f}",
        f"{result.coarse_ms:.2f}",
        f"{middle:.2f} ({low:.2f} to {high:.2f})",
        f"{result.exact.held_mb:.0f}, {result.coarse.held_mb:.0f}",
        f"{result.exact.fit_s:.1f}, {result.coarse.fit_s:.1f}",
    )


def _percent(share: Share) -> str:
    low, high = share.interval
    return f"{_bare(share)} ({100.0 * low:.1f} to {100.0 * high:.1f})"


def _bare(share: Share) -> str:
    return f"{100.0 * share.value:.1f}" if share.of else "-"


def growth_line(results: Sequence[Result]) -> str:
    """How the time of a look grows with the map: an exponent for exact IMA and for each number of candidates.

    Empty where no number of candidates was measured on two sizes or more.
    """
    words = []
    for count in dict.fromkeys(result.candidates for result in results):
        rows = [result for result in results if result.candidates == count]
        nodes = [result.nodes for result in rows]
        if len(set(nodes)) < 2:
            continue
        exact, coarse = (growth(nodes, [getattr(row, name) for row in rows]) for name in ("exact_ms", "coarse_ms"))
        words.append(f"{count or 'all'} candidates: exact nodes^{exact:.2f}, coarse nodes^{coarse:.2f}")
    return "time of a look grows as " + "; ".join(words) if words else ""


def fidelity_table(rows: Iterable[Row]) -> str:
    """A row for each way to make the map and each place of the robot."""
    heads = ("map", "robot", "same best node, %", "right, %", "mean best match", "mean match")
    cells = [
        (
            row.name,
            row.place,
            f"{100.0 * row.same:.0f}",
            f"{100.0 * row.right:.0f}",
            f"{row.best:.3f}",
            f"{row.match:.3f}",
        )
        for row in rows
    ]
    return table(heads, cells)
