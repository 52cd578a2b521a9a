"""Figures 3 and 4 of the second seed, done again."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.active_vision import (
    BY_ENTROPY,
    EXPERIMENT,
    IN_TURN,
    LOOKS,
    POSITIONS,
    hidden_poses,
    hypotheses,
    measure,
)
from benchmarks.experiments.selections import ByLot, InTurn
from benchmarks.worlds.office import CLEAR_M, OfficeSettings, OfficeWorld, clearance
from topoloc.active import Action
from topoloc.topo_map import TopoMap
from topoloc.types import WeightedPoses


def test_groups_of_particles_are_told_apart() -> None:
    rng = np.random.default_rng(0)
    one = rng.normal(0.0, 0.2, (70, 2))
    assert hypotheses(one) == 1
    assert hypotheses(np.concatenate([one, one + np.array([5.0, 0.0]), one + np.array([0.0, 4.0])])) == 3
    assert hypotheses(np.concatenate([one, [[9.0, 9.0]]])) == 1, "a stray particle is no hypothesis"


def test_hidden_positions_are_no_training_points() -> None:
    world = OfficeWorld(OfficeSettings())
    layout: TopoMap = world.layout()
    for seed in range(1000, 1010):
        poses = hidden_poses(layout, seed)
        assert poses.shape == (POSITIONS, 3)
        assert (layout.distance_to_nearest(poses[:, :2]) >= 0.15).all()
        assert (clearance(OfficeWorld.plan, poses[:, :2]) >= CLEAR_M).all()


def test_by_lot_takes_all_and_in_turn_the_first() -> None:
    belief = WeightedPoses.uniform(np.zeros((1, 3)))
    actions = [Action(np.zeros(3), np.array([0.0, 0.0, 0.1 * k])) for k in range(4)]
    by_lot = ByLot(np.random.default_rng(1))
    assert {by_lot.choose(belief, actions) for _ in range(100)} == {0, 1, 2, 3}
    assert InTurn().choose(belief, actions) == 0


@pytest.mark.slow
def test_the_error_falls_as_the_camera_turns() -> None:
    """Two calibration seeds; the choice by entropy beside small turns, where things have moved."""
    measured = [measure(seed) for seed in (1000, 1001)]

    def mean(way: str, key: str) -> float:
        return float(np.mean([one[way][key] for one in measured]))

    for condition in ("as mapped", "two days old"):
        assert mean(BY_ENTROPY, f"error 3 {condition}") < 0.6 * mean(BY_ENTROPY, f"error 0 {condition}")
    assert mean(BY_ENTROPY, "near 3 as mapped") > 0.9
    assert mean(BY_ENTROPY, "hypotheses 3 as mapped") < mean(BY_ENTROPY, "hypotheses 0 as mapped")
    assert mean(BY_ENTROPY, "error 3 two days old") < mean(IN_TURN, "error 3 two days old")
    for one in measured:
        assert len(one[BY_ENTROPY]["errors as mapped"]) == LOOKS
        assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(one[BY_ENTROPY])
    EXPERIMENT.draw(measured, Figure())
