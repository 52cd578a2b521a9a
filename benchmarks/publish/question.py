"""The question that the benchmark is for: two pairs on every scenario, and which is better where."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.publish.markdown import code, pair_name, spread, table
from benchmarks.publish.published import Published
from benchmarks.report.comparisons import QUESTION
from benchmarks.results import summarize
from benchmarks.spread import FEWEST_PAIRS, Difference, Verdict, paired, verdict
from topoloc.metrics import METRICS

ASKED = ("node_accuracy", "position_median_m", "recall_at_p99", "calibration_error")
"""Columns in which the pairs are held against each other."""
OF_THE_FIRST = {Verdict.WORSE: "better", Verdict.BETTER: "worse"}
"""What the first pair is where the second is so beside it."""
LABELS = {metric.name: f"{metric.label} ({metric.unit})" if metric.unit else metric.label for metric in METRICS}


def question(published: Published) -> str:
    """How to read it, the table, and the answer."""
    found = {metric: _told(published, metric) for metric in ASKED}
    if not any(found.values()):
        return "They did not both run on any scenario."
    first, second = map(pair_name, QUESTION)
    body = [line for metric in ASKED for line in _lines(published, metric, found[metric])]
    answer = (f"- {LABELS[metric]}: {_in_words(told)}" for metric, told in found.items() if told)
    return "\n\n".join(
        (
            "Paired over the seeds, drive by drive. A difference is called one where the 95 % interval excludes zero, "
            f"from {FEWEST_PAIRS} seeds on; of equal ones about one in 20 is called so by chance.",
            table(("metric", "scenario", first, second, "the second less the first", "better"), body),
            f"In short, {first} beside {second}:",
            "\n".join(answer),
        )
    )


Told = Mapping[str, tuple[Difference, Verdict]]
"""By scenario: the second pair less the first, and what it is beside it."""


def _told(published: Published, metric: str) -> Told:
    apart, run = paired(published.run.rows, metric, *QUESTION), published.run
    return {
        scenario: (apart[scenario], verdict(apart[scenario], metric, run.recorded(scenario)))
        for scenario in published.names("scenarios")
        if scenario in apart
    }


def _lines(published: Published, metric: str, told: Told) -> list[tuple[str, ...]]:
    """The table's lines in one metric."""
    values = summarize(published.run.rows, metric)
    winners = {Verdict.WORSE: pair_name(QUESTION[0]), Verdict.BETTER: pair_name(QUESTION[1])}
    return [
        (
            code(metric),
            scenario,
            *(spread(values[scenario, *pair]) for pair in QUESTION),
            _signed(difference, with_interval=word != Verdict.ONE_DRIVE),
            winners.get(word, word.value),
        )
        for scenario, (difference, word) in told.items()
    ]


def _signed(difference: Difference, with_interval: bool) -> str:
    if difference.mean is None:
        return "-"
    ends = difference.interval if with_interval else None
    return f"{difference.mean:+.3f}" + ("" if ends is None else f" ({ends.low:+.3f} to {ends.high:+.3f})")


def _in_words(told: Told) -> str:
    """``better in lab-fresh, twins; worse in building; no difference told in lab-old``."""
    where: dict[str, list[str]] = {word: [] for word in OF_THE_FIRST.values()}
    for scenario, (_, word) in told.items():
        where.setdefault(OF_THE_FIRST.get(word, word.value), []).append(scenario)
    return "; ".join(f"{word} in {', '.join(names)}" for word, names in where.items() if names)
