"""Nodes and paths on the plan of a figure."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.worlds.world import Place

if TYPE_CHECKING:
    from matplotlib.axes import Axes


def draw_nodes(axes: Axes, places: Sequence[Place]) -> None:
    """Nodes with their ids, on axes in metres of one scale."""
    axes.plot([place.x for place in places], [place.y for place in places], "o", ms=15, mfc="white", mec="0.3")
    for place in places:
        axes.text(place.x, place.y, place.id, ha="center", va="center", fontsize=8)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
