"""The plan of a map, seen from above: nodes, edges, and the paths of a run."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from topoloc.geometry import Floats, between, compose
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

TRUTH, ESTIMATE, ODOMETRY, WRONG = "#000000", "#0072B2", "#999999", "#D55E00"
"""Colours that colour-blind readers tell apart (Okabe and Ito)."""

START: dict[str, Any] = {
    "linestyle": "",
    "marker": "o",
    "markersize": 15,
    "markerfacecolor": "none",
    "markeredgecolor": "#009E73",
    "markeredgewidth": 1.6,
    "label": "start",
    "zorder": 8,
}
"""The ring where a path begins."""


def dead_reckoning(odometry: Floats, start: Floats) -> Floats:
    """Raw odometer poses (N, 3) moved so that the first one is at ``start`` (3,), map frame."""
    return compose(start, between(odometry[0], odometry))


def draw_plan(
    topo_map: TopoMap,
    estimates: Floats,
    truth: Floats | None = None,
    odometry: Floats | None = None,
    wrong: Sequence[int] = (),
    title: str = "",
) -> Figure:
    """Draw a run of N frames.

    Args:
        topo_map: nodes and edges.
        estimates: (N, 3) poses, map frame.
        truth: (N, 3), where known.
        odometry: (N, 3) dead reckoning in the map frame, where known.
        wrong: indices of estimates that named a wrong node.
        title: above the plan; that no truth is known is told beside it.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 5.0), layout="constrained")
    axes = figure.add_subplot()
    draw_paths(axes, topo_map, estimates, truth, odometry, wrong)
    known = [path for path in (odometry, truth, estimates) if path is not None]
    axes.plot(*np.array([path[0, :2] for path in known]).T, **START)
    axes.legend(fontsize=8, framealpha=0.8)
    axes.set_title(title if truth is not None else ", ".join(filter(None, [title, "no ground truth"])))
    return figure


def draw_paths(
    axes: Axes,
    topo_map: TopoMap,
    estimates: Floats,
    truth: Floats | None = None,
    odometry: Floats | None = None,
    wrong: Sequence[int] = (),
) -> None:
    """Draw a run into axes.

    Args:
        axes: to draw into.
        topo_map: nodes and edges.
        estimates: (N, 3) poses, map frame.
        truth: (N, 3), where known.
        odometry: (N, 3) dead reckoning in the map frame, where known.
        wrong: indices of estimates that named a wrong node.
    """
    for a, b in np.asarray(topo_map.edges):
        axes.plot(*topo_map.positions[[a, b]].T, color="#DDDDDD", zorder=1)
    axes.plot(*topo_map.positions.T, linestyle="", marker="s", markersize=13, color="#F0E442", zorder=2)
    if odometry is not None:
        axes.plot(*odometry[:, :2].T, color=ODOMETRY, linewidth=1.2, linestyle=":", label="dead reckoning", zorder=3)
    if truth is not None:
        axes.plot(*truth[:, :2].T, color=TRUTH, linewidth=1.0, label="truth", zorder=4)
    axes.plot(*estimates[:, :2].T, color=ESTIMATE, linewidth=0.6, marker="o", markersize=3, label="estimate", zorder=5)
    if len(wrong):
        chosen = estimates[np.asarray(wrong), :2]
        axes.plot(*chosen.T, color=WRONG, linestyle="", marker="x", markersize=7, label="wrong node", zorder=6)
    for node in topo_map.nodes:
        axes.annotate(node.id, (node.x, node.y), ha="center", va="center", fontsize=8, zorder=7)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axes.legend(fontsize=8, framealpha=0.8)


def as_png(figure: Figure) -> bytes:
    """The figure as the bytes of a PNG file."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()
