from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.baselines import BestMatch
from estimators.gaussian import ANY_HEADING
from estimators.voting import Voting, VotingConfig, rank_weights, ranked
from topoloc.estimate import estimate_from, node_masses
from topoloc.interfaces import Estimator
from topoloc.testing import check_estimator, evidence_for, toy_map
from topoloc.types import Evidence, Motion, Status, WeightedPoses

MAP = toy_map()


def started(neighbours: int = 5, prior: WeightedPoses | None = None) -> Estimator:
    voting = Voting(VotingConfig(neighbours))
    voting.reset(MAP, np.random.default_rng(0), prior)
    return voting


def views(match: list[float], nodes: list[int], log_likelihoods: list[float] | None = None) -> Evidence:
    """One hypothesis a view, several at one node."""
    count = len(match)
    poses = np.column_stack([MAP.positions[nodes], np.full(count, 0.5)])
    ones = np.ones(count)
    likely = np.zeros(count) if log_likelihoods is None else np.array(log_likelihoods)
    return Evidence(poses, np.array(nodes), np.array(match), ones, likely, 0.3 * ones, 20.0 * ones)


def masses(voting: Estimator) -> np.ndarray:
    return node_masses(voting.belief, MAP)


def test_contract() -> None:
    check_estimator(Voting)


@settings(deadline=None)
@given(st.integers(1, 200))
def test_weights_by_rank_fall_and_sum_to_one(count: int) -> None:
    weights = rank_weights(count)
    assert weights.sum() == pytest.approx(1.0)
    assert (weights > 0.0).all() and (np.diff(weights) < 0.0).all()
    assert weights[-1] == pytest.approx(2.0 / (count**2 + count))


