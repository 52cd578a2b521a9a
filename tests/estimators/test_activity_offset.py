"""The tracker's reset to the place off the node that match and odometry agree on, beside the thesis's (3.7, 5.2.3)."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators.activity import ActivityTracker, ActivityTrackerConfig, Hypotheses
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

SIGMA, PLACE_VARIANCE = 0.2, 0.09


def corridor() -> TopoMap:
    """Four nodes, a metre apart along x."""
    return TopoMap("corridor", Camera(), tuple(Node(str(n), str(n), float(n), 0.0) for n in range(4)))


def seen(node: int, match: float, place: tuple[float, float], heading_deg: float = 0.0) -> Evidence:
    pose = np.array([[*place, np.deg2rad(heading_deg)]])
    return Evidence(
        pose, np.array([node]), np.array([match]), np.array([1 - match]), np.array([2.0]), np.array([SIGMA]), np.ones(1)
    )


def drive(metres: float, variance: float = 0.0) -> Motion:
    return Motion(np.array([metres, 0.0, 0.0]), np.diag([variance, variance, 0.0]))


def tracker(**settings: Any) -> ActivityTracker:
    """Known to stand on node 0, heading along x."""
    chosen: dict[str, Any] = {"deviation": "fixed", "outlier_floor": 0.0, "reset": "offset", **settings}
    config = ActivityTrackerConfig(**chosen)
    made = ActivityTracker(config)
    made.reset(corridor(), np.random.default_rng(0))
    one = Hypotheses(np.array([0]), np.zeros(1), np.full(1, np.nan), np.ones(1), np.zeros(1, dtype=bool))
    made.restore(one, 0, 0.0)
    return made


def of_winner(made: ActivityTracker) -> tuple[float, float]:
    """Where the winner stands along x [m], and its variance [m^2]."""
    step = made.last
    assert step is not None and step.winner is not None
    x = step.destinations.nodes[step.winner] + step.destinations.offsets[step.winner, 0]
    return float(x), float(step.destinations.variances[step.winner])


def test_authors_case_of_error() -> None:
    """5.2.3: node 0 is seen again half-way, then nothing good until node 1; the reset to 0 loses half a metre."""
    answers = {}
    for reset in ("node", "offset"):
        made = tracker(reset=reset)
        made.predict(drive(0.45))
        made.update(seen(0, 0.7, (0.0, 0.0)))
        made.predict(drive(0.45))
        made.update(Evidence.blind())
        assert made.last is not None
        answers[reset] = made.last.node
    assert answers == {"node": 0, "offset": 1}


@given(
    moved=st.floats(-0.6, 0.6),
    measured=st.floats(-0.6, 0.6),
    drift=st.floats(0.0, 0.1),
)
def test_is_a_kalman_update(moved: float, measured: float, drift: float) -> None:
    """One origin, one destination, no floor: the textbook's scalar filter along x."""
    made = tracker()
    made.predict(drive(moved, drift))
    made.update(seen(0, 0.9, (measured, 0.0)))
    before = PLACE_VARIANCE + drift
    gain = before / (before + SIGMA**2)
    step = made.last
    assert step is not None
    matched = step.destinations  # the first of them; the virtual one is the last
    assert matched.offsets[0, 0] == pytest.approx(moved + gain * (measured - moved), abs=1e-9)
    assert matched.variances[0] == pytest.approx((1.0 - gain) * before, abs=1e-9)


def test_second_look_is_surer_than_the_first() -> None:
    made = tracker()
    made.update(seen(0, 0.9, (0.1, 0.0)))
    first = of_winner(made)[1]
    made.update(seen(0, 0.9, (0.1, 0.0)))
    assert of_winner(made)[1] < first


@given(floor=st.floats(0.0, 0.9), far=st.floats(0.0, 3.0))
def test_stands_between_where_it_was_matched_and_where_the_odometry_led(floor: float, far: float) -> None:
    made = tracker(outlier_floor=floor)
    made.predict(drive(0.3))
    made.update(seen(3, 0.9, (3.0 - far, 0.0)))
    step = made.last
    assert step is not None
    x = 3.0 + float(step.destinations.offsets[0, 0])
    assert min(0.3, 3.0 - far) - 1e-9 <= x <= max(0.3, 3.0 - far) + 1e-9
    assert 0.0 < step.destinations.variances[0] <= SIGMA**2 + 1e-12


def test_carried_robot_stands_where_it_is_matched() -> None:
    """Too far to have driven there: only the floor explains the move, and the odometry has no say."""
    made = tracker(outlier_floor=0.1)
    made.update(seen(3, 0.9, (2.9, 0.0)))
    step = made.last
    assert step is not None
    np.testing.assert_allclose(step.destinations.offsets[0], [-0.1, 0.0], atol=2e-2)


