from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from estimators.auxiliary import PROPOSALS, AuxiliaryParticleFilter, FullyAdapted, Proposal
from estimators.free_area import FreeArea
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter
from estimators.resampling import multinomial
from topoloc.estimate import mean_and_covariance, node_masses
from topoloc.geometry import between, compose, wrap
from topoloc.interfaces import Estimator
from topoloc.nearby import Nearby
from topoloc.odometry import OdometryNoise
from topoloc.testing import check_estimator, evidence_for, toy_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

MAP = toy_map()
STILL = Motion(np.zeros(3), np.diag([4e-4, 4e-4, 1e-4]))
LINE = np.outer([0.1, -0.05, 0.02], [0.1, -0.05, 0.02])
COVARIANCES = {
    "regular": LINE + np.diag([0.04, 0.01, 0.03]),
    "singular": LINE,
    "heading only": np.diag([0.0, 0.0, 0.05]),
    "zero": np.zeros((3, 3)),
}
DELTA = np.array([0.4, -0.1, 0.7])
ADAPTATIONS = sorted(PROPOSALS)


def filter_on(prior: WeightedPoses | None = None, seed: int = 0, **chosen: Any) -> AuxiliaryParticleFilter:
    estimator = AuxiliaryParticleFilter(AuxiliaryParticleFilter.Config(**chosen))
    estimator.reset(MAP, np.random.default_rng(seed), prior)
    return estimator


def evidence_of(poses: Any, log_likelihoods: Any, sigma: Any, kappa: Any, log_floor: float = -2.0) -> Evidence:
    count = len(poses)
    half = np.full(count, 0.5)
    return Evidence(
        np.asarray(poses),
        np.zeros(count, dtype=np.int64),
        half,
        half,
        np.broadcast_to(log_likelihoods, count),
        np.broadcast_to(sigma, count),
        np.broadcast_to(kappa, count),
        log_floor,
    )


# --- the fully adapted proposal, particle by particle ---------------------------------------------------------------


def case(seed: int) -> tuple[np.ndarray, Evidence]:
    """Particles (7, 3) and evidence of four hypotheses, the last without a heading."""
    rng = np.random.default_rng(seed)
    around = np.array([2.0, 2.0, np.pi])
    kappa = [8.0, 20.0, 300.0, 0.0]
    hypotheses = rng.uniform(-around, around, (4, 3))
    return rng.uniform(-around, around, (7, 3)), evidence_of(
        hypotheses, rng.normal(size=4), rng.uniform(0.1, 0.8, 4), kappa
    )


def literal_product(
    pose: np.ndarray, covariance: np.ndarray, evidence: Evidence, j: int
) -> tuple[float, np.ndarray, np.ndarray]:
    """Log of lambda_j N(x_i + u; x_j, Q + H), and the product's mean and covariance, in the map's frame."""
    c, s = np.cos(pose[2]), np.sin(pose[2])
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    spread, predicted = turn @ covariance @ turn.T, pose + turn @ DELTA
    sigma, kappa = float(evidence.sigma[j]), float(evidence.kappa[j])
    rows = 2 if kappa == 0.0 else 3
    noise = np.diag([sigma**2, sigma**2, 1.0 / kappa if kappa else 1.0])[:rows, :rows]
    off = evidence.poses[j] - predicted
    off[2] = (off[2] + np.pi) % (2.0 * np.pi) - np.pi
    total = spread[:rows, :rows] + noise
    log_density = -0.5 * (off[:rows] @ np.linalg.inv(total) @ off[:rows] + np.log(np.linalg.det(2.0 * np.pi * total)))
    log_lambda = evidence.log_likelihoods[j] + np.log(2.0 * np.pi * sigma**2 * (2.0 * np.pi if kappa else 1.0))
    gain = spread[:, :rows] @ np.linalg.inv(total)
    mean, product = predicted + gain @ off[:rows], spread - gain @ spread[:rows]
    return float(log_lambda + log_density), mean, product


@pytest.mark.parametrize("name", COVARIANCES)
@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_masses_are_the_literal_ones(name: str, seed: int) -> None:
    poses, evidence = case(seed)
    proposal = FullyAdapted(poses, Motion(DELTA, COVARIANCES[name]), evidence)
    literal = np.array([[literal_product(pose, COVARIANCES[name], evidence, j)[0] for j in range(4)] for pose in poses])
    np.testing.assert_allclose(proposal.log_masses[:, :4], literal, rtol=1e-9, atol=1e-9)
    assert (proposal.log_masses[:, 4] == evidence.log_floor).all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10_000))
def test_the_product_is_that_of_the_explicit_inverses(seed: int) -> None:
    # Q regular, so that C = (Q^-1 + H^-1)^-1 can be taken at its word; the gain form must come to the same
    poses, evidence = case(seed)
    covariance = COVARIANCES["regular"]
    gains = FullyAdapted(poses, Motion(DELTA, covariance), evidence).gains
    for j in range(4):
        sharpness = np.diag([evidence.sigma[j] ** -2, evidence.sigma[j] ** -2, evidence.kappa[j]])
        product = np.linalg.inv(np.linalg.inv(covariance) + sharpness)
        np.testing.assert_allclose(covariance - gains[j] @ covariance, product, atol=1e-12)
        np.testing.assert_allclose(gains[j], product @ sharpness, atol=1e-12)
    assert (gains[4] == 0.0).all()


