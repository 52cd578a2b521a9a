"""Action selection: the formula against loops, its laws, and cases whose answer is known."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from estimators.action import LeastEntropy, expected_entropy, merged
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter
from topoloc.active import Action, ViewEvidence, pans, turns
from topoloc.geometry import compose
from topoloc.testing import evidence_for, toy_map
from topoloc.types import Evidence, WeightedPoses

MAP = toy_map()
FINE = LeastEntropy.Config(cell_m=0.1, cell_deg=5.0)
LOG_FLOOR, LOG_PEAK, KAPPA = -2.0, 1.0, 400.0
ACTIONS = [
    *pans(np.deg2rad([0.0, 70.0, -100.0]), (0.2, 0.05, 0.1)),
    Action(np.array([0.4, -0.1, 2.5]), np.array([0.1, 0.0, -0.3])),
]


def some_poses(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return np.column_stack([rng.uniform(-0.5, 2.5, (count, 2)), rng.uniform(-np.pi, np.pi, count)])


def some_views(count: int = 7, seed: int = 0) -> tuple[list[Evidence], np.ndarray]:
    """Evidence of all shapes, one of it blind, and where the views were taken."""
    rng = np.random.default_rng(seed)
    poses, evidences = some_poses(count, seed + 1), []
    for size in [0, *rng.integers(1, 7, count - 1)]:
        level = rng.uniform(0.0, 1.0, size)
        hypotheses = np.column_stack([rng.uniform(-0.5, 2.5, (size, 2)), rng.uniform(-np.pi, np.pi, size)])
        sigma, kappa = rng.uniform(0.3, 0.8, size), rng.choice([0.0, 3.0, 20.0], size)
        floor = rng.uniform(-5.0, -1.0)
        nodes = np.zeros(size, dtype=np.int64)
        evidences.append(Evidence(hypotheses, nodes, level, level, rng.normal(0.0, 2.0, size), sigma, kappa, floor))
    return evidences, poses


def some_belief(count: int, seed: int = 5) -> WeightedPoses:
    """Poses in different cells, each with its own weight."""
    return WeightedPoses(some_poses(count, seed), np.random.default_rng(seed).normal(0.0, 1.0, count))


def one_view_of(pose: Sequence[float]) -> Evidence:
    one = np.ones(1)
    return Evidence(
        np.array([pose]), np.zeros(1, dtype=np.int64), one, 0.0 * one, LOG_PEAK * one, 0.3 * one, KAPPA * one, LOG_FLOOR
    )


def both(first: Evidence, second: Evidence) -> Evidence:
    parts = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
    joint: dict[str, Any] = {name: np.concatenate([getattr(first, name), getattr(second, name)]) for name in parts}
    return replace(first, **joint)


# --- the formula ----------------------------------------------------------------------------------------------------


def literal_weights(evidences: Sequence[Evidence], poses: np.ndarray) -> list[float]:
    sigma = float(np.median(np.concatenate([evidence.sigma for evidence in evidences])))
    kappa = float(np.median(np.concatenate([evidence.kappa for evidence in evidences])))
    weights = []
    for x, y, heading in poses:
        around = 0.0
        for x2, y2, heading2 in poses:
            squared = (x - x2) ** 2 + (y - y2) ** 2
            around += np.exp(-squared / (2.0 * sigma**2)) * np.exp(kappa * (np.cos(heading - heading2) - 1.0))
        weights.append(1.0 / around)
    return weights


def literal_entropy(belief: WeightedPoses, evidences: Sequence[Evidence], poses: np.ndarray, action: Action) -> float:
    """EQUATIONS.md, 2 "Action selection", with each cell's likelihoods scaled to sum to one: one term at a time."""
    views = literal_weights(evidences, poses)
    likelihood = []
    for pose in belief.poses:
        camera = compose(compose(pose, action.motion), action.camera)
        at = [evidence.log_likelihood(camera[None, :2], camera[None, 2:])[0, 0] for evidence in evidences]
        row = [weight * np.exp(value) for weight, value in zip(views, at, strict=True)]
        likelihood.append([value / sum(row) for value in row])
    entropy = 0.0
    for k in range(len(evidences)):
        seen = sum(w * g[k] for w, g in zip(belief.weights, likelihood, strict=True))
        for w, g in zip(belief.weights, likelihood, strict=True):
            share = w * g[k] / seen
            entropy -= seen * share * np.log(share)
    return entropy


