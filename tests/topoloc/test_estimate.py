from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from topoloc.estimate import (
    SUREST,
    SURPRISE,
    EstimateRule,
    agreement,
    estimate_from,
    mean_and_covariance,
    node_masses,
)
from topoloc.geometry import circular_mean, wrap
from topoloc.testing import evidence_for, toy_map
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Status, WeightedPoses

LINE = TopoMap("line", Camera(), tuple(Node(str(i), "", float(i), 0.0) for i in range(4)))


def belief_of(rows: list[tuple[float, float, float]], weights: list[float], spread: float = 0.0) -> WeightedPoses:
    with np.errstate(divide="ignore"):
        return WeightedPoses(np.array(rows), np.log(np.array(weights)), np.full(3, spread))


def test_node_masses_are_shares_of_the_belief_nearest_to_each_node() -> None:
    belief = belief_of([(0.1, 0.3, 0), (-5, 0, 0), (1.4, 0, 0), (1.6, 0, 0)], [1, 2, 3, 4])
    assert node_masses(belief, LINE) == pytest.approx([0.3, 0.3, 0.4, 0.0])


class TestMoments:
    def test_headings_on_the_circle(self) -> None:
        poses = np.array([[0.0, 0.0, math.pi - 0.1], [2.0, 0.0, -math.pi + 0.3]])
        mean, covariance = mean_and_covariance(poses, np.array([1.0, 1.0]), np.zeros(3))
        assert mean == pytest.approx([1.0, 0.0, -math.pi + 0.1])
        assert covariance[2, 2] == pytest.approx(0.04)
        assert covariance[0, 2] == pytest.approx(0.2)
        assert covariance[0, 0] == pytest.approx(1.0)

    def test_against_numpy(self) -> None:
        rng = np.random.default_rng(0)
        poses, weights = rng.normal(0, 0.3, (50, 3)), rng.uniform(0, 1, 50)
        mean, covariance = mean_and_covariance(poses, weights, np.zeros(3))
        assert mean[:2] == pytest.approx(np.average(poses[:, :2], axis=0, weights=weights))
        assert covariance[:2, :2] == pytest.approx(np.cov(poses[:, :2].T, aweights=weights, ddof=0))

    def test_the_spread_is_added_to_the_diagonal(self) -> None:
        spread = np.array([0.1, 0.2, 0.3])
        _, covariance = mean_and_covariance(np.array([[1.0, 2.0, 3.0]]), np.ones(1), spread)
        assert covariance == pytest.approx(np.diag(spread))


