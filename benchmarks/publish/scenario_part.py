"""The report's part on one scenario: who is right how often, and all main metrics of the best pairs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from benchmarks.publish.markdown import code, pair_name, percent, spread, table
from benchmarks.publish.published import Published
from benchmarks.results import Row, Summary, summarize
from benchmarks.spread import FEWEST_PAIRS, Group, Interval, Pair, against_best, spreads

JUDGED = "node_accuracy"
TELLING = (
    "node_accuracy",
    "adjacent_rate",
    "wrong_rate",
    "position_median_m",
    "heading_median_deg",
    "steps_to_localize",
    "recall_at_p99",
    "recovery_steps",
    "calibration_error",
    "nees",
)
"""Columns of the table of the best pairs."""
SHOWN_BEST = 8
ONE_DRIVE = (
    "One recorded drive: seeds are the estimators' random numbers alone, so no interval is given and no difference is "
    "told; ± is over these seeds."
)


def scenario_part(published: Published, scenario: str) -> str:
    """What happens there, estimators by sensors, and the best pairs."""
    rows = published.rows_of(scenario)
    parts = (
        f"### {scenario}",
        str(published.run.table("scenarios", scenario).get("description", "")),
        ONE_DRIVE * published.run.recorded(scenario),
        _matrix(published, scenario, rows),
        _leaders(rows),
    )
    return "\n\n".join(part for part in parts if part)


def _matrix(published: Published, scenario: str, rows: Sequence[Row]) -> str:
    """Estimators by sensors that have any value; in bold what cannot be told apart from the best."""
    accuracy, one_drive = summarize(rows, JUDGED), published.run.recorded(scenario)
    ends: Mapping[Group, Interval | None] = {} if one_drive else spreads(rows, JUDGED)
    told = not one_drive and published.choice.seeds >= FEWEST_PAIRS
    bold = _level_with_best(rows) if told else set()
    valued = {sensor for (_, sensor, _), summary in accuracy.items() if summary.values}
    sensors = [sensor for sensor in published.names("sensors") if sensor in valued]
    body = []
    for estimator in published.names("estimators"):
        cells = []
        for sensor in sensors:
            group = scenario, sensor, estimator
            text = _cell(accuracy[group], ends.get(group)) if group in accuracy else ""
            cells.append(f"**{text}**" if (sensor, estimator) in bold else text)
        body.append((code(estimator), *cells))
    return table(("", *map(code, sensors)), body) if sensors else "No run came to an end."


def _level_with_best(rows: Sequence[Row]) -> set[Pair]:
    """The best pair of the only scenario, and those that cannot be told apart from it."""
    return {
        pair
        for best in against_best(rows, JUDGED).values()
        for pair in (best.pair, *(pair for pair, lag in best.others.items() if not lag.called))
    }


def _cell(summary: Summary, interval: Interval | None) -> str:
    return summary.text() if summary.mean is None else percent(summary.mean, interval)


def _leaders(rows: Sequence[Row]) -> str:
    """All main metrics of the pairs that name the right node most often; none that no pair has a value for."""
    means = {group: summary.mean for group, summary in summarize(rows, JUDGED).items() if summary.mean is not None}
    chosen = sorted(means, key=lambda group: -means[group])[:SHOWN_BEST]
    columns = {column: summarize(rows, column) for column in TELLING}
    shown = [column for column, found in columns.items() if any(found[group].values for group in chosen)]
    if not shown:
        return ""
    heads = ("the best pairs, mean ± standard deviation", *map(code, shown))
    body = [
        (pair_name((group[1], group[2])), *(spread(columns[column][group]) for column in shown)) for group in chosen
    ]
    return table(heads, body)