@pytest.mark.parametrize("name", COVARIANCES)
@pytest.mark.parametrize("j", range(4))
def test_draws_have_the_literal_moments(name: str, j: int) -> None:
    poses, evidence = case(3)
    count = 20_000
    proposal = FullyAdapted(poses, Motion(DELTA, COVARIANCES[name]), evidence)
    drawn, _ = proposal.draw(np.full(count, 2), np.full(count, j), np.random.default_rng(j))
    _, mean, covariance = literal_product(poses[2], COVARIANCES[name], evidence, j)
    deviation = np.column_stack([drawn[:, :2] - mean[:2], wrap(drawn[:, 2] - mean[2])])
    sd = np.sqrt(np.diag(covariance).clip(min=0.0))
    # 5 standard errors: sd / sqrt(n) of a mean, at most sqrt(2 / n) times the product of both sds of a covariance
    assert (np.abs(deviation.mean(axis=0)) <= 5.0 * sd / np.sqrt(count) + 1e-7).all()
    scatter = 5.0 * np.sqrt(2.0 / count) * np.outer(sd, sd)
    assert (np.abs(deviation.T @ deviation / count - covariance) <= scatter + 1e-9).all()


def test_the_floors_particles_move_as_the_motion_says() -> None:
    poses, evidence = case(5)
    motion, count = Motion(DELTA, COVARIANCES["regular"]), 20_000
    floor = np.full(count, 4)
    drawn, log_corrections = FullyAdapted(poses, motion, evidence).draw(
        np.zeros(count, dtype=np.int64), floor, np.random.default_rng(1)
    )
    mean, covariance = mean_and_covariance(between(poses[0], drawn), np.ones(count), np.zeros(3))
    # 5 standard errors, as above
    np.testing.assert_allclose(mean, DELTA, atol=5.0 * 0.25 / np.sqrt(count))
    np.testing.assert_allclose(covariance, motion.covariance, atol=5.0 * np.sqrt(2.0 / count) * 0.06)
    assert (log_corrections == 0.0).all()


@pytest.mark.parametrize("name", ADAPTATIONS)
def test_without_noise_particles_go_where_the_motion_says(name: str) -> None:
    poses, evidence = case(6)
    motion = Motion(DELTA, np.zeros((3, 3)))
    proposal = PROPOSALS[name](poses, motion, evidence)
    drawn, log_corrections = chosen_draws(proposal, np.full(7, 1 / 7), 200, np.random.default_rng(0))[:2]
    reached = compose(poses, DELTA)
    assert np.abs(drawn[:, None] - reached).max(axis=2).min(axis=1).max() < 1e-9
    assert np.isfinite(log_corrections).all()


@settings(max_examples=15, deadline=None)
@given(st.permutations(range(4)))
def test_order_of_hypotheses_orders_the_branches_only(order: list[int]) -> None:
    poses, evidence = case(8)
    names = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
    shuffled = replace(evidence, **{name: getattr(evidence, name)[order] for name in names})
    motion = Motion(DELTA, COVARIANCES["regular"])
    plain, other = FullyAdapted(poses, motion, evidence), FullyAdapted(poses, motion, shuffled)
    np.testing.assert_allclose(other.log_masses, plain.log_masses[:, [*order, 4]], atol=1e-12)
    np.testing.assert_allclose(other.gains, plain.gains[[*order, 4]], atol=1e-14)


