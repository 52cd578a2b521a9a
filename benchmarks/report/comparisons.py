"""Any two pairs held against each other on each scenario; computed here, looked up by the page."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import comb

from benchmarks.report.headline import Headline, known_of
from benchmarks.report.markup import json_script, pair_name, plural, select
from benchmarks.report.run_read import RunRead
from benchmarks.spread import Difference, Pair, Verdict, by_seed, differences, verdict

METRICS = ("node_accuracy", "position_median_m")
MOST_COMPARISONS = 10_000
"""Pairs of pairs, times scenarios; beyond, pairs with a low mean node accuracy are left out."""
QUESTION: tuple[Pair, Pair] = (("ima", "activity"), ("pca", "particle"))
"""What is shown before somebody chooses: the question that the benchmark is for."""
SCALE = 1000
"""Differences are embedded as whole thousandths."""
CODES = (Verdict.NOT_TOLD, Verdict.WORSE, Verdict.BETTER, Verdict.TOO_FEW, Verdict.ONE_DRIVE, Verdict.NO_VALUE)
"""Verdicts on the second pair, by the numbers that ``comparisons.js`` knows them by."""

Entry = list[int | None]


def offered(run: RunRead, headline: Headline) -> list[Pair]:
    """Pairs that can be compared, sensor by sensor; where they are too many, not all.

    Always among them: the pairs of ``QUESTION`` and each sensor's best pair. Then those with the highest mean.
    """
    known = known_of(run.rows)
    ranked = [*headline.ranked, *(pair for pair in run.pairs if pair in known and pair not in headline.cells)]
    best = {pair[0]: pair for pair in reversed(ranked)}
    always = list(dict.fromkeys([*(pair for pair in QUESTION if pair in known), *best.values()]))
    count = len(ranked)
    while count > len(always) and comb(count, 2) * len(run.scenarios) > MOST_COMPARISONS:
        count -= 1
    kept = list(dict.fromkeys([*always, *ranked]))[:count]
    return [pair for pair in run.pairs if pair in kept]


def compare(run: RunRead, pairs: Sequence[Pair]) -> list[Entry | None]:
    """Of any two pairs, the second less the first, in the order of ``combinations``; scenarios and metrics inside.

    Each is None where one of the two did not run, else mean, low and high end in thousandths (None where unknown),
    seeds that both have, and the verdict's place in ``CODES``.
    """
    sides, places, told = [], [], []
    groups = {metric: by_seed(run.rows, metric) for metric in METRICS}
    one_drive = {scenario: run.recorded(scenario) for scenario in run.scenarios}
    for first, second in combinations(pairs, 2):
        for scenario in run.scenarios:
            for metric, own in groups.items():
                places.append((scenario, *first) in own and (scenario, *second) in own)
                if places[-1]:
                    sides.append((own[scenario, *first], own[scenario, *second]))
                    told.append((metric, one_drive[scenario]))
    found = iter([_entry(one, *about) for one, about in zip(differences(sides), told, strict=True)])
    return [next(found) if there else None for there in places]


def _entry(difference: Difference, metric: str, one_drive: bool) -> Entry:
    interval = difference.interval
    ends = (None, None) if interval is None else (interval.low, interval.high)
    numbers = [None if value is None else round(SCALE * value) for value in (difference.mean, *ends)]
    return [*numbers, difference.pairs, CODES.index(verdict(difference, metric, one_drive))]


def comparisons_section(run: RunRead, headline: Headline) -> str:
    """Two selects and an empty table that the page fills."""
    pairs = offered(run, headline)
    if len(pairs) < 2:
        return "<p>It takes two pairs that came to an end.</p>"
    data = {"scenarios": run.scenarios, "pairs": len(pairs), "entries": compare(run, pairs)}
    names = [pair_name(pair) for pair in pairs]
    first, second = map(pairs.index, QUESTION) if set(QUESTION) <= set(pairs) else (0, 1)
    left = len(known_of(run.rows)) - len(pairs)
    out = f" To keep the page small, {plural(left, 'pair')} with a low mean are left out." if left else ""
    mean = "mean [95 %]" if run.choice.seeds > 1 else "difference"
    heads = f'<th scope="col">{mean}</th><th scope="col">verdict</th>'
    return (
        '<div data-role="comparison"><p class="controls">'
        f"{select('A', names, 'first', first)}{select('B', names, 'second', second)}</p>"
        '<div class="wide" tabindex="0" role="region" aria-label="A and B on each scenario"><table class="versus">'
        '<thead><tr><th scope="col" rowspan="2">scenario</th>'
        '<th scope="colgroup" colspan="2">node accuracy, B &minus; A</th>'
        '<th scope="colgroup" colspan="2">median position error, B &minus; A (m)</th></tr>'
        f"<tr>{heads}{heads}</tr></thead><tbody></tbody></table></div>"
        '<p class="note" data-role="not-both"></p>'
        f'<p class="note">Differences are taken seed by seed, on the same drives.{out} Other metrics, and two '
        "runs: <code>topoloc compare</code>.</p>"
        f"{json_script('comparisons', data)}</div>"
    )
