"""5.2.3, 6.1: the odometry reset to the node's centre, and to where match and odometry agree (ours)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import CONDITIONS, drives, tracked_drives
from benchmarks.experiments.experiment import Experiment, Measured, Quantity
from benchmarks.experiments.methods import OURS, THESIS, Method
from benchmarks.experiments.picture import OTHER
from benchmarks.experiments.picture import OURS as OURS_COLOUR
from benchmarks.experiments.picture import THESIS as THESIS_COLOUR
from benchmarks.experiments.tracking import Tracked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 5.0
COLUMNS: Mapping[str, Method] = {
    "thesis, to the node": THESIS,
    "fixed sigmas, to the node": Method(THESIS.sensor, replace(OURS.tracker, reset="node")),
    "fixed sigmas, offset kept": Method(THESIS.sensor, OURS.tracker),
    "the same, incremental zoom": Method(OURS.sensor, OURS.tracker),
}
"""From the thesis's tracker to ours, one change at a time but for the action model, which is one."""


def measure(seed: int) -> Measured:
    """Five rounds under each condition, by each tracker."""
    seen = tracked_drives(drives(seed, LAPS), COLUMNS)
    return {
        column: {f"{key} {name}": value for name, one in by_name.items() for key, value in _row(one).items()}
        for column, by_name in seen.items()
    }


def _row(seen: Tracked) -> dict[str, float]:
    count = int(seen.nearest.max()) + 1
    lags = ~seen.right & (seen.said == (seen.nearest - 1) % count)  # nodes are numbered along the tour
    off = np.linalg.norm(seen.poses[:, :2] - seen.truth[:, :2], axis=1)
    return {
        "error rate": float(np.mean(~seen.right)),
        "lag rate": float(np.mean(lags)),
        "off": float(np.median(off)),
    }


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Errors by condition."""
    axes = figure.add_subplot()
    colours = dict(zip(COLUMNS, (THESIS_COLOUR, "#56B4E9", OTHER, OURS_COLOUR), strict=True))
    draw_bars(axes, measured, {name: f"error rate {name}" for name in CONDITIONS}, colours)
    axes.set(ylabel="errors, share of the updates")
    axes.legend(frameon=False, fontsize=8)


PUBLISHED = {"fresh": "0", "old": "4.7 %", "people": "1.2 %"}


def _rows(name: str) -> tuple[Quantity, ...]:
    return (
        Quantity(
            f"error rate {name}", f"errors, share of updates, {name}", PUBLISHED[name], "5.2.3, 5.2.4", 3, percent=True
        ),
        Quantity(f"lag rate {name}", f"of the updates, one node behind, {name}", "-", "5.2.3", 3, percent=True),
        Quantity(f"off {name}", f"estimate off the truth, median, {name} [m]", "-", "ours"),
    )


EXPERIMENT = Experiment(
    name="odometry-reset",
    title="Where the odometry is reset to",
    source="5.2.3, 6.1",
    about=(
        "The author found most errors to come from the reset of the odometry to the node's centre at each destination, "
        "and asked for a better one. Five rounds, 28 to 34 cm off the nodes. Published errors stand for the thesis's "
        "tracker. A node is an error if it is more than 0.25 m farther from the robot than the nearest one."
    ),
    measure=measure,
    quantities=tuple(row for name in CONDITIONS for row in _rows(name)),
    draw=draw,
)