@settings(max_examples=15, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_masses_and_draws_turn_with_the_world(angle: float, x: float, y: float) -> None:
    poses, evidence = case(9)
    motion, world = Motion(DELTA, COVARIANCES["regular"]), np.array([x, y, angle])
    turned = replace(evidence, poses=compose(world, evidence.poses))
    plain, other = FullyAdapted(poses, motion, evidence), FullyAdapted(compose(world, poses), motion, turned)
    np.testing.assert_allclose(other.log_masses, plain.log_masses, atol=1e-8)
    particles, branches = np.divmod(np.arange(35), 5)
    drawn, other_drawn = (each.draw(particles, branches, np.random.default_rng(2))[0] for each in (plain, other))
    moved = compose(world, drawn)
    np.testing.assert_allclose(other_drawn[:, :2], moved[:, :2], atol=1e-9)
    np.testing.assert_allclose(wrap(other_drawn[:, 2] - moved[:, 2]), 0.0, atol=1e-9)


def on_a_wide_map(seed: int, log_floor: float = -4.0) -> tuple[np.ndarray, Evidence]:
    """Particles, most of them near the middle, and evidence of 400 hypotheses a metre apart."""
    rng = np.random.default_rng(seed)
    x, y = np.meshgrid(np.arange(20.0), np.arange(20.0))
    hypotheses = np.column_stack([x.ravel(), y.ravel(), rng.uniform(-np.pi, np.pi, 400)])
    poses = np.column_stack([rng.normal(10.0, 0.5, (80, 2)), rng.uniform(-np.pi, np.pi, 80)])
    poses[:20, :2] = rng.uniform(-3.0, 23.0, (20, 2))
    poses[0, :2] = 1e4
    sigma, kappa = rng.uniform(0.1, 0.3, 400), rng.choice([0.0, 8.0, 200.0], 400)
    return poses, evidence_of(hypotheses, rng.normal(-1.0, 2.0, 400), sigma, kappa, log_floor)


@pytest.mark.parametrize("name", COVARIANCES)
def test_branches_out_of_reach_are_left_out_and_no_others(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    motion = Motion(DELTA, COVARIANCES[name])
    for seed in range(3):
        poses, evidence = on_a_wide_map(seed)
        few = FullyAdapted(poses, motion, evidence)
        with monkeypatch.context() as patch:
            patch.setattr(Nearby, "worthwhile", lambda points, reach: None)
            every = FullyAdapted(poses, motion, evidence)
        assert few.log_masses.shape[1] < every.log_masses.shape[1] == 401
        scattered = np.full(every.log_masses.shape, -np.inf)
        row, column = np.nonzero(few.log_masses > -np.inf)
        scattered[row, few.branches[row, column]] = few.log_masses[row, column]
        assert (few.log_masses > -np.inf).sum() == (scattered > -np.inf).sum()  # none twice
        kept = scattered > -np.inf
        np.testing.assert_allclose(scattered[kept], every.log_masses[kept], rtol=1e-12, atol=1e-12)
        assert np.exp(np.where(kept, -np.inf, every.log_masses)).sum(axis=1).max() < 1e-14 * np.exp(-4.0)


def test_draws_are_the_same_with_and_without_those_out_of_reach() -> None:
    poses, evidence = on_a_wide_map(1)
    motion, count = Motion(DELTA, COVARIANCES["regular"]), 30_000
    weights = np.full(len(poses), 1.0 / len(poses))
    means = []
    for part in (evidence, replace(evidence, log_floor=-np.inf)):  # without a floor all are looked at
        proposal = FullyAdapted(poses[20:], motion, part)
        drawn, corrections, mass = chosen_draws(proposal, weights[20:], count, np.random.default_rng(2))
        if part is evidence:
            near = np.exp(corrections)[:, None] * features(drawn) * mass
            floor = proposal.log_masses[0, -1] + np.log(weights[20:].sum())
            assert proposal.log_masses.shape[1] < 401
        else:
            assert proposal.log_masses.shape[1] == 401
        means.append((mass * np.exp(corrections)[:, None] * features(drawn)).mean(axis=0))
    predicted = compose(poses[20:], DELTA)
    expected = means[1] + np.exp(floor) * features(predicted).mean(axis=0)
    # 5 standard errors of both, and of the heading that the floor's particles scatter by
    tolerance = 5.0 * np.sqrt(2.0) * near.std(axis=0) / np.sqrt(count) + 0.05 * np.exp(floor)
    assert (np.abs(means[0] - expected) < tolerance).all()


# --- both proposals draw from prediction times Evidence.log_likelihood ----------------------------------------------


def chosen_draws(
    proposal: Proposal, weights: np.ndarray, count: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray, float]:
    """Draws (n, 3), their log corrections (n,), and the sum of the masses."""
    masses = weights[:, None] * np.exp(proposal.log_masses)
    particles, branches = np.divmod(multinomial(masses.ravel(), count, rng), masses.shape[1])
    drawn, log_corrections = proposal.draw(particles, branches, rng)
    return drawn, log_corrections, float(masses.sum())


def features(poses: np.ndarray) -> np.ndarray:
    """(n, 5) whose means tell posteriors apart."""
    return np.column_stack([np.ones(len(poses)), poses[:, :2], np.cos(poses[:, 2]), np.sin(poses[:, 2])])


def integrated(poses: np.ndarray, weights: np.ndarray, motion: Motion, evidence: Evidence) -> np.ndarray:
    """Integral (5,) of the features over prediction times likelihood, on a fine grid of the motion's noise."""
    axes = [np.linspace(-5.0, 5.0, steps) for steps in (21, 21, 121)]  # headings fine enough for a sharp kappa
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
    density = np.exp(-0.5 * (grid**2).sum(axis=1))
    noise = grid @ np.linalg.cholesky(motion.covariance).T
    total = np.zeros(5)
    for pose, weight in zip(poses, weights, strict=True):
        reached = compose(pose, motion.delta + noise)
        likelihood = np.exp(evidence.log_likelihood(reached[:, :2], reached[:, 2:])[:, 0])
        total += weight * (density / density.sum() * likelihood) @ features(reached)
    return total


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
@pytest.mark.parametrize(
    ("kappa", "heading_sd"),
    [(0.0, 0.2), (0.5, 0.3), (1.0, 0.1), (1.0, 1.5), (3.0, 0.3), (8.0, 0.6), (20.0, 0.2), (20.0, 3.0), (200.0, 0.1)],
)
def test_draws_are_those_of_the_integral(adaptation: str, kappa: float, heading_sd: float) -> None:
    motion = Motion(DELTA, np.outer([0.1, 0.02, 0.05], [0.1, 0.02, 0.05]) + np.diag([0.03, 0.02, heading_sd**2]))
    poses, weights = np.array([[0.0, 0.0, 0.3], [0.4, 0.1, -0.4], [-0.3, 0.2, 3.0]]), np.array([0.5, 0.3, 0.2])
    hypotheses = np.array([[0.4, 0.2, 1.2], [0.7, -0.1, -0.6], [-0.5, 0.3, -2.0]])
    evidence = evidence_of(hypotheses, [0.3, 0.0, -0.2], 0.35, kappa, -3.0)
    proposal = PROPOSALS[adaptation](poses, motion, evidence)
    count = 20_000
    drawn, log_corrections, mass = chosen_draws(proposal, weights, count, np.random.default_rng(4))
    terms = mass * np.exp(log_corrections)[:, None] * features(drawn)
    # 5 standard errors as measured; the grid's own error is below 1e-3 of the evidence
    expected = integrated(poses, weights, motion, evidence)
    tolerance = 5.0 * terms.std(axis=0) / np.sqrt(count) + 1e-3 * expected[0]
    assert (np.abs(terms.mean(axis=0) - expected) < tolerance).all()


@pytest.mark.parametrize(("kappa", "tolerance"), [(0.0, 1e-4), (200.0, 2e-3), (1000.0, 5e-4)])
def test_the_sum_of_masses_is_the_evidence(kappa: float, tolerance: float) -> None:
    # for a sharp kappa without any correction; von Mises against Gaussian: 1 / (8 kappa) at the peak
    poses, weights = np.array([[0.0, 0.0, 0.3], [0.4, 0.1, -0.4]]), np.array([0.7, 0.3])
    motion = Motion(DELTA, np.diag([0.02, 0.01, 0.01]))
    hypotheses = np.array([[0.5, 0.1, 1.1], [0.7, -0.1, 0.4]])
    evidence = evidence_of(hypotheses, [0.3, 0.0], 0.35, kappa, -3.0)
    mass = float(weights @ np.exp(FullyAdapted(poses, motion, evidence).log_masses).sum(axis=1))
    assert mass == pytest.approx(integrated(poses, weights, motion, evidence)[0], rel=tolerance)


def test_equal_weights_for_sharp_evidence() -> None:
    # 1000 particles around the truth: the corrections are all there is to tell the weights apart
    particles = filter_on(WeightedPoses.uniform([[1.0, 0.5, 0.4]], [0.02, 0.02, 0.01]))
    particles.predict(Motion(np.zeros(3), np.diag([0.02, 0.02, 0.01])))
    particles.update(evidence_of([[1.1, 0.5, 0.5]], 2.0, 0.2, 1000.0))
    alive = particles.belief.weights[particles.belief.weights > 0.0]
    assert alive.std() < 0.01 * alive.mean()


# --- the lazy motion ------------------------------------------------------------------------------------------------


def moments(belief: WeightedPoses) -> tuple[np.ndarray, np.ndarray]:
    return mean_and_covariance(belief.poses, belief.weights, belief.spread)


def test_until_the_update_the_belief_is_the_predicted_means() -> None:
    for adaptation in ADAPTATIONS:
        particles = filter_on(adaptation=adaptation)
        particles.update(evidence_for(MAP, (1.0, 1.0, 0.5)))
        before = particles.belief
        particles.predict(Motion(DELTA, COVARIANCES["regular"]))
        assert np.array_equal(particles.belief.poses, compose(before.poses, DELTA))
        assert np.array_equal(particles.belief.log_weights, before.log_weights)


NOTHING_SEEN = {
    "blind": Evidence.blind(),
    "floor only": evidence_of([[0.0, 0.0, 0.0]], -np.inf, 0.4, 20.0),
    "impossible": evidence_of([[0.0, 0.0, 0.0]], -np.inf, 0.4, 20.0, -np.inf),
}


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
@pytest.mark.parametrize("steps", [1, 2, 3])
@pytest.mark.parametrize("seen", NOTHING_SEEN)
def test_noise_is_neither_lost_nor_doubled(adaptation: str, steps: int, seen: str) -> None:
    # along a straight line, so that the covariances add up
    count = 20_000
    motion = Motion(np.array([0.3, 0.05, 0.0]), np.diag([0.003, 0.001, 0.0]))
    particles = filter_on(WeightedPoses.uniform([[0.5, 0.5, 0.0]]), particles=count, adaptation=adaptation)
    for _ in range(steps):
        particles.predict(motion)
    for _ in range(2):
        particles.update(NOTHING_SEEN[seen])
    mean, covariance = moments(particles.belief)
    # 5 standard errors: sd / sqrt(n) of a mean, sqrt(2 / n) of a variance
    expected = steps * motion.covariance
    np.testing.assert_allclose(mean[:2], [0.5 + 0.3 * steps, 0.5 + 0.05 * steps], atol=5.0 * np.sqrt(0.009 / count))
    assert (np.abs(covariance - expected) < 5.0 * np.sqrt(2.0 / count) * expected.max() + 1e-12).all()


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_two_motions_and_an_update_are_the_kalman_filters(adaptation: str) -> None:
    # no heading, no recovery, no floor: the posterior of the position is one Gaussian
    count, variance = 20_000, 0.3**2
    first, second = np.diag([0.01, 0.004, 0.0]), np.diag([0.005, 0.02, 0.0])
    particles = filter_on(
        WeightedPoses.uniform([[0.4, 0.4, 0.0]]), particles=count, recovery=0.0, adaptation=adaptation
    )
    particles.predict(Motion(np.array([0.3, 0.0, np.pi / 2.0]), first))
    particles.predict(Motion(np.array([0.1, 0.0, 0.0]), second))  # along y now
    seen, predicted = np.array([0.9, 0.4]), np.array([0.7, 0.5])
    log_evidence = particles.update(evidence_of([[*seen, 0.0]], 0.5, np.sqrt(variance), 0.0, -np.inf))
    prior = np.diag([0.01 + 0.02, 0.004 + 0.005])
    total = prior + variance * np.eye(2)
    gain = prior @ np.linalg.inv(total)
    off = seen - predicted
    expected = 0.5 + np.log(2.0 * np.pi * variance) - 0.5 * off @ np.linalg.inv(total) @ off
    expected -= 0.5 * np.log(np.linalg.det(2.0 * np.pi * total))
    mean, covariance = moments(particles.belief)
    # 20,000 particles scatter by 0.001 m, 0.0002 m^2 and 0.0015
    np.testing.assert_allclose(mean[:2], predicted + gain @ off, atol=0.005)
    np.testing.assert_allclose(covariance[:2, :2], prior - gain @ prior, atol=0.001)
    assert log_evidence == pytest.approx(expected, abs=0.008)


def test_blind_frames_change_nothing_but_the_pending_motion() -> None:
    particles = filter_on()
    particles.update(evidence_for(MAP, (1.0, 1.0, 0.5)))
    before = particles.belief
    assert particles.update(Evidence.blind()) is None
    assert np.array_equal(particles.belief.poses, before.poses)
    assert np.array_equal(particles.belief.log_weights, before.log_weights)


# --- the same posterior as the grid's and the particle filter's -----------------------------------------------------


def look_alikes(pose: np.ndarray) -> Evidence:
    """Evidence for a pose and, as strong, for its look-alike at the other end of the map."""
    here = evidence_for(MAP, pose)
    there = evidence_for(MAP, (2.2 - pose[0], 0.9 * pose[1], pose[2] + 2.0))
    poses = np.concatenate([here.poses, there.poses])
    strength = np.concatenate([here.log_likelihoods, there.log_likelihoods])
    return evidence_of(poses, 0.5 * strength - 0.5, 0.4, 8.0)


def drive(estimator: Estimator) -> tuple[np.ndarray, np.ndarray]:
    """Node masses (6, K) and log evidence (6,) along six motions, two of them without a look."""
    estimator.reset(MAP, np.random.default_rng(11))
    robot, motion = np.array([0.0, 0.0, 0.2]), Motion(np.array([0.25, 0.02, 0.2]), np.diag([0.004, 0.004, 0.006]))
    masses, log_evidence = [], []
    for step in range(8):
        robot = compose(robot, motion.delta)
        estimator.predict(motion)
        if step in (2, 5):
            estimator.update(Evidence.blind())
            continue
        log_evidence.append(estimator.update(look_alikes(robot)))
        masses.append(node_masses(estimator.belief, MAP))
    return np.array(masses), np.array(log_evidence)


@pytest.fixture(scope="module")
def references() -> list[tuple[np.ndarray, np.ndarray]]:
    grid = MarkovGrid(MarkovGrid.Config(resolution_m=0.125, headings=48))
    return [drive(grid), drive(ParticleFilter(ParticleFilter.Config(particles=20_000)))]


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_three_filters_agree(references: list[tuple[np.ndarray, np.ndarray]], adaptation: str) -> None:
    masses, log_evidence = drive(filter_on(particles=20_000, adaptation=adaptation))
    for other_masses, other_evidence in references:
        # masses scatter by 0.05 between seeds, of either filter; the log evidence by 0.05
        assert 0.5 * np.abs(masses - other_masses).sum(axis=1).max() < 0.1
        assert abs(log_evidence.sum() - other_evidence.sum()) < 0.15
    assert 0.3 < masses.max() < 0.95  # informed, and never settled


def joint_of_mixed_prior(prior: np.ndarray, evidence: Evidence, share: float) -> tuple[np.ndarray, np.ndarray, float]:
    """Node masses (K,), mean position (2,) and log evidence of (1 - share) ``prior`` + share even, over fine cells.

    Args:
        prior: mean x, y, heading, and their standard deviations; cut off at the border of the free area.
        evidence: of the frame.
        share: of the free area.
    """
    xs, ys, _ = MAP.free_cells(0.05, 0.75)
    place = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    place = place[FreeArea(MAP, 0.25, 0.75).contains(place)]
    heading = np.linspace(-np.pi, np.pi, 72, endpoint=False)
    likelihood = np.exp(evidence.log_likelihood(place, heading[None]))
    off = (((place - prior[:2]) / prior[3:5]) ** 2).sum(axis=1)[:, None] + (wrap(heading - prior[2]) / prior[5]) ** 2
    tight = np.exp(-0.5 * off)
    joint = ((1.0 - share) * tight / tight.sum() + share / likelihood.size) * likelihood
    there = joint.sum(axis=1)
    masses = np.bincount(MAP.nearest_node(place), weights=there, minlength=len(MAP.nodes))
    return masses / there.sum(), there @ place / there.sum(), float(np.log(there.sum()))


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
@pytest.mark.parametrize("moves", [False, True])
def test_log_evidence_and_posterior_are_those_of_the_mixed_prior(adaptation: str, moves: bool) -> None:
    # the prior's own spread, or the motion's: both parts, the tight one and the recovered one, matter
    evidence = evidence_for(MAP, (2.0, 1.0, 1.0))
    spread = np.array([0.01, 0.01, 0.02])
    masses, _, log_evidence = joint_of_mixed_prior(np.array([0.0, 0.0, 0.0, *np.sqrt(spread)]), evidence, 0.02)
    point = WeightedPoses.uniform([[0.0, 0.0, 0.0]], np.zeros(3) if moves else spread)
    particles = filter_on(point, particles=20_000, recovery=0.02, adaptation=adaptation)
    if moves:
        particles.predict(Motion(np.zeros(3), np.diag(spread)))
    # 20,000 particles scatter by 0.004; the floor's part of what is recovered is left out, 0.003 of the whole
    assert particles.update(evidence) == pytest.approx(log_evidence, abs=0.02)
    assert 0.2 < masses[5] < 0.95
    assert np.abs(node_masses(particles.belief, MAP) - masses).max() < 0.02


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_the_prediction_ends_at_the_border(adaptation: str) -> None:
    # the motion leads to the border and half across it; the evidence lies across it too
    spread = np.array([0.04, 0.04, 0.02])
    seen = evidence_of([[-0.8, 0.2, 0.1], [0.2, 0.0, 0.0]], [2.0, 0.5], 0.3, 20.0, -1.0)
    _, mean, log_evidence = joint_of_mixed_prior(np.array([-0.7, 0.0, 0.0, *np.sqrt(spread)]), seen, 0.2)
    particles = filter_on(
        WeightedPoses.uniform([[0.0, 0.0, 0.0]]), particles=20_000, recovery=0.2, adaptation=adaptation
    )
    particles.predict(Motion(np.array([-0.7, 0.0, 0.0]), np.diag(spread)))
    # 20,000 particles scatter by 0.01 in the evidence and by 0.002 m in the mean
    assert particles.update(seen) == pytest.approx(log_evidence, abs=0.05)
    belief = particles.belief
    np.testing.assert_allclose(moments(belief)[0][:2], mean, atol=0.01)
    assert (belief.poses[belief.weights > 0.0, 0] >= -0.75).all()
    assert 0.2 < (belief.weights > 0.0).mean() < 0.9


# --- after anything, from anywhere ----------------------------------------------------------------------------------

GOOD = evidence_for(MAP, (0.3, 0.1, 0.5))
FAR = GOOD.poses + np.array([1e4, 0.0, 0.0])
EVIDENCES = {
    "good": GOOD,
    "blind": Evidence.blind(),
    "impossible": replace(GOOD, poses=FAR, log_floor=-np.inf),
    "no floor": replace(GOOD, log_floor=-np.inf),
    "nothing but the floor": replace(GOOD, log_likelihoods=np.full(6, -np.inf)),
    "nothing": replace(GOOD, log_likelihoods=np.full(6, -np.inf), log_floor=-np.inf),
    "huge": replace(GOOD, log_likelihoods=GOOD.log_likelihoods + 1e6),
    "huge and far": replace(GOOD, poses=FAR, log_likelihoods=GOOD.log_likelihoods + 1e6),
    "tiny": replace(GOOD, log_likelihoods=GOOD.log_likelihoods - 1e6, log_floor=-np.inf),
    "no heading": replace(GOOD, kappa=np.zeros(6)),
    "hardly a heading": replace(GOOD, kappa=np.full(6, 1e-3), log_floor=-np.inf),
    "heading to a hair": replace(GOOD, kappa=np.full(6, 1e6), log_floor=-np.inf),
    "place to a hair": replace(GOOD, sigma=np.full(6, 1e-6), log_floor=-np.inf),
}
MOTIONS = {
    "calm": Motion(np.array([0.3, 0.0, 0.1]), np.diag([1e-3, 1e-3, 1e-3])),
    "exact": Motion(np.array([0.07, -0.02, 3.0]), np.zeros((3, 3))),
    "singular": Motion(DELTA, LINE),
    "unknown": OdometryNoise().unknown(),
    "far": Motion(np.array([40.0, 0.0, 0.0]), np.diag([1e-3, 1e-3, 1e-3])),
    "wild": Motion(np.zeros(3), np.diag([1e4, 1e4, 1e4])),
}


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_contract(adaptation: Any) -> None:
    check_estimator(lambda: AuxiliaryParticleFilter(AuxiliaryParticleFilter.Config(adaptation=adaptation)))


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(sorted(MOTIONS)), st.sampled_from(sorted(EVIDENCES))), max_size=8))
def test_belief_sums_to_one_after_anything(adaptation: str, drive: list[tuple[str, str]]) -> None:
    particles = filter_on(particles=100, adaptation=adaptation)
    for motion, evidence in drive:
        particles.predict(MOTIONS[motion])
        log_evidence = particles.update(EVIDENCES[evidence])
        assert (log_evidence is None) == (evidence == "blind")
        assert log_evidence is None or not np.isnan(log_evidence)
        belief = particles.belief
        assert belief.poses.shape == (100, 3) and np.isfinite(belief.poses).all()
        assert belief.weights.sum() == pytest.approx(1.0)


