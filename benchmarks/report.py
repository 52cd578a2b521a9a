"""``report.html``: one file that says what a benchmark run found; opens from disk, needs nothing else."""

from __future__ import annotations

import statistics
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from itertools import pairwise
from math import dist
from pathlib import Path
from string import Template
from typing import Any

import tomli_w

from benchmarks.results import (
    COLUMNS,
    FAILED,
    OK,
    UNAVAILABLE,
    Point,
    Row,
    Summary,
    Track,
    read_results,
    read_tracks,
    summarize,
)
from topoloc.files import write_text
from topoloc.metrics import METRICS
from topoloc.settings import read_toml

UNITS_PER_METRE = 100.0
MARGIN_M = 0.5
STRAY_M = 1.0
"""Dead reckoning that strays farther than this from everything else is cut off, or the plan would be all margin."""

_COST_DEFINITIONS = {
    "sensor_ms": "mean time of one look of the sensor, in one thread",
    "estimator_ms": "mean time of one update without the look: motion, evidence, estimate",
    "peak_mb": "most memory that the process held so far, whatever it ran before",
}


def write_report(folder: Path) -> Path:
    """Write the report of a run's folder from what lies in it."""
    config = read_toml(folder / "config.toml", "restore it; a benchmark writes it before it starts")
    path = folder / "report.html"
    write_text(path, report_html(read_results(folder / "results.csv"), read_tracks(folder), config))
    return path


def report_html(rows: Sequence[Row], tracks: Mapping[str, Track], config: Mapping[str, Any]) -> str:
    """The report as one HTML page.

    Args:
        rows: of ``results.csv``.
        tracks: a drive of each scenario, for the plans.
        config: as ``config.toml`` has it: tables ``run`` and ``scenarios``, and whatever else is worth showing.
    """
    run = config.get("run", {})
    scenarios = config.get("scenarios", {})
    expected = run.get("rows", len(rows))
    return _PAGE.substitute(
        state=escape(_state(rows, expected)),
        started=escape(str(run.get("started", ""))),
        matrices="\n".join(_matrix(rows, name, scenarios.get(name, {})) for name in _names(rows, "scenario")),
        problems=_problems(rows),
        plans="\n".join(_plan(track) for track in tracks.values()) or "<p>No run has come to an end.</p>",
        rows=_runs(rows),
        definitions=_definitions(),
        command=escape(str(run.get("command", ""))),
        settings=escape(tomli_w.dumps(dict(config))),
    )


def _state(rows: Sequence[Row], expected: int) -> str:
    counts = {status: sum(row.status == status for row in rows) for status in (OK, FAILED, UNAVAILABLE)}
    text = ", ".join(f"{count} {status}" for status, count in counts.items() if count or status == OK)
    missing = f"; unfinished: {expected - len(rows)} of {expected} are still to run" if len(rows) < expected else ""
    return f"{len(rows)} runs: {text}{missing}"


def _names(rows: Iterable[Row], what: str) -> list[str]:
    return list(dict.fromkeys(str(getattr(row, what)) for row in rows))


def _matrix(rows: Sequence[Row], scenario: str, about: Mapping[str, Any]) -> str:
    """Sensors by estimators for one scenario: mean node accuracy, its spread, and the median position error."""
    own = [row for row in rows if row.scenario == scenario]
    sensors, estimators = _names(own, "sensor"), _names(own, "estimator")
    accuracy, position = summarize(own, "node_accuracy"), summarize(own, "position_median_m")
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in estimators)
    body = []
    for sensor in sensors:
        cells = []
        for estimator in estimators:
            key = (scenario, sensor, estimator)
            cells.append(_matrix_cell(accuracy[key], position[key]) if key in accuracy else "<td>not run</td>")
        body.append(f'<tr><th scope="row">{escape(sensor)}</th>{"".join(cells)}</tr>')
    description = escape(str(about.get("description", "")))
    return (
        f'<h3>{escape(scenario)}</h3><p>{description}</p><div class="wide"><table class="matrix"><thead><tr>'
        f"<td></td>{head}</tr></thead><tbody>{''.join(body)}</tbody></table></div>"
    )


def _matrix_cell(accuracy: Summary, position: Summary) -> str:
    if accuracy.mean is None:
        return f'<td class="none" title="{escape(accuracy.reason)}">{escape(accuracy.text())}</td>'
    shade = f"--share: {100.0 * accuracy.mean:.0f}%"
    return f'<td style="{shade}"><b>{accuracy.text()}</b><br><small>{position.text(unit=" m")}</small></td>'


def _problems(rows: Iterable[Row]) -> str:
    """What did not run, each reason once."""
    reasons: dict[tuple[str, str], list[str]] = {}
    for row in rows:
        if row.status != OK:
            run = f"{row.sensor} with {row.estimator} on {row.scenario}, seed {row.seed}"
            reasons.setdefault((row.status, row.reason), []).append(run)
    if not reasons:
        return ""
    items = "".join(
        f"<li><b>{escape(status)}</b>: {escape(reason)}<details><summary>{len(runs)} runs</summary>"
        f"{'<br>'.join(escape(run) for run in runs)}</details></li>"
        for (status, reason), runs in reasons.items()
    )
    return f"<h2>What did not run</h2><ul>{items}</ul>"