class TestEstimate:
    def test_the_leading_mode(self) -> None:
        rows = [(0.0, 0.0, 3.1), (0.0, 0.2, -3.1), (3.0, 0.0, 1.0)]
        estimate = estimate_from(belief_of(rows, [0.4, 0.4, 0.2], 0.01), LINE)
        assert (estimate.node, estimate.status) == (0, Status.LOCALIZED)
        assert estimate.probability == pytest.approx(0.8)
        assert estimate.pose[:2] == pytest.approx([0.0, 0.1])
        assert abs(estimate.pose[2]) == pytest.approx(math.pi)
        beside = math.pi - 3.1
        assert np.diag(estimate.covariance) == pytest.approx([0.01, 0.01 + 0.1**2, 0.01 + beside**2])

    def test_a_mode_does_not_end_at_a_nodes_border(self) -> None:
        """A cloud halfway between two nodes: the mode holds both halves, though one node leads."""
        rows = [(0.3, 0.0, 0.0), (0.45, 0.0, 0.0), (0.6, 0.0, 0.0)]
        estimate = estimate_from(belief_of(rows, [1, 1, 1]), LINE)
        assert estimate.node == 0
        assert estimate.pose[0] == pytest.approx(0.45)
        narrow = estimate_from(belief_of(rows, [1, 1, 1]), LINE, rule=EstimateRule(mode_radius_m=0.2))
        assert narrow.pose[0] == pytest.approx(0.375)

    def test_a_share_spread_wide_around_an_empty_middle(self) -> None:
        rows = [(0.0, 5.0, 0.0), (0.0, -5.0, 0.0)]
        estimate = estimate_from(belief_of(rows, [1, 1]), LINE)
        assert estimate.pose[:2] == pytest.approx([0.0, 0.0])
        assert estimate.covariance[1, 1] == pytest.approx(25.0)

    def test_a_tie_names_no_node_and_is_lost(self) -> None:
        estimate = estimate_from(belief_of([(0, 0, 0), (2, 0, 0)], [1, 1]), LINE)
        assert (estimate.node, estimate.probability, estimate.status) == (None, 0.0, Status.LOST)
        assert np.isfinite(estimate.pose).all() and np.isfinite(estimate.covariance).all()

    def test_nearly_a_tie_names_the_leader(self) -> None:
        assert estimate_from(belief_of([(0, 0, 0), (2, 0, 0)], [1.0, 1.0001]), LINE).node == 2

    @pytest.mark.parametrize(
        ("share", "status"),
        [(0.69, Status.AMBIGUOUS), (0.71, Status.LOCALIZED), (0.31, Status.AMBIGUOUS), (0.29, Status.LOST)],
    )
    def test_the_status_follows_the_probability(self, share: float, status: Status) -> None:
        rest = (1.0 - share) / 3.0
        belief = belief_of([(float(i), 0, 0) for i in range(4)], [share, rest, rest, rest])
        estimate = estimate_from(belief, LINE)
        assert (estimate.node, estimate.status) == (0, status)
        assert estimate.probability == pytest.approx(share)

    def test_the_formula(self) -> None:
        rule = EstimateRule(bias=-0.5, gain=2.0, evidence_gain=0.3)
        estimate = estimate_from(belief_of([(0, 0, 0), (1, 0, 0)], [0.8, 0.2]), LINE, -2.0, rule)
        assert estimate.probability == pytest.approx(1.0 / (1.0 + math.exp(-(-0.5 + 2.0 * math.log(4.0) - 0.6))))

    def test_by_default_the_belief_is_taken_at_its_word(self) -> None:
        belief = belief_of([(0, 0, 0), (1, 0, 0)], [0.8, 0.2])
        assert estimate_from(belief, LINE).probability == pytest.approx(0.8)

    def test_bad_evidence_makes_a_sure_belief_lost(self) -> None:
        rule = EstimateRule(evidence_gain=0.3)
        estimate = estimate_from(belief_of([(0, 0, 0)], [1.0]), LINE, -1000.0, rule)
        assert 0.0 <= estimate.probability < 1e-6
        assert (estimate.node, estimate.status) == (0, Status.LOST)

    def test_certainty_stays_below_one(self) -> None:
        estimate = estimate_from(belief_of([(0, 0, 0)], [1.0]), LINE)
        assert 0.99 < estimate.probability < 1.0
        assert np.isfinite(estimate.covariance).all()

    def test_a_map_of_one_node(self) -> None:
        one = TopoMap("one", Camera(), (Node("1", "", 0.0, 0.0),))
        assert estimate_from(belief_of([(9, 9, 0)], [1.0]), one).node == 0

    def test_weights_of_zero_do_not_matter(self) -> None:
        rows = [(0.0, 0.0, 0.5), (0.1, 0.0, -2.0)]
        estimate = estimate_from(belief_of(rows, [1.0, 0.0]), LINE)
        assert estimate.pose == pytest.approx([0.0, 0.0, 0.5])


def test_a_robot_far_off_the_map_is_lost_and_at_no_node() -> None:
    the_map = toy_map()
    for distance, status in ((1.5, Status.LOCALIZED), (2.5, Status.LOST)):
        pose = np.array([[the_map.positions[:, 0].max() + distance, 0.0, 0.0]])
        estimate = estimate_from(WeightedPoses.uniform(pose), the_map)
        assert estimate.status is status
        assert (estimate.probability == 0.0) == (status is Status.LOST)
    corridor = TopoMap("corridor", Camera(), (Node("a", "", 0.0, 0.0), Node("b", "", 20.0, 0.0)))
    assert estimate_from(WeightedPoses.uniform(np.array([[9.0, 0.0, 0.0]])), corridor).status is Status.LOCALIZED


