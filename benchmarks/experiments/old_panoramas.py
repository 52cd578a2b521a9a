"""5.2.3: ten rounds of the laboratory with panoramas two days old (Tables 5.2 to 5.4, Figure 5.24)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.picture import OURS, PUBLISHED, THESIS
from benchmarks.experiments.tracking import Tracked, tracked
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from benchmarks.worlds.settings import WorldSettings
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 10.0
PUBLISHED_ERRORS = {"2": 1, "4": 1, "5": 1, "6": 6, "7": 3}
"""Table 5.4: how often each node was the wrong or omitted one, of 255 updates; node 4 was named on node 1."""


def measure(seed: int) -> Measured:
    """Ten rounds with old panoramas, and with fresh ones."""
    old = LabWorld(WorldSettings(laps=LAPS, age=1.0)).simulate(seed)
    fresh = LabWorld(WorldSettings(laps=LAPS)).simulate(seed)
    result = {}
    for column, method in METHODS.items():
        aged, new = tracked(old, method), tracked(fresh, method)
        result[column] = {
            **aged.counts(),
            "adjacent": float(_adjacent(aged, old.topo_map).sum()),
            "fresh match": new.counts()["mean match"],
            "fresh error rate": new.counts()["error rate"],
            "fresh strict error rate": new.counts()["strict error rate"],
            "missed": [int(((aged.nearest == node) & ~aged.right).sum()) for node in range(len(LAB_PLACES))],
            "tenth round": _last_round(aged, old.topo_map),
        }
    return result


def _adjacent(seen: Tracked, topo_map: TopoMap) -> np.ndarray:
    """(U,) whether a wrong node is next to the true one."""
    joined = [topo_map.adjacent(int(said), int(near)) for said, near in zip(seen.said, seen.nearest, strict=True)]
    return np.asarray(~seen.right & np.array(joined))


def _last_round(seen: Tracked, topo_map: TopoMap) -> list[tuple[str, float | None]]:
    """Node and activity of each update of the tenth round, as Table 5.2 lists them; None where merely supposed."""
    first = int(np.searchsorted(seen.frames, seen.frames[-1] * (LAPS - 1.0) / LAPS))
    return [
        (topo_map.nodes[said].id if said >= 0 else "-", None if np.isnan(activity) else float(activity))
        for said, activity in zip(seen.said[first:], seen.activity[first:], strict=True)
    ]


def tell(measured: Sequence[Measured]) -> str:
    """Table 5.2 of the first seed."""
    steps = measured[0][AS_PUBLISHED]["tenth round"]
    listed = ", ".join(node if activity is None else f"{node} ({activity:.2f})" for node, activity in steps)
    return f"Table 5.2, first seed: node (activity) at each update of the tenth round: {listed}"


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """How often each node was missed, of all errors: Table 5.4 as bars."""
    axes = figure.add_subplot()
    ids = [place.id for place in LAB_PLACES]
    published = np.array([PUBLISHED_ERRORS.get(name, 0) for name in ids])
    rows = [("published (Table 5.4)", published / published.sum(), PUBLISHED)]
    for (column, _), colour in zip(METHODS.items(), (THESIS, OURS), strict=True):
        missed = np.sum([one[column]["missed"] for one in measured], axis=0)
        rows.append((f"simulated, {column}", missed / max(missed.sum(), 1), colour))
    for number, (label, shares, colour) in enumerate(rows):
        axes.bar(np.arange(len(ids)) + 0.27 * (number - 1), shares, 0.25, label=label, color=colour)
    axes.set(xticks=np.arange(len(ids)), xticklabels=ids, xlabel="node", ylabel="share of the errors")
    axes.legend(frameon=False)


EXPERIMENT = Experiment(
    name="old-panoramas",
    title="Localization with panoramas two days old",
    source="5.2.3, Tables 5.2 to 5.4",
    about=(
        "Ten rounds past the eight nodes of the laboratory, 28 to 34 cm off their centres, with a map made two days "
        "before: furniture moved, another light. A node is an error if it is more than 0.25 m farther from the robot "
        "than the nearest one; strictly, if it is not the very nearest. The authors judged by eye."
    ),
    measure=measure,
    quantities=(
        Quantity("updates", "update steps", "255", "Table 5.3", 0),
        Quantity("destinations", "destinations", "193", "Table 5.3", 0),
        Quantity("normal", "normal destinations", "153", "Table 5.3", 0),
        Quantity("virtual", "virtual destinations", "40", "Table 5.3", 0),
        Quantity("supposed", "supposed places", "62", "Table 5.3", 0),
        Quantity("mean activity", "mean activity of destinations", "0.4633", "Table 5.3"),
        Quantity("mean match", "mean match of normal destinations", "0.6448", "Table 5.3"),
        Quantity("errors", "errors", "12", "Table 5.4", 0),
        Quantity("adjacent", "of these, on an adjacent node", "11", "Table 5.4", 0),
        Quantity("error rate", "errors, share of updates", "4.7 %", "Table 5.4", 3, percent=True),
        Quantity("strict error rate", "the same, very nearest node only", "-", "ours", 3, percent=True),
        Quantity("fresh match", "mean match with fresh panoramas", "0.73275", "5.2.3"),
        Quantity("fresh error rate", "errors with fresh panoramas", "0", "5.2.3", 3, percent=True),
        Quantity("fresh strict error rate", "the same, very nearest node only", "-", "ours", 3, percent=True),
    ),
    draw=draw,
    tell=tell,
)