def _runs(rows: Iterable[Row]) -> str:
    head = "".join(f'<th scope="col"><button type="button">{escape(name)}</button></th>' for name in COLUMNS)
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row.cells()) + "</tr>\n" for row in rows)
    return f'<table class="sortable"><thead><tr>{head}</tr></thead><tbody>\n{body}</tbody></table>'


def _definitions() -> str:
    lines = [(metric.name, metric.unit, metric.definition, metric.better) for metric in METRICS]
    lines += [(name, name.rpartition("_")[2], text, "lower") for name, text in _COST_DEFINITIONS.items()]
    body = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in line) + "</tr>" for line in lines)
    head = "".join(f'<th scope="col">{name}</th>' for name in ("column", "unit", "what it is", "better"))
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _plan(track: Track) -> str:
    """A drawing of one drive with its text alternative and its caption."""
    errors = [dist(track.truth[frame], place) for frame, place in zip(track.updates, track.estimates, strict=True)]
    off = f", in the median {statistics.median(errors):.2f} m off" if errors else ""
    carried = "".join(f" The robot is carried at frame {frame}." for frame in track.kidnapped_at)
    outcome = (
        f"{track.sensor} with {track.estimator}, seed {track.seed}, names the right node in {sum(track.right)} of "
        f"{len(track.right)} updates{off}.{carried}"
    )
    alternative = f"Plan of {track.scenario} with {len(track.nodes)} nodes and {len(track.edges)} edges. {outcome}"
    caption = f"<b>{escape(track.scenario)}</b>: {escape(outcome)}"
    return f"<figure>{_plan_svg(track, alternative)}<figcaption>{caption}</figcaption></figure>"


def _plan_svg(track: Track, alternative: str) -> str:
    canvas = _Canvas([*track.nodes, *track.truth, *track.estimates], track.dead_reckoning)
    parts = [canvas.line([track.nodes[a], track.nodes[b]], "edge") for a, b in track.edges]
    parts += [canvas.line(path, "reckoned") for path in _pieces(track.dead_reckoning, [])]
    parts += [canvas.line(path, "truth") for path in _pieces(track.truth, track.kidnapped_at)]
    for frame, place, right in zip(track.updates, track.estimates, track.right, strict=True):
        parts += [canvas.line([track.truth[frame], place], "error"), canvas.mark(place, right)]
    parts += [canvas.node(place, name) for place, name in zip(track.nodes, track.ids, strict=True)]
    return (
        f'<svg viewBox="0 0 {canvas.width:.0f} {canvas.height:.0f}" role="img" aria-label="{escape(alternative)}">'
        f"<title>{escape(track.scenario)}</title>{''.join(parts)}</svg>"
    )


def _pieces(path: Sequence[Point], cuts: Iterable[int]) -> list[Sequence[Point]]:
    """The path, cut where the robot was carried: it did not drive there."""
    ends = [0, *cuts, len(path)]
    return [path[start:end] for start, end in pairwise(ends) if end - start > 1]


class _Canvas:
    """Map coordinates (metres, y up) to those of a drawing (y down).

    Args:
        inside: points that must be seen.
        straying: points that may be cut off.
    """

    def __init__(self, inside: Sequence[Point], straying: Sequence[Point]) -> None:
        low, high = [], []
        for axis in (0, 1):
            least, most = min(point[axis] for point in inside), max(point[axis] for point in inside)
            low.append(max(min([least, *(p[axis] for p in straying)]), least - STRAY_M) - MARGIN_M)
            high.append(min(max([most, *(p[axis] for p in straying)]), most + STRAY_M) + MARGIN_M)
        self._left, self._top = low[0], high[1]
        self.width, self.height = ((b - a) * UNITS_PER_METRE for a, b in zip(low, high, strict=True))

    def _at(self, point: Point) -> tuple[float, float]:
        return (point[0] - self._left) * UNITS_PER_METRE, (self._top - point[1]) * UNITS_PER_METRE

    def line(self, points: Sequence[Point], kind: str) -> str:
        """A line through points."""
        text = " ".join(f"{x:.1f},{y:.1f}" for x, y in map(self._at, points))
        return f'<polyline class="{kind}" points="{text}"/>'

    def mark(self, point: Point, right: bool) -> str:
        """An estimate: a dot where the node is right, a cross where it is not, so that colour alone tells nothing."""
        x, y = self._at(point)
        if right:
            return f'<circle class="right" cx="{x:.1f}" cy="{y:.1f}" r="6"/>'
        return f'<path class="wrong" d="M{x - 7:.1f} {y - 7:.1f}l14 14m0 -14l-14 14"/>'

    def node(self, point: Point, name: str) -> str:
        """A node and its name, to that side of it where there is more room."""
        x, y = self._at(point)
        side, anchor = (-12, "end") if x > 0.6 * self.width else (12, "start")
        return (
            f'<circle class="node" cx="{x:.1f}" cy="{y:.1f}" r="8"/>'
            f'<text x="{x + side:.1f}" y="{y - 10:.1f}" text-anchor="{anchor}">{escape(name)}</text>'
        )


