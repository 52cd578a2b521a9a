"""The activity tracker: Tables 5.7 and 5.8 of the thesis, and what Code 3.1 with 4.1.5 says case by case."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from estimators.activity import (
    ActivityTracker,
    ActivityTrackerConfig,
    Hypotheses,
    action_model,
    fixed_action_model,
)
from topoloc.geometry import rotate
from topoloc.testing import check_estimator
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

LAB = {"1": (0, 0), "2": (1, 0), "3": (1, 1), "4": (1, 2), "5": (0, 2), "6": (0, 1), "7": (-1, 1), "8": (-1, 0)}
"""Figure 5.22 on its 1 m grid."""
NAN = float("nan")


def lab() -> TopoMap:
    return TopoMap("lab", Camera(), tuple(Node(name, name, float(x), float(y)) for name, (x, y) in LAB.items()))


def row(name: str) -> int:
    return list(LAB).index(name)


def seen(matches: dict[str, float], headings_deg: dict[str, float] | float = 0.0) -> Evidence:
    """Evidence with one hypothesis a node, headings in degrees (NaN: unknown)."""
    angles = headings_deg if isinstance(headings_deg, dict) else dict.fromkeys(matches, headings_deg)
    degrees = np.array([angles[name] for name in matches])
    value = np.array(list(matches.values()))
    count = len(value)
    positions = np.array([LAB[name] for name in matches], dtype=float).reshape(-1, 2)
    poses = np.column_stack([positions, np.nan_to_num(np.deg2rad(degrees))])
    kappa = np.where(np.isnan(degrees), 0.0, 20.0)
    nodes = np.array([row(name) for name in matches], dtype=np.int64)
    return Evidence(poses, nodes, value, 1 - value, 20 * (value - 0.5), np.full(count, 0.4), kappa)


def origins(names: list[str], activities: list[float], heading_deg: float) -> Hypotheses:
    """Origins as a table of the thesis lists them; a name that ends in v is the virtual one."""
    count = len(names)
    return Hypotheses(
        nodes=np.array([row(name.rstrip("v")) for name in names]),
        headings=np.full(count, np.deg2rad(heading_deg)),
        match=np.full(count, NAN),
        activity=np.array(activities),
        virtual=np.array([name.endswith("v") for name in names]),
    )


def motion(x: float = 0.0, y: float = 0.0, turn_deg: float = 0.0) -> Motion:
    return Motion(np.array([x, y, np.deg2rad(turn_deg)]), np.eye(3) * 1e-4)


def tracker_at(
    start: Hypotheses,
    best: str,
    heading_deg: float,
    config: ActivityTrackerConfig | None = None,
) -> ActivityTracker:
    tracker = ActivityTracker(config)
    tracker.reset(lab(), np.random.default_rng(0))
    tracker.restore(start, _row_of(start, best), np.deg2rad(heading_deg))
    return tracker


def _row_of(start: Hypotheses, best: str) -> int:
    same = (start.nodes == row(best.rstrip("v"))) & (start.virtual == best.endswith("v"))
    return int(np.flatnonzero(same)[0])


# Table 5.7: the robot turns on node 1. Headings are not in the thesis; deviations of 9.1805, 10 and 9.5182 degrees
# give its activities to the last digit, and equal ones (or none) give 0.40592, 0.26197, 0.33211.
@pytest.mark.parametrize(
    ("headings", "expected", "digits"),
    [
        (None, (0.40592, 0.26197, 0.33211), 5),
        ((9.1805050, 10.0, 9.5181776), (0.418523, 0.249694, 0.331782), 6),
    ],
    ids=["without heading terms", "with heading terms"],
)
def test_table_5_7(headings: tuple[float, float, float] | None, expected: tuple[float, ...], digits: int) -> None:
    of_1, of_2, virtual = headings or (0.0, 0.0, 0.0)
    start = origins(["1", "1v"], [0.470396, 0.529604], 0.0 if headings else NAN)
    tracker = tracker_at(start, "1v", virtual)
    tracker.predict(motion(turn_deg=30.0))
    tracker.update(seen({"1": 0.611119, "2": 0.65027}, {"1": 30.0 + of_1, "2": 30.0 + of_2}))
    step = tracker.last
    assert step is not None
    assert list(step.destinations.nodes) == [row("1"), row("2"), row("1")]
    assert list(step.destinations.virtual) == [False, False, True]
    assert step.destinations.match[2] == 0.5
    np.testing.assert_allclose(step.destinations.activity, expected, atol=0.5 * 10.0**-digits * 1.01)
    assert (step.kind, step.node) == ("normal", row("1"))


# Table 5.8: from node 8 to node 1, 1 m along x. Deviations of 10 degrees for node 2 and 6.2509 for 1v give the
# thesis's activities to the last digit; without heading terms 0.5176 and 0.4824, and the wrong node would win.
@pytest.mark.parametrize(
    ("headings", "expected", "digits", "winner"),
    [
        (None, (0.5176, 0.4824), 4, "normal"),
        ((10.0, 6.2508840), (0.441696, 0.558304), 6, "virtual"),
    ],
    ids=["without heading terms", "with heading terms"],
)
def test_table_5_8(headings: tuple[float, float] | None, expected: tuple[float, ...], digits: int, winner: str) -> None:
    of_2, virtual = headings or (0.0, 0.0)
    names = ["1", "8", "4", "8v"]
    start = origins(names, [0.235045, 0.341719, 0.129596, 0.29364], 0.0 if headings else NAN)
    tracker = tracker_at(start, "8", virtual)
    x, y = rotate((1.0, 0.0), -np.deg2rad(virtual))
    tracker.predict(motion(x, y))
    tracker.update(seen({"2": 0.541098}, of_2))
    step = tracker.last
    assert step is not None
    assert list(step.destinations.nodes) == [row("2"), row("1")]
    np.testing.assert_allclose(step.destinations.activity, expected, atol=0.5 * 10.0**-digits * 1.01)
    assert step.kind == winner


def test_contract() -> None:
    check_estimator(ActivityTracker)


def test_starts_anywhere_and_names_no_node() -> None:
    """5.2.2: every node an origin with activity 0.125; before the first win there is no d0."""
    tracker = ActivityTracker()
    tracker.reset(lab(), np.random.default_rng(0))
    np.testing.assert_allclose(np.unique(tracker.belief.weights), 0.125 / 4)
    tracker.predict(motion(3.0))
    tracker.update(Evidence.blind())
    assert tracker.last is not None
    assert (tracker.last.kind, tracker.last.node) == ("none", None)
    np.testing.assert_allclose(tracker.belief.poses[::4, :2], lab().positions)  # the motion was discarded


def test_first_win_takes_the_best_match_and_its_heading() -> None:
    tracker = ActivityTracker()
    tracker.reset(lab(), np.random.default_rng(0))
    tracker.predict(motion(turn_deg=50.0))
    tracker.update(seen({"1": 0.7, "5": 0.52, "6": 0.4}, {"1": 80.0, "5": 10.0, "6": 0.0}))
    step = tracker.last
    assert step is not None
    assert (step.kind, step.node, len(step.destinations)) == ("normal", row("1"), 2)
    assert np.rad2deg(tracker.heading) == pytest.approx(80.0)


def test_threshold_is_strict() -> None:
    tracker = ActivityTracker()
    tracker.reset(lab(), np.random.default_rng(0))
    tracker.update(seen({"1": 0.5}))
    assert tracker.last is not None
    assert tracker.last.kind == "none"


def test_supposed_place_keeps_the_origins_and_the_vector_grows() -> None:
    """3.8: without a destination the answer is d0, and neither origins nor odometry are reset."""
    tracker = tracker_at(origins(["8"], [1.0], 0.0), "8", 0.0)
    for moved, expected in ((0.4, "8"), (0.4, "1"), (0.4, "1"), (0.4, "2")):
        tracker.predict(motion(moved))
        tracker.update(seen({"4": 0.45}))
        assert tracker.last is not None
        assert (tracker.last.kind, tracker.last.node) == ("supposed", row(expected))
        assert list(tracker.last.origins.nodes) == [row("8")]
    np.testing.assert_allclose(tracker.belief.poses[0], [0.6, 0.0, 0.0], atol=1e-12)


def test_winning_virtual_destination_resets_the_odometry_but_not_the_heading() -> None:
    """A d0 has the match eps_M: it resets the position like any d*, and can never set the heading."""
    tracker = tracker_at(origins(["8"], [1.0], 0.0), "8", 5.0)
    tracker.predict(motion(0.9))
    tracker.update(seen({"4": 0.51}, 120.0))
    assert tracker.last is not None
    assert (tracker.last.kind, tracker.last.node) == ("virtual", row("1"))
    assert np.rad2deg(tracker.heading) == pytest.approx(5.0)
    weights = tracker.belief.weights
    np.testing.assert_allclose(tracker.belief.poses[weights.argmax(), :2], LAB["1"])


@pytest.mark.parametrize(("match", "heading"), [(0.59, 20.0), (0.6, 20.0), (0.61, 4.0)])
def test_heading_is_corrected_above_its_threshold_only(match: float, heading: float) -> None:
    tracker = tracker_at(origins(["8"], [1.0], 0.0), "8", 20.0)
    tracker.predict(motion(1.0))
    tracker.update(seen({"1": match}, 4.0))
    assert tracker.last is not None
    assert tracker.last.kind == "normal"
    assert np.rad2deg(tracker.heading) == pytest.approx(heading)


def test_one_displacement_for_all_origins_but_each_its_own_heading() -> None:
    """4.1.5 and Table 5.8: Q_a = Q_o + vector; phi_a = phi_o + turned."""
    start = Hypotheses(
        np.array([row("8"), row("6")]),
        np.deg2rad([0.0, 90.0]),
        np.full(2, NAN),
        np.array([0.6, 0.4]),
        np.zeros(2, bool),
    )
    tracker = tracker_at(start, "8", 0.0)
    tracker.predict(motion(0.5, turn_deg=90.0))
    tracker.predict(motion(0.5))
    np.testing.assert_allclose(tracker.belief.poses, [[-0.5, 0.5, np.pi / 2], [0.5, 1.5, -np.pi]], atol=1e-12)


def test_every_deviation_zero_is_no_division_by_zero() -> None:
    tracker = tracker_at(origins(["1"], [1.0], 0.0), "1", 0.0)
    tracker.update(seen({"1": 0.7}, 0.0))
    assert tracker.last is not None
    np.testing.assert_allclose(tracker.last.destinations.activity, [0.7 / 1.2, 0.5 / 1.2])


def test_action_model_is_the_product_of_3_16_and_3_17() -> None:
    delta_l, delta_phi = np.array([[0.0, 1.0], [2.0, 0.5]]), np.array([[0.1, 0.3], [0.2, NAN]])
    model = action_model(delta_l, delta_phi)
    expected = np.exp(-(delta_l**2) / (2 * 2.0**2)) * np.exp(-(np.nan_to_num(delta_phi) ** 2) / (2 * 0.3**2))
    np.testing.assert_allclose(model, expected)


def test_unknown_heading_of_a_view_has_factor_one_and_sets_no_heading() -> None:
    tracker = tracker_at(origins(["1"], [1.0], 0.0), "1", 40.0)
    tracker.update(seen({"1": 0.9}, NAN))
    assert tracker.last is not None
    assert np.isnan(tracker.last.delta_phi[0, 0])
    assert np.rad2deg(tracker.heading) == pytest.approx(40.0)


def test_recovers_from_kidnapping_within_three_good_looks() -> None:
    """5.2.2: a match 1.65 times better beats any distance, so good looks elsewhere win."""
    tracker = ActivityTracker()
    tracker.reset(lab(), np.random.default_rng(0))
    for _ in range(3):
        tracker.update(seen({"8": 0.75}, 0.0))
    assert tracker.last is not None
    assert tracker.last.node == row("8")
    steps = 0
    while tracker.last.node != row("4"):
        tracker.predict(motion(turn_deg=12.0))
        tracker.update(seen({"4": 0.75}, 100.0 + 12.0 * steps))
        steps += 1
        assert steps <= 3


def test_prior_gives_heading_and_offset() -> None:
    tracker = ActivityTracker()
    prior = WeightedPoses(np.array([[0.1, 0.0, 1.0], [1.0, 2.1, -1.0]]), np.log([0.8, 0.2]))
    tracker.reset(lab(), np.random.default_rng(0), prior)
    assert tracker.heading == pytest.approx(1.0)
    tracker.predict(motion(1.0))
    tracker.update(Evidence.blind())
    assert tracker.last is not None
    assert tracker.last.kind == "supposed"
    assert tracker.last.node == lab().nearest_node(np.array([[np.cos(1.0), np.sin(1.0)]]))[0]


def test_order_of_hypotheses_does_not_matter() -> None:
    tables = []
    for names in (["1", "2", "5"], ["5", "2", "1"]):
        tracker = tracker_at(origins(["8", "1"], [0.5, 0.5], 0.0), "8", 0.0)
        tracker.predict(motion(0.8))
        matches = {"1": 0.62, "2": 0.66, "5": 0.58}
        tracker.update(seen({name: matches[name] for name in names}, 3.0))
        assert tracker.last is not None
        done = tracker.last.destinations
        tables.append(dict(zip(zip(done.nodes, done.virtual, strict=True), done.activity, strict=True)))
    assert tables[0] == pytest.approx(tables[1])


def test_thresholds_out_of_order_are_refused() -> None:
    with pytest.raises(ValueError, match="match_threshold <= head_threshold"):
        ActivityTrackerConfig(match_threshold=0.7, head_threshold=0.6)


def test_rounding_is_no_deviation() -> None:
    """A residue of 1e-16 must not become the width of the Gaussian and cost a pair the factor 1.65."""
    exact, residue = np.zeros((2, 2)), np.array([[0.0, 4.4e-16], [0.0, 0.0]])
    np.testing.assert_array_equal(action_model(residue, residue), action_model(exact, exact))


def test_prior_without_a_common_heading_invents_none() -> None:
    tracker = ActivityTracker()
    around = np.column_stack([np.zeros((4, 2)), np.deg2rad([-180.0, -90.0, 0.0, 90.0])])
    tracker.reset(lab(), np.random.default_rng(0), WeightedPoses.uniform(around))
    tracker.predict(motion(3.0))
    tracker.update(Evidence.blind())
    assert tracker.last is not None
    assert (tracker.last.kind, tracker.last.node) == ("none", None)
    assert np.isnan(tracker.last.origins.headings).all()
    tracker.update(seen({"1": 0.7}, 60.0))
    assert np.rad2deg(tracker.heading) == pytest.approx(60.0)


def test_supposed_places_grow_uncertain_until_a_win() -> None:
    tracker = tracker_at(origins(["8"], [1.0], 0.0), "8", 0.0)
    spreads = [tracker.belief.spread]
    for _ in range(3):
        tracker.predict(motion(0.3))
        tracker.update(Evidence.blind())
        spreads.append(tracker.belief.spread)
    np.testing.assert_allclose(np.diff(spreads, axis=0), 1e-4)
    tracker.update(seen({"1": 0.8}, 0.0))
    np.testing.assert_allclose(tracker.belief.spread, spreads[0])


# --- fixed sigmas with an outlier floor, beside the thesis's rule (ours) --------------------------------------------

FIXED = ActivityTrackerConfig(deviation="fixed")
BARE = ActivityTrackerConfig(deviation="fixed", outlier_floor=0.0)


@pytest.mark.parametrize("floor", [0.0, 0.2])
def test_fixed_action_model_pair_by_pair(floor: float) -> None:
    delta_l, delta_phi = np.array([[0.0, 1.0], [2.0, 0.5]]), np.array([[0.0, 0.3], [0.2, NAN]])
    model = fixed_action_model(delta_l, delta_phi, 0.8, 0.5, floor)
    place = np.exp([[0.0, -(1.0**2) / (2 * 0.64)], [-(2.0**2) / (2 * 0.64), -(0.5**2) / (2 * 0.64)]])
    heading = np.exp([[0.0, -(0.3**2) / (2 * 0.25)], [-(0.2**2) / (2 * 0.25), 0.0]])
    np.testing.assert_allclose(model, (1.0 - floor) * place * heading + floor)


def test_fixed_sigmas_judge_a_pair_whatever_the_others_are() -> None:
    """The thesis's largest deviation does not: a far hypothesis makes all others look near."""
    near, both = np.array([[0.5]]), np.array([[0.5], [6.0]])
    fixed = [fixed_action_model(delta, np.zeros_like(delta), 0.8, 0.5, 0.1)[0, 0] for delta in (near, both)]
    largest = [action_model(delta, np.zeros_like(delta))[0, 0] for delta in (near, both)]
    assert fixed[0] == fixed[1]
    assert largest[0] == pytest.approx(np.exp(-0.5))
    assert largest[1] > 0.99


