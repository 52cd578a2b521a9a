"""What a look of each sensor and an update of each estimator takes, on the machine of the run."""

from __future__ import annotations

import statistics
from collections.abc import Sequence

from benchmarks.publish.markdown import code, table
from benchmarks.publish.published import Published


def costs(published: Published) -> str:
    """Whose times these are, and a table each for sensors and estimators."""
    machine = published.machine
    text = (
        "Milliseconds, one thread: medians over all pairs and seeds that the sensor or the estimator has part in, of "
        f"`{published.choice.command}` on {machine['processor'] or 'an unknown processor'}, {machine['cores']} cores. "
        "On another machine they differ, and while it does other work."
    )
    return "\n\n".join((text, *(_medians(published, what) for what in ("sensor", "estimator"))))


def _medians(published: Published, what: str) -> str:
    """Of ``sensor`` or ``estimator``: one by scenario."""
    column = f"{what}_ms"
    values: dict[tuple[str, str], list[float]] = {}
    for row in published.run.rows:
        value = row.values.get(column)
        if value is not None:
            values.setdefault((getattr(row, what), row.scenario), []).append(value)
    names = [name for name in published.names(f"{what}s") if name in {key[0] for key in values}]
    scenarios = [name for name in published.names("scenarios") if name in {key[1] for key in values}]
    body = [(code(name), *(_median(values.get((name, scenario), ())) for scenario in scenarios)) for name in names]
    return table((f"{what}, {code(column)}, median", *scenarios), body)


def _median(values: Sequence[float]) -> str:
    return f"{statistics.median(values):.2f}" if values else ""
