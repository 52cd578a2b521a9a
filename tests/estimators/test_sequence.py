from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.baselines import BestMatch
from estimators.gaussian import ANY_HEADING
from estimators.sequence import SequenceMatching, SequenceMatchingConfig
from topoloc.estimate import estimate_from, mean_and_covariance, node_masses
from topoloc.geometry import compose, rotate, wrap
from topoloc.interfaces import Estimator
from topoloc.testing import check_estimator, evidence_for, toy_map
from topoloc.types import Evidence, Motion, WeightedPoses

MAP = toy_map()
STEP = Motion(np.array([0.4, 0.05, 0.3]), np.diag([0.002, 0.002, 0.003]))
NAMES = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")


def started(config: SequenceMatchingConfig | None = None, prior: WeightedPoses | None = None) -> SequenceMatching:
    sequence = SequenceMatching(config)
    sequence.reset(MAP, np.random.default_rng(0), prior)
    return sequence


def random_look(seed: int) -> Evidence:
    """Evidence near a random pose, each node's hypothesis with a heading of its own."""
    rng = np.random.default_rng(seed)
    evidence = evidence_for(MAP, (*rng.uniform(0.0, 1.5, 2), rng.uniform(-3.0, 3.0)))
    turn = rng.normal(0.0, 0.5, len(evidence.poses))
    return replace(evidence, poses=np.column_stack([evidence.poses[:, :2], wrap(evidence.poses[:, 2] + turn)]))


def driven(sequence: Estimator, looks: list[Evidence], motion: Motion = STEP) -> Estimator:
    for number, look in enumerate(looks):
        if number:
            sequence.predict(motion)
        sequence.update(look)
    return sequence


def test_contract() -> None:
    check_estimator(SequenceMatching)


# --- the score, candidate by candidate and look by look -------------------------------------------------------------


def literal_led_back(pose: tuple[float, float, float], motion: np.ndarray) -> tuple[float, float, float]:
    """The pose before a motion that led to ``pose``."""
    heading = pose[2] - motion[2]
    x = pose[0] - math.cos(heading) * motion[0] + math.sin(heading) * motion[1]
    y = pose[1] - math.sin(heading) * motion[0] - math.cos(heading) * motion[1]
    return x, y, heading


def literal_scores(looks: list[Evidence], motion: np.ndarray, length: int, memory: float) -> list[float]:
    scores = []
    for x, y, heading in looks[-1].poses:
        pose, score = (float(x), float(y), float(heading)), 0.0
        for age, look in enumerate(looks[::-1][:length]):
            score += memory**age * look.log_likelihood([pose[:2]], [[pose[2]]]).item()
            pose = literal_led_back(pose, motion)
        scores.append(score)
    return scores


@pytest.mark.parametrize(("length", "memory"), [(10, 0.9), (3, 0.5), (1, 1.0)])
def test_scores_equal_literal_loops(length: int, memory: float) -> None:
    looks = [random_look(seed) for seed in range(6)]
    belief = driven(started(SequenceMatchingConfig(looks=length, memory=memory, candidates=4)), looks).belief
    best = np.argsort(-looks[-1].match)[:4]
    np.testing.assert_array_equal(belief.poses, looks[-1].poses[best])
    scores = literal_scores(looks, STEP.delta, length, memory)
    np.testing.assert_allclose(belief.log_weights, np.array(scores)[best], atol=1e-9)


def test_log_evidence_is_what_the_last_candidates_foretold() -> None:
    first, second = random_look(1), random_look(2)
    sequence = started()
    assert sequence.update(first) is None  # nothing foretold the first look
    before = sequence.belief
    sequence.predict(STEP)
    expected = 0.0
    for weight, pose in zip(before.weights, before.poses, strict=True):
        carried = compose(pose, STEP.delta)
        expected += weight * math.exp(second.log_likelihood([carried[:2]], [[carried[2]]]).item())
    assert sequence.update(second) == pytest.approx(math.log(expected))


# --- what it is for, and what it cannot do --------------------------------------------------------------------------


def alike(evidence: Evidence, first: int, second: int) -> Evidence:
    """Two nodes that look the same: the second as the first does."""
    look: dict[str, np.ndarray] = {name: getattr(evidence, name).copy() for name in ("match", "log_likelihoods")}
    for values in look.values():
        values[second] = values[first] + 0.01
    return replace(evidence, match=look["match"], log_likelihoods=look["log_likelihoods"])