def estimate_written_out(belief: WeightedPoses, radius: float) -> tuple[int | None, float, np.ndarray, np.ndarray]:
    """Node, mass, mean and covariance, step by step as the formulas have it, on the map ``LINE``."""
    weights = np.exp(belief.log_weights) / np.exp(belief.log_weights).sum()
    distance = np.linalg.norm(belief.poses[:, None, :2] - LINE.positions, axis=2)
    nearest = np.argmin(distance, axis=1)
    masses = np.array([weights[nearest == node].sum() for node in range(4)])
    leader = int(np.argmax(masses))
    tied = np.isclose(np.delete(masses, leader), masses[leader], rtol=1e-9, atol=0.0).any()
    own = weights * (nearest == leader)
    centre = own @ belief.poses[:, :2] / own.sum()
    near = np.linalg.norm(belief.poses[:, :2] - centre, axis=1) <= radius
    share = weights[near] / weights[near].sum()
    poses = belief.poses[near]
    mean = np.array([*(share @ poses[:, :2]), circular_mean(poses[:, 2], share)])
    deviation = np.column_stack([poses[:, :2] - mean[:2], wrap(poses[:, 2] - mean[2])])
    covariance = (share[:, None] * deviation).T @ deviation + np.diag(belief.spread)
    return None if tied else leader, float(masses[leader]), mean, covariance


class TestWrittenOut:
    @pytest.mark.parametrize("count", [1, 100, 1000, 30_000])
    @pytest.mark.parametrize("radius", [1.0, 0.3, math.inf])
    def test_a_cloud(self, count: int, radius: float) -> None:
        """30,000 are more than are worked on at a time, and make the map's table of nearest nodes."""
        rng = np.random.default_rng(count)
        poses = np.column_stack([rng.normal(1.3, 0.8, (count, 2)), wrap(rng.normal(3.0, 0.7, count))])
        belief = WeightedPoses(poses, rng.normal(0.0, 1.0, count), np.array([0.01, 0.02, 0.03]))
        node, mass, mean, covariance = estimate_written_out(belief, radius)
        estimate = estimate_from(belief, LINE, rule=EstimateRule(mode_radius_m=radius, astray_m=math.inf))
        assert estimate.node == node
        assert estimate.probability == pytest.approx(min(mass, SUREST), abs=1e-9)
        np.testing.assert_allclose(estimate.pose, mean, atol=1e-9)
        np.testing.assert_allclose(estimate.covariance, covariance, atol=1e-9)

    def test_a_tie_and_headings_all_around(self) -> None:
        """Where headings cancel the direction is rounding's: the same as ever, or recorded runs would not repeat."""
        headings = wrap(np.arange(24) * np.pi / 12.0)
        rows = [(x, 0.1, heading) for x in (0.0, 0.1, 2.0, 2.1) for heading in headings]
        belief = belief_of(rows, [1.0] * len(rows), 0.01)
        node, _, mean, covariance = estimate_written_out(belief, 1.0)
        estimate = estimate_from(belief, LINE)
        assert estimate.node is None and node is None
        np.testing.assert_allclose(estimate.pose, mean, atol=1e-9)
        np.testing.assert_allclose(estimate.covariance, covariance, atol=1e-9)


class TestAgreement:
    def test_a_look_that_speaks_for_the_pose_raises_the_probability(self) -> None:
        belief = belief_of([(0.0, 0.0, 0.5), (1.0, 0.0, 0.5)], [0.7, 0.3], 0.01)
        rule = EstimateRule(agreement_gain=0.5)
        here, elsewhere = evidence_for(LINE, (0.0, 0.0, 0.5)), evidence_for(LINE, (3.0, 0.0, -2.5))
        probability = [estimate_from(belief, LINE, 0.0, rule, look).probability for look in (here, None, elsewhere)]
        assert probability[0] > probability[1] > probability[2]
        assert probability[1] == pytest.approx(0.7)

    def test_value_by_hand(self) -> None:
        belief = belief_of([(0.0, 0.0, 0.5)], [1.0], 0.01)
        look = evidence_for(LINE, (0.0, 0.0, 0.5))
        there = float(look.log_likelihood(np.zeros((1, 2)), np.array([[0.5]]))[0, 0])
        rule = EstimateRule(bias=-0.3, gain=0.1, evidence_gain=0.4, agreement_gain=0.2)
        logit = -0.3 + 0.1 * math.log(0.999 / 0.001) + 0.4 * -1.5 + 0.2 * there
        assert estimate_from(belief, LINE, -1.5, rule, look).probability == pytest.approx(
            1.0 / (1.0 + math.exp(-logit))
        )

    def test_a_blind_look_says_nothing_and_an_impossible_one_no_more_than_a_surprise(self) -> None:
        look = evidence_for(LINE, (0.0, 0.0, 0.5))
        impossible = replace(look, log_likelihoods=np.full(4, -np.inf), log_floor=-np.inf)
        pose = np.array([0.0, 0.0, 0.5])
        assert agreement(Evidence.blind(), pose) == agreement(None, pose) == 0.0
        assert agreement(impossible, pose) == SURPRISE
