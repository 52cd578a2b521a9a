"""5.2.9: what the digital zoom is worth to the localization."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import drives, tracked_drives
from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED, Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS, Method
from benchmarks.experiments.passes import identified
from benchmarks.experiments.picture import OTHER, OURS, THESIS
from benchmarks.experiments.tracking import Tracked

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 5.0
SEEN_UNDER = ("fresh", "old")
WITHOUT = "without zoom"


def _without_zoom(method: Method) -> Method:
    return replace(method, sensor=replace(method.sensor, zoom=1.0))


COMPARED: Mapping[str, Method] = {
    AS_PUBLISHED: METHODS[AS_PUBLISHED],
    WITHOUT: _without_zoom(METHODS[AS_PUBLISHED]),
    IMPROVED: METHODS[IMPROVED],
    f"{IMPROVED}, {WITHOUT}": _without_zoom(METHODS[IMPROVED]),
}
"""By column of the table."""


def measure(seed: int) -> Measured:
    """Five rounds with fresh and with old panoramas, by each method with and without zoom."""
    driven = {name: drive for name, drive in drives(seed, LAPS).items() if name in SEEN_UNDER}
    return {
        column: {f"{key} {name}": value for name, seen in by_name.items() for key, value in _row(seen).items()}
        for column, by_name in tracked_drives(driven, COMPARED).items()
    }


def _row(seen: Tracked) -> dict[str, float]:
    counts = seen.counts()
    best = np.array([looked.match.max(initial=0.0) for looked in seen.evidence])
    return {
        "identified": identified(seen),
        "normal": counts["normal"] / counts["updates"],
        "supposed": counts["supposed"] / counts["updates"],
        "best match": float(best.mean()),
        "alone": float((seen.best == seen.nearest).mean()),
        "error rate": counts["error rate"],
        "strict error rate": counts["strict error rate"],
    }


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Nodes identified, and errors, with the zoom and without."""
    colours = {AS_PUBLISHED: THESIS, WITHOUT: OTHER, IMPROVED: OURS}
    for axes, key, label in zip(
        figure.subplots(1, 2),
        ("identified", "error rate"),
        ("share of the passes identified", "errors, share of the updates"),
        strict=True,
    ):
        draw_bars(axes, measured, {name: f"{key} {name}" for name in SEEN_UNDER}, colours)
        axes.set(xlabel="panoramas", ylabel=label)
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, frameon=False, fontsize=8)


def _rows(name: str) -> tuple[Quantity, ...]:
    most = "with most, without not most"
    return (
        Quantity(f"identified {name}", f"passes of a node that identify it, {name}", most, "5.2.9", percent=True),
        Quantity(f"normal {name}", f"normal destinations, share of updates, {name}", "-", "ours", percent=True),
        Quantity(f"supposed {name}", f"supposed places, share of updates, {name}", "-", "ours", percent=True),
        Quantity(f"best match {name}", f"mean best match of an image, {name}", "-", "ours"),
        Quantity(f"alone {name}", f"images alone right, strictly, {name}", "-", "ours", percent=True),
        Quantity(f"error rate {name}", f"errors, share of updates, {name}", "-", "ours", 3, percent=True),
        Quantity(
            f"strict error rate {name}", f"the same, very nearest node only, {name}", "-", "ours", 3, percent=True
        ),
    )


EXPERIMENT = Experiment(
    name="no-zoom",
    title="Localization without the digital zoom",
    source="5.2.9",
    about=(
        "Five rounds, 28 to 34 cm off the nodes, with the zoom of 1.1 and without. The thesis gives no numbers: "
        "without zoom the system would not have identified most of the nodes, at least those that the robot did not "
        "pass through exactly. A pass identifies its node if a normal destination there wins at least once while it "
        "is the nearest."
    ),
    measure=measure,
    quantities=tuple(row for name in SEEN_UNDER for row in _rows(name)),
    draw=draw,
)
