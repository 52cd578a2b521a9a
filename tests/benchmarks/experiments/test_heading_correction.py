"""Turned by hand, blind, one look, blind again (thesis 5.2.7)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.heading_correction import AFTER, BEFORE, EXPERIMENT, _named, common_prefix, second_visit


@pytest.mark.parametrize(
    ("named", "common"), [(BEFORE, 7), (("1", "6", "7", "8", "1"), 5), (("1", "2"), 1), ((), 0), ((*BEFORE, "3"), 7)]
)
def test_common_prefix(named: tuple[str, ...], common: int) -> None:
    assert common_prefix(named, BEFORE) == common


def test_repetitions_are_left_out() -> None:
    assert _named(np.array([-1, 0, 0, 5, 5, 0])) == ["-", "1", "6", "1"]


def test_visits_to_node_1() -> None:
    visit, end = second_visit(np.array([0, 0, 1, 2, 0, 0, 0, 3, 0, 1]))
    assert (visit, end) == (slice(4, 7), 9)


def test_draws_and_tells() -> None:
    path = [[0.0, 0.0], [1.0, 0.0]]
    row = {"truth": path, "path before": path, "path after": path, "before": ["1", "6"], "after": ["1", "2"]}
    figure = Figure()
    EXPERIMENT.draw([{AS_PUBLISHED: row}], figure)
    assert [len(axes.lines) for axes in figure.axes] == [3, 3]
    assert EXPERIMENT.tell is not None
    assert EXPERIMENT.tell([{AS_PUBLISHED: row}]) == "first seed, before: 1, 6; after: 1, 2"


@pytest.mark.slow
def test_the_claims_of_the_thesis_on_one_seed() -> None:
    """The first nodes as published, before drift decides; looks at node 1 bring the heading back to 10 degrees."""
    ours = EXPERIMENT.measure(10)[AS_PUBLISHED]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours)
    assert ours["before"][:4] == list(BEFORE[:4])
    assert ours["after"][:5] == list(AFTER[:5])
    assert ours["at 1"] == 1.0 and 1.0 <= ours["looks"] <= 4.0
    assert ours["off before"] > 45.0 and ours["off after"] < 10.0
    assert ours["right after"] > ours["right before"] + 0.3
