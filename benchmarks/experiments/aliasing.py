"""5.2.5: two places that look alike, and the tracker between them (Table 5.7)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import CONDITIONS, drives, tracked_drives
from benchmarks.experiments.experiment import Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.printed_steps import TABLE_5_7
from benchmarks.experiments.rivals import rivals, share_of
from benchmarks.experiments.tracking import Tracked
from benchmarks.worlds.lab import LabWorld
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 5.0


def measure(seed: int) -> Measured:
    """The printed step, and drives under each condition."""
    topo_map, result = LabWorld().layout(), {}
    for column, driven in tracked_drives(drives(seed, LAPS), METHODS).items():
        values = TABLE_5_7.measured(METHODS[column])
        for name, seen in driven.items():
            values |= {f"{key} {name}": value for key, value in _resolved(seen, topo_map).items()}
        result[column] = values
    return result


def _resolved(seen: Tracked, topo_map: TopoMap) -> dict[str, float]:
    aliased = rivals(seen, topo_map).aliased
    return {"aliased": float(aliased.mean()), "resolved": share_of(seen.right, aliased)}


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """How often a wrong node matches better, and how often the tracker names the right one all the same."""
    left, right = figure.subplots(1, 2)
    draw_bars(left, measured, {name: f"aliased {name}" for name in CONDITIONS})
    left.set_title("a wrong node matches better than the right one", fontsize=9)
    left.set(xlabel="panoramas", ylabel="share of the updates")
    draw_bars(right, measured, {name: f"resolved {name}" for name in CONDITIONS})
    right.set_title("the tracker names the right one", fontsize=9)
    right.set(xlabel="panoramas", ylabel="share of these")
    right.set_ylim(0.0, 1.0)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=8)


EXPERIMENT = Experiment(
    name="aliasing",
    title="Perceptual aliasing",
    source="5.2.5, Table 5.7",
    about=(
        "First, the printed step: the tracker starts from the printed origins and gets the printed matches. Headings "
        "are not printed; with the rebuilt ones (deviations of 9.2, 10 and 9.5 degrees) the table comes out to the "
        "last digit, without any the order is the same. The other columns do the same step with other settings. Then, "
        "in simulated drives of five rounds: how often a wrong node and the right one are both destinations and the "
        "wrong one matches better, and how often the tracker names the right one. Right is within 0.25 m."
    ),
    measure=measure,
    quantities=(
        Quantity("1", "Table 5.7: activity of 1, rebuilt headings", "0.418523", "Table 5.7", 6),
        Quantity("2", "activity of 2, which matches best", "0.249694", "Table 5.7", 6),
        Quantity("1v", "activity of 1v", "0.331782", "Table 5.7", 6),
        Quantity("won", "the right node wins", "yes", "Table 5.7", percent=True),
        Quantity("1 bare", "activity of 1, no headings", "0.418523", "Table 5.7", 5),
        Quantity("2 bare", "activity of 2, no headings", "0.249694", "Table 5.7", 5),
        Quantity("1v bare", "activity of 1v, no headings", "0.331782", "Table 5.7", 5),
        Quantity("won bare", "the right node wins, no headings", "yes", "Table 5.7", percent=True),
        *(
            row
            for name in CONDITIONS
            for row in (
                Quantity(f"aliased {name}", f"a wrong node matches better, {name}", "quite often", "5.2.5", 3, True),
                Quantity(f"resolved {name}", f"of these, the tracker is right, {name}", "resolved", "5.2.5", 2, True),
            )
        ),
    ),
    draw=draw,
)
