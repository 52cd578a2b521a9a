"""5.2.8: laboratory, entry and corridor, there and back once (Figures 5.30 and 5.31, Table 5.9)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.odometer_path import astray, by_odometer
from benchmarks.experiments.passes import passed_unnamed, visits
from benchmarks.experiments.picture import OTHER, OURS, THESIS
from benchmarks.experiments.plan import draw_nodes
from benchmarks.experiments.tracking import Tracked, tracked
from benchmarks.worlds.lab import LEFT
from benchmarks.worlds.lab_corridor import CORRIDOR_PLACES, LabCorridorWorld
from topoloc.types import Ints

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NODE_10, NODE_15 = 9, 14


def measure(seed: int) -> Measured:
    """One trip, by the odometer and by the tracker."""
    world = LabCorridorWorld()
    drive = world.simulate(seed)
    odometry, truth = world.drive(seed)
    off_m, off_deg = astray(odometry, truth)
    path = by_odometer(odometry, truth[0])[:, :2].round(3).tolist()
    common = {"off": off_m, "off turned": off_deg, "odometer": path, "truth": truth[:, :2].round(3).tolist()}
    return {column: common | _row(tracked(drive, method)) for column, method in METHODS.items()}


def _row(seen: Tracked) -> dict[str, Any]:
    inside, unsure = seen.truth[:, 0] > LEFT, seen.kind != "normal"
    unnamed = passed_unnamed(seen)
    back = [node for node, first in unnamed if first > _turned_back(seen.nearest)]
    return {
        **seen.counts(),
        "inside": float(inside.sum()),
        "outside": float((~inside).sum()),
        "unsure outside": float((~inside[unsure]).mean()) if unsure.any() else float("nan"),
        "errors inside": float((~seen.right & inside).sum()),
        "errors outside": float((~seen.right & ~inside).sum()),
        "passes": float(len(visits(seen.nearest))),
        "unnamed": float(len(unnamed)),
        "10 on the way back": float(NODE_10 in back),
        "wrong at": seen.truth[~seen.right, :2].round(3).tolist(),
    }


def _turned_back(nearest: Ints) -> int:
    """The last update at the end of the corridor."""
    return int(np.flatnonzero(nearest == NODE_15)[-1])


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """The first seed: the real path over the nodes, where a wrong node was named, and the path by the odometer."""
    axes, first = figure.add_subplot(), measured[0][AS_PUBLISHED]
    axes.plot(*np.array(first["truth"]).T, color=OTHER, lw=1.5, label="real path (Figure 5.30)")
    axes.plot(*np.array(first["odometer"]).T, color=THESIS, lw=1.2, label="by the odometer (Figure 5.31)")
    draw_nodes(axes, CORRIDOR_PLACES)
    wrong = np.array(first["wrong at"]).reshape(-1, 2)
    axes.plot(*wrong.T, "x", color=OURS, ms=8, mew=2, label="wrong node named")
    axes.legend(frameon=False, fontsize=8)


EXPERIMENT = Experiment(
    name="corridor",
    title="Laboratory and corridor",
    source="5.2.8, Figures 5.30 and 5.31, Table 5.9",
    about=(
        "Once round the laboratory, through two open doors to the end of the corridor and back; the panoramas were "
        "taken with closed doors, but for node 9's. The coordinates of nodes 9 to 15, doors and furniture are rebuilt. "
        "A node is an error if it is more than 0.25 m farther from the robot than the nearest one; strictly, if it is "
        "not the very nearest. A node is passed unnamed if no update names it while it is the nearest. The simulated "
        "entry and corridor are barer than real ones: blank walls match other blank walls at 0.5 to 0.6."
    ),
    measure=measure,
    quantities=(
        Quantity("updates", "update steps", "51", "Table 5.9", 0),
        Quantity("inside", "in the laboratory", "30", "Table 5.9", 0),
        Quantity("outside", "in the entry and the corridor", "21", "Table 5.9", 0),
        Quantity("destinations", "destinations", "33", "Table 5.9", 0),
        Quantity("normal", "normal destinations", "23", "Table 5.9", 0),
        Quantity("virtual", "virtual destinations", "10", "Table 5.9", 0),
        Quantity("supposed", "supposed places", "18", "Table 5.9", 0),
        Quantity("mean activity", "mean activity of destinations", "0.5026", "Table 5.9"),
        Quantity("mean match", "mean match of normal destinations", "0.6642", "Table 5.9"),
        Quantity("unsure outside", "virtual and supposed that lie outside the laboratory", "most", "5.2.8", 2, True),
        Quantity("errors", "errors", "1", "5.2.8", 0),
        Quantity("error rate", "errors, share of updates", "2.0 %", "5.2.8", 3, percent=True),
        Quantity("strict error rate", "the same, very nearest node only", "-", "ours", 3, percent=True),
        Quantity("errors inside", "errors in the laboratory", "0", "5.2.8", 0),
        Quantity("errors outside", "errors in the entry and the corridor", "1", "5.2.8", 0),
        Quantity("passes", "passes of a node", "-", "ours", 0),
        Quantity("unnamed", "nodes passed unnamed", "1", "5.2.8", 0),
        Quantity("10 on the way back", "node 10 passed unnamed on the way back", "yes", "5.2.8", percent=True),
        Quantity("off", "odometer off at the end, m", "several", "Figure 5.31"),
        Quantity("off turned", "the same, degrees", "almost 90", "Figure 5.31", 0),
    ),
    draw=draw,
)
