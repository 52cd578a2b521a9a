"""5.2.6: the virtual destination wins where no look is right (Table 5.8)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import CONDITIONS, drives, tracked_drives
from benchmarks.experiments.experiment import Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.printed_steps import TABLE_5_8
from benchmarks.experiments.rivals import rivals, share_of
from benchmarks.experiments.tracking import Tracked
from benchmarks.worlds.lab import LabWorld
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 5.0
PUBLISHED = {"fresh": "-", "old": "21 % (40 of 193)", "people": "18 % (34 of 184)"}
"""Tables 5.3 and 5.5."""


def measure(seed: int) -> Measured:
    """The printed step, and drives under each condition."""
    topo_map, result = LabWorld().layout(), {}
    for column, driven in tracked_drives(drives(seed, LAPS), METHODS).items():
        values = TABLE_5_8.measured(METHODS[column])
        for name, seen in driven.items():
            values |= {f"{key} {name}": value for key, value in _helped(seen, topo_map).items()}
        result[column] = values
    return result


def _helped(seen: Tracked, topo_map: TopoMap) -> dict[str, float]:
    virtual, misled = seen.kind == "virtual", rivals(seen, topo_map).misled
    return {
        "virtual": share_of(virtual, seen.destinations),
        "virtual right": share_of(seen.right, virtual),
        "misled": float(misled.mean()),
        "virtual there": share_of(virtual, misled),
        "right there": share_of(seen.right, misled),
    }


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """How often the virtual destination wins, and what becomes of updates whose looks are all wrong."""
    left, right = figure.subplots(1, 2)
    draw_bars(left, measured, {name: f"virtual right {name}" for name in CONDITIONS})
    left.set_title("the virtual destination wins", fontsize=9)
    left.set(xlabel="panoramas", ylabel="share that is right")
    draw_bars(right, measured, {name: f"right there {name}" for name in CONDITIONS})
    right.set_title("no normal destination is right", fontsize=9)
    right.set(xlabel="panoramas", ylabel="share named right")
    for axes in (left, right):
        axes.set_ylim(0.0, 1.0)
    figure.legend(*left.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False, fontsize=8)


def _rows(name: str) -> tuple[Quantity, ...]:
    table = {"fresh": "ours", "old": "Table 5.3", "people": "Table 5.5"}[name]
    return (
        Quantity(f"virtual {name}", f"virtual share of destinations, {name}", PUBLISHED[name], table, 2, True),
        Quantity(f"virtual right {name}", f"of these, right, {name}", "-", "ours", 2, True),
        Quantity(f"misled {name}", f"updates whose normal destinations are all wrong, {name}", "-", "ours", 3, True),
        Quantity(f"virtual there {name}", f"of these, the virtual one wins, {name}", "-", "ours", 2, True),
        Quantity(f"right there {name}", f"of these, named right, {name}", "-", "ours", 2, True),
    )


EXPERIMENT = Experiment(
    name="virtual-destination",
    title="Virtual destination",
    source="5.2.6, Table 5.8",
    about=(
        "First, the printed step from node 8 to node 1: the tracker starts from the printed origins and gets the "
        "printed match of node 2. Headings are not printed; with the rebuilt ones (10 degrees off for node 2, 6.25 for "
        "1v) the table comes out to the last digit, without any the wrong node would win. Then, in simulated drives of "
        "five rounds: how often the virtual destination wins and is right, and what the tracker names where every "
        "normal destination is wrong. Right is within 0.25 m."
    ),
    measure=measure,
    quantities=(
        Quantity("2", "Table 5.8: activity of 2, rebuilt headings", "0.441696", "Table 5.8", 6),
        Quantity("1v", "activity of 1v", "0.558304", "Table 5.8", 6),
        Quantity("won", "1v, which is right, wins", "yes", "Table 5.8", percent=True),
        Quantity("2 bare", "activity of 2, no headings", "0.441696", "Table 5.8", 4),
        Quantity("1v bare", "activity of 1v, no headings", "0.558304", "Table 5.8", 4),
        Quantity("won bare", "1v wins, no headings", "yes", "Table 5.8", percent=True),
        *(row for name in CONDITIONS for row in _rows(name)),
    ),
    draw=draw,
)
