"""5.1.2: panoramas from snapshots every 15 and every 30 degrees (Figures 5.9 and 5.10)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED, Experiment, Measured, Quantity
from benchmarks.experiments.photograph import node_matches, photograph
from benchmarks.experiments.turns import Turn, placement_errors, reconstructed, shown, turn_at
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LabWorld, lab_scene
from benchmarks.worlds.snapshots import Scan
from sensors.ima import IMA
from sensors.panorama import Panorama
from topoloc.geometry import Floats, compose, wrap
from topoloc.types import Image, Ints

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STEPS = {"15": Scan(snapshots=24), "30": Scan(snapshots=12)}
"""Of nominally so many degrees; the turn errs by 4 degrees a step in both, since the robot brakes as badly."""
METHODS = {AS_PUBLISHED: "thesis", IMPROVED: "circle"}
VIEWS = 12
"""Fresh views on each node."""
SHOWN = 2
"""Node 3, the centre, is shown."""


def measure(seed: int) -> Measured:
    """Panoramas of both steps at the eight nodes of the laboratory, and fresh views matched with them."""
    world = LabWorld()
    views = _fresh_views(world, seed)
    result: dict[str, dict[str, Any]] = {column: {"pictures": {}} for column in METHODS}
    for step, scan in STEPS.items():
        turns = [turn_at(world, place, seed, scan, 17) for place in range(len(world.places))]
        for column, method in METHODS.items():
            made = [reconstructed(method, {}, turn) for turn in turns]
            result[column] |= {f"{key} {step}": value for key, value in _counts(world, made, turns, views).items()}
            result[column]["pictures"][step] = shown(made[SHOWN].image)
    for own in result.values():
        own["match difference"] = own["match 15"] - own["match 30"]
    published = result[AS_PUBLISHED]  # ours fades its seams: there is no noise to divide by
    published["noise ratio"] = published["noise 15"] / published["noise 30"]
    return result


def _fresh_views(world: LabWorld, seed: int) -> list[list[tuple[float, Image]]]:
    """Heading [rad] and picture of the robot turning on each node."""
    rng, scene = generator(seed, Stream.MEASUREMENT, 17), lab_scene(seed)
    views = []
    for place in world.positions:
        headings = wrap(rng.uniform(-np.pi, np.pi) + np.arange(VIEWS) * 2.0 * np.pi / VIEWS)
        poses = [compose(np.array([*place, heading]), world.mount) for heading in headings]
        shake = world.config.turning_shake_px
        pictures = [photograph(scene, pose, world.config.effects, rng, shake) for pose in poses]
        views.append(list(zip(headings.tolist(), pictures, strict=True)))
    return views


def _counts(
    world: LabWorld, made: Sequence[Panorama], turns: Sequence[Turn], views: list[list[tuple[float, Image]]]
) -> dict[str, float]:
    """Noise of panoramas of all nodes, and how fresh views match them."""
    layout, width = world.layout(), world.camera.width
    # The first snapshot looks up the map, as all simulated panoramas do.
    nodes = [
        replace(node, heading=float(wrap(panorama.heading + np.pi / 2.0)), panorama=panorama.image)
        for node, panorama in zip(layout.nodes, made, strict=True)
    ]
    sensor = IMA()
    sensor.fit(replace(layout, nodes=tuple(nodes), filtered=True))
    rows = []
    for node, seen in enumerate(views):
        for heading, picture in seen:
            match, headings = node_matches(sensor, picture, world.mount)
            off = np.rad2deg(abs(float(wrap(headings[node] - heading))))
            rows.append((match[node], match.argmax() == node, off <= 10.0))
    match, right, near = np.array(rows, dtype=np.float64).T
    at_seams = [
        seam_gradient(panorama.image, seams(panorama.columns, width, panorama.image.shape[1])) for panorama in made
    ]
    seam, elsewhere, total = np.mean(at_seams, axis=0)
    errors = np.concatenate([placement_errors(panorama, turn) for panorama, turn in zip(made, turns, strict=True)])
    return {
        "seam": float(seam),
        "elsewhere": float(elsewhere),
        "noise": float(total),
        "match": float(match.mean()),
        "worst match": float(match.min()),
        "right": float(right.mean()),
        "near": float(near.mean()),
        "placed": float((errors <= 5.0).mean()),
    }


def seams(lefts: Ints, width: int, columns: int) -> Ints:
    """Columns (K,) that belong to another snapshot than their left neighbours, around the circle.

    Args:
        lefts: (S,) left columns of snapshots ``width`` columns wide, each pasted over those before it.
        width: of a snapshot, pixels.
        columns: of the circle.
    """
    owner = np.full(columns, -1)
    for number, left in enumerate(lefts):
        owner[(left + np.arange(width)) % columns] = number
    return np.flatnonzero(owner != np.roll(owner, 1))


def seam_gradient(image: Image, at: Ints) -> tuple[float, float, float]:
    """Mean absolute change of grey from a column to the one at its right: at seams, elsewhere, and in surplus.

    Args:
        image: (rows, columns) grey circle.
        at: columns whose left neighbour is across a seam.

    Returns:
        Grey levels at seams; elsewhere; and the surplus at the seams, spread over all columns of the circle.
    """
    levels: Floats = image.astype(np.float64)
    change = np.abs(levels - np.roll(levels, 1, axis=1)).mean(axis=0)
    is_seam = np.isin(np.arange(len(change)), at)
    seam, elsewhere = float(change[is_seam].mean()), float(change[~is_seam].mean())
    return seam, elsewhere, (seam - elsewhere) * float(is_seam.mean())


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figures 5.9 and 5.10: node 3, first seed, by both methods."""
    pictures = {
        f"{column}\n{step} degrees": picture
        for column in METHODS
        for step, picture in measured[0][column]["pictures"].items()
    }
    for axes, (name, picture) in zip(figure.subplots(len(pictures), 1, sharex=True), pictures.items(), strict=True):
        axes.imshow(np.array(picture), cmap="gray", vmin=0, vmax=255, aspect="auto", extent=(0.0, 360.0, 0.0, 1.0))
        axes.set_ylabel(name, rotation=0, ha="right", va="center", fontsize=8)
        axes.set(yticks=[], xticks=range(0, 361, 45))
    axes.set_xlabel("clockwise from the left edge of the first snapshot [deg]")


