"""The plan of an explanation: the way so far, and the belief at the frame."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from benchmarks import replay
from benchmarks.explanation.rerun import Rerun
from topoloc.geometry import Floats
from topoloc.metrics import Run
from topoloc.plan import ESTIMATE, TRUTH, dead_reckoning, draw_paths

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BELIEF = "#CC79A7"
"""Told from the others by colour-blind readers (Okabe and Ito)."""
DISC, FEWEST_POINTS = 1500.0, 12.0
"""Area of the disc of a whole belief, and the least of any [points^2]."""
MARGIN_M = 0.7
"""Around nodes, truth and estimates; dead reckoning that strays farther is cut off."""
ARROWS_AN_INCH = 2.4
"""Where the robot looks is an arrow this part of an inch long, whatever the scale of the plan."""


def draw_plan_of(axes: Axes, again: Rerun, belief: list[replay.Cell]) -> None:
    """Nodes, truth, dead reckoning and estimates up to the frame, and the belief there as discs.

    Args:
        axes: to draw into.
        again: the run up to the frame.
        belief: cells as ``replay.cells_of`` has them; none where no look was taken.
    """
    topo_map, truth = again.case.topo_map, again.case.truth[: len(again.steps)]
    estimates = np.array([step.estimate.pose for step in again.steps])
    run = Run.of(topo_map, again.steps, truth)
    wrong = [int(index) for index in run.updates[~run.right]]
    draw_paths(axes, topo_map, estimates, truth, _reckoned(again), wrong)
    if belief:
        x, y, share = np.array(belief).T
        size = np.maximum(DISC * share, FEWEST_POINTS)
        axes.scatter(x, y, s=size, color=BELIEF, alpha=0.55, linewidth=0.0, zorder=2.5, label="belief")
    for pose, colour, depth in ((truth[-1], TRUTH, 8), (estimates[-1], ESTIMATE, 9)):
        way = np.cos(pose[2]), np.sin(pose[2])
        axes.quiver(
            *pose[:2],
            *way,
            color=colour,
            angles="xy",
            scale_units="inches",
            scale=ARROWS_AN_INCH,
            units="inches",
            width=0.05,
            zorder=depth,
        )
    _frame(axes, np.concatenate([topo_map.positions, truth[:, :2], estimates[:, :2]]))
    axes.set_title("arrows: where the robot is and looks, and where it is believed to be", fontsize=9, loc="left")


def _frame(axes: Axes, points: Floats) -> None:
    """Limits around the points (N, 2), and a legend with every disc as small as a letter, below the plan."""
    from matplotlib.collections import PathCollection

    (left, bottom), (right, top) = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    axes.set(xlim=(left, right), ylim=(bottom, top))
    legend = axes.legend(
        fontsize=8, loc="upper center", bbox_to_anchor=(0.5, 0.0), borderaxespad=5.5, ncols=5, frameon=False
    )
    for handle in legend.legend_handles:
        if isinstance(handle, PathCollection):
            handle.set_sizes([40.0])


def _reckoned(again: Rerun) -> Floats | None:
    """(N, 3) where the odometer alone puts the robot, from its true start on; None where it has none."""
    frames = (again.case.frames[index] for index in range(len(again.steps)))
    readings = [frame.odometry for frame in frames]
    known = [reading for reading in readings if reading is not None]
    return dead_reckoning(np.array(known), again.case.truth[0]) if len(known) == len(readings) else None
