"""Error over time: how far off each estimator was at each frame, in the median over the seeds."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from benchmarks.report.answers import Answers
from benchmarks.report.markup import NONE, number, select
from benchmarks.report.run_read import RunRead
from topoloc.geometry import Floats

WIDTH, HEIGHT, LEFT, BELOW = 720.0, 300.0, 40.0, 34.0
"""Of the chart's field, and of the room for its scales, in units of the drawing."""
MOST_POINTS, MOST_LINES_OF_TABLE, MARKERS = 300, 20, 7
COLOURS, DASHES, SHAPES = 5, 3, 4
TICKS_M = (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 1000.0)
SHAPE_PATHS = (
    "M-3.5 0a3.5 3.5 0 1 0 7 0a3.5 3.5 0 1 0-7 0",
    "M-3 -3h6v6h-6z",
    "M0 -4.4l4 7h-8z",
    "M0 -4.6l4 4.6-4 4.6-4-4.6z",
)


@dataclass(frozen=True)
class Scale:
    """From frames and metres to the drawing; metres are drawn by their logarithm."""

    frames: int
    low: float
    high: float

    def x(self, frame: float) -> float:
        """From the left."""
        return WIDTH * frame / max(self.frames - 1, 1)

    def y(self, metres: float) -> float:
        """From the top; what is smaller than the lowest tick is drawn there."""
        share = math.log(max(metres, self.low) / self.low) / math.log(self.high / self.low)
        return HEIGHT * (1.0 - min(share, 1.0))


def median_errors(answers: Sequence[Answers]) -> Floats:
    """(N,) median over a pair's runs of their errors at each frame; a shorter run leaves its end to the others."""
    table = np.full((len(answers), max(len(one.errors) for one in answers)), np.nan)
    for row, one in zip(table, answers, strict=True):
        row[: len(one.errors)] = one.errors
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames where no run has a finite error stay NaN
        return np.asarray(np.nanmedian(table, axis=0))


def error_section(run: RunRead, kidnapped: Mapping[str, Sequence[int]]) -> str:
    """A chart for each scenario and sensor; two selects choose one.

    Args:
        run: the run.
        kidnapped: frames at which the robot was carried elsewhere, by scenario.
    """
    curves = {group: median_errors(answers) for group, answers in run.answers.items()}
    scenarios = [name for name in run.scenarios if any(group[0] == name for group in curves)]
    sensors = [name for name in run.sensors if any(group[1] == name for group in curves)]
    if not curves:
        return "<p>No answers of a run that came to an end can be read.</p>"
    charts = []
    for i, scenario in enumerate(scenarios):
        for j, sensor in enumerate(sensors):
            groups = {name: (scenario, sensor, name) for name in run.estimators}
            own = {name: curves[group] for name, group in groups.items() if group in curves}
            styles = {name: run.estimators.index(name) for name in own}
            chart = _chart(scenario, sensor, own, styles, kidnapped.get(scenario, ())) if own else _nothing(sensor)
            charts.append(f'<div data-choice="{i} {j}"{" hidden" * (i + j > 0)}>{chart}</div>')
    chooser = f"{select('Scenario', scenarios, 'choose')}{select('Sensor', sensors, 'choose')}"
    return f'<div data-role="chooser"><p class="controls">{chooser}</p>{"".join(charts)}</div>'


def _nothing(sensor: str) -> str:
    return f"<p>No run of {escape(sensor)} came to an end there.</p>"


def _chart(
    scenario: str, sensor: str, curves: Mapping[str, Floats], styles: Mapping[str, int], kidnapped: Sequence[int]
) -> str:
    """The lines, the legend that brings one forward, and the numbers."""
    known = np.concatenate([curve[np.isfinite(curve)] for curve in curves.values()])
    top = float(known.max(initial=0.0))
    high = next((tick for tick in TICKS_M[2:] if tick >= top), TICKS_M[-1])
    low = max((tick for tick in TICKS_M if tick <= float(known.min(initial=high)) and tick < high), default=TICKS_M[0])
    scale = Scale(max(map(len, curves.values())), low, high)
    lines = "".join(_line(styles[name], curve, scale) for name, curve in curves.items())
    typical = {name: float(np.nanmedian(curve)) for name, curve in curves.items() if np.isfinite(curve).any()}
    told = ", ".join(f"{name} {number(typical.get(name))} m" for name in curves)
    label = f"Position error over time of {sensor} on {scenario}; median over all frames: {told}."
    box = f"{-LEFT:.0f} -26 {WIDTH + LEFT + 12:.0f} {HEIGHT + BELOW + 26:.0f}"
    legend = "".join(_entry(styles[name], name, typical.get(name)) for name in curves)
    return (
        f'<div class="chart"><div class="wide" tabindex="0" role="region" aria-label="Chart of {escape(sensor)} on '
        f'{escape(scenario)}"><svg viewBox="{box}" role="img" aria-label="{escape(label)}">'
        f"{_axes(scale)}{_carried(kidnapped, scale)}{lines}</svg></div>"
        f'<ul class="legend lines" aria-label="Lines">{legend}</ul></div>'
        f"{_numbers(scenario, sensor, curves)}"
    )


