"""5.2.4: ten rounds with people about (Tables 5.5 and 5.6)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.conditions import CONDITIONS
from benchmarks.experiments.experiment import AS_PUBLISHED, Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.tracking import Tracked, right_nodes, tracked
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.people import crowd
from benchmarks.worlds.world import Simulation
from topoloc.geometry import compose
from topoloc.metrics import Bools
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 10.0
PUBLISHED_UPDATES = 253
COUNTED = {"normal": 150, "virtual": 34, "supposed": 69, "errors": 3, "errors with": 2}
"""Tables 5.5 and 5.6."""
LABELS = ("normal\ndestinations", "virtual\ndestinations", "supposed\nplaces", "errors", "errors with\nsomeone in view")


def measure(seed: int) -> Measured:
    """Ten rounds, and who stood before the camera."""
    world = LabWorld(replace(CONDITIONS["people"], laps=LAPS))
    drive = world.simulate(seed)
    somebody = in_view(world, seed, drive)
    return {column: _row(tracked(drive, method), somebody, drive.topo_map) for column, method in METHODS.items()}


def in_view(world: LabWorld, seed: int, drive: Simulation) -> Bools:
    """(N,) whether somebody stands before the camera in each frame; who sits on a chair is none of them."""
    cameras = compose(drive.truth, np.stack([frame.camera for frame in drive.frames]))
    scene, chance = world.scene(seed, world.config.now()), generator(seed, Stream.PEOPLE)
    stand = crowd(world.config.people, cameras, scene, world.view_rad / 2.0, seed, chance)
    return np.array([len(people) > 0 for people in stand])


def _row(seen: Tracked, somebody: Bools, topo_map: TopoMap) -> dict[str, Any]:
    there, wrong = somebody[seen.frames], ~seen.right
    apart = np.linalg.norm(topo_map.positions[seen.said] - topo_map.positions[seen.nearest], axis=1)
    along = (seen.said - seen.nearest) % len(topo_map.nodes)
    mistaken = wrong & seen.destinations
    return {
        **seen.counts(),
        "there": float(there.sum()),
        "there share": float(there.mean()),
        "right there": float(seen.right[there].mean()),
        "supposed there": float(1.0 - seen.destinations[there].mean()),
        "errors with": float((wrong & there).sum()),
        "errors without": float((wrong & ~there).sum()),
        "not adjacent": float((wrong & ~np.isin(along, (1, len(topo_map.nodes) - 1))).sum()),
        "farthest": float(apart[wrong & (seen.said >= 0)].max(initial=0.0)),
        "among": float(right_among(seen, topo_map)[mistaken].mean()) if mistaken.any() else float("nan"),
        "match of errors": float(seen.match[mistaken].mean()) if mistaken.any() else float("nan"),
        "activity of errors": float(seen.activity[mistaken].mean()) if mistaken.any() else float("nan"),
        "list": [_error(seen, there, topo_map, int(update)) for update in np.flatnonzero(wrong)],
    }


def right_among(seen: Tracked, topo_map: TopoMap) -> Bools:
    """(U,) whether a right node is among the destinations of the update."""
    right = right_nodes(topo_map, seen.truth)
    return np.array([row[step.destinations.nodes].any() for row, step in zip(right, seen.steps, strict=True)])


def _error(seen: Tracked, there: Bools, topo_map: TopoMap, update: int) -> str:
    """As Table 5.6 lists it."""
    said, real = (
        topo_map.nodes[node].id if node >= 0 else "none" for node in (seen.said[update], seen.nearest[update])
    )
    known = "supposed"
    if seen.destinations[update]:
        known = f"match {seen.match[update]:.3f}, activity {seen.activity[update]:.3f}"
    return f"node {said} (real was {real}; {known}{'; someone in view' if there[update] else ''})"


def tell(measured: Sequence[Measured]) -> str:
    """Table 5.6 of the first seed."""
    return f"Table 5.6, first seed: {'; '.join(measured[0][AS_PUBLISHED]['list']) or 'no errors'}"


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Shares of the updates: Tables 5.5 and 5.6 as bars."""
    axes = figure.add_subplot()
    shares = [
        {column: {key: float(values[key]) / values["updates"] for key in COUNTED} for column, values in one.items()}
        for one in measured
    ]
    published = [count / PUBLISHED_UPDATES for count in COUNTED.values()]
    draw_bars(axes, shares, {label: key for key, label in zip(COUNTED, LABELS, strict=True)}, published=published)
    axes.set_ylabel("share of the updates")
    axes.legend(frameon=False)


EXPERIMENT = Experiment(
    name="people",
    title="Localization with people about",
    source="5.2.4, Tables 5.5 and 5.6",
    about=(
        "Ten rounds past the eight nodes, 28 to 34 cm off their centres, with panoramas of the same day. Someone "
        "stands before the camera or walks along in 35 % of the frames as the setting has it (people=0.35), 38 % on "
        "these seeds, in a tenth of the stays over the whole view, and others sit on chairs. A node is an error if it "
        "is more than 0.25 m farther from the robot than the nearest one; strictly, if it is not the very nearest. The "
        "authors judged by eye. Updates with people are those with someone standing in view; adjacent means next to it "
        "in the order of the path."
    ),
    measure=measure,
    quantities=(
        Quantity("updates", "update steps", "253", "Table 5.5", 0),
        Quantity("there", "involving people", "90", "Table 5.5", 0),
        Quantity("there share", "the same, share of updates", "about 35 %", "5.2.4", 2, percent=True),
        Quantity("destinations", "destinations", "184", "Table 5.5", 0),
        Quantity("normal", "normal destinations", "150", "Table 5.5", 0),
        Quantity("virtual", "virtual destinations", "34", "Table 5.5", 0),
        Quantity("supposed", "supposed places", "69", "Table 5.5", 0),
        Quantity("mean activity", "mean activity of destinations", "0.4986", "Table 5.5"),
        Quantity("mean match", "mean match of normal destinations", "0.6654", "Table 5.5"),
        Quantity("right there", "right with someone in view", "most", "5.2.4", percent=True),
        Quantity("supposed there", "supposed places with someone in view", "-", "ours", percent=True),
        Quantity("errors", "errors", "3", "Table 5.6", 0),
        Quantity("error rate", "errors, share of updates", "1.2 %", "Tables 5.5, 5.6", 3, percent=True),
        Quantity("strict error rate", "the same, very nearest node only", "-", "ours", 3, percent=True),
        Quantity("errors with", "errors with someone in view", "2", "Table 5.6", 0),
        Quantity("errors without", "errors without", "1", "Table 5.6", 0),
        Quantity("not adjacent", "errors not on an adjacent node of the path", "3", "5.2.4", 0),
        Quantity("farthest", "farthest error, node to node, m", "within 1.5", "5.2.4"),
        Quantity("match of errors", "mean match of wrong destinations", "0.679, 0.571, 0.600", "Table 5.6"),
        Quantity("activity of errors", "mean activity of wrong destinations", "0.331, 0.512, 0.517", "Table 5.6"),
        Quantity("among", "wrong destinations: the right node was one, too", "all", "5.2.4", percent=True),
    ),
    draw=draw,
    tell=tell,
)
