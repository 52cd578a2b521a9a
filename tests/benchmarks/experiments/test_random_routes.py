"""Random routes (thesis 5.2.9)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments import random_routes
from benchmarks.experiments.conditions import CONDITIONS, drives
from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from benchmarks.experiments.random_routes import EXPERIMENT
from benchmarks.worlds.drive import Route


def test_conditions_share_map_and_way() -> None:
    """But not the tour's: a random route leaves it."""
    driven = drives(10, 1.0, Route(random=True))
    assert set(driven) == set(CONDITIONS)
    for drive in driven.values():
        assert drive.topo_map is driven["fresh"].topo_map
        np.testing.assert_array_equal(drive.truth, driven["fresh"].truth)
    topo_map = driven["fresh"].topo_map
    on = np.diff(topo_map.nearest_node(driven["fresh"].truth[:, :2])) % len(topo_map.nodes)
    assert set(on.tolist()) - {0, 1}


def test_draws() -> None:
    row = {quantity.key: 0.5 for quantity in EXPERIMENT.quantities}
    figure = Figure()
    EXPERIMENT.draw([{AS_PUBLISHED: row, IMPROVED: row}], figure)
    assert len(figure.axes[0].patches) == 6


@pytest.mark.slow
def test_it_keeps_track(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rounds of three seeds: a node named wrongly at less than a quarter of the updates, fresh less than old."""
    monkeypatch.setattr(random_routes, "LAPS", 2.0)
    ours = [EXPERIMENT.measure(seed)[AS_PUBLISHED] for seed in (10, 11, 12)]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours[0])
    errors = {name: np.mean([one[f"error rate {name}"] for one in ours]) for name in CONDITIONS}
    assert max(errors.values()) < 0.25
    assert errors["fresh"] < errors["old"]
