"""Counting updates as Tables 5.3, 5.5 and 5.9 do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from benchmarks.experiments.methods import THESIS
from benchmarks.experiments.tracking import Fitted, Tracked, right_nodes, tracked, tracked_frames
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings


def test_counts_by_hand(by_hand: Callable[..., Tracked]) -> None:
    seen = by_hand(
        ("normal", 0, 0, [(0, 0.8, False), (0, 0.5, True)]),
        ("normal", 1, 0, [(1, 0.6, False)]),
        ("virtual", 1, 1, [(1, 0.5, True)]),
        ("supposed", 1, 2, []),
    )
    counts = seen.counts()
    wanted = {"updates": 4, "destinations": 3, "normal": 2, "virtual": 1, "supposed": 1, "errors": 2}
    assert {key: counts[key] for key in wanted} == wanted
    assert counts["mean match"] == pytest.approx(0.7)
    assert counts["error rate"] == counts["strict error rate"] == 0.5


def test_a_node_is_right_up_to_a_quarter_of_a_metre_farther_than_the_nearest() -> None:
    layout = LabWorld().layout()
    right = right_nodes(layout, np.array([[0.4, 0.0, 0.0], [0.35, 0.0, 0.0], [0.0, 0.0, 1.0]]))
    assert [np.flatnonzero(row).tolist() for row in right] == [[0, 1], [0], [0]]


@pytest.mark.slow
def test_a_fitted_sensor_changes_nothing() -> None:
    drive = LabWorld(WorldSettings(updates=4)).simulate(10)
    fitted = Fitted(THESIS, drive.topo_map)
    once, again = tracked(drive), tracked_frames(drive.topo_map, drive.frames, drive.truth, THESIS, fitted)
    assert once.counts() == again.counts()
    np.testing.assert_array_equal(once.match, again.match)
    np.testing.assert_array_equal(once.poses, again.poses)
    assert np.abs(once.heading[1:] - once.truth[1:, 2]).max() < np.deg2rad(15.0)
    assert (once.right == right_nodes(drive.topo_map, once.truth)[np.arange(4), once.said]).all()
