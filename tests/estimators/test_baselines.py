from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from estimators.baselines import BestMatch, DeadReckoning
from estimators.gaussian import ANY_HEADING, best_hypothesis, cubature_points
from topoloc.estimate import estimate_from, mean_and_covariance
from topoloc.geometry import compose, wrap
from topoloc.testing import evidence_for, toy_map
from topoloc.types import Evidence, Motion, Status, WeightedPoses

TURN = Motion(np.array([0.3, 0.02, 0.2]), np.diag([0.0013, 0.0013, 0.0008]))


def started(estimator: BestMatch | DeadReckoning, prior: WeightedPoses | None = None) -> BestMatch | DeadReckoning:
    estimator.reset(toy_map(), np.random.default_rng(0), prior)
    return estimator


def hypotheses(match: list[float], nodes: list[int], kappa: float = 20.0) -> Evidence:
    count = len(match)
    poses = np.column_stack([np.arange(count), np.zeros(count), np.full(count, 0.5)])
    ones = np.ones(count)
    return Evidence(poses, np.array(nodes), np.array(match), ones, 0 * ones, 0.3 * ones, kappa * ones)


@pytest.mark.parametrize("make", [BestMatch, DeadReckoning])
def test_before_any_match_the_robot_may_be_anywhere(make: type[BestMatch | DeadReckoning]) -> None:
    estimator = started(make())
    for _ in range(3):
        estimator.predict(TURN)
        estimator.update(Evidence.blind())
    assert len(estimator.belief.poses) == 4 * 6
    estimate = estimate_from(estimator.belief, toy_map())
    assert estimate.node is None and estimate.status is Status.LOST


@pytest.mark.parametrize(("match", "nodes", "best"), [([0.2, 0.9, 0.5], [0, 1, 2], 1), ([0.2, 0.9, 0.9], [0, 5, 2], 2)])
def test_highest_match_wins_and_ties_go_to_the_lowest_node(match: list[float], nodes: list[int], best: int) -> None:
    assert best_hypothesis(hypotheses(match, nodes)) == best


def test_ties_at_one_node_do_not_depend_on_the_order() -> None:
    evidence = hypotheses([0.9, 0.9, 0.9], [2, 2, 2])
    swapped = replace(evidence, poses=evidence.poses[::-1])
    assert np.array_equal(evidence.poses[best_hypothesis(evidence)], swapped.poses[best_hypothesis(swapped)])


@pytest.mark.parametrize(("kappa", "variance"), [(20.0, 0.05), (0.0, ANY_HEADING), (0.01, ANY_HEADING)])
def test_best_match_is_as_wide_as_its_hypothesis(kappa: float, variance: float) -> None:
    estimator = started(BestMatch())
    assert estimator.update(hypotheses([0.2, 0.9], [0, 1], kappa)) is None
    np.testing.assert_allclose(estimator.belief.poses, [[1.0, 0.0, 0.5]])
    np.testing.assert_allclose(estimator.belief.spread, [0.09, 0.09, variance])


def test_best_match_has_no_memory_but_for_blind_frames() -> None:
    estimator = started(BestMatch())
    estimator.update(evidence_for(toy_map(), (0.0, 0.0, 0.0)))
    estimator.update(evidence_for(toy_map(), (2.0, 1.0, 1.0)))
    estimator.predict(TURN)
    estimator.update(Evidence.blind())
    np.testing.assert_allclose(estimator.belief.poses, [[2.0, 1.0, 1.0]])


def test_best_match_starts_at_its_prior() -> None:
    prior = WeightedPoses.uniform([[1.0, 1.0, 0.3]])
    assert started(BestMatch(), prior).belief is prior


def test_dead_reckoning_starts_at_the_first_match_and_looks_at_no_other() -> None:
    estimator = started(DeadReckoning())
    estimator.predict(TURN)
    estimator.update(Evidence.blind())
    estimator.update(evidence_for(toy_map(), (1.0, 1.0, 0.5)))
    estimator.predict(TURN)
    assert estimator.update(evidence_for(toy_map(), (0.0, 0.0, -2.0))) is None
    mean, _ = mean_and_covariance(estimator.belief.poses, estimator.belief.weights, estimator.belief.spread)
    np.testing.assert_allclose(mean, compose([1.0, 1.0, 0.5], TURN.delta), atol=1e-12)