def belief_in_world(world: np.ndarray, order: int = 1, **chosen: Any) -> tuple[WeightedPoses, TopoMap]:
    """The belief after a drive in a world that is moved by a pose (3,); with ``order`` -1, hypotheses backwards."""
    places = compose(world, np.column_stack([MAP.positions, np.zeros(len(MAP.nodes))]))
    nodes = tuple(replace(node, x=x, y=y) for node, (x, y, _) in zip(MAP.nodes, places, strict=True))
    the_map = replace(MAP, nodes=nodes)
    estimator = AuxiliaryParticleFilter(AuxiliaryParticleFilter.Config(particles=20_000, **chosen))
    estimator.reset(the_map, np.random.default_rng(2))
    for pose in [(0.2, 0.1, 0.4), (0.6, 0.3, 0.7), (1.0, 0.6, 1.0)]:
        seen = evidence_for(MAP, pose)
        estimator.update(
            replace(
                seen,
                poses=compose(world, seen.poses)[::order],
                match=seen.match[::order],
                log_likelihoods=seen.log_likelihoods[::order],
            )
        )
        estimator.predict(Motion(np.array([0.45, 0.03, 0.3]), np.diag([0.003, 0.002, 0.004])))
    return estimator.belief, the_map


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
@pytest.mark.parametrize(("world", "order"), [((3.0, -7.0, 0.4), 1), ((3.0, -7.0, -2.9), 1), ((0.0, 0.0, 0.0), -1)])
def test_belief_turns_with_the_world_and_knows_no_order(
    adaptation: str, world: tuple[float, float, float], order: int
) -> None:
    plain, _ = belief_in_world(np.zeros(3), adaptation=adaptation)
    other, the_map = belief_in_world(np.array(world), order, adaptation=adaptation)
    # scatter between seeds is about 0.03; the border of the free area follows the cells, not the world: as much again
    assert np.abs(node_masses(plain, MAP) - node_masses(other, the_map)).max() < 0.08
    off = between(compose(world, moments(plain)[0]), moments(other)[0])
    assert np.linalg.norm(off[:2]) < 0.08 and abs(off[2]) < 0.06


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
@pytest.mark.parametrize("seed", range(3))
def test_kidnapped_robot_is_found_at_once(adaptation: str, seed: int) -> None:
    particles = filter_on(seed=seed, adaptation=adaptation)
    for place in [(0.0, 0.0, 0.5)] * 8 + [(2.0, 1.0, -2.0)]:
        particles.predict(STILL)
        particles.update(evidence_for(MAP, place))
    # the recovered part's share, from the prior' that the filter states
    seen = evidence_for(MAP, (2.0, 1.0, -2.0))
    recovered = 0.01 * np.exp(seen.log_mass) / FreeArea(MAP, 0.25, 0.75).size
    assert node_masses(particles.belief, MAP)[5] > 0.5 * recovered / (recovered + np.exp(-4.0))
    distinct = len(np.unique(particles.belief.poses[particles.belief.weights > 0.0], axis=0))
    assert distinct > 500  # it is no handful of copies
    for _ in range(2):
        particles.predict(STILL)
        particles.update(seen)
    assert node_masses(particles.belief, MAP)[5] > 0.9


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_all_particles_are_recovered_where_none_else_is_possible(adaptation: str) -> None:
    particles = filter_on(WeightedPoses.uniform([[0.0, 0.0, 0.0]]), adaptation=adaptation, recovery=0.01)
    seen = evidence_of([[2.0, 0.9, 0.5]], 1.0, 0.05, 20.0, -np.inf)  # 40 sigma away
    assert particles.update(seen) == pytest.approx(
        np.log(0.01) + seen.log_mass - np.log(FreeArea(MAP, 0.25, 0.75).size)
    )
    assert particles.belief.poses.shape == (1000, 3)
    assert (np.abs(particles.belief.poses[:, :2] - [2.0, 0.9]) < 0.3).all()


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_without_recovery_a_kidnapped_robot_stays_lost(adaptation: str) -> None:
    particles = filter_on(adaptation=adaptation, recovery=0.0)
    for place in [(0.0, 0.0, 0.5)] * 8 + [(2.0, 1.0, -2.0)] * 3:
        particles.predict(STILL)
        particles.update(evidence_for(MAP, place))
    assert node_masses(particles.belief, MAP)[5] < 0.1


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_evidence_outside_the_free_area_recovers_nothing(adaptation: str) -> None:
    particles = filter_on(recovery=0.5, adaptation=adaptation)
    good = evidence_for(MAP, (0.0, 0.0, 0.0), log_floor=-4.0)
    far = replace(good, poses=good.poses + np.array([100.0, 0.0, 0.0]))
    assert particles.update(far) == pytest.approx(np.log(0.5) - 4.0)
    assert (particles.belief.poses[:, 0] < 10.0).all()
    assert (particles.belief.weights > 0.0).all()  # no particle was wasted on it


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_impossible_evidence_leaves_the_belief_as_predicted(adaptation: str) -> None:
    particles = filter_on(adaptation=adaptation)
    before = particles.belief
    assert particles.update(EVIDENCES["nothing"]) == -np.inf
    assert np.array_equal(particles.belief.poses, before.poses)
    assert np.array_equal(particles.belief.log_weights, before.log_weights)


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_hypotheses_of_likelihood_zero_leave_the_floor(adaptation: str) -> None:
    evidence = EVIDENCES["nothing but the floor"]
    assert filter_on(adaptation=adaptation).update(evidence) == pytest.approx(-4.0)