def test_virtual_destination_stays_where_the_odometry_led() -> None:
    made = tracker()
    made.predict(drive(0.7, 0.02))
    made.update(seen(3, 0.51, (3.0, 0.0)))  # too far to win
    step = made.last
    assert step is not None and step.kind == "virtual"
    x, variance = of_winner(made)
    assert step.node == 1
    assert x == pytest.approx(0.7)
    assert variance == pytest.approx(PLACE_VARIANCE + 0.02)


def test_names_the_node_nearest_to_where_the_winner_stands() -> None:
    made = tracker(sigma_m=1.0)
    made.predict(drive(0.7))
    made.update(seen(0, 0.9, (0.7, 0.0)))  # node 0's panorama, zoomed: 0.7 m ahead of it
    assert made.last is not None
    assert made.last.node == 1


@pytest.mark.parametrize(("left_m", "turned_deg"), [(0.3, 5.0), (-0.3, -5.0), (0.0, 0.0)])
def test_heading_is_freed_from_parallax(left_m: float, turned_deg: float) -> None:
    """To the left of the node, what is seen lies as if the robot had turned counter-clockwise."""
    scene = 0.3 / np.deg2rad(5.0)
    made = tracker(parallax_m=scene)
    made.update(seen(0, 0.9, (0.0, left_m), turned_deg))
    step = made.last
    assert step is not None
    left = float(step.destinations.offsets[0] @ [-np.sin(np.deg2rad(turned_deg)), np.cos(np.deg2rad(turned_deg))])
    expected = np.deg2rad(turned_deg) - left / scene
    assert step.destinations.headings[0] == pytest.approx(expected)
    assert made.heading == pytest.approx(expected)


def test_published_reset_keeps_no_offset() -> None:
    made = tracker(reset="node")
    made.predict(drive(0.4))
    made.update(seen(0, 0.9, (0.4, 0.0)))
    assert made.last is not None
    assert not made.last.destinations.offsets.any()
    assert made.belief.poses[0, 0] == 0.0


@pytest.mark.parametrize("settings", [{"reset": "centre"}, {"parallax_m": -1.0}, {"parallax_m": np.inf}])
def test_bad_settings(settings: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(settings))):
        ActivityTrackerConfig(**settings)


class TestHeadingAtTheStart:
    def test_the_first_heading_is_taken_however_poor(self) -> None:
        """A match too poor to correct a heading is better than one made up."""
        made = ActivityTracker(ActivityTrackerConfig(match_threshold=0.3, deviation="fixed", reset="offset"))
        made.reset(corridor(), np.random.default_rng(0))
        made.update(seen(1, 0.45, (1.0, 0.0), 90.0))
        made.predict(drive(0.6))
        np.testing.assert_allclose(made.belief.poses[0, :2], [1.0, 0.6], atol=0.05)

    def test_without_any_heading_no_direction_is_made_up(self) -> None:
        made = ActivityTracker(ActivityTrackerConfig(match_threshold=0.3, deviation="fixed", reset="offset"))
        made.reset(corridor(), np.random.default_rng(0))
        one = np.ones(1)
        look = Evidence(np.array([[1.0, 0.0, 0.0]]), np.array([1]), 0.7 * one, 0.3 * one, one, SIGMA * one, 0.0 * one)
        made.update(look)
        before = made.belief.spread[0]
        made.predict(drive(0.6))
        np.testing.assert_allclose(made.belief.poses[:, :2], np.tile([1.0, 0.0], (4, 1)), atol=0.05)
        assert made.belief.spread[0] == pytest.approx(before + 0.6**2 / 2.0)

    def test_a_heading_once_known_is_not_corrected_by_a_poor_match(self) -> None:
        made = tracker(match_threshold=0.3)
        made.update(seen(0, 0.45, (0.0, 0.0), 90.0))
        assert made.heading == 0.0


def test_a_prior_keeps_its_place_and_spread() -> None:
    made = ActivityTracker(ActivityTrackerConfig(deviation="fixed", reset="offset"))
    prior = WeightedPoses.uniform([[0.3, 0.0, 0.0], [0.5, 0.0, 0.0]], spread=(0.01, 0.03, 0.0))
    made.reset(corridor(), np.random.default_rng(0), prior)
    made.predict(drive(0.4))
    made.update(Evidence.blind())
    assert made.last is not None
    assert made.last.node == 1  # 0.4 + 0.4 m
    np.testing.assert_allclose(made.belief.poses, [[0.8, 0.0, 0.0]])
    assert made.belief.spread[0] == pytest.approx(0.01 / 2.0 + 0.02)