def test_dead_reckoning_starts_at_the_mean_of_its_prior() -> None:
    prior = WeightedPoses(
        np.array([[0.0, 0.0, 3.0], [1.0, 0.0, -3.0]]), np.log([0.25, 0.75]), np.array([0.1, 0.1, 0.01])
    )
    expected = mean_and_covariance(prior.poses, prior.weights, prior.spread)
    belief = started(DeadReckoning(), prior).belief
    for value, want in zip(mean_and_covariance(belief.poses, belief.weights, belief.spread), expected, strict=True):
        np.testing.assert_allclose(value, want, atol=1e-12)


def test_dead_reckoning_covariance_equals_a_simulation() -> None:
    rng, start = np.random.default_rng(4), np.array([0.0, 0.0, 0.7])
    spread = np.array([0.01, 0.01, 0.005])
    estimator = started(DeadReckoning(), WeightedPoses.uniform([start], spread))
    poses = start + rng.normal(size=(40_000, 3)) * np.sqrt(spread)
    for _ in range(15):
        estimator.predict(TURN)
        poses = compose(poses, TURN.delta + rng.multivariate_normal(np.zeros(3), TURN.covariance, len(poses)))
    belief = estimator.belief
    mean, covariance = mean_and_covariance(belief.poses, belief.weights, belief.spread)
    true_mean, true_covariance = mean_and_covariance(poses, np.ones(len(poses)), np.zeros(3))
    assert np.abs(mean - true_mean).max() < 0.03  # second-order shortening: 2 m of path, heading sd 0.13
    scale = np.sqrt(np.outer(np.diag(true_covariance), np.diag(true_covariance)))
    assert (np.abs(covariance - true_covariance) / scale).max() < 0.05


@given(
    st.lists(st.floats(-1.0, 1.0), min_size=9, max_size=9),
    st.tuples(st.floats(-5, 5), st.floats(-5, 5), st.floats(-3.14, 3.14)),
)
def test_cubature_points_have_the_mean_and_the_covariance(entries: list[float], mean: tuple[float, ...]) -> None:
    root = np.array(entries).reshape(3, 3)
    covariance = root @ root.T + 1e-9 * np.eye(3)
    points = cubature_points(np.array(mean), covariance)
    assert len(points.poses) == 6
    got_mean, got = mean_and_covariance(points.poses, points.weights, points.spread)
    np.testing.assert_allclose(got_mean[:2], mean[:2], atol=1e-9)
    assert abs(wrap(got_mean[2] - mean[2])) < 1e-9
    np.testing.assert_allclose(got, covariance, atol=1e-9)


def test_a_heading_less_known_than_any_is_told_as_any() -> None:
    points = cubature_points(np.zeros(3), np.diag([1.0, 1.0, 50.0]))
    mean, covariance = mean_and_covariance(points.poses, points.weights, points.spread)
    np.testing.assert_allclose(mean, 0.0, atol=1e-9)
    np.testing.assert_allclose(np.diag(covariance), [1.0, 1.0, 0.999 * ANY_HEADING])


def test_the_estimate_of_dead_reckoning_is_its_gaussian_however_wide() -> None:
    """A mode of one metre would catch two or three of the six points, and their covariance is nearly singular."""
    reckoning = DeadReckoning()
    start = WeightedPoses.uniform(np.array([[0.0, 0.0, 0.3]]), (0.1, 0.1, 0.02))
    reckoning.reset(toy_map(), np.random.default_rng(0), start)
    for _ in range(8):
        reckoning.predict(Motion(np.array([0.3, 0.0, 0.1]), np.diag([0.2, 0.3, 0.01])))
    belief = reckoning.belief
    mean, covariance = mean_and_covariance(belief.poses, belief.weights, belief.spread)
    estimate = estimate_from(belief, toy_map(), rule=DeadReckoning.estimate_rule)
    np.testing.assert_allclose(estimate.pose, mean)
    np.testing.assert_allclose(estimate.covariance, covariance)
    assert np.linalg.eigvalsh(estimate.covariance).min() > 1e-3
