"""A table of each scenario: every pair, every metric that people ask for, what did not run, how to run it again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from html import escape

from benchmarks.report.commands import commands_of
from benchmarks.report.headline import MARKS, OPEN, standing_of
from benchmarks.report.markup import NONE, number, pair_name, reach
from benchmarks.report.run_read import RunRead
from benchmarks.results import FAILED, OK, Row, Summary, summarize
from benchmarks.spread import Best, Group, Interval, Pair, against_best, spreads
from topoloc.metrics import METRICS, Metric

LEFT_TO_THE_FILE = frozenset({"steps", "strict_accuracy", "adjacent_rate", "position_rmse_m", "peak_mb"})
"""Columns of ``results.csv`` that would make the tables too wide to read."""
SHOWN = tuple(metric for metric in METRICS if metric.name not in LEFT_TO_THE_FILE)
JUDGED = "node_accuracy"
WAYS = {
    "higher": ("↑", "higher is better"),
    "lower": ("↓", "lower is better"),
    "near 3": ("→3", "nearer to 3 is better"),
}
MOST_IN_SIGHT = 20
"""Tables of more rows scroll in a box of their own."""

Values = Mapping[str, Mapping[Group, Summary]]
Ends = Mapping[str, Mapping[Group, Interval | None]]


def tables_section(run: RunRead) -> str:
    """The tables of all scenarios."""
    values = {metric.name: summarize(run.rows, metric.name) for metric in SHOWN}
    ends = {metric.name: spreads(run.rows, metric.name) for metric in SHOWN}
    best = against_best(run.rows, JUDGED)
    return "".join(_scenario(run, name, values, ends, best.get(name)) for name in run.scenarios)


def _scenario(run: RunRead, scenario: str, values: Values, ends: Ends, best: Best | None) -> str:
    rows = [row for row in run.rows if row.scenario == scenario]
    pairs = [pair for pair in run.pairs if any((row.sensor, row.estimator) == pair for row in rows)]
    metrics = [m for m in SHOWN if any(values[m.name][scenario, *pair].values for pair in pairs)]
    lines = []
    for pair in pairs:
        cells = (
            _cell(
                values[m.name][scenario, *pair],
                ends[m.name][scenario, *pair],
                _mark(m, pair, best, run.recorded(scenario)),
                m.name == metrics[0].name,
            )
            for m in metrics
        )
        lines.append(f'<tr><th scope="row">{_breakable(pair)}</th>{"".join(cells)}{_outcome(rows, pair)}</tr>')
    about = escape(str(run.about(scenario).get("description", "")))
    kind = "somebody's folder: one drive, seeds are the estimator's alone" if run.recorded(scenario) else "simulated"
    tall = " tall" if len(pairs) > MOST_IN_SIGHT else ""
    return (
        f'<section class="scenario"><h3>{escape(scenario)}</h3><p>{about} <small>({kind})</small></p>'
        f'<div class="wide{tall}" tabindex="0" role="region" aria-label="Results on {escape(scenario)}">'
        f'<table class="sortable"><thead><tr>{_heads(metrics)}</tr></thead><tbody>{"".join(lines)}</tbody></table>'
        f"</div>{_reasons(rows)}{commands_of(run, scenario, pairs)}</section>"
    )


def _heads(metrics: Sequence[Metric]) -> str:
    cells = ['<th scope="col"><button type="button">sensor/<wbr>estimator<span class="unit"></span></button></th>']
    for metric in metrics:
        unit = "" if metric.unit in metric.label.split() else metric.unit
        sign, words = WAYS.get(metric.better, ("", ""))
        said = f'<span class="unit">{escape(unit)} <span aria-hidden="true">{sign}</span></span>'
        title = f'title="{escape(metric.definition)}"'
        cells.append(
            f'<th scope="col"><button type="button" {title}>{escape(metric.label)} {said}'
            f'<span class="unseen">, {words}</span></button></th>'
        )
    cells.append('<th scope="col"><button type="button">runs completed<span class="unit"></span></button></th>')
    return "".join(cells)


def _cell(value: Summary, ends: Interval | None, mark: str, first: bool) -> str:
    """A value; the first cell of a pair without any run that came to an end says what became of them."""
    if value.mean is None:
        told = first and value.status != OK
        kind = value.status if told and value.status == FAILED else "none"
        return f'<td data-value="" class="{kind}">{escape(value.status) if told else NONE}</td>'
    spread = f"<small>{reach(ends)}</small>" if ends else ""
    return f'<td data-value="{value.mean:.6g}">{number(value.mean)}{mark}{spread}</td>'


def _mark(metric: Metric, pair: Pair, best: Best | None, one_drive: bool) -> str:
    """How the pair stands to the best one of the scenario, with the marks of the headline."""
    mark = MARKS[standing_of(pair, best, one_drive) if metric.name == JUDGED else OPEN]
    return f' <span class="mark">{mark}</span>' if mark else ""


def _outcome(rows: Sequence[Row], pair: Pair) -> str:
    """How many runs of a pair came to an end, and where some did, what became of the others."""
    own = [row for row in rows if (row.sensor, row.estimator) == pair]
    good = sum(row.status == OK for row in own)
    others = dict.fromkeys(row.status for row in own if row.status != OK and good)
    kind = f' class="{FAILED}"' if FAILED in others else ""
    return f'<td data-value="{good}"{kind}>{escape(", ".join([f"{good} of {len(own)}", *others]))}</td>'


def _reasons(rows: Sequence[Row]) -> str:
    """Why runs did not come to an end, each reason once, with the pairs that it stopped."""
    stopped: dict[tuple[str, str], dict[Pair, None]] = {}
    for row in rows:
        if row.status != OK:
            stopped.setdefault((row.status, row.reason), {})[row.sensor, row.estimator] = None
    return "".join(
        f'<p class="note"><b>{escape(status)}</b>: {escape(reason)}: {escape(", ".join(map(pair_name, pairs)))}</p>'
        for (status, reason), pairs in stopped.items()
    )


def _breakable(pair: Pair) -> str:
    return f"{escape(pair[0])}/<wbr>{escape(pair[1])}"
