"""The heading off the nodes, and what is left of its error without parallax."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.heading_off_node import EXPERIMENT, summary, within
from benchmarks.experiments.methods import METHODS
from benchmarks.experiments.parallax import SCENE_M
from benchmarks.experiments.tracking import Tracked
from topoloc.topo_map import Camera, Node, TopoMap

MAP = TopoMap("two", Camera(), (Node("a", "", 0.0, 0.0), Node("b", "", 1.0, 0.0)))


def seen(error_deg: list[float], match: list[float], truth: list[tuple[float, float, float]]) -> Tracked:
    """Updates won by node a; what the summary does not read is nothing."""
    count = len(match)
    nothing: Any = None
    return Tracked(
        kind=np.array(["normal"] * count),
        said=np.zeros(count, dtype=np.int64),
        nearest=nothing,
        best=nothing,
        right=np.array([True] * (count - 1) + [False]),
        match=np.array(match),
        activity=nothing,
        heading_error=np.deg2rad(error_deg),
        heading=nothing,
        poses=np.zeros((count, 3)),
        truth=np.array(truth),
        frames=nothing,
        steps=(),
        evidence=(),
    )


def test_right_updates_are_counted_and_corrected_by_hand() -> None:
    offset = np.deg2rad(12.0) * SCENE_M
    drive = seen(
        [12.0, 0.0, 25.0, 170.0], [0.7, 0.7, 0.55, 0.9], [(0.0, offset, np.deg2rad(-12.0))] + [(0.0, 0.0, 0.0)] * 3
    )
    found = summary(drive, drive.truth, MAP)
    assert found["updates head"] == 2.0  # the last is not right, the third not sure enough
    assert found["updates match"] == 3.0
    assert found["within 10 head"] == 0.5
    assert found["within 20 match"] == pytest.approx(2.0 / 3.0)
    assert found["within 10 head true"] == 1.0
    assert found["within 10 head grid"] == 1.0
    assert found["within 10 head tracker"] == 0.5  # it takes the robot to be on the node
    assert found["median corrected"] == pytest.approx(0.0, abs=1e-6)
    assert found["scene"] == pytest.approx(SCENE_M)


def test_errors_wrap() -> None:
    assert within(np.deg2rad([355.0, 9.0, 11.0, -11.0]), 10.0) == 0.5


def test_it_is_drawn() -> None:
    own = {"points": [[-0.3, -0.2], [-5.0, -3.0], [0.0, 0.5]]}
    figure = Figure()
    EXPERIMENT.draw([{AS_PUBLISHED: own}], figure)
    assert figure.axes[0].get_ylabel() == "error of the heading [deg]"


@pytest.mark.slow
def test_the_goal_holds_off_the_node_and_after_correction() -> None:
    """Within 20 degrees in 97 % of right updates; within 10 after correction, of three seeds together."""
    measured = [EXPERIMENT.measure(seed) for seed in (10, 11, 12)]
    for column in METHODS:
        for one in measured:
            assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(one[column])
        assert np.mean([one[column]["within 20 head"] for one in measured]) >= 0.97
        assert np.mean([one[column]["within 10 head grid"] for one in measured]) >= 0.97
        assert np.mean([one[column]["median corrected"] for one in measured]) < 2.0