def test_the_way_here_tells_look_alikes_apart() -> None:
    """Nodes 0 and 5 look alike, 5 a little better; two metres straight back from 0 lies node 4, from 5 no node."""
    looks = [alike(evidence_for(MAP, (x, 0.0, -np.pi)), 0, 5) for x in (2.0, 1.5, 1.0, 0.5, 0.0)]
    straight = Motion(np.array([0.5, 0.0, 0.0]), np.diag([0.002, 0.002, 0.003]))
    best = BestMatch()
    best.reset(MAP, np.random.default_rng(0))
    assert estimate_from(driven(best, looks, straight).belief, MAP).node == 5
    assert node_masses(driven(started(), looks, straight).belief, MAP)[0] > 0.9


def test_after_a_whole_sequence_a_kidnapping_is_forgotten() -> None:
    """Looks before the window leave nothing behind: the belief is that of a fresh start."""
    elsewhere, here = [random_look(seed) for seed in range(5)], [random_look(seed) for seed in range(20, 24)]
    config = SequenceMatchingConfig(looks=4)
    kidnapped, fresh = driven(started(config), elsewhere + here), driven(started(config), here)
    np.testing.assert_allclose(kidnapped.belief.log_weights, fresh.belief.log_weights, atol=1e-9)


@pytest.mark.parametrize("heading", [0.0, 0.3, np.pi])
def test_a_heading_is_found_by_driving_where_none_is_seen(heading: float) -> None:
    floor = toy_map(5, 3)
    robot = np.array([2.0 - 1.6 * np.cos(heading), 1.0 - 1.6 * np.sin(heading), heading])
    sequence = SequenceMatching()
    sequence.reset(floor, np.random.default_rng(0))
    for _ in range(9):
        sequence.update(evidence_for(floor, robot, heading_known=False))
        pose = estimate_from(sequence.belief, floor).pose
        assert np.linalg.norm(pose[:2] - robot[:2]) < 0.71  # half a diagonal of the nodes' grid
        robot = compose(robot, (0.4, 0.0, 0.0))
        sequence.predict(Motion(np.array([0.4, 0.0, 0.0]), np.diag([0.002, 0.002, 0.003])))
    # half of the 15 degrees between candidates, and 0.7 m from robot to node over a way of 3.2 m: 20 degrees
    assert abs(wrap(estimate_from(sequence.belief, floor).pose[2] - heading)) < np.deg2rad(20.0)


def test_unknown_headings_are_tried_all_around() -> None:
    evidence = replace(random_look(3), kappa=np.array([20.0, 0.0, 20.0, 0.0, 20.0, 20.0]))
    sequence = started(SequenceMatchingConfig(headings=4))
    sequence.update(evidence)
    poses = sequence.belief.poses
    assert len(poses) == 4 + 2 * 4
    at_one = poses[(poses[:, :2] == evidence.poses[1, :2]).all(axis=1), 2]
    around = wrap(evidence.poses[1, 2] + np.arange(4) * np.pi / 2.0)
    np.testing.assert_allclose(np.sort(at_one), np.sort(around))


# --- laws -----------------------------------------------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(st.lists(st.integers(0, 30), min_size=2, max_size=5), st.integers(1, 3))
def test_a_blind_frame_only_adds_its_motion(seeds: list[int], blind: int) -> None:
    looks = [random_look(seed) for seed in seeds]
    plain, interrupted = started(), started()
    whole = np.zeros(3)
    for _ in range(blind + 1):
        whole = compose(whole, STEP.delta)
    driven(plain, looks, Motion(whole, STEP.covariance))
    for number, look in enumerate(looks):
        if number:
            interrupted.predict(STEP)
            for _ in range(blind):
                assert interrupted.update(Evidence.blind()) is None
                interrupted.predict(STEP)
        interrupted.update(look)
    np.testing.assert_allclose(interrupted.belief.poses, plain.belief.poses, atol=1e-9)
    np.testing.assert_allclose(interrupted.belief.log_weights, plain.belief.log_weights, atol=1e-7)


def test_between_looks_the_candidates_ride_on_the_odometry() -> None:
    sequence = started()
    sequence.update(random_look(4))
    before = sequence.belief
    for _ in range(3):
        sequence.predict(STEP)
        sequence.update(Evidence.blind())
    expected = before.poses
    for _ in range(3):
        expected = compose(expected, STEP.delta)
    np.testing.assert_allclose(sequence.belief.poses, expected, atol=1e-12)
    np.testing.assert_array_equal(sequence.belief.log_weights, before.log_weights)


