"""The picture of a layout, beside the truth where that is known."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from topoloc.geometry import Floats
from topoloc.types import Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOURS = "viridis"
"""Colour-blind readers, too, tell early images from late ones by it."""
LABELLED = 60
"""Of more images than this, the numbers would hide each other."""


def draw_layout(layout: Floats, truth: Floats | None, edges: Ints, unit: str, title: str) -> Figure:
    """A layout, and the truth on the left of it where there is one.

    Args:
        layout: (N, 2), put onto the truth where there is one.
        truth: (N, 2), or None.
        edges: (E, 2) pairs of images that a line joins, in both.
        unit: of the axes.
        title: above the layout.
    """
    from matplotlib.figure import Figure

    parts = [(layout, title)] if truth is None else [(truth, "truth"), (layout, title)]
    figure = Figure(figsize=(1.0 + 4.6 * len(parts), 4.8), layout="constrained")
    grid = figure.subplots(1, len(parts), sharex=True, sharey=True, squeeze=False)[0]
    for axes, (positions, name) in zip(grid, parts, strict=True):
        draw_images(axes, positions, edges)
        axes.set(xlabel=f"x [{unit}]", title=name)
    grid[0].set_ylabel(f"y [{unit}]")
    return figure


def draw_images(axes: Axes, positions: Floats, edges: Ints, numbered: bool = True) -> None:
    """Draw images into axes, from early (dark) to late.

    Args:
        axes: to draw into.
        positions: (N, 2).
        edges: (E, 2) pairs that a line joins.
        numbered: with their numbers, from 1, where they are ``LABELLED`` or fewer.
    """
    for a, b in np.asarray(edges):
        axes.plot(*positions[[a, b]].T, color="0.8", linewidth=0.8, zorder=1)
    axes.scatter(positions[:, 0], positions[:, 1], c=np.arange(len(positions)), cmap=COLOURS, s=14, zorder=2)
    for number, place in enumerate(positions, start=1) if numbered and len(positions) <= LABELLED else ():
        axes.annotate(str(number), place, xytext=(3, 3), textcoords="offset points", fontsize=6, zorder=3)
    axes.set_aspect("equal")
