"""Third seed, sections 3 and 5: maps laid out by springs from image distances alone, beside MDS and SMACOF."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any, get_args

import numpy as np

from benchmarks.experiments.experiment import NOT_IN_THE_SEED, THIRD_SEED, Experiment, Measured, Quantity
from benchmarks.experiments.layouts import (
    AS_THEY_ARE,
    BATCH,
    CLASSICAL,
    INCREMENTAL,
    LENGTHS,
    SMACOF,
    STARTS,
    Walk,
    made_by,
    walked,
)
from benchmarks.experiments.picture import OTHER, OURS, PUBLISHED, THESIS
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.image_grid import GRIDS, GridName
from sensors.fourier import FourierSignature, FourierSignatureConfig
from topoloc.geometry import Floats
from topoloc.types import Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

METHODS = tuple(STARTS)
SPRINGS = (INCREMENTAL, BATCH)
COLOURS: Mapping[str, str] = {INCREMENTAL: OURS, BATCH: THESIS, CLASSICAL: PUBLISHED, SMACOF: OTHER}
SMALL: tuple[GridName, ...] = ("12x9", "11x6")
"""Grids that laws and orders are compared on: elsewhere the room looks alike on both sides of its middle, and no law
and no order mends that."""
NAMES: tuple[GridName, ...] = get_args(GridName)
LARGEST: GridName = "35x10"
NUMBERS = (50, 100, 200, 350)
"""Images of the largest grid, its first rows: the step stays."""
STEPS_M, BLOCK = (0.1, 0.2, 0.3), (12, 3)
"""Steps between 12 x 3 images of the largest grid: every one, every second, every third; their number stays."""
COMPONENTS = (2, 4, 8, 16, 32, 64)
COMPONENTS_ON: GridName = "12x9"
LAWS: Mapping[str, dict[str, Any]] = {
    "constant": {"stiffness": "constant"},
    "1/d": {"stiffness": "inverse"},
    "1/d²": {"stiffness": "inverse-square"},
    "linear": {"stiffness": "linear", "reach": 2.0},
    "exponential": {"stiffness": "exponential", "reach": 1.0},
}
"""Reaches chosen on seeds 1000 to 1002, among 1, 1.5, 2, 3 and 0.2, 0.3, 0.5, 1 median distances."""
ORDERS = ("back and forth", "row by row", "at random")

Values = dict[str, dict[str, Any]]
"""By method and key."""


def measure(seed: int) -> Measured:
    """All grids, and cuts through number, step, components, law and order of the images."""
    values: Values = {method: {} for method in METHODS}
    walks = {name: walked(name, seed) for name in NAMES}
    eye = FourierSignature()
    distances = {name: eye.distances_between(walk.images) for name, walk in walks.items()}
    for name, walk in walks.items():
        _compare(values, name, distances[name], walk.positions, seed)
    _numbers(values, distances[LARGEST], walks[LARGEST], seed)
    for step_m in STEPS_M:
        chosen = block_of(walks[LARGEST], round(step_m / GRIDS[LARGEST].spacing_m))
        apart = distances[LARGEST][np.ix_(chosen, chosen)]
        _compare(values, f"step {step_m}", apart, walks[LARGEST].positions[chosen], seed)
    _components(values, walks[COMPONENTS_ON], seed)
    _laws_and_orders(values, {name: (distances[name], walks[name]) for name in SMALL}, seed)
    _claims(values)
    return values


def _compare(values: Values, key: str, distances: Floats, truth: Floats, seed: int) -> None:
    """Every method on image distances and along chains: ``KEY LENGTHS`` is mu, ``KEY LENGTHS s`` the time."""
    for lengths, config in LENGTHS.items():
        for method in METHODS:
            made = made_by(method, distances, truth, config, seed)
            values[method] |= {f"{key} {lengths}": made.error, f"{key} {lengths} s": made.seconds}


def _numbers(values: Values, distances: Floats, walk: Walk, seed: int) -> None:
    """The first images of the largest grid; all of them were laid out before."""
    for number in NUMBERS[:-1]:
        _compare(values, f"images {number}", distances[:number, :number], walk.positions[:number], seed)
    for method in METHODS:
        whole = {key: value for key, value in values[method].items() if key.startswith(f"{LARGEST} ")}
        values[method] |= {key.replace(LARGEST, f"images {NUMBERS[-1]}", 1): value for key, value in whole.items()}


def block_of(walk: Walk, every: int) -> Ints:
    """Which images (``BLOCK`` in all) lie on every second, third, ... row and column, back and forth among them."""
    rows, columns = (every * np.arange(size) for size in BLOCK)
    taken = np.flatnonzero(np.isin(walk.cells[:, 0], rows) & np.isin(walk.cells[:, 1], columns))
    row, column = walk.cells[taken].T // every
    return np.asarray(taken[np.lexsort((np.where(row % 2, -column, column), row))])


def _components(values: Values, walk: Walk, seed: int) -> None:
    """Signatures of other lengths: mu, and the time of all that was done, from pictures to layout."""
    for number in COMPONENTS:
        begun = time.process_time()
        eye = FourierSignature(FourierSignatureConfig(components=number))
        distances = eye.distances_between(walk.images)
        seconds = time.process_time() - begun
        _compare(values, f"components {number}", distances, walk.positions, seed)
        for method in METHODS:
            values[method][f"components {number} all s"] = seconds + values[method][f"components {number} chains s"]


def _laws_and_orders(values: Values, grids: Mapping[GridName, tuple[Floats, Walk]], seed: int) -> None:
    """Mean over the small grids of mu by the law of the springs, and by the order in which images come."""
    for law, lengths, method in product(LAWS, LENGTHS, SPRINGS):
        config = replace(LENGTHS[lengths], **LAWS[law])
        errors = [made_by(method, apart, walk.positions, config, seed).error for apart, walk in grids.values()]
        values[method][f"law {law} {lengths}"] = float(np.mean(errors))
    rng = generator(seed, Stream.MEASUREMENT, 31)
    for order in ORDERS:
        errors = []
        for apart, walk in grids.values():
            turn = ordered(walk.cells, order, rng)
            mixed = apart[np.ix_(turn, turn)]
            errors.append(made_by(INCREMENTAL, mixed, walk.positions[turn], AS_THEY_ARE, seed).error)
        values[INCREMENTAL][f"order {order} image distances"] = float(np.mean(errors))


def ordered(cells: Ints, order: str, rng: np.random.Generator) -> Ints:
    """Places (N,) in a walk over cells (N, 2), back and forth, that bring it into one of the ``ORDERS``."""
    if order == "at random":
        return np.asarray(rng.permutation(len(cells)))
    return np.lexsort((cells[:, 1], cells[:, 0])) if order == "row by row" else np.arange(len(cells))


def _claims(values: Values) -> None:
    """What the seed's sentences come to: mu of the batch method less that of the incremental one, and the growth."""
    for lengths in LENGTHS:
        keys = [f"{name} {lengths}" for name in NAMES]
        gain = np.array([values[BATCH][key] - values[INCREMENTAL][key] for key in keys])
        values[INCREMENTAL] |= {f"gain {lengths}": float(gain.mean()), f"better {lengths}": float(np.mean(gain > 0.0))}
    for method in METHODS:
        seconds = [max(values[method][f"images {number} image distances s"], 1e-6) for number in NUMBERS]
        values[method]["growth"] = float(np.polyfit(np.log(NUMBERS), np.log(seconds), 1)[0])
        values[method]["best"] = min(values[method][f"{name} {lengths}"] for name in NAMES for lengths in LENGTHS)


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Mu by grid, law, components, step and number of images, and the time by their number."""
    panels = figure.subplots(2, 3).ravel()
    _draw_means(panels[0], measured, {name: name for name in NAMES}, "grid")
    _draw_means(panels[1], measured, {law: f"law {law}" for law in LAWS}, "stiffness, 12x9 and 11x6")
    for axes, values, name, label in (
        (panels[2], COMPONENTS, "components", f"Fourier components, {COMPONENTS_ON}"),
        (panels[3], STEPS_M, "step", "step of 12 x 3 images [m]"),
        (panels[4], NUMBERS, "images", f"images of {LARGEST}"),
    ):
        _draw_means(axes, measured, {str(value): f"{name} {value}" for value in values}, label)
    numbers = {str(number): f"images {number}" for number in NUMBERS}
    _draw_means(panels[5], measured, numbers, f"images of {LARGEST}", " s")
    panels[5].set(yscale="log")
    panels[5].set_ylabel("time [s]", fontsize=7)
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=6, frameon=False
    )


def _draw_means(
    axes: Axes, measured: Sequence[Measured], keys: Mapping[str, str], label: str, ending: str = ""
) -> None:
    """Means with standard deviations, by label on the axis: hollow on image distances, full along chains."""
    for method, lengths in product(METHODS, LENGTHS):
        names = [f"{key} {lengths}{ending}" for key in keys.values()]
        if not set(names) <= set(measured[0][method]):
            continue  # laws are the springs' own
        found = np.array([[one[method][name] for name in names] for one in measured], dtype=float)
        whole = lengths != "image distances"
        axes.errorbar(
            list(keys),
            found.mean(axis=0),
            found.std(axis=0, ddof=1) if len(found) > 1 else None,
            color=COLOURS[method],
            marker="o",
            markersize=3,
            markerfacecolor=COLOURS[method] if whole else "white",
            linewidth=0.9,
            linestyle="-" if whole else ":",
            label=f"{method}, {lengths}",
        )
    axes.tick_params(labelsize=6)
    axes.set_xlabel(label, fontsize=7)
    axes.set_ylabel("Procrustes mu", fontsize=7)


def _rows(lengths: str) -> tuple[Quantity, ...]:
    """Mu on one kind of lengths."""
    known, lost, fine = NOT_IN_THE_SEED, "5; curves lost", lengths == "chains"
    return (
        *(Quantity(f"{name} {lengths}", f"{name}, {lengths}", known, lost, 3) for name in NAMES),
        *(Quantity(f"images {n} {lengths}", f"{n} images, {lengths}", known, lost, 3) for n in NUMBERS[:-1]),
        *(
            Quantity(f"step {m} {lengths}", f"12 x 3 images, step {m} m, {lengths}", known, lost, 3, detail=fine)
            for m in STEPS_M
        ),
        *(
            Quantity(f"components {n} {lengths}", f"{n} components, {lengths}", known, lost, 3, detail=fine)
            for n in COMPONENTS
        ),
        *(Quantity(f"law {law} {lengths}", f"stiffness {law}, {lengths}", known, lost, 3, detail=fine) for law in LAWS),
    )


EXPERIMENT = Experiment(
    name="map-layout",
    title="Maps from image distances alone",
    source="sections 3 and 5",
    about=(
        "The third seed's six image grids, simulated, driven row by row, back and forth; distances of Fourier "
        f"signatures ({FourierSignatureConfig().components} components, homomorphic filter); springs of constant "
        "stiffness, all images at once from random places (batch, mean of three) or one by one (incremental), beside "
        "classical MDS and scikit-learn's SMACOF (mean of three). Quality is Procrustes mu: 0 is the shape of the "
        "grid, 1 nothing of it. Image distances are the seed's way. Chains are ours: distances summed along chains of "
        "images, each joined with its 3 nearest. Laws and orders: mean of 12x9 and 11x6; components: 12x9. Times are "
        "of one core, layout alone unless said. The seed's curves did not survive, its sentences did. Incremental "
        "beats batch on image distances, where a random start may leave a fold, but hardly on strips of 12 x 3, where "
        "classical MDS is better; it takes longer in all, since all springs move after every image. Along chains both "
        "come to nearly the same. More components cost hardly more time here. Grids 10x15, 6x8 and 5x10 fill most of "
        "their room. What the moduli tell apart there is mainly how far from the middle an image was taken, since a "
        "room turned or mirrored hardly changes them: on image distances every method folds such a map. The two ends "
        "of the hall of 5x10 look alike, and nothing unfolds that."
    ),
    measure=measure,
    quantities=(
        Quantity("gain image distances", "mu of batch less incremental, mean of six grids", "clearly positive", "6", 3),
        Quantity("better image distances", "grids on which incremental is better", "-", "ours", 2, True),
        Quantity("gain chains", "mu of batch less incremental, chains", "-", "ours", 3),
        Quantity("best", "least mu of any grid", "accurate when tuned", "6", 3),
        Quantity("growth", "time grows with this power of the number of images", "exponentially", "3.1", 1),
        *(row for lengths in LENGTHS for row in _rows(lengths)),
        *(Quantity(f"order {order} image distances", f"images {order}", "-", "ours", 3) for order in ORDERS),
        *(
            Quantity(f"images {n} {lengths} s", f"time, s: {n} images, {lengths}", NOT_IN_THE_SEED, "5; curves lost")
            for lengths in LENGTHS
            for n in NUMBERS
        ),
        *(
            Quantity(f"components {n} all s", f"time, s: {n} components, pictures to layout", "a compromise", "6")
            for n in COMPONENTS
        ),
    ),
    draw=draw,
    document=THIRD_SEED,
)