@pytest.mark.parametrize("seed", range(4))
def test_entropies_are_those_of_the_formula_in_loops(seed: int) -> None:
    evidences, poses = some_views(seed=seed)
    belief = some_belief(9, seed + 20)
    views = ViewEvidence.of(evidences, poses)
    entropies = LeastEntropy(views, FINE).entropies(belief, ACTIONS)
    expected = [literal_entropy(belief, evidences, poses, action) for action in ACTIONS]
    assert len(merged(belief, FINE.cell_m, FINE.cell_deg, 500).poses) == 9  # every pose is a cell of its own
    np.testing.assert_allclose(entropies, expected, rtol=1e-10)
    assert np.ptp(entropies) > 1e-3  # the actions differ


def test_probabilities_are_the_evidences_own_likelihoods() -> None:
    evidences, poses = some_views()
    cameras = some_poses(5, 9)
    views = ViewEvidence.of(evidences, poses)
    likelihoods = np.exp([one.log_likelihood(cameras[:, :2], cameras[:, 2:])[:, 0] for one in evidences]).T
    weighted = likelihoods * views.weights
    probabilities = LeastEntropy(views).probabilities(cameras)
    np.testing.assert_allclose(probabilities, weighted / weighted.sum(axis=1, keepdims=True), rtol=1e-10)


# --- cases whose answer is known ------------------------------------------------------------------------------------


HERE, THERE = (0.0, 0.0), (50.0, 0.0)


def two_places() -> ViewEvidence:
    """Two places that look the same ahead (heading 0) and each its own way to the left (heading 90 degrees)."""
    ahead = both(one_view_of((*HERE, 0.0)), one_view_of((*THERE, 0.0)))
    left = [one_view_of((*place, np.pi / 2.0)) for place in (HERE, THERE)]
    poses = [(*place, heading) for heading in (0.0, np.pi / 2.0) for place in (HERE, THERE)]
    return ViewEvidence.of([ahead, ahead, *left], poses)


def von_mises_peak() -> float:
    """A von Mises of mean 1 over the circle, at its peak: by integration, not by a Bessel function."""
    angles = np.linspace(-np.pi, np.pi, 200_001)[:-1]
    return float(1.0 / np.mean(np.exp(KAPPA * (np.cos(angles) - 1.0))))


def test_look_alikes_leave_all_doubt_and_differences_take_it() -> None:
    belief = WeightedPoses.uniform([(*HERE, 0.0), (*THERE, 0.0)])
    actions, selection = pans(np.array([0.0, np.pi / 2.0])), LeastEntropy(two_places())
    alike, apart = selection.entropies(belief, actions)
    assert alike == pytest.approx(np.log(2.0), abs=1e-12)
    floor = np.exp(LOG_FLOOR)
    seen = floor + np.exp(LOG_PEAK) * von_mises_peak()
    share = seen / (seen + floor)  # of the right place, once its own view is seen
    doubt = -share * np.log(share) - (1.0 - share) * np.log(1.0 - share)
    # from either place: its own view to the left, the other place's, and two views ahead that say nothing there
    expected = ((seen + floor) * doubt + 2.0 * floor * np.log(2.0)) / (seen + 3.0 * floor)
    assert apart == pytest.approx(expected, rel=1e-9)
    assert selection.choose(belief, actions) == 1
    assert selection.choose(belief, actions[::-1]) == 0


