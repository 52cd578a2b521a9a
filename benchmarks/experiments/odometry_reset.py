"""5.2.3, 6.1: the odometry reset to the node's centre, and to where match and odometry agree (ours)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import CONDITIONS, drives, tracked_drives
from benchmarks.experiments.experiment import Experiment, Measured, Quantity
from benchmarks.experiments.incremental_zoom import COLUMNS as COMPARED
from benchmarks.experiments.incremental_zoom import SCENE_M
from benchmarks.experiments.methods import OURS, THESIS, Method
from benchmarks.experiments.picture import OTHER
from benchmarks.experiments.picture import OURS as OURS_COLOUR
from benchmarks.experiments.picture import THESIS as THESIS_COLOUR
from benchmarks.experiments.tracking import Tracked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 3.0
OUR_MODEL = replace(
    OURS.tracker,
    reset="node",
    match_threshold=THESIS.tracker.match_threshold,
    head_threshold=THESIS.tracker.head_threshold,
)
"""Our action model with the thesis's thresholds, which are made for its matching, and its reset."""
KEPT = replace(OUR_MODEL, reset="offset")
COLUMNS: Mapping[str, Method] = {
    "thesis": THESIS,
    "our action model": Method(THESIS.sensor, OUR_MODEL),
    "offset kept": Method(THESIS.sensor, KEPT),
    "zoom told": Method(replace(THESIS.sensor, scene_m=SCENE_M), KEPT),
    "incremental zoom": Method(COMPARED["incremental zoom"].sensor, KEPT),
    "ima-robust, its thresholds": OURS,
}
"""From the thesis's tracker to ours, each with all that the ones before it have."""


def measure(seed: int) -> Measured:
    """Three rounds under each condition, by each tracker."""
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
    shades = (THESIS_COLOUR, "#56B4E9", OTHER, "#F0E442", "#CC79A7", OURS_COLOUR)
    colours = dict(zip(COLUMNS, shades, strict=True))
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
        "The author found most errors to come from the reset of the odometry to the node's centre at each "
        "destination, and asked for a better one, perhaps one that tells matches with zoom from those without. Three "
        "rounds, 28 to 34 cm off the nodes. Each column has what the one before it has: the thesis's tracker; fixed "
        "sigmas with an outlier floor, and the match to its third power; offsets kept; the hypothesis placed by which "
        "of the thesis's three zooms won, the author's idea; by incremental zoom; and the robust matching with its own "
        "thresholds, which is the improved method of the other tables. Published errors stand for the thesis's "
        "tracker. A node is an error if it is more than 0.25 m farther from the robot than the nearest one."
    ),
    measure=measure,
    quantities=tuple(row for name in CONDITIONS for row in _rows(name)),
    draw=draw,
)