@pytest.mark.parametrize("adaptation", ADAPTATIONS)
def test_where_the_whole_prediction_is_outside_it_is_kept(adaptation: str) -> None:
    particles = filter_on(adaptation=adaptation, recovery=0.0)
    particles.predict(Motion(np.array([100.0, 0.0, 0.0]), np.zeros((3, 3))))
    assert particles.update(evidence_for(MAP, (0.0, 0.0, 0.0), log_floor=-4.0)) == pytest.approx(-4.0)
    assert np.isfinite(particles.belief.log_weights).all()
    assert (np.abs(np.linalg.norm(particles.belief.poses[:, :2], axis=1) - 100.0) < 3.5).all()


@pytest.mark.parametrize("told", [False, True])
def test_particles_that_leave_the_free_area_have_no_weight(told: bool) -> None:
    two = WeightedPoses(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.log([0.3, 0.7]))
    particles = filter_on(two)
    particles.predict(Motion(np.array([1.5, 0.0, 0.0]), np.zeros((3, 3))))
    particles.update(EVIDENCES["nothing but the floor"] if told else Evidence.blind())
    belief = particles.belief
    assert (belief.poses[belief.weights > 0.0, 0] < 2.0).all()
    assert belief.weights.sum() == pytest.approx(1.0)


def test_a_prior_outside_the_free_area_has_no_weight() -> None:
    two = WeightedPoses(np.array([[0.0, 0.0, 0.0], [9.0, 0.0, 0.0]]), np.log([0.3, 0.7]))
    belief = filter_on(two).belief
    assert (belief.poses[belief.weights > 0.0, 0] == 0.0).all()