_PAGE = Template("""<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>topoloc bench</title>
<style>
:root { color-scheme: light dark; --ink: #1b1f24; --paper: #fff; --soft: #667; --rule: #d5d9de; --shade: #0072b2;
  --blue: #0072b2; --orange: #b36b00; --red: #d55e00; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8eaed; --paper: #16181b; --soft: #9aa; --rule: #3a3f45;
  --blue: #56b4e9; --orange: #e69f00; --red: #ff8a4a; } }
body { margin: 0 auto; max-width: 72rem; padding: 1rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.5 system-ui, sans-serif; }
h1, h2, h3 { line-height: 1.2; } h2 { margin-top: 2.5rem; } small, figcaption, .note { color: var(--soft); }
.notice { border-left: .3rem solid var(--blue); padding: .5rem 1rem; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--rule); padding: .35rem .6rem; text-align: left; vertical-align: top; }
.matrix td[style] { background: color-mix(in srgb, var(--shade) calc(var(--share) * .35), transparent); }
.matrix td, .sortable td { white-space: nowrap; } .none { color: var(--soft); font-style: italic; }
th button { all: unset; cursor: pointer; font-weight: 600; } th button:focus-visible { outline: 2px solid var(--blue); }
th[aria-sort=ascending] button::after { content: " ▲"; } th[aria-sort=descending] button::after { content: " ▼"; }
.plans { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(20rem, 100%), 1fr)); gap: 1.5rem; }
figure { margin: 0; } svg { width: 100%; height: auto; border: 1px solid var(--rule); }
svg text { font-size: 15px; fill: var(--ink); stroke: var(--paper); stroke-width: 4; paint-order: stroke; }
polyline { fill: none; stroke-width: 3; stroke-linejoin: round; } .edge { stroke: var(--rule); stroke-width: 8; }
.truth { stroke: var(--ink); } .reckoned { stroke: var(--orange); stroke-dasharray: 14 9; }
.error { stroke: var(--soft); stroke-width: 1.5; } .right { fill: var(--blue); }
.wrong { stroke: var(--red); stroke-width: 5; fill: none; } .node { fill: var(--paper); stroke: var(--soft);
  stroke-width: 4; }
pre { overflow-x: auto; border: 1px solid var(--rule); padding: .8rem; }
</style>
</head>
<body>
<h1>topoloc bench</h1>
<p>$state. Started $started.</p>
<p class="notice">The worlds are simulated: rooms, pictures, people and odometer errors are drawn by a program, and no
camera has seen them. They tell methods apart under conditions that are known exactly; how well a method does in your
rooms only your own recording shows.</p>

<h2>Sensors and estimators</h2>
<p class="note">Node accuracy, mean ± standard deviation over the seeds (a share of the updates; 1 is best); below it
the median position error. A stronger colour is better.</p>
$matrices
$problems

<h2>Where the robot was, and where it thought it was</h2>
<p class="note">One drive of each scenario, not picked for its outcome: the first sensor and estimator that ran, with
the first seed. Solid line: truth. <span style="color: var(--orange)">Dashed line: dead reckoning</span> from the true
start. <span style="color: var(--blue)">Dot: estimate</span> with the right node;
<span style="color: var(--red)">cross: estimate with another node</span>; a thin line leads to the truth. Circles: nodes
of the map.</p>
<div class="plans">
$plans
</div>

<h2>Every run</h2>
<p class="note">Click a heading to sort; empty cells are undefined and stay at the end.</p>
<div class="wide">
$rows
</div>

<h2>What the columns say</h2>
<div class="wide">
$definitions
</div>

<h2>How to reproduce it</h2>
<p>The same versions and seeds give the same results, apart from times and memory:</p>
<pre>$command</pre>
<details><summary>All settings and versions (config.toml)</summary><pre>$settings</pre></details>

<script>
"use strict";
function compare(a, b) {
  const x = Number(a), y = Number(b);
  return Number.isNaN(x) || Number.isNaN(y) ? a.localeCompare(b) : x - y;
}
for (const button of document.querySelectorAll(".sortable th button")) {
  button.addEventListener("click", () => {
    const heading = button.parentElement, body = heading.closest("table").tBodies[0];
    const direction = heading.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    const text = row => row.cells[heading.cellIndex].textContent;
    for (const other of heading.parentElement.cells) other.removeAttribute("aria-sort");
    heading.setAttribute("aria-sort", direction === 1 ? "ascending" : "descending");
    const rows = [...body.rows], full = rows.filter(row => text(row) !== "");
    full.sort((a, b) => direction * compare(text(a), text(b)));
    body.append(...full, ...rows.filter(row => text(row) === ""));
  });
}
</script>
</body>
</html>
""")
