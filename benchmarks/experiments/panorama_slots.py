"""5.1.2: panoramas from snapshots with 4, 8 and 15 slots, without and with CLAHE (Figures 5.5 to 5.8)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED, Experiment, Measured, Quantity
from benchmarks.experiments.turns import Turn, placement_errors, reconstructed, shown, turn_at
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from benchmarks.worlds.lab_corridor import LabCorridorWorld
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.snapshots import Scan
from topoloc.geometry import Floats

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PLACED_DEG = 5.0
"""A snapshot is placed right when it is at most this far off, an eighth of a view."""
THESIS_SETTINGS: Mapping[str, Mapping[str, Any]] = {
    "4 slots": {"slots": 4, "clahe": False},
    "8 slots": {"slots": 8, "clahe": False},
    "15 slots": {"slots": 15, "clahe": False},
    "8 slots, CLAHE": {"slots": 8, "clahe": True},
    "15 slots, CLAHE": {"slots": 15, "clahe": True},
}
CIRCLE = "circle"
"""Our method has no slots, and looks at gradients, to which CLAHE does nothing."""
SHOWN = 2
"""Node 3, the centre, is shown."""
SAID = {
    "4 slots": ("failed", "Figure 5.5"),
    "8 slots": ("better, errors", "Figure 5.6"),
    "15 slots": ("not sufficient", "Figure 5.7"),
    "8 slots, CLAHE": ("correct", "Figure 5.8"),
    "15 slots, CLAHE": ("safer", "5.1.3"),
}


def measure(seed: int) -> Measured:
    """The turns at all 15 nodes, put together in all ways."""
    world = LabCorridorWorld()
    turns = [turn_at(world, place, seed, Scan(), 16) for place in range(len(world.places))]
    published: dict[str, Any] = {"pictures": {}}
    for name, settings in THESIS_SETTINGS.items():
        errors, picture = _put_together("thesis", settings, turns)
        published |= counts(name, errors)
        published["pictures"][name] = picture
    errors, picture = _put_together(CIRCLE, {}, turns)
    ours: dict[str, Any] = counts(CIRCLE, errors) | {"pictures": {CIRCLE: picture}}
    on_axis = LabWorld(WorldSettings(camera_ahead_m=0.0))
    turns = [turn_at(on_axis, place, seed, Scan(), 16) for place in range(len(on_axis.places))]
    for own, method in ((published, "thesis"), (ours, CIRCLE)):
        errors, _ = _put_together(method, {}, turns)
        own |= {"on axis: lab": _share(errors), "on axis: worst": float(errors.max())}
    return {AS_PUBLISHED: published, IMPROVED: ours}


def _put_together(method: str, settings: Mapping[str, Any], turns: Sequence[Turn]) -> tuple[Floats, list[list[int]]]:
    made = [reconstructed(method, settings, turn) for turn in turns]
    errors = [placement_errors(panorama, turn) for panorama, turn in zip(made, turns, strict=True)]
    return np.array(errors), shown(made[SHOWN].image)


def counts(name: str, errors: Floats) -> dict[str, float]:
    """What errors (nodes, snapshots) [degrees] come to: in the laboratory, and at nodes 9 to 15 beyond."""
    lab, beyond = errors[: len(LAB_PLACES)], errors[len(LAB_PLACES) :]
    return {
        f"{name}: lab": _share(lab),
        f"{name}: whole": float((lab <= PLACED_DEG).all(axis=1).mean()),
        f"{name}: worst": float(lab.max()),
        f"{name}: beyond": _share(beyond),
    }


def _share(errors: Floats) -> float:
    """Of the snapshots that are placed right."""
    return float((errors <= PLACED_DEG).mean())


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figures 5.5 to 5.8 and two more: node 3, first seed."""
    pictures = measured[0][AS_PUBLISHED]["pictures"] | measured[0][IMPROVED]["pictures"]
    for axes, (name, picture) in zip(figure.subplots(len(pictures), 1, sharex=True), pictures.items(), strict=True):
        axes.imshow(np.array(picture), cmap="gray", vmin=0, vmax=255, aspect="auto", extent=(0.0, 360.0, 0.0, 1.0))
        axes.set_ylabel(name.replace(", ", "\n"), rotation=0, ha="right", va="center", fontsize=8)
        axes.set(yticks=[], xticks=range(0, 361, 45))
    axes.set_xlabel("clockwise from the left edge of the first snapshot [deg]")


def _rows(name: str, published: str, where: str) -> tuple[Quantity, ...]:
    said = f"{name}: snapshots within {PLACED_DEG:g} degrees"
    return (
        Quantity(f"{name}: lab", f"{said}, laboratory", published, where, percent=True),
        Quantity(f"{name}: whole", f"{name}: panoramas with all snapshots so", "-", "ours", percent=True),
        Quantity(f"{name}: worst", f"{name}: worst placement, degrees", "-", "ours", 0),
        Quantity(f"{name}: beyond", f"{said}, nodes 9 to 15", "-", "ours", percent=True),
    )


EXPERIMENT = Experiment(
    name="panorama-slots",
    title="Panoramas from snapshots: slots and CLAHE",
    source="5.1.2, Figures 5.5 to 5.8",
    about=(
        "A turn of twelve snapshots, 30 degrees apart but for 4 degrees of standard deviation, at the eight nodes of "
        "the laboratory and at the seven of its way out, entry and corridor, put together by the thesis's method with "
        "its settings for Figures 5.5 to 5.8 and with its later choice of 15 slots and CLAHE; and by our method, which "
        "closes the circle and has no slots. A snapshot is placed right within 5 degrees; the first stands for itself. "
        "The thesis judged by eye, one panorama each; it says that 30 degrees served for all, the corridor's included. "
        "The camera stands 10 cm ahead of the axis on which the robot turns, so that near scenes shift by more or less "
        "than the robot has turned: pictures that fit each other well are then up to 10 degrees off the robot's "
        "heading. The last rows have the camera on the axis."
    ),
    measure=measure,
    quantities=(
        *(row for name, said in SAID.items() for row in _rows(name, *said)),
        *_rows(CIRCLE, "-", "ours"),
        Quantity(
            "on axis: lab", "camera on the axis, both methods by default: within 5 degrees", "-", "ours", percent=True
        ),
        Quantity("on axis: worst", "the same: worst placement, degrees", "-", "ours", 0),
    ),
    draw=draw,
)
