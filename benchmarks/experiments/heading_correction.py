"""5.2.7: turned by hand and blind for a round, then one look at node 1, and blind again (Figures 5.28 and 5.29)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.picture import OTHER, THESIS
from benchmarks.experiments.plan import draw_nodes
from benchmarks.experiments.tracking import Tracked, tracked_frames
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from benchmarks.worlds.settings import WorldSettings
from topoloc.geometry import wrap
from topoloc.metrics import Bools
from topoloc.types import Ints

if TYPE_CHECKING:
    from matplotlib.figure import Figure

BEFORE, AFTER = ("1", "6", "7", "8", "1", "2", "1"), ("1", "2", "3", "4", "5", "6", "7", "8", "1")
"""Published: the nodes named blind, repetitions left out, before and after the look."""
NODE_1 = 0
TURNED_AT = 1
TURNED_DEG = -90.0
LAPS = 2.4
"""Two rounds, and the rest of the last visit to node 1."""


def measure(seed: int) -> Measured:
    """Two rounds that are blind but for the visits to node 1."""
    settings = WorldSettings(laps=LAPS, turned_at=TURNED_AT, turned_deg=TURNED_DEG)
    world = LabWorld(settings)
    _, truth = world.drive(seed)
    again, end = second_visit(world.layout().nearest_node(truth[:, :2]))
    seeing = np.zeros(len(truth), dtype=bool)
    seeing[:TURNED_AT] = seeing[again] = True
    covered = tuple(np.flatnonzero(~seeing).tolist())
    drive = LabWorld(replace(settings, covered=covered)).simulate(seed)
    return {
        column: _row(tracked_frames(drive.topo_map, drive.frames[:end], truth[:end], method), seeing)
        for column, method in METHODS.items()
    }


def second_visit(nearest: Ints) -> tuple[slice, int]:
    """Frames of the second visit to node 1 by the nearest nodes (N,) of a drive, and where the third visit ends."""
    here = np.concatenate([[False], nearest == NODE_1, [False]]).astype(int)
    starts, ends = np.flatnonzero(np.diff(here) == 1), np.flatnonzero(np.diff(here) == -1)
    return slice(int(starts[1]), int(ends[1])), int(ends[2])


def _row(seen: Tracked, seeing: Bools) -> dict[str, Any]:
    looks = np.flatnonzero(seeing[seen.frames])  # updates that saw; the first is the start
    first, last = looks[looks > 0][0], looks[-1]
    blind, corrected = slice(0, first), slice(last, len(seen.said))
    before, after = _named(seen.said[blind]), _named(seen.said[corrected])
    off = np.rad2deg(np.abs(wrap(seen.heading - seen.truth[:, 2])))
    return {
        "looks": float(len(looks) - 1),
        "at 1": float(seen.said[last] == NODE_1),
        "prefix before": float(common_prefix(before, BEFORE)),
        "prefix after": float(common_prefix(after, AFTER)),
        "right before": float(seen.right[1:first].mean()),
        "right after": float(seen.right[last + 1 :].mean()),
        "off before": float(off[first - 1]),
        "off after": float(off[last]),
        "off at the end": float(off[-1]),
        "before": before,
        "after": after,
        "path before": seen.poses[blind, :2].round(3).tolist(),
        "path after": seen.poses[corrected, :2].round(3).tolist(),
        "truth": seen.truth[corrected, :2].round(3).tolist(),
    }


def _named(said: Ints) -> list[str]:
    """Ids of the nodes named, repetitions left out."""
    return [LAB_PLACES[node].id if node >= 0 else "-" for node, _ in groupby(said.tolist())]


def common_prefix(one: Sequence[str], other: Sequence[str]) -> int:
    """How many nodes two sequences have in common from the start."""
    same = [a == b for a, b in zip(one, other, strict=False)]
    return [*same, False].index(False)


def tell(measured: Sequence[Measured]) -> str:
    """The sequences of the first seed."""
    first = measured[0][AS_PUBLISHED]
    return f"first seed, before: {', '.join(first['before'])}; after: {', '.join(first['after'])}"


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """The first seed's path by the odometer, before and after the look, over the nodes."""
    first = measured[0][AS_PUBLISHED]
    for axes, key, title in zip(
        figure.subplots(1, 2, sharex=True, sharey=True),
        ("path before", "path after"),
        ("turned by -90° (Figure 5.28)", "after looks at node 1 (Figure 5.29)"),
        strict=True,
    ):
        axes.plot(*np.array(first["truth"]).T, color=OTHER, ls="--", lw=1.2, label="real path")
        axes.plot(*np.array(first[key]).T, color=THESIS, lw=1.8, label="by the odometer")
        draw_nodes(axes, LAB_PLACES)
        axes.set_title(title, fontsize=9)
        axes.legend(frameon=False, fontsize=8, loc="lower center", ncols=2)
        axes.margins(0.15)


EXPERIMENT = Experiment(
    name="heading-correction",
    title="Heading angle correction",
    source="5.2.7, Figures 5.28 and 5.29",
    about=(
        "The robot is localized on node 1, its camera is covered, and it is turned by -90 degrees by hand, which the "
        "odometer does not notice (turned_at=1); it turns back by itself and drives the usual round, which the "
        "odometer therefore sees turned. On its second visit to node 1 it looks; then it is covered for another "
        "round. Counted are the nodes named, repetitions left out, from the start on in common with the published "
        "sequences. A round blind is long for the simulated odometer, which turns some 25 degrees off in it: drift "
        "decides the ends."
    ),
    measure=measure,
    quantities=(
        Quantity("prefix before", "blind: nodes in common with 1 6 7 8 1 2 1", "7", "5.2.7", 1),
        Quantity("right before", "blind: updates that are right", "completely wrong", "5.2.7", percent=True),
        Quantity("off before", "blind: heading off before the look, degrees", "-", "Figure 5.28", 0),
        Quantity("looks", "updates that see, at node 1", "a couple", "5.2.7", 1),
        Quantity("at 1", "node 1 is named then", "yes", "5.2.7", percent=True),
        Quantity("off after", "heading off after the look, degrees", "-", "Figure 5.29", 1),
        Quantity("prefix after", "blind again: nodes in common with 1 2 3 4 5 6 7 8 1", "9", "5.2.7", 1),
        Quantity("right after", "blind again: updates that are right", "-", "ours", percent=True),
        Quantity("off at the end", "heading off after that round, degrees", "-", "ours", 0),
    ),
    draw=draw,
    tell=tell,
)
