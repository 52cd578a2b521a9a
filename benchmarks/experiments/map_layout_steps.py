"""Third seed, section 5: steps on the way to a map, by the batch and by the incremental method."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.experiment import NOT_IN_THE_SEED, THIRD_SEED, Experiment, Measured, Quantity
from benchmarks.experiments.layouts import AS_THEY_ARE, BATCH, INCREMENTAL, walked
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.image_grid import GRIDS, GridName, neighbours_of
from sensors.fourier import FourierSignature
from topoloc.geometry import Floats
from topoloc.mapping import METHODS, onto, shape_error
from topoloc.mapping.picture import draw_images
from topoloc.types import Ints

if TYPE_CHECKING:
    from matplotlib.figure import Figure

GRID: GridName = "12x9"
STEPS: Mapping[str, tuple[int, ...]] = {BATCH: (0, 5, 20, 80), INCREMENTAL: (9, 27, 54, 108)}
"""Iterations of the batch method, whose last picture is at rest, however many that took; images of the incremental."""
MARKS = ("first", "second", "third", "last")


def measure(seed: int) -> Measured:
    """Positions at four steps of each method, put onto the truth, and how far they are from it."""
    walk = walked(GRID, seed)
    distances = FourierSignature().distances_between(walk.images)
    result: dict[str, dict[str, Any]] = {}
    for method in STEPS:
        shown = layouts_at(method, distances, generator(seed, Stream.MEASUREMENT, 32))
        values: dict[str, Any] = {"cells": walk.cells.tolist()}
        for mark, positions in zip(MARKS, shown, strict=True):
            truth = walk.positions[: len(positions)]
            values[mark] = shape_error(truth, positions) if np.linalg.matrix_rank(truth - truth[0]) == 2 else np.nan
            values[f"{mark} layout"] = onto(truth, positions).apply(positions).round(4).tolist()
        result[method] = values
    return result


def layouts_at(method: str, distances: Floats, rng: np.random.Generator) -> list[Floats]:
    """Positions (M, 2) at the ``STEPS`` of a method; the last are those at rest."""
    steps = list(METHODS[method](distances, AS_THEY_ARE, rng))
    first = 0 if method == BATCH else 1  # iterations count from 0, images from 1
    chosen = [steps[min(number - first, len(steps) - 1)] for number in STEPS[method][:-1]]
    return [step.positions for step in (*chosen, steps[-1])]


def lines_between(cells: Ints) -> Ints:
    """Pairs (E, 2) of images on neighbouring cells (N, 2) of the whole grid."""
    grid = GRIDS[GRID]
    place = {int(number): rank for rank, number in enumerate(cells[:, 0] * grid.columns + cells[:, 1])}
    pairs = [(place[a], place[b]) for a, b in neighbours_of(grid).tolist() if a in place and b in place]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """The seed's two figures of intermediate steps, of the first seed: batch above, incremental below."""
    panels = figure.subplots(len(STEPS), len(MARKS))
    for (row, method), (column, mark) in product(enumerate(STEPS), enumerate(MARKS)):
        axes, values = panels[row, column], measured[0][method]
        positions = np.array(values[f"{mark} layout"])
        draw_images(axes, positions, lines_between(np.array(values["cells"])[: len(positions)]), numbered=False)
        number = STEPS[method][column]
        what = f"{number} iterations" if method == BATCH else f"{number} images"
        axes.set_title(f"{method}: {'at rest' if method == BATCH and mark == MARKS[-1] else what}", fontsize=7)
        axes.set(xticks=[], yticks=[])


def _rows() -> tuple[Quantity, ...]:
    whens = [f"after {number} iterations" for number in STEPS[BATCH][:-1]] + ["at rest"]
    return tuple(
        Quantity(mark, f"mu {when}; with {images} images", NOT_IN_THE_SEED, "5; pictures lost", 3)
        for mark, when, images in zip(MARKS, whens, STEPS[INCREMENTAL], strict=True)
    )


EXPERIMENT = Experiment(
    name="map-layout-steps",
    title="Steps on the way to a map",
    source="sections 3 and 5",
    about=(
        f"The grid {GRID}, simulated, and image distances as in map-layout. Batch: random places, then after so many "
        "iterations. Incremental: with so many images, nine a row; the first row alone is a line, which has no mu. The "
        "picture is of the first seed, each step put onto the truth; dark points are early images, lines join "
        "neighbours of the grid."
    ),
    measure=measure,
    quantities=_rows(),
    draw=draw,
    document=THIRD_SEED,
)
