"""A picture to judge a field of view by: how far what was seen twice lies from where it should (ours)."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from topoloc.camera.field_of_view import FieldOfView
from topoloc.plan import ESTIMATE, WRONG

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MOST_POINTS = 6000
"""More of them would only cover each other."""
SPREADS_SHOWN = 8.0
"""The axes reach so many times the median distance: what lies outside is false matches."""
BINS = 24
LEAST_SHARE = 0.005
"""Where fewer of the points are, no median is drawn."""


def draw_residuals(found: FieldOfView) -> Figure:
    """Residuals across and down against the column, and those of each pair of frames.

    A flat cloud around zero is a good fit. A bend at both edges is a lens that is not straightened; points on one side
    only are near things, seen by a camera that does not sit on the axis; single pairs off are bad odometry.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.6, 7.2), layout="constrained")
    across, down, pairs = figure.subplots(3, 1)
    half = found.size[0] / 2.0
    columns = (found.points.after[:, 0] + 1.0) * half
    for axes, side, name in ((across, 0, "across"), (down, 1, "down")):
        _scatter(axes, columns, found.residuals[:, side] * half)
        axes.set(xlabel="column [pixels]", ylabel=f"off {name} [pixels]", xlim=(0, found.size[0]))
    _by_pair(pairs, found, half)
    across.legend(fontsize=8, loc="upper right")
    across.set_title(
        f"{found.hfov_deg:.2f} degrees (standard deviation {found.sd_deg:.2f}), {found.pairs} pairs of frames, "
        f"{found.turned_deg:.0f} degrees turned, {100.0 * found.agreeing:.0f} % agree"
    )
    return figure


def _scatter(axes: Axes, columns: np.ndarray, off: np.ndarray) -> None:
    """Points, and their median from left to right."""
    some = slice(None, None, -(-len(off) // MOST_POINTS))
    axes.plot(columns[some], off[some], ".", color=ESTIMATE, markersize=2, alpha=0.4, label="seen in two frames")
    edges = np.linspace(columns.min(), columns.max() + 1e-9, BINS + 1)
    which = np.digitize(columns, edges) - 1
    filled = [number for number in range(BINS) if (which == number).mean() >= LEAST_SHARE]
    middles = [0.5 * (edges[number] + edges[number + 1]) for number in filled]
    axes.plot(middles, [np.median(off[which == number]) for number in filled], color=WRONG, label="median")
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set_ylim(-_reach(off), _reach(off))


def _reach(off: np.ndarray) -> float:
    """How far axes reach [pixels]."""
    return max(1.0, SPREADS_SHOWN * float(np.median(np.abs(off))))


def _by_pair(axes: Axes, found: FieldOfView, half: float) -> None:
    """Median and quartiles across of each pair of frames, one after the other."""
    numbers = np.arange(found.points.pairs)
    off = found.residuals[:, 0] * half
    low, middle, high = np.array([np.percentile(off[found.points.pair == n], (25, 50, 75)) for n in numbers]).T
    axes.vlines(numbers, low, high, color=ESTIMATE, linewidth=1.5)
    axes.plot(numbers, middle, ".", color=WRONG, markersize=4)
    axes.axhline(0.0, color="black", linewidth=0.6)
    axes.set(xlabel="pair of frames", ylabel="off across, middle half [pixels]", ylim=(-_reach(off), _reach(off)))