def _style(index: int) -> str:
    """Colour and dash of the estimator of this index; together they differ for the first fifteen."""
    return f"c{index % COLOURS} d{index // COLOURS % DASHES}"


def _line(index: int, curve: Floats, scale: Scale) -> str:
    """A polyline, broken where nothing is known, and markers along it."""
    stride = math.ceil(len(curve) / MOST_POINTS)
    frames = np.arange(0, len(curve), stride)
    known = frames[np.isfinite(curve[frames])]
    gaps = np.flatnonzero(np.diff(known) > stride) + 1
    pieces = [
        "M" + "L".join(f"{scale.x(int(k)):.1f} {scale.y(float(curve[k])):.1f}" for k in piece)
        for piece in np.split(known, gaps)
        if len(piece)
    ]
    every = max(1, len(known) // MARKERS)
    shape = SHAPE_PATHS[index % SHAPES]
    marks = "".join(
        f'<path class="shape" transform="translate({scale.x(int(k)):.1f} {scale.y(float(curve[k])):.1f})" d="{shape}"/>'
        for k in known[index % every :: every]
    )
    return f'<g class="line {_style(index)}" data-line="{index}"><path class="run" d="{"".join(pieces)}"/>{marks}</g>'


def _entry(index: int, name: str, typical: float | None) -> str:
    """A button of the legend, with a piece of the line."""
    swatch = (
        f'<svg class="line {_style(index)}" viewBox="0 0 36 12" aria-hidden="true"><path class="run" d="M1 6H35"/>'
        f'<path class="shape" transform="translate(18 6)" d="{SHAPE_PATHS[index % SHAPES]}"/></svg>'
    )
    text = f"{escape(name)} <small>{number(typical)} m</small>"
    return f'<li><button type="button" aria-pressed="false" data-line="{index}">{swatch} {text}</button></li>'


def _axes(scale: Scale) -> str:
    parts = [f'<rect class="frame" width="{WIDTH:.0f}" height="{HEIGHT:.0f}"/>']
    for tick in TICKS_M:
        if scale.low <= tick <= scale.high:
            y = scale.y(tick)
            parts.append(f'<path class="grid" d="M0 {y:.1f}H{WIDTH:.0f}"/>')
            parts.append(f'<text x="-5" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>')
    for frame in _round_frames(scale.frames):
        x = scale.x(frame)
        parts.append(f'<path class="grid" d="M{x:.1f} {HEIGHT:.0f}v4"/>')
        parts.append(f'<text x="{x:.1f}" y="{HEIGHT + 16:.0f}" text-anchor="middle">{frame}</text>')
    parts.append(f'<text x="{WIDTH / 2:.0f}" y="{HEIGHT + 31:.0f}" text-anchor="middle">frame</text>')
    parts.append(f'<text x="{-LEFT:.0f}" y="-14">m (logarithmic)</text>')
    return "".join(parts)


def _round_frames(frames: int) -> range:
    """Some six frames with round numbers."""
    step = next(size * 10**power for power in range(9) for size in (1, 2, 5) if size * 10**power * 7 >= frames)
    return range(0, frames, step)


def _carried(kidnapped: Sequence[int], scale: Scale) -> str:
    return "".join(
        f'<path class="carried" d="M{scale.x(frame):.1f} 0V{HEIGHT:.0f}"/>'
        f'<text x="{scale.x(frame) + 5:.1f}" y="13">carried elsewhere</text>'
        for frame in kidnapped
        if frame < scale.frames
    )


def _numbers(scenario: str, sensor: str, curves: Mapping[str, Floats]) -> str:
    """The table that stands for the chart; of a long drive every k-th frame."""
    frames = max(map(len, curves.values()))
    stride = math.ceil(frames / MOST_LINES_OF_TABLE)
    head = "".join(f'<th scope="col">{escape(name)}</th>' for name in curves)
    body = "".join(
        f'<tr><th scope="row">{frame}</th>'
        + "".join(f"<td>{number(float(c[frame])) if frame < len(c) else NONE}</td>" for c in curves.values())
        + "</tr>"
        for frame in range(0, frames, stride)
    )
    step = "every frame" if stride == 1 else f"every {stride} frames"
    return (
        f"<details><summary>The same as numbers, {step}</summary>"
        f'<div class="wide" tabindex="0" role="region" aria-label="Numbers of {escape(sensor)} on {escape(scenario)}">'
        f"<table><caption><span>{escape(sensor)} on {escape(scenario)}: position error in m, "
        "median over seeds</span></caption>"
        f'<thead><tr><th scope="col">frame</th>{head}</tr></thead><tbody>{body}</tbody></table></div></details>'
    )