def test_less_than_one_particle_is_recovered_in_the_mean() -> None:
    # ten particles at one place, and 5 % of the joint mass at another: half a particle
    floor, expected = np.exp(-4.0), 0.05
    wanted = expected / (1.0 - expected) * 0.99 * floor / 0.01 * FreeArea(MAP, 0.25, 0.75).size
    evidence = evidence_of([[2.0, 0.5, 0.0]], np.log(wanted / (2.0 * np.pi * 0.2**2)), 0.2, 20.0, -4.0)
    shares = []
    for seed in range(100):
        particles = filter_on(WeightedPoses.uniform([[0.0, 0.0, 0.0]]), seed, particles=10, recovery=0.01)
        particles.update(evidence)
        shares.append(particles.belief.weights[particles.belief.poses[:, 0] > 1.0].sum())
    assert np.mean(shares) == pytest.approx(expected, abs=5.0 * 0.05 / np.sqrt(100))  # each share is 0 or 0.1


def test_blind_steps_lose_no_particles_outside() -> None:
    particles = filter_on(WeightedPoses.uniform([[0.0, 0.0, 0.0]]))
    for _ in range(100):
        particles.predict(Motion(np.zeros(3), np.diag([0.01, 0.01, 0.01])))
        particles.update(Evidence.blind())
    # a step across the border of the area is some 0.1 m long, of two metres
    assert (particles.belief.weights > 0.0).mean() > 0.6