@settings(deadline=None)
@given(st.integers(0, 1000), st.integers(1, 40))
def test_the_first_are_those_of_the_whole_ranking(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    evidence = views(list(rng.integers(0, 4, 30) / 4.0), list(rng.integers(0, len(MAP.nodes), 30)))
    x, y, heading = evidence.poses.T
    whole = np.lexsort((heading, y, x, evidence.nodes, -evidence.match))
    assert np.array_equal(ranked(evidence), whole)
    assert np.array_equal(ranked(evidence, count), whole[:count])


def test_votes_by_hand() -> None:
    """Four vote, 0.4, 0.3, 0.2, 0.1 by rank: node 3 has the best match, node 1 the most votes; the fifth has none."""
    voting = started(4)
    voting.update(views([0.6, 0.9, 0.7, 0.8, 0.5], [1, 3, 1, 1, 5]))
    np.testing.assert_allclose(masses(voting), [0.0, 0.3 + 0.2 + 0.1, 0.0, 0.4, 0.0, 0.0], atol=1e-12)
    assert estimate_from(voting.belief, MAP).node == 1


def test_a_vote_counts_by_its_likelihood() -> None:
    voting = started(2)
    voting.update(views([0.9, 0.8], [3, 1], [0.0, np.log(6.0)]))
    np.testing.assert_allclose(masses(voting)[[3, 1]], np.array([2.0, 6.0]) / 8.0)


def test_rank_alone_would_tie_where_likelihoods_do_not() -> None:
    """2 + 1 = 3: of three equal likelihoods the node with one vote ties with that of two, and none is named."""
    voting = started(3)
    voting.update(views([0.9, 0.8, 0.7], [3, 1, 1]))
    assert estimate_from(voting.belief, MAP).node is None
    voting.update(views([0.9, 0.8, 0.7], [3, 1, 1], [0.3, 0.2, 0.1]))
    assert estimate_from(voting.belief, MAP).node == 3


@pytest.mark.parametrize("neighbours", [1, 2, 4, 9])
def test_with_one_hypothesis_a_node_the_best_match_leads_whatever_j_is(neighbours: int) -> None:
    voting, best = started(neighbours), BestMatch()
    best.reset(MAP, np.random.default_rng(0))
    for pose in [(0.3, 0.1, 0.5), (1.6, 0.8, -2.0), (0.9, 0.2, 3.0)]:
        evidence = evidence_for(MAP, pose)
        assert voting.update(evidence) is None
        best.update(evidence)
        assert estimate_from(voting.belief, MAP).node == estimate_from(best.belief, MAP).node


def test_one_neighbour_is_the_best_match_alone() -> None:
    voting, best = started(1), BestMatch()
    evidence = replace(evidence_for(MAP, (0.3, 0.1, 0.5)), sigma=np.linspace(0.2, 0.4, 6), kappa=np.arange(6.0))
    for estimator in (voting, best):
        estimator.update(evidence)
    np.testing.assert_array_equal(voting.belief.poses, best.belief.poses)
    np.testing.assert_allclose(voting.belief.spread, best.belief.spread)


def test_spread_is_the_voters_mean() -> None:
    voting = started(2)
    evidence = replace(views([0.9, 0.8, 0.7], [0, 1, 2]), sigma=np.array([0.1, 0.4, 9.0]), kappa=np.array([20.0, 0, 1]))
    voting.update(evidence)
    place, heading = (2 * 0.01 + 0.16) / 3, (2 * 0.05 + ANY_HEADING) / 3
    np.testing.assert_allclose(voting.belief.spread, [place, place, heading])


@settings(deadline=None)
@given(st.permutations(range(6)))
def test_order_of_hypotheses_does_not_matter(order: list[int]) -> None:
    """Two have the same match, and only one of them may vote."""
    evidence = views([0.9, 0.8, 0.8, 0.4, 0.3, 0.2], [0, 1, 2, 3, 4, 5])
    names = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
    shuffled = replace(evidence, **{name: getattr(evidence, name)[order] for name in names})
    beliefs = []
    for one in (evidence, shuffled):
        voting = started(2)
        voting.update(one)
        beliefs.append(voting.belief)
    np.testing.assert_array_equal(beliefs[0].poses, beliefs[1].poses)
    np.testing.assert_array_equal(beliefs[0].log_weights, beliefs[1].log_weights)


def test_equal_matches_are_ranked_by_node_however_the_world_is_turned() -> None:
    evidence = views([0.9, 0.9], [5, 2])
    half_turn = replace(evidence, poses=evidence.poses * [-1.0, -1.0, 1.0])
    for one in (evidence, half_turn):
        voting = started(1)
        voting.update(one)
        np.testing.assert_array_equal(voting.belief.poses, one.poses[1:])


@pytest.mark.parametrize(
    "nothing",
    [Evidence.blind(), views([0.9, 0.8], [0, 1], [-np.inf, -np.inf])],
    ids=["blind", "likelihoods of zero"],
)
def test_a_frame_that_says_nothing_leaves_the_last_answer(nothing: Evidence) -> None:
    voting = started()
    voting.update(views([0.9], [4]))
    voting.predict(Motion(np.array([0.5, 0.0, 0.1]), np.eye(3) * 0.01))
    assert voting.update(nothing) is None
    np.testing.assert_allclose(masses(voting), [0, 0, 0, 0, 1, 0])


def test_before_the_first_frame_anywhere_or_the_prior() -> None:
    assert estimate_from(started().belief, MAP).status is Status.LOST
    prior = WeightedPoses.uniform(np.array([[1.0, 1.0, 0.3]]))
    assert started(prior=prior).belief is prior


def test_fewer_hypotheses_than_neighbours_all_vote() -> None:
    voting = started(10)
    voting.update(views([0.9, 0.8], [0, 5]))
    np.testing.assert_allclose(masses(voting), [2 / 3, 0, 0, 0, 0, 1 / 3])


def test_no_voters_are_refused() -> None:
    with pytest.raises(ValueError, match="neighbours is 0"):
        VotingConfig(neighbours=0)