@pytest.mark.parametrize("config", [FIXED, BARE, ActivityTrackerConfig(deviation="fixed", match_power=4.0)])
def test_contract_with_fixed_sigmas(config: ActivityTrackerConfig) -> None:
    check_estimator(lambda: ActivityTracker(config))


def looks_until_found(config: ActivityTrackerConfig, at_most: int) -> int | None:
    """A robot sure to be at 8 is carried to 4 and turns there: looks until 4 wins; None if that takes more."""
    tracker = ActivityTracker(config)
    tracker.reset(lab(), np.random.default_rng(0))
    for _ in range(3):
        tracker.update(seen({"8": 0.75}, 0.0))
    assert tracker.last is not None
    assert tracker.last.node == row("8")
    for look in range(1, at_most + 1):
        tracker.predict(motion(turn_deg=12.0))
        tracker.update(seen({"4": 0.75}, 100.0 + 12.0 * look))
        if tracker.last.node == row("4"):
            return look
    return None


@pytest.mark.parametrize("power", [1.0, 4.0])
def test_a_kidnapping_needs_the_outlier_floor(power: float) -> None:
    """Bare fixed sigmas take 2.8 m and 100 degrees for impossible, and answer with the odometry's d0 for long."""
    late, soon = {1.0: (10, 3), 4.0: (4, 1)}[power]
    assert looks_until_found(replace(BARE, match_power=power), late) is None
    found = looks_until_found(replace(FIXED, match_power=power), late)
    assert found is not None and found <= soon
    thesis = looks_until_found(ActivityTrackerConfig(match_power=power), late)
    assert thesis is not None and thesis <= 3