# --- few particles --------------------------------------------------------------------------------------------------

CIRCLE = np.array([0.25, 0.0, 0.25])


def views() -> np.ndarray:
    """An appearance map: views every 0.25 m and 15 degrees."""
    axes = np.arange(-0.5, 2.51, 0.25), np.arange(-0.5, 2.51, 0.25), np.arange(24) * np.pi / 12.0 - np.pi
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)


def nearest_views(pose: np.ndarray, rng: np.random.Generator) -> Evidence:
    """The second seed's sensor model: 10 views that look most alike, weights 2 (J - j + 1) / (J^2 + J), sharp."""
    every = views()
    off = ((every[:, :2] - pose[:2]) ** 2).sum(axis=1) / 0.25**2 + (wrap(every[:, 2] - pose[2]) / np.deg2rad(15.0)) ** 2
    best = np.argsort(off * np.exp(0.3 * rng.normal(size=len(every))))[:10]
    return evidence_of(every[best], np.log(2.0 * (10.0 - np.arange(10)) / 110.0 * 400.0), 0.05, 400.0, -4.0)


def position_error(estimator: Estimator, the_map: TopoMap, seed: int) -> float:
    """Root mean square error [m] on a round without an odometer, once the robot is found."""
    rng = np.random.default_rng(seed)
    estimator.reset(the_map, np.random.default_rng(seed + 1000))
    robot, errors = np.array([1.0, 0.0, 0.0]), []
    for _ in range(16):
        robot = compose(robot, CIRCLE)
        estimator.predict(OdometryNoise().unknown())
        estimator.update(nearest_views(robot, rng))
        errors.append(moments(estimator.belief)[0][:2] - robot[:2])
    return float(np.sqrt((np.array(errors[4:]) ** 2).sum(axis=1).mean()))


def test_few_fully_adapted_particles_do_better_than_as_many_blindly_moved_ones() -> None:
    the_map = toy_map(3, 3)
    bootstrap, full = (
        np.array([position_error(estimator, the_map, seed) for seed in range(8)])
        for estimator in (ParticleFilter(ParticleFilter.Config(particles=150)), filter_on(particles=150))
    )
    # over 20 seeds: 0.059 m (standard error 0.002) against 0.112 m (0.005); bootstrap with 1000 particles: 0.068 m
    assert full.mean() < 0.75 * bootstrap.mean()


@pytest.mark.parametrize(
    "wrong",
    [{"particles": 1}, {"adaptation": "half"}, {"recovery": -0.1}, {"recovery": 0.6}, {"resolution_m": 0.0}],
)
def test_settings_that_cannot_work_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"must|use one of: full, generic"):
        AuxiliaryParticleFilter.Config(**wrong)
