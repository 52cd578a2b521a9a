"""5.2.9: from node to node at random."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import CONDITIONS, drives, tracked_drives
from benchmarks.experiments.experiment import Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.worlds.drive import Route

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 5.0
KEYS = ("error rate", "strict error rate", "normal", "virtual", "supposed", "mean match")
COUNTED = ("normal", "virtual", "supposed")


def measure(seed: int) -> Measured:
    """As many updates as in five rounds, under each condition."""
    driven = drives(seed, LAPS, Route(random=True))
    result = {}
    for column, by_name in tracked_drives(driven, METHODS).items():
        counts = {name: seen.counts() for name, seen in by_name.items()}
        result[column] = {
            f"{key} {name}": count[key] / (count["updates"] if key in COUNTED else 1.0)
            for name, count in counts.items()
            for key in KEYS
        }
    return result


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Errors under each condition."""
    axes = figure.add_subplot()
    draw_bars(axes, measured, {name: f"error rate {name}" for name in CONDITIONS})
    axes.set(xlabel="condition", ylabel="errors, share of the updates")
    axes.legend(frameon=False)


def _rows(name: str) -> tuple[Quantity, ...]:
    return (
        Quantity(f"error rate {name}", f"errors, share of updates, {name}", "kept track", "5.2.9", 3, percent=True),
        Quantity(
            f"strict error rate {name}", f"the same, very nearest node only, {name}", "-", "ours", 3, percent=True
        ),
        Quantity(f"normal {name}", f"normal destinations, share of updates, {name}", "-", "ours", percent=True),
        Quantity(f"virtual {name}", f"virtual destinations, share of updates, {name}", "-", "ours", percent=True),
        Quantity(f"supposed {name}", f"supposed places, share of updates, {name}", "-", "ours", percent=True),
        Quantity(f"mean match {name}", f"mean match of normal destinations, {name}", "-", "ours"),
    )


EXPERIMENT = Experiment(
    name="random-routes",
    title="Random routes in the laboratory",
    source="5.2.9",
    about=(
        "The robot goes from node to neighbouring node at random (route.random), turning back only where there is no "
        "other way; as many updates as in five rounds, fresh panoramas, two days old, and with people. The thesis "
        "gives no numbers: during random navigation the software kept track of the position. Its robot avoided "
        "obstacles by an omnidirectional sensor; this one knows its way. A node is an error if it is more than 0.25 m "
        "farther from the robot than the nearest one."
    ),
    measure=measure,
    quantities=tuple(row for name in CONDITIONS for row in _rows(name)),
    draw=draw,
)