@settings(max_examples=30, deadline=None)
@given(st.permutations(range(6)))
def test_order_of_hypotheses_does_not_matter(order: list[int]) -> None:
    looks = [random_look(seed) for seed in range(4)]
    shuffled = [replace(look, **{name: getattr(look, name)[order] for name in NAMES}) for look in looks]
    plain, other = driven(started(), looks).belief, driven(started(), shuffled).belief
    np.testing.assert_array_equal(other.poses, plain.poses)
    np.testing.assert_allclose(other.log_weights, plain.log_weights, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(st.floats(-7.0, 7.0), st.tuples(st.floats(-20, 20), st.floats(-20, 20)), st.booleans())
def test_turning_the_world_turns_the_belief(angle: float, shift: tuple[float, float], headings_known: bool) -> None:
    looks = [random_look(seed) for seed in range(4)]
    if not headings_known:
        looks = [replace(look, kappa=np.zeros(6)) for look in looks]

    def moved(poses: np.ndarray) -> np.ndarray:
        return np.column_stack([rotate(poses[:, :2], angle) + shift, wrap(poses[:, 2] + angle)])

    plain = driven(started(), looks).belief
    other = driven(started(), [replace(look, poses=moved(look.poses)) for look in looks]).belief
    difference = other.poses - moved(plain.poses)
    np.testing.assert_allclose(np.column_stack([difference[:, :2], wrap(difference[:, 2])]), 0.0, atol=1e-9)
    np.testing.assert_allclose(other.log_weights, plain.log_weights, atol=1e-6)


def test_a_frame_possible_nowhere_changes_nothing_and_is_not_remembered() -> None:
    looks = [random_look(seed) for seed in range(3)]
    impossible = replace(looks[0], log_likelihoods=np.full(6, -np.inf), log_floor=-np.inf)
    plain, troubled = driven(started(), looks[:2]), driven(started(), looks[:2])
    assert troubled.update(impossible) == -np.inf
    np.testing.assert_array_equal(troubled.belief.log_weights, plain.belief.log_weights)
    for sequence in (plain, troubled):
        sequence.predict(STEP)
        sequence.update(looks[2])
    np.testing.assert_array_equal(troubled.belief.log_weights, plain.belief.log_weights)


def test_a_prior_is_the_belief_until_the_first_look() -> None:
    prior = WeightedPoses(np.array([[1.0, 1.0, 0.3], [0.0, 0.0, -2.0]]), np.log([0.7, 0.3]), np.array([0.1, 0.1, 0.2]))
    sequence = started(prior=prior)
    assert sequence.belief is prior
    sequence.predict(STEP)
    np.testing.assert_allclose(sequence.belief.poses, compose(prior.poses, STEP.delta))
    log_evidence = sequence.update(random_look(5))
    assert log_evidence is not None and math.isfinite(log_evidence)
    fresh = started()
    fresh.update(random_look(5))
    np.testing.assert_array_equal(sequence.belief.log_weights, fresh.belief.log_weights)


def test_before_the_first_look_motions_lead_from_nowhere() -> None:
    sequence = started()
    sequence.predict(STEP)
    assert len(sequence.belief.poses) == 4 * 6
    np.testing.assert_allclose(np.unique(sequence.belief.poses[:, :2], axis=0), MAP.positions)


def test_the_belief_is_as_wide_as_its_candidates() -> None:
    falling = np.linspace(0.9, 0.4, 6)
    kappa = np.array([0.0, 10, 20, 30, 40, 0.001])
    evidence = replace(random_look(6), match=falling, sigma=np.linspace(0.2, 0.7, 6), kappa=kappa)
    sequence = started()
    sequence.update(evidence)
    weights = sequence.belief.weights  # of 24 copies of the first hypothesis, then of the others
    by_hypothesis = np.array([weights[:24].sum(), *weights[24:]])
    cell = np.deg2rad(15.0) ** 2 / 12.0
    heading = by_hypothesis @ np.array([cell, 0.1, 0.05, 1 / 30, 0.025, ANY_HEADING])
    np.testing.assert_allclose(sequence.belief.spread, [*[by_hypothesis @ evidence.sigma**2] * 2, heading])
    assert np.isfinite(mean_and_covariance(sequence.belief.poses, weights, sequence.belief.spread)[1]).all()


@pytest.mark.parametrize(
    ("setting", "value"), [("looks", 0), ("memory", 0.0), ("memory", 1.1), ("candidates", 0), ("headings", 0)]
)
def test_settings_that_cannot_work_are_refused(setting: str, value: float) -> None:
    with pytest.raises(ValueError, match=f"{setting} is"):
        SequenceMatchingConfig(**{setting: value})  # type: ignore[arg-type]
