"""The picture of ``topoloc speed growth``: time over size, both logarithmic, a panel for each thing that grows."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from benchmarks.speed.growth import Growth

COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours that colour-blind readers tell apart (Okabe and Ito)."""
MARKERS = "osD^vP*X"
"""One more than colours: where both come round again, they come in other pairs."""


def draw_growth(growths: Sequence[Growth]) -> Figure:
    """Medians with quartiles; a grey line in each panel is what grows as the size itself."""
    panels = list(dict.fromkeys(growth.grower.by for growth in growths))
    figure = Figure(figsize=(5.0 * len(panels), 4.8), layout="constrained")
    for axes, by in zip(np.atleast_1d(figure.subplots(1, len(panels))), panels, strict=True):
        _panel(axes, [growth for growth in growths if growth.grower.by == by], by)
    return figure


def _panel(axes: Axes, growths: Sequence[Growth], by: str) -> None:
    for growth, colour, marker in zip(growths, cycle(COLOURS), cycle(MARKERS), strict=False):
        points = growth.points
        sizes, times = [point.size for point in points], np.array([point.ms for point in points])
        around = np.abs(np.array([(point.ms_low, point.ms_high) for point in points]).T - times)
        label = f"{growth.grower.name}: {by}^{growth.exponent[0]:.2f}"
        axes.errorbar(sizes, times, around, color=colour, marker=marker, markersize=4, label=label)
    steepest = max(growths, key=lambda growth: growth.points[-1].ms)
    ends = np.array([steepest.points[0].size, steepest.points[-1].size], dtype=np.float64)
    axes.plot(ends, steepest.points[-1].ms * ends / ends[-1], color="#999999", linestyle=":", label=f"{by}^1")
    axes.set(xscale="log", yscale="log", xlabel=by, ylabel="ms a look or update")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
