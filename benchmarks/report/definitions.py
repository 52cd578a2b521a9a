"""What the columns of the tables say, and what the run was made with."""

from __future__ import annotations

from html import escape

import tomli_w

from benchmarks.report.markup import items
from benchmarks.report.run_read import RunRead
from topoloc.metrics import METRICS


def notice(run: RunRead) -> str:
    """What the figures can tell of the reader's rooms: of simulated scenarios little, of recorded ones one drive."""
    recorded = [name for name in run.scenarios if run.recorded(name)]
    simulated = [name for name in run.scenarios if name not in recorded]
    told = []
    if simulated:
        told.append(
            f"<p><b>Simulated</b> ({escape(', '.join(simulated))}): rooms, pictures, people and odometer errors are "
            "drawn by a program, and no camera has seen them. They tell methods apart under conditions that are known "
            "exactly; how well a method does in your rooms only your own recording shows.</p>"
        )
    if recorded:
        told.append(
            f"<p><b>Somebody's folder</b> ({escape(', '.join(recorded))}): one drive. Its seeds are the estimator's "
            "random numbers alone: an interval over seeds says nothing about another drive, and no difference is "
            "called from it.</p>"
        )
    return "".join(told)


def problems(run: RunRead) -> str:
    """Answers that should be there and are not."""
    if not run.unreadable:
        return ""
    return (
        "<details><summary>Answers that cannot be read, and are missing in the two sections below: "
        f"{len(run.unreadable)}</summary><ul>{items(run.unreadable)}</ul></details>"
    )


def definitions_table() -> str:
    """Every metric: name, unit, definition, which way is better."""
    lines = [(m.label, m.name, m.unit, m.definition, m.better) for m in METRICS]
    body = "".join(
        f'<tr><th scope="row">{escape(name)}</th><td><code>{escape(column)}</code></td>'
        + "".join(f"<td>{escape(cell)}</td>" for cell in rest)
        + "</tr>"
        for name, column, *rest in lines
    )
    names = ("name", "column of results.csv", "unit", "what it is", "better")
    head = "".join(f'<th scope="col">{name}</th>' for name in names)
    return f'<table class="definitions"><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>'


def settings(run: RunRead) -> str:
    """``config.toml``."""
    return escape(tomli_w.dumps(dict(run.config)))