def _rows() -> tuple[Quantity, ...]:
    rows = []
    for step, published, where in (("15", "significant", "Figure 5.9"), ("30", "less", "Figure 5.10")):
        rows += [
            Quantity(f"seam {step}", f"{step} degrees: change of grey across a seam, levels", "-", "ours", 1),
            Quantity(f"elsewhere {step}", f"{step} degrees: the same elsewhere, levels", "-", "ours", 1),
            Quantity(
                f"noise {step}", f"{step} degrees: surplus of the seams over the circle, levels", published, where
            ),
            Quantity(f"match {step}", f"{step} degrees: mean match of fresh views", "-", "ours", 3),
            Quantity(f"worst match {step}", f"{step} degrees: worst match of a fresh view", "-", "ours"),
            Quantity(f"right {step}", f"{step} degrees: node matches best", "-", "ours", percent=True),
            Quantity(f"near {step}", f"{step} degrees: heading within 10 degrees", "-", "ours", percent=True),
            Quantity(f"placed {step}", f"{step} degrees: snapshots within 5 degrees", "-", "ours", percent=True),
        ]
    return tuple(rows)


EXPERIMENT = Experiment(
    name="panorama-step",
    title="Panoramas from snapshots: the step angle",
    source="5.1.2, Figures 5.9 and 5.10",
    about=(
        "At the eight nodes of the laboratory, turns with a snapshot every 15 and every 30 degrees, put together by "
        "the thesis's method with 15 slots and CLAHE, and by ours, which fades neighbours into each other. The noise "
        "that the thesis saw, vertical lines where snapshots were inserted, is measured as the change of grey across "
        "a seam above that elsewhere, times the share of columns that are seams; for ours, seams are where they would "
        "be. IMA then matches twelve fresh views a node with the panoramas. Right is more noise and a lower match with "
        "15 degrees."
    ),
    measure=measure,
    quantities=(
        *_rows(),
        Quantity("noise ratio", "noise with 15 degrees over that with 30", "above 1", "5.1.2"),
        Quantity("match difference", "match with 15 degrees above that with 30", "below 0", "5.1.2", 3),
    ),
    draw=draw,
)
