"""Bars side by side: what was published, and means over seeds with their standard deviation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED, Measured
from benchmarks.experiments.picture import OURS, PUBLISHED, THESIS
from topoloc.geometry import Floats

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS: Mapping[str, str] = {AS_PUBLISHED: THESIS, IMPROVED: OURS}


def draw_bars(
    axes: Axes,
    measured: Sequence[Measured],
    keys: Mapping[str, str],
    colours: Mapping[str, str] = COLOURS,
    published: Sequence[float] | None = None,
) -> None:
    """A group of bars for each key.

    Args:
        axes: to draw into.
        measured: of all seeds; NaN where one has no value.
        keys: of the measurements, by the label on the axis.
        colours: of the columns that are drawn.
        published: value of each key; None: nothing was.
    """
    groups: list[tuple[str, str, Floats, Floats | None]] = []
    if published is not None:
        groups.append(("published", PUBLISHED, np.asarray(published, dtype=float), None))
    for column, colour in colours.items():
        values = np.array([[one[column][key] for key in keys.values()] for one in measured], dtype=float)
        mean, spread = zip(*(_mean_and_spread(of_key) for of_key in values.T), strict=True)
        groups.append((f"simulated, {column}", colour, np.array(mean), np.array(spread)))
    at, width = np.arange(len(keys)), 0.8 / len(groups)
    for number, (label, colour, height, spread_of) in enumerate(groups):
        shift = width * (number - (len(groups) - 1) / 2.0)
        axes.bar(at + shift, height, 0.93 * width, yerr=spread_of, label=label, color=colour, capsize=2)
    axes.set(xticks=at, xticklabels=list(keys))
    axes.set_ylim(bottom=0.0)


def _mean_and_spread(values: Floats) -> tuple[float, float]:
    known = values[np.isfinite(values)]
    if not len(known):
        return 0.0, 0.0
    return float(known.mean()), float(known.std(ddof=1)) if len(known) > 1 else 0.0