def test_a_turn_in_place_is_worth_what_a_pan_of_the_same_angle_is() -> None:
    views = ViewEvidence.of(*some_views())
    angles, selection = np.deg2rad([0.0, 50.0, -120.0]), LeastEntropy(views)
    belief = some_belief(20)
    np.testing.assert_allclose(selection.entropies(belief, pans(angles)), selection.entropies(belief, turns(angles)))


def test_equally_good_actions_give_the_first() -> None:
    selection = LeastEntropy(ViewEvidence.of(*some_views()))
    best = int(np.argmin(selection.entropies(some_belief(20), ACTIONS)))
    again = [ACTIONS[best], *ACTIONS, ACTIONS[best]]
    assert selection.choose(some_belief(20), again) == 0


# --- laws -----------------------------------------------------------------------------------------------------------

SELECTION = LeastEntropy(ViewEvidence.of(*some_views()))
SHARES = arrays(np.float64, st.integers(2, 8), elements=st.floats(0.01, 1.0)).map(lambda row: row / row.sum())


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(12)))
def test_the_order_of_particles_does_not_matter(order: list[int]) -> None:
    belief = some_belief(12)
    shuffled = WeightedPoses(belief.poses[order], belief.log_weights[order])
    np.testing.assert_allclose(SELECTION.entropies(shuffled, ACTIONS), SELECTION.entropies(belief, ACTIONS), rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(7)))
def test_the_order_of_views_does_not_matter(order: list[int]) -> None:
    evidences, poses = some_views()
    shuffled = LeastEntropy(ViewEvidence.of([evidences[k] for k in order], poses[order]))
    belief = some_belief(12)
    np.testing.assert_allclose(shuffled.entropies(belief, ACTIONS), SELECTION.entropies(belief, ACTIONS), rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 11), st.floats(0.01, 0.99))
def test_a_particle_split_into_two_copies_is_no_doubt(split: int, share: float) -> None:
    belief = some_belief(12)
    log_weights = np.append(belief.log_weights, belief.log_weights[split] + np.log(share))
    log_weights[split] += np.log1p(-share)
    copied = WeightedPoses(np.vstack([belief.poses, belief.poses[split]]), log_weights)
    np.testing.assert_allclose(SELECTION.entropies(copied, ACTIONS), SELECTION.entropies(belief, ACTIONS), rtol=1e-9)


@settings(max_examples=30, deadline=None)
@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-3.1, 3.1), st.integers(1, 50))
def test_a_belief_of_one_cell_has_no_doubt_to_lose(x: float, y: float, heading: float, copies: int) -> None:
    belief = WeightedPoses.uniform(np.tile((x, y, heading), (copies, 1)))
    np.testing.assert_allclose(SELECTION.entropies(belief, ACTIONS), 0.0, atol=1e-12)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 40), st.integers(2, 9))
def test_no_look_adds_doubt(seed: int, particles: int, views: int) -> None:
    belief = some_belief(particles, seed)
    cells = merged(belief, 0.5, 30.0, 500)
    prior = -float(np.sum(cells.weights * np.log(cells.weights)))
    entropies = LeastEntropy(ViewEvidence.of(*some_views(views, seed))).entropies(belief, ACTIONS)
    assert (entropies <= prior + 1e-9).all()
    assert (entropies >= -1e-9).all()


@given(SHARES, st.integers(0, 10_000))
def test_the_formula_adds_no_doubt_where_each_cell_sees_as_much(weights: np.ndarray, seed: int) -> None:
    likelihoods = np.random.default_rng(seed).uniform(0.0, 1.0, (len(weights), 5))
    prior = -float(np.sum(weights * np.log(weights)))
    assert expected_entropy(weights, likelihoods / likelihoods.sum(axis=1, keepdims=True)) <= prior + 1e-12


