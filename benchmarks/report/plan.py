"""The plan of a drive as SVG: what does not move. The page's script adds the robot, the answers and the belief."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from itertools import pairwise

from benchmarks.report.markup import plural
from benchmarks.report.replay_files import DriveRead

MARGIN_CM, STRAY_CM = 40, 50
"""Dead reckoning that strays farther than this from everything else is cut off, or the plan would be all margin."""
UNITS = 480.0
"""The longer side of a plan, in strokes: sizes of marks and letters are told in these."""
MOST_NAMED, LONGEST_ID = 40, 14
"""Nodes of larger maps are drawn without their ids."""

Place = Sequence[int]


def plan_svg(drive: DriveRead, scenario: str) -> str:
    """Nodes, edges, truth and dead reckoning; a unit of the drawing is a centimetre, y points down."""
    left, top, width, height = _box(drive)
    unit = max(width, height) / UNITS
    edges = "".join(_path([drive.nodes[a][2:4], drive.nodes[b][2:4]]) for a, b in drive.edges)
    truth = "".join(map(_path, _pieces(drive.truth, drive.kidnapped_at)))
    label = f"Plan of {scenario}: {plural(len(drive.nodes), 'node')}, {plural(len(drive.edges), 'edge')}."
    return (
        f'<svg class="plan" viewBox="{left} {top} {width} {height}" style="--u:{unit:.3f}" data-unit="{unit:.3f}" '
        f'role="img" aria-label="{escape(label)}"><path class="edges" d="{edges}"/><path class="way" d="{truth}"/>'
        f'<path class="reckoned" d="{"".join(map(_path, _pieces(drive.reckoned, [])))}"/>'
        f'<g data-role="belief"></g><g class="nodes">{_nodes(drive, unit, left + 0.6 * width)}</g>'
        '<g data-role="answers"></g><g data-role="poses"></g></svg>'
    )


def _nodes(drive: DriveRead, unit: float, turn: float) -> str:
    """Circles, and ids to that side of them where there is more room; names would cover each other."""
    parts = []
    for identity, name, x, y, _ in drive.nodes:
        said = identity if not name or name == identity else f"{identity} {name}"
        parts.append(f'<circle cx="{x}" cy="{-y}" r="{5 * unit:.1f}"><title>{escape(said)}</title></circle>')
        if len(drive.nodes) <= MOST_NAMED:
            side, anchor = (-8, "end") if x > turn else (8, "start")
            text = identity if len(identity) <= LONGEST_ID else f"{identity[: LONGEST_ID - 1]}…"
            parts.append(
                f'<text x="{x + side * unit:.1f}" y="{-y - 7 * unit:.1f}" text-anchor="{anchor}">{escape(text)}</text>'
            )
    return "".join(parts)


def _box(drive: DriveRead) -> tuple[int, int, int, int]:
    """Left, top, width and height of what must be seen."""
    inside = [*(node[2:4] for node in drive.nodes), *(pose[:2] for pose in drive.truth)]
    ends = []
    for axis in (0, 1):
        low, high = min(place[axis] for place in inside), max(place[axis] for place in inside)
        stray = [place[axis] for place in drive.reckoned]
        ends.append(
            (
                max(min([low, *stray]), low - STRAY_CM) - MARGIN_CM,
                min(max([high, *stray]), high + STRAY_CM) + MARGIN_CM,
            )
        )
    (left, right), (bottom, top) = ends
    return left, -top, right - left, top - bottom


def _pieces(path: Sequence[Place], cuts: Sequence[int]) -> list[Sequence[Place]]:
    """The path, cut where the robot was carried: it did not drive there."""
    return [path[start:end] for start, end in pairwise([0, *cuts, len(path)]) if end - start > 1]


def _path(places: Sequence[Place]) -> str:
    return "M" + "L".join(f"{place[0]} {-place[1]}" for place in places)
