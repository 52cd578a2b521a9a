"""Any two pairs held against each other on each scenario; computed here, looked up by the page."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

from benchmarks.report.headline import Headline
from benchmarks.report.markup import json_script, pair_name, plural, select
from benchmarks.report.run_read import RunRead
from benchmarks.spread import FEWEST_PAIRS, Difference, Pair, better, by_seed, differences

METRICS = ("node_accuracy", "position_median_m")
MOST_COMPARISONS = 10_000
"""Pairs of pairs, times scenarios; beyond, only the pairs with the highest mean node accuracy are offered."""
QUESTION: tuple[Pair, Pair] = (("ima", "activity"), ("pca", "particle"))
"""What is shown before somebody chooses: the question that the benchmark is for."""
SCALE = 1000
"""Differences are embedded as whole thousandths."""

NONE_TOLD, A_BETTER, B_BETTER, TOO_FEW = range(4)

Entry = list[int | None]


def offered(headline: Headline, run: RunRead) -> list[Pair]:
    """Pairs that can be compared, in the order of the headline; all of them, unless they are too many."""
    ranked = headline.ranked
    while comb(len(ranked), 2) * len(run.scenarios) > MOST_COMPARISONS:
        ranked.pop()
    return ranked


def compare(run: RunRead, pairs: Sequence[Pair]) -> list[Entry | None]:
    """Of any two pairs, the second less the first, in the order of ``combinations``; scenarios and metrics inside.

    Each is None where one of the two did not run, else mean, low and high end in thousandths (None where unknown),
    seeds that both have, and the verdict.
    """
    sides, places, metrics = [], [], []
    groups = {metric: by_seed(run.rows, metric) for metric in METRICS}
    for first, second in combinations(pairs, 2):
        for scenario in run.scenarios:
            for metric, own in groups.items():
                places.append((scenario, *first) in own and (scenario, *second) in own)
                if places[-1]:
                    sides.append((own[scenario, *first], own[scenario, *second]))
                    metrics.append(metric)
    found = iter([_entry(*one) for one in zip(differences(sides), metrics, strict=True)])
    return [next(found) if there else None for there in places]


def verdict(difference: Difference, metric: str) -> int:
    """Which side is better, if that can be said."""
    if difference.pairs < FEWEST_PAIRS:
        return TOO_FEW
    if not difference.called or difference.mean is None:
        return NONE_TOLD
    return B_BETTER if (difference.mean > 0.0) == (better(metric) == "higher") else A_BETTER


def _entry(difference: Difference, metric: str) -> Entry:
    interval = difference.interval
    ends = (None, None) if interval is None else (interval.low, interval.high)
    numbers = [None if value is None else round(SCALE * value) for value in (difference.mean, *ends)]
    return [*numbers, difference.pairs, verdict(difference, metric)]


def comparisons_section(run: RunRead, headline: Headline) -> str:
    """Two selects and an empty table that the page fills."""
    pairs = offered(headline, run)
    if len(pairs) < 2:
        return "<p>It takes two pairs that came to an end.</p>"
    data = {"scenarios": run.scenarios, "pairs": len(pairs), "entries": compare(run, pairs)}
    names = [pair_name(pair) for pair in pairs]
    first, second = (pairs.index(pair) for pair in QUESTION) if set(QUESTION) <= set(pairs) else (0, 1)
    left = len(headline.cells) - len(pairs)
    out = f" To keep the page small, {plural(left, 'pair')} with the lowest mean are left out." if left else ""
    return (
        '<div data-role="comparison"><p class="controls">'
        f"{select('A', names, 'first', first)}{select('B', names, 'second', second)}</p>"
        '<div class="wide" tabindex="0" role="region" aria-label="A and B on each scenario"><table class="versus">'
        '<thead><tr><th scope="col" rowspan="2">scenario</th>'
        '<th scope="colgroup" colspan="2">node accuracy, B &minus; A</th>'
        '<th scope="colgroup" colspan="2">median position error, B &minus; A (m)</th></tr><tr>'
        '<th scope="col">mean [95 %]</th><th scope="col">verdict</th><th scope="col">mean [95 %]</th>'
        '<th scope="col">verdict</th></tr></thead><tbody></tbody></table></div>'
        f'<p class="note">Differences are taken seed by seed, on the same drives.{out} Other metrics, and two '
        "runs: <code>topoloc compare</code>.</p>"
        f"{json_script('comparisons', data)}</div>"
    )