def test_the_formula_may_add_doubt_where_cells_see_unequally_much() -> None:
    """What ``LeastEntropy`` scales for: a likelihood of few views is a doubt that is looked for."""
    weights = np.array([0.98, 0.01, 0.01])
    likelihoods = np.array([[1e-3], [1.0], [1.0]])  # the likely cell hardly foresees the only view
    assert expected_entropy(weights, likelihoods) > 3.0 * expected_entropy(weights, np.ones((3, 1)))


def test_a_corner_photographed_twice_changes_nothing() -> None:
    """As in EQUATIONS.md, 4: the evidence itself does not change by copies, and the copies share their weight."""
    evidences, poses = some_views()
    apart = poses.copy()
    apart[:, :2] += 100.0 * np.arange(len(poses))[:, None]  # so that no view stands near another
    copied = LeastEntropy(ViewEvidence.of([*evidences, *evidences[2:5]], np.vstack([apart, apart[2:5]])))
    plain = LeastEntropy(ViewEvidence.of(evidences, apart))
    belief = some_belief(12)
    np.testing.assert_allclose(copied.entropies(belief, ACTIONS), plain.entropies(belief, ACTIONS), rtol=1e-9)


@pytest.mark.parametrize("factor", [-1e6, -30.0, 30.0, 1e6])
def test_one_factor_for_all_likelihoods_changes_nothing(factor: float) -> None:
    evidences, poses = some_views()
    evidences = evidences[1:]  # a blind view's likelihood is 1 in any case
    scaled = [
        replace(one, log_likelihoods=one.log_likelihoods + factor, log_floor=one.log_floor + factor)
        for one in evidences
    ]
    belief = some_belief(12)
    first, second = (
        LeastEntropy(ViewEvidence.of(views, poses[1:])).entropies(belief, ACTIONS) for views in (evidences, scaled)
    )
    np.testing.assert_allclose(second, first, rtol=1e-7)  # 1e6 leaves ten digits of a likelihood


# --- what real runs bring -------------------------------------------------------------------------------------------

GOOD = evidence_for(MAP, (0.3, 0.1, 0.5))
EXTREMES = {
    "blind": Evidence.blind(),
    "huge": replace(GOOD, log_likelihoods=GOOD.log_likelihoods + 1e6),
    "tiny": replace(GOOD, log_likelihoods=GOOD.log_likelihoods - 1e6),
    "impossible": replace(GOOD, log_likelihoods=np.full(6, -np.inf), log_floor=-np.inf),
    "no heading": replace(GOOD, kappa=np.zeros(6)),
    "heading to a hair": replace(GOOD, kappa=np.full(6, 1e6)),
    "far": replace(GOOD, poses=GOOD.poses + np.array([1e4, 0.0, 0.0]), log_floor=-np.inf),
}


@settings(max_examples=60, deadline=None)
@given(st.lists(st.sampled_from(sorted(EXTREMES)), min_size=1, max_size=5))
def test_entropies_stay_finite_whatever_the_views_say(names: list[str]) -> None:
    views = ViewEvidence.of([EXTREMES[name] for name in names], some_poses(len(names), 3))
    selection, belief = LeastEntropy(views), some_belief(12)
    entropies = selection.entropies(belief, ACTIONS)
    assert np.isfinite(entropies).all()
    assert (entropies >= -1e-9).all()
    assert (entropies <= np.log(12.0) + 1e-9).all()
    assert 0 <= selection.choose(belief, ACTIONS) < len(ACTIONS)
    np.testing.assert_allclose(selection.probabilities(belief.poses).sum(axis=1), 1.0)


def test_views_that_say_nothing_leave_the_doubt_as_it_is() -> None:
    selection = LeastEntropy(ViewEvidence.of([Evidence.blind()] * 3, some_poses(3, 0)))
    belief = WeightedPoses.uniform(some_poses(10, 1))
    np.testing.assert_allclose(selection.entropies(belief, ACTIONS), np.log(10.0))


