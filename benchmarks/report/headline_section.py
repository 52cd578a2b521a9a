"""The first table as HTML: what it says in a sentence, its cells, and what its marks mean."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from html import escape

from benchmarks.report.commands import advice
from benchmarks.report.headline import BEST, LEVEL, MARKS, METRIC, PARTLY, WORSE, Headline
from benchmarks.report.markup import NONE, number, pair_name, plural, span
from benchmarks.report.run_read import RunRead
from benchmarks.results import OK
from benchmarks.spread import FEWEST_PAIRS, Pair
from topoloc.metrics import METRICS

INTERVALS = (
    '<p class="note">Intervals are 95 % bootstrap intervals of the mean over seeds (expanded percentiles). Of fewer '
    "than six seeds they are too narrow.</p>"
)


def headline_section(run: RunRead, headline: Headline) -> str:
    """The table, what its marks mean, what cannot be said, and what to do about that."""
    if not headline.cells:
        return f"<p>No run has come to an end, so there is nothing to compare yet.</p>{advice(run)}"
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in run.estimators)
    apart = [sensor for sensor in run.sensors if _standings(headline, sensor) == {PARTLY}]
    body = _rows(run, headline, [sensor for sensor in run.sensors if sensor not in apart])
    below = (
        f'<tbody class="apart"><tr><th scope="rowgroup" colspan="{len(run.estimators) + 1}">'
        f"not on all of these scenarios</th></tr>{_rows(run, headline, apart)}</tbody>"
        if apart
        else ""
    )
    return (
        f'{_finding(headline)}{advice(run)}<p class="note">{_caption(run, headline)}</p>'
        '<div class="wide" tabindex="0" role="region" aria-label="Node accuracy, sensors by estimators">'
        f'<table class="matrix"><thead><tr><td></td>{head}</tr></thead><tbody>{body}</tbody>{below}</table></div>'
        f"{_legend(headline)}{INTERVALS if run.choice.seeds > 1 else ''}"
    )


def _standings(headline: Headline, sensor: str) -> set[str]:
    return {cell.standing for pair, cell in headline.cells.items() if pair[0] == sensor}


def _finding(headline: Headline) -> str:
    """What the table says, in a sentence or two."""
    if headline.best is None:
        return ""
    cell = headline.cells[headline.best]
    names = [pair_name(pair) for pair, one in headline.cells.items() if one.standing == BEST]
    best = ", ".join(f"<b>{escape(name)}</b>" for name in names or [pair_name(headline.best)])
    value = f"{number(cell.mean)} {span(cell.interval)}".strip()
    if headline.one_drive:
        return (
            f"<p>Highest: {best} with {value}. Each scenario is one recorded drive, and seeds are the estimator's "
            "random numbers alone: no difference can be called from them.</p>"
        )
    if headline.seeds < FEWEST_PAIRS:
        return (
            f"<p>Highest so far: {best} with {value}. With {plural(headline.seeds, 'seed')} no difference can be "
            f"called one yet: that takes at least {FEWEST_PAIRS}.</p>"
        )
    counts = Counter(cell.standing for cell in headline.cells.values())
    return (
        f"<p>Highest: {best} with {value}. Not told apart from it: {plural(counts[LEVEL], 'other pair')}; "
        f"worse: {counts[WORSE]}.</p>"
    )


def _caption(run: RunRead, headline: Headline) -> str:
    """What a cell is, over which scenarios and seeds, and what node accuracy is."""
    names = [name for name in run.scenarios if name in headline.compared]
    count = plural(len(names), "scenario")
    where = f"all {count}" if len(names) == len(run.scenarios) > 1 else f"{count} ({escape(', '.join(names))})"
    interval = " [95 % interval over seeds]" if headline.seeds > 1 else ""
    definition = next(metric.definition for metric in METRICS if metric.name == METRIC)
    recorded = [] if headline.one_drive else [name for name in run.scenarios if run.recorded(name)]
    out = f" Recorded drives tell no difference and are left out: {escape(', '.join(recorded))}." if recorded else ""
    return (
        f"Node accuracy, mean over {where} and {plural(headline.seeds, 'seed')}{interval}; 1 is best. It is the "
        f"{escape(definition)}.{out}"
    )


def _rows(run: RunRead, headline: Headline, sensors: Sequence[str]) -> str:
    return "".join(
        f'<tr><th scope="row">{escape(sensor)}</th>'
        + "".join(_cell(run, headline, (sensor, estimator)) for estimator in run.estimators)
        + "</tr>"
        for sensor in sensors
    )


def _cell(run: RunRead, headline: Headline, pair: Pair) -> str:
    cell = headline.cells.get(pair)
    if cell is None:
        return f'<td class="none">{escape(_why_empty(run, pair))}</td>'
    mark = f' <span class="mark">{MARKS[cell.standing]}</span>' if MARKS[cell.standing] else ""
    partly = cell.standing == PARTLY
    shade = "" if partly else f' style="--share:{100.0 * cell.mean**2:.0f}%"'
    told = f"<small>{span(cell.interval)}</small>" if cell.interval else ""
    told += f"<small>{plural(cell.scenarios, 'scenario')}</small>" * partly
    return f'<td class="{cell.standing}"{shade}><b>{number(cell.mean)}</b>{mark}{told}</td>'


def _why_empty(run: RunRead, pair: Pair) -> str:
    """The status of a pair without a value; a dash where it ran, but on nothing that is averaged."""
    found = [row.status for row in run.rows if (row.sensor, row.estimator) == pair]
    return NONE if OK in found else found[0] if found else "not run"


def _legend(headline: Headline) -> str:
    """The marks that occur, and what they mean."""
    called = headline.one_drive or headline.seeds >= FEWEST_PAIRS
    meanings = {
        BEST: "highest mean" if called else "highest mean so far",
        LEVEL: "not told apart from the best: the interval of the paired differences holds zero",
        WORSE: "worse than the best: the interval of the paired differences excludes zero, as it does by chance "
        "for one or two in a hundred equal pairs",
        PARTLY: "lacks one of these scenarios: mean over those that it ran on, not held against the best",
    }
    present = {cell.standing for cell in headline.cells.values()}
    told = [f"<li><span>{MARKS[key]}</span> {text}</li>" for key, text in meanings.items() if key in present]
    shade = "<li>A stronger colour is a higher value.</li>"
    return f'<ul class="legend">{"".join(told)}{shade}</ul>'
