"""The README's table: node accuracy of some pairs on three scenarios."""

from __future__ import annotations

from collections.abc import Mapping

from benchmarks.publish.markdown import code, table
from benchmarks.publish.published import Published
from benchmarks.results import Summary, summarize
from benchmarks.spread import Group, Pair
from topoloc.errors import InputError

HEADLINE_SCENARIOS = ("lab-fresh", "lab-people", "lab-kidnapped")
HEADLINE_HEADS = ("fresh", "people in 35 % of the frames", "kidnapped half-way", "position, fresh")
HEADLINE: tuple[Pair, ...] = (
    *(("ima", name) for name in ("grid", "particle", "auxiliary", "multi-gaussian", "sequence", "kalman")),
    ("ima-robust", "activity-offset"),
    *(("ima", name) for name in ("activity-offset", "activity", "best-match", "dead-reckoning")),
    *((sensor, name) for sensor in ("local", "pca") for name in ("particle", "best-match")),
    ("descriptor", "particle"),
    *(("histogram", name) for name in ("grid", "particle", "sequence", "activity", "best-match")),
)
"""The pairs of the table."""


def headline_of(published: Published) -> str:
    """The table. Raises ``InputError`` where the run has not all that stands in it."""
    accuracy, position = (summarize(published.run.rows, name) for name in ("node_accuracy", "position_median_m"))
    _refuse_missing(published, accuracy)
    body = [
        (
            code(sensor),
            code(estimator),
            *(accuracy[scenario, sensor, estimator].text() for scenario in HEADLINE_SCENARIOS),
            position[HEADLINE_SCENARIOS[0], sensor, estimator].text(unit=" m"),
        )
        for sensor, estimator in HEADLINE
    ]
    return table(("sensor", "estimator", *HEADLINE_HEADS), body)


def _refuse_missing(published: Published, known: Mapping[Group, Summary]) -> None:
    for scenario in HEADLINE_SCENARIOS:
        for sensor, estimator in HEADLINE:
            if (scenario, sensor, estimator) not in known:
                problem = f"has no row of {sensor}/{estimator} on {scenario}, which the README's table needs"
                raise InputError(published.run.folder, problem, "run topoloc bench --full")