@pytest.mark.parametrize("make", [ParticleFilter, MarkovGrid])
def test_beliefs_of_filters_are_taken_as_they_are(make: type[ParticleFilter | MarkovGrid]) -> None:
    estimator = make()
    estimator.reset(MAP, np.random.default_rng(0))
    selection = LeastEntropy(
        ViewEvidence.of([evidence_for(MAP, pose) for pose in some_poses(20, 0)], some_poses(20, 0))
    )
    anywhere = selection.entropies(estimator.belief, ACTIONS)
    for _ in range(3):
        estimator.update(GOOD)
    assert selection.entropies(estimator.belief, ACTIONS).max() < 0.8 * anywhere.min()


# --- cells ----------------------------------------------------------------------------------------------------------


def test_cells_keep_weight_and_mean() -> None:
    poses = np.array([(0.1, 0.1, 3.1), (0.2, 0.1, 3.0), (0.3, 0.1, 3.1), (0.1, 0.1, -3.1)])
    belief = WeightedPoses(poses, np.log([1.0, 3.0, 2.0, 2.0]))
    cells = merged(belief, 0.25, 15.0, 10)
    rows = np.column_stack([cells.poses, cells.weights])
    expected = [(0.1, 0.1, -3.1, 0.25), (0.175, 0.1, 3.025, 0.5), (0.3, 0.1, 3.1, 0.25)]
    np.testing.assert_allclose(rows[np.lexsort(rows.T[[2, 0]])], np.array(expected)[[0, 1, 2]], atol=1e-3)


def test_cells_without_weight_are_left_out() -> None:
    belief = WeightedPoses(np.array([(0.1, 0.1, 0.1), (9.0, 9.0, 0.1)]), np.array([0.0, -np.inf]))
    np.testing.assert_allclose(merged(belief, 0.25, 15.0, 10).poses, [(0.1, 0.1, 0.1)])


@pytest.mark.parametrize("most", [20, 100, 500])
def test_a_belief_of_many_cells_is_thinned_and_keeps_its_shape(most: int) -> None:
    belief = some_belief(5000)
    thinned = merged(belief, 0.25, 15.0, most)
    assert len(thinned.poses) <= most
    assert thinned.weights.sum() == pytest.approx(1.0)
    x = belief.poses[:, 0]
    mean, spread = belief.weights @ x, np.sqrt(belief.weights @ (x - belief.weights @ x) ** 2)
    # draws at equal distances along cells that are sorted by x, 3 m wide in all
    assert abs(thinned.weights @ thinned.poses[:, 0] - mean) < 0.1 * spread + 3.0 / most
    assert np.array_equal(thinned.poses, merged(belief, 0.25, 15.0, most).poses)  # nothing is left to chance


def test_only_the_likeliest_hypotheses_of_a_view_count() -> None:
    evidences, poses = some_views()
    kept = []
    for one in evidences:
        best = np.sort(np.argsort(-one.log_likelihoods)[:2])
        names = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
        kept.append(replace(one, **{name: getattr(one, name)[best] for name in names}))
    two = LeastEntropy(ViewEvidence.of(evidences, poses), LeastEntropy.Config(neighbours=2))
    cameras = some_poses(5, 4)
    weights = ViewEvidence.of(evidences, poses).weights
    same = LeastEntropy(replace(ViewEvidence.of(kept, poses), weights=weights))
    np.testing.assert_allclose(two.probabilities(cameras), same.probabilities(cameras), rtol=1e-12)
    assert not np.allclose(two.probabilities(cameras), SELECTION.probabilities(cameras))


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"cell_m": 0.0}, "cell_m must be positive"),
        ({"cell_m": np.inf}, "cell_m must be positive"),
        ({"cell_deg": 400.0}, "cell_deg lie above 0"),
        ({"most_cells": 1}, "most_cells is 1"),
        ({"neighbours": 0}, "neighbours is 0"),
    ],
)
def test_settings_that_cannot_work_are_refused(setting: dict[str, float], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        LeastEntropy.Config(**setting)  # type: ignore[arg-type]
