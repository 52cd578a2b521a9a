"""5.2.1: three rounds by the odometer alone (Figures 5.22 and 5.23)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.odometer_path import by_odometer
from benchmarks.experiments.picture import OTHER, THESIS
from benchmarks.experiments.plan import draw_nodes
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from benchmarks.worlds.settings import WorldSettings
from topoloc.geometry import Floats, wrap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

ROUNDS = 3
NODE_3, NODE_4 = 2, 3


def measure(seed: int) -> Measured:
    """Drive three rounds and reckon."""
    world = LabWorld(WorldSettings(laps=float(ROUNDS)))
    odometry, truth = world.drive(seed)
    said = by_odometer(odometry, truth[0])
    off = np.hypot(*(said - truth)[:, :2].T)
    nearest, named = (world.layout().nearest_node(path[:, :2]) for path in (truth, said))
    to_4 = slice(0, int(np.flatnonzero(nearest == NODE_4)[0]) + 1)
    ends = [round(number * (len(truth) - 1) / ROUNDS) for number in range(1, ROUNDS + 1)]
    return {
        AS_PUBLISHED: {
            **{f"off {number}": float(off[end]) for number, end in enumerate(ends, 1)},
            "turned": float(np.rad2deg(abs(wrap(said[-1, 2] - truth[-1, 2])))),
            "x": float(said[-1, 0]),
            "y": float(said[-1, 1]),
            "between": float(_is_between(said[-1, :2])),
            "off at 4": float(off[to_4].max()),
            "right to 4": float((named == nearest)[to_4].mean()),
            "right in all": float((named == nearest).mean()),
            "odometer": said.round(3).tolist(),
            "truth": truth.round(3).tolist(),
        }
    }


def _is_between(place: Floats) -> bool:
    """Whether nodes 3 and 4 are the two nearest to a place (2,)."""
    nodes = np.array([(node.x, node.y) for node in LAB_PLACES])
    return set(np.argsort(np.linalg.norm(nodes - place, axis=1))[:2].tolist()) == {NODE_3, NODE_4}


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """The first seed's path as it was and by the odometer, and where the odometer of each seed ends."""
    left, right = figure.subplots(1, 2, sharex=True, sharey=True)
    first = measured[0][AS_PUBLISHED]
    for axes, key, title, colour in (
        (left, "truth", "real path (Figure 5.22)", OTHER),
        (right, "odometer", "by the odometer (Figure 5.23)", THESIS),
    ):
        x, y, _ = np.array(first[key]).T
        axes.plot(x, y, color=colour, lw=1.2)
        draw_nodes(axes, LAB_PLACES)
        axes.set_title(title, fontsize=9)
    ends = np.array([(one[AS_PUBLISHED]["x"], one[AS_PUBLISHED]["y"]) for one in measured])
    right.plot(*ends.T, "kx", label="end, each seed")
    right.legend(frameon=False, fontsize=8)


EXPERIMENT = Experiment(
    name="dead-reckoning",
    title="Odometry error over three rounds",
    source="5.2.1, Figures 5.22 and 5.23",
    about=(
        "Three rounds past nodes 1 to 8 and back to 1, reckoned from the true start by the odometer alone. The thesis "
        "says that the odometer ended between nodes 3 and 4, which lie 1.4 and 2.2 m from node 1; its other figures "
        "are drawn, not printed. How far off the simulated odometer ends (curvature, scale, slipping wheels, heating "
        "grilles) was fitted to this on other seeds; to which side was not."
    ),
    measure=measure,
    quantities=(
        Quantity("off 1", "off after one round, m", "-", "ours"),
        Quantity("off 2", "off after two rounds, m", "-", "ours"),
        Quantity("off 3", "off after three rounds, m", "1.4 to 2.2, by the nodes", "Figure 5.23"),
        Quantity("turned", "heading off after three rounds, degrees", "-", "ours", 0),
        Quantity("x", "x of the end, node 1 at 0, m", "about 1, by the nodes", "Figure 5.23"),
        Quantity("y", "y of the end, m", "1 to 2, by the nodes", "Figure 5.23"),
        Quantity("between", "ends between 3 and 4: no other node is nearer", "yes", "5.2.1", percent=True),
        Quantity("off at 4", "most off from 1 to 4 in the first round, m", "quite reliable", "5.2.1"),
        Quantity("right to 4", "right nearest node by odometry, 1 to 4, first round", "-", "ours", percent=True),
        Quantity("right in all", "the same, all three rounds", "-", "ours", percent=True),
    ),
    draw=draw,
)