def test_fixed_sigmas_believe_the_odometry_where_the_thesis_believes_a_better_match() -> None:
    """One metre on from 8 the robot is at 1; a match at 4, far off and somewhat better, is a look-alike."""
    winners = {}
    for name, config in {"largest": ActivityTrackerConfig(), "fixed": FIXED}.items():
        tracker = tracker_at(origins(["8", "4"], [0.9, 0.1], 0.0), "8", 0.0, config)
        tracker.predict(motion(1.0))
        tracker.update(seen({"1": 0.55, "4": 0.8}, 0.0))
        assert tracker.last is not None
        winners[name] = tracker.last.node
    assert winners == {"largest": row("4"), "fixed": row("1")}


def test_where_every_move_is_impossible_the_match_alone_decides() -> None:
    """Without a floor Gaussians of 40 m underflow to zero for all pairs; 0 / 0 must not become the activity."""
    tracker = tracker_at(origins(["8"], [1.0], 0.0), "8", 0.0, BARE)
    tracker.predict(motion(40.0))
    tracker.update(seen({"1": 0.6, "4": 0.9}, 0.0))
    assert tracker.last is not None
    np.testing.assert_allclose(tracker.last.destinations.activity, np.array([0.6, 0.9, 0.5]) / 2.0)


@pytest.mark.parametrize(("power", "ratio"), [(1.0, 0.8 / 0.6), (4.0, (0.8 / 0.6) ** 4), (1e5, np.inf)])
def test_power_of_the_match(power: float, ratio: float) -> None:
    config = ActivityTrackerConfig(match_power=power)
    tracker = tracker_at(origins(["8"], [1.0], NAN), "8", 0.0, config)
    tracker.update(seen({"1": 0.8, "7": 0.6}, NAN))  # both one metre away
    assert tracker.last is not None
    activity = tracker.last.destinations.activity
    assert activity.sum() == pytest.approx(1.0)
    with np.errstate(divide="ignore"):
        assert activity[0] / activity[1] == pytest.approx(ratio)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"deviation": "mean"}, "use one of: largest, fixed"),
        ({"sigma_m": 0.0}, "sigma_m is 0.0"),
        ({"sigma_deg": np.inf}, "sigma_deg inf"),
        ({"outlier_floor": 1.0}, "outlier_floor is 1.0"),
        ({"match_power": 0.0}, "match_power is 0.0"),
    ],
)
def test_action_models_that_cannot_work_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        ActivityTrackerConfig(**settings)
