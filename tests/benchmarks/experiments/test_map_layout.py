"""Maps from image distances alone (third seed, sections 3 and 5)."""

from __future__ import annotations

from collections import defaultdict
from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure
from scipy.spatial.distance import cdist

from benchmarks.experiments.experiment import Measured
from benchmarks.experiments.layouts import (
    AS_THEY_ARE,
    BATCH,
    CHAINED,
    CLASSICAL,
    INCREMENTAL,
    LENGTHS,
    SMACOF,
    STARTS,
    Walk,
    back_and_forth,
    classical_mds,
    made_by,
    smacof,
)
from benchmarks.experiments.map_layout import BLOCK, EXPERIMENT, NUMBERS, ORDERS, SPRINGS, block_of, ordered
from benchmarks.experiments.map_layout_steps import EXPERIMENT as STEPS_EXPERIMENT
from benchmarks.experiments.map_layout_steps import MARKS, STEPS, layouts_at, lines_between
from benchmarks.worlds.image_grid import GRIDS, Grid, points_of
from topoloc.geometry import Floats
from topoloc.mapping import shape_error


def walk_over(grid: Grid) -> Walk:
    order = back_and_forth(grid)
    return Walk([], points_of(grid)[order], np.column_stack(np.divmod(order, grid.columns)))


def apart(points: Floats) -> Floats:
    return np.asarray(cdist(points, points))


def test_every_step_of_a_walk_leads_to_a_neighbour() -> None:
    walk = walk_over(GRIDS["6x8"])
    assert sorted(back_and_forth(GRIDS["6x8"])) == list(range(48))
    np.testing.assert_allclose(np.linalg.norm(np.diff(walk.positions, axis=0), axis=1), 0.5)


@pytest.mark.parametrize("every", [1, 2, 3])
def test_blocks_of_one_number_and_another_step(every: int) -> None:
    walk = walk_over(GRIDS["35x10"])
    chosen = block_of(walk, every)
    assert len(chosen) == BLOCK[0] * BLOCK[1]
    steps = np.linalg.norm(np.diff(walk.positions[chosen], axis=0), axis=1)
    np.testing.assert_allclose(steps, 0.1 * every)  # back and forth among them


def test_orders_of_the_images() -> None:
    walk, rng = walk_over(GRIDS["6x8"]), np.random.default_rng(0)
    rows = walk.positions[ordered(walk.cells, "row by row", rng)]
    np.testing.assert_allclose(rows, points_of(GRIDS["6x8"]))
    np.testing.assert_array_equal(ordered(walk.cells, ORDERS[0], rng), np.arange(48))
    mixed = ordered(walk.cells, "at random", rng)
    assert sorted(mixed) == list(range(48)) and (mixed != np.arange(48)).any()


def test_floors_give_exact_distances_back() -> None:
    truth = np.random.default_rng(0).normal(size=(20, 2))
    assert shape_error(truth, classical_mds(apart(truth))) < 1e-12
    assert min(shape_error(truth, smacof(apart(truth), np.random.default_rng(n))) for n in range(3)) < 1e-3


@pytest.mark.parametrize("method", STARTS)
def test_every_method_takes_the_lengths_it_is_told(method: str) -> None:
    truth = walk_over(GRIDS["6x8"]).positions
    saturated = 1.0 - np.exp(-2.0 * apart(truth))
    plain, chains = (made_by(method, saturated, truth, config, 1000) for config in (AS_THEY_ARE, CHAINED))
    assert chains.error < 0.05 and chains.error < plain.error
    assert plain.seconds >= 0.0


def by_hand() -> Measured:
    """A value for every row in every column, as a seed has them but for the laws."""
    keys = {quantity.key for quantity in EXPERIMENT.quantities}
    keys |= {f"images {NUMBERS[-1]} {lengths}" for lengths in LENGTHS}  # in the table as 35x10
    keys |= {f"{key} s" for key in keys}
    values: dict[str, dict[str, Any]] = defaultdict(dict)
    for method in STARTS:
        values[method] = {key: 0.5 for key in keys if method in SPRINGS or not key.startswith("law")}
    return values


@pytest.mark.parametrize("seeds", [1, 2])
def test_six_panels_are_drawn(seeds: int) -> None:
    figure = Figure()
    EXPERIMENT.draw([by_hand()] * seeds, figure)
    assert [len(axes.containers) for axes in figure.axes] == [8, 4, 8, 8, 8, 8]


def test_steps_are_those_that_are_named() -> None:
    truth = walk_over(GRIDS["12x9"]).positions
    shown = {method: layouts_at(method, apart(truth), np.random.default_rng(0)) for method in STEPS}
    assert [len(positions) for positions in shown[INCREMENTAL]] == list(STEPS[INCREMENTAL])
    assert [len(positions) for positions in shown[BATCH]] == [108] * len(MARKS)
    assert shape_error(truth, shown[INCREMENTAL][-1]) < 1e-3
    assert shape_error(truth, shown[BATCH][0]) > 0.5


def test_lines_join_neighbours() -> None:
    walk = walk_over(GRIDS["12x9"])
    for count in (9, 27, 108):
        lines = lines_between(walk.cells[:count])
        rows = count // 9
        assert len(lines) == 8 * rows + 9 * (rows - 1)
        np.testing.assert_allclose(np.linalg.norm(np.diff(walk.positions[lines], axis=1), axis=2), 0.1)


@pytest.mark.slow
def test_the_sentences_of_the_seed() -> None:
    """Incremental beats batch, accurate maps are possible, and chains help every method wherever the room allows."""
    one = EXPERIMENT.measure(1000)
    for quantity in EXPERIMENT.quantities:
        assert any(quantity.key in one[method] for method in one), quantity.key
    assert one[INCREMENTAL]["gain image distances"] > 0.02
    assert one[INCREMENTAL]["best"] < 0.03
    for name in ("12x9", "11x6"):
        assert one[INCREMENTAL][f"{name} image distances"] < one[CLASSICAL][f"{name} image distances"]
    for name in ("10x15", "12x9", "11x6", "35x10"):
        for method in (INCREMENTAL, BATCH, CLASSICAL, SMACOF):
            plain, chains = (one[method][f"{name} {lengths}"] for lengths in LENGTHS)
            assert chains < plain
    assert 1.5 < one[BATCH]["growth"] < 3.0  # a power: not exponential


@pytest.mark.slow
def test_steps_on_the_way() -> None:
    one = STEPS_EXPERIMENT.measure(1000)
    assert one[BATCH]["first"] > 0.8 > one[BATCH]["last"]
    assert one[INCREMENTAL]["second"] < 0.3 and np.isnan(one[INCREMENTAL]["first"])
    figure = Figure()
    STEPS_EXPERIMENT.draw([one], figure)
    assert len(figure.axes) == 8
