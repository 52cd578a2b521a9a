from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import logsumexp
from scipy.stats import chi2, multivariate_normal

from estimators.gaussian import ANY_HEADING, carried, cubature_points
from estimators.kalman import Kalman, MultiGaussian
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter
from estimators.sampling import sample_motion
from topoloc.estimate import estimate_from, mean_and_covariance, node_masses
from topoloc.geometry import compose, rotate, wrap
from topoloc.interfaces import Estimator
from topoloc.testing import check_estimator, evidence_for, toy_map
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, Status, WeightedPoses

MAP = toy_map()
STILL = Motion(np.zeros(3), np.diag([4e-4, 4e-4, 1e-4]))
CURVE = Motion(np.array([0.3, 0.02, 0.2]), np.diag([0.003, 0.002, 0.004]))
SINGULAR = np.outer([0.1, -0.05, 0.02], [0.1, -0.05, 0.02])
FULL = SINGULAR + np.diag([0.01, 0.002, 0.003])
CORRELATED = np.array([[0.09, 0.02, 0.03], [0.02, 0.05, -0.02], [0.03, -0.02, 0.06]])
ALL = [Kalman, MultiGaussian]
PURE: list[Callable[[], Kalman | MultiGaussian]] = [Kalman, lambda: MultiGaussian(MultiGaussian.Config(recovery=0.0))]


def started(make: Callable[[], Any], prior: WeightedPoses | None = None, the_map: TopoMap = MAP) -> Any:
    estimator = make()
    estimator.reset(the_map, np.random.default_rng(0), prior)
    return estimator


def moments(estimator: Estimator) -> tuple[np.ndarray, np.ndarray]:
    belief = estimator.belief
    return mean_and_covariance(belief.poses, belief.weights, belief.spread)


def hypotheses(
    poses: Any, log_likelihoods: Any = 0.0, sigma: float = 0.4, kappa: float = 20.0, log_floor: float = -4.0
) -> Evidence:
    placed = np.atleast_2d(np.asarray(poses, dtype=np.float64))
    ones = np.ones(len(placed))
    nodes = MAP.nearest_node(placed[:, :2])
    return Evidence(
        placed, nodes, 0.5 * ones, 0.5 * ones, log_likelihoods * ones, sigma * ones, kappa * ones, log_floor
    )


# --- the motion -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("heading_sd", "noise"), [(0.1, SINGULAR), (0.5, FULL), (1.0, SINGULAR), (1.7, FULL)])
def test_predicted_moments_are_those_of_a_simulation(heading_sd: float, noise: np.ndarray) -> None:
    mean, motion = np.array([1.0, -2.0, 2.5]), Motion(np.array([0.8, 0.3, 1.2]), noise)
    scale = np.diag([1.0, 1.0, heading_sd / np.sqrt(CORRELATED[2, 2])])
    covariance = scale @ CORRELATED @ scale
    kalman = started(Kalman, cubature_points(mean, covariance))
    kalman.predict(motion)

    rng, count = np.random.default_rng(5), 200_000
    start = rng.multivariate_normal(mean, covariance, count)
    moved = sample_motion(start, motion, rng)
    moved[:, 2] = start[:, 2] + wrap(moved[:, 2] - start[:, 2])  # not wrapped: more than half a turn off is possible
    got_mean, got = moments(kalman)
    difference = got_mean - moved.mean(axis=0)
    # five standard errors; a covariance's is at most that of a Gaussian's variance, sqrt(2 / n) of the sds' product
    sd = moved.std(axis=0)
    assert (np.abs([*difference[:2], wrap(difference[2])]) < 5.0 * sd / np.sqrt(count)).all()
    assert (np.abs(got - np.cov(moved.T)) < 5.0 * np.sqrt(2.0 / count) * np.outer(sd, sd)).all()


@pytest.mark.parametrize("make", ALL)
def test_small_noise_is_carried_to_first_order(make: Callable[[], Estimator]) -> None:
    mean, spread, motion = np.array([1.0, 0.5, -3.1]), np.array([1e-6, 2e-6, 1e-6]), Motion(CURVE.delta, 1e-6 * FULL)
    estimator = started(make, WeightedPoses.uniform(mean[None], spread))
    expected = mean, np.diag(spread)
    for _ in range(5):
        estimator.predict(motion)
        expected = carried(*expected, motion)
    got_mean, got = moments(estimator)
    # second-order terms are a heading variance of 1e-6 times metres
    np.testing.assert_allclose(got_mean, expected[0], atol=1e-5)
    np.testing.assert_allclose(got, expected[1], rtol=1e-3, atol=1e-10)


@pytest.mark.parametrize("make", ALL)
def test_a_motion_without_noise_moves_an_exact_pose_exactly(make: Callable[[], Estimator]) -> None:
    start, exact = np.array([0.2, 0.1, 3.0]), Motion(np.array([0.3, -0.1, 0.4]), np.zeros((3, 3)))
    estimator = started(make, WeightedPoses.uniform(start[None]))
    estimator.predict(exact)
    mean, covariance = moments(estimator)
    np.testing.assert_allclose(mean, compose(start, exact.delta), atol=1e-12)
    np.testing.assert_allclose(covariance, 0.0, atol=1e-12)


def test_a_heading_is_never_less_known_than_any() -> None:
    kalman = started(Kalman, WeightedPoses.uniform([[0.0, 0.0, 1.0]]))
    for _ in range(50):
        kalman.predict(Motion(np.array([0.1, 0.0, 0.0]), np.diag([0.01, 0.01, 1.0])))
    covariance = moments(kalman)[1]
    assert covariance[2, 2] == pytest.approx(0.999 * ANY_HEADING)  # the points stop just short of half a turn
    assert np.linalg.eigvalsh(covariance).min() > 0.0
    before = moments(kalman)[0]
    kalman.predict(Motion(np.array([1.0, 0.0, 0.0]), np.zeros((3, 3))))
    gone = moments(kalman)[0] - before
    # the resultant of a heading of that variance, which the quadrature meets to 0.3 %
    np.testing.assert_allclose(gone[:2], np.exp(-ANY_HEADING / 2.0) * np.array([np.cos(1.0), np.sin(1.0)]), atol=0.003)


# --- one update -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kappa", [50.0, 0.0])
def test_one_hypothesis_is_the_closed_form_update(kappa: float) -> None:
    mean, pose, sigma = np.array([0.3, 0.2, 3.0]), np.array([0.6, -0.1, -3.0]), 0.25
    kalman = started(Kalman, cubature_points(mean, CORRELATED))
    log_evidence = kalman.update(hypotheses(pose, 1.5, sigma, kappa, log_floor=-np.inf))

    rows = np.eye(3)[: 3 if kappa else 2]
    noise = np.diag([sigma**2, sigma**2, 1.0 / max(kappa, 1.0)])[: len(rows), : len(rows)]
    innovation = (rows @ (pose - mean + [0.0, 0.0, 2.0 * np.pi])).round(12)
    spread = rows @ CORRELATED @ rows.T + noise
    gain = CORRELATED @ rows.T @ np.linalg.inv(spread)
    expected = mean + gain @ innovation
    got_mean, got = moments(kalman)
    np.testing.assert_allclose(got_mean, [*expected[:2], wrap(expected[2])], atol=1e-9)
    np.testing.assert_allclose(got, CORRELATED - gain @ spread @ gain.T, atol=1e-9)
    volume = 2.0 * np.pi * sigma**2 * (2.0 * np.pi if kappa else 1.0)
    log_density = multivariate_normal(cov=spread).logpdf(innovation)
    assert log_evidence == pytest.approx(1.5 + np.log(volume) + log_density, abs=1e-9)


def test_the_update_is_that_of_filterpys_unscented_filter() -> None:
    mean, pose = np.array([0.3, 0.2, 0.5]), np.array([0.6, -0.1, 0.9])
    kalman = started(Kalman, cubature_points(mean, CORRELATED))
    kalman.update(hypotheses(pose, 0.0, 0.25, 40.0, log_floor=-np.inf))
    points = MerweScaledSigmaPoints(3, alpha=0.5, beta=2.0, kappa=0.0)
    oracle = UnscentedKalmanFilter(3, 3, 1.0, hx=lambda state: state, fx=lambda state, dt: state, points=points)
    oracle.x, oracle.P, oracle.Q, oracle.R = mean, CORRELATED, np.zeros((3, 3)), np.diag([0.0625, 0.0625, 0.025])
    oracle.predict()
    oracle.update(pose)
    got_mean, got = moments(kalman)
    np.testing.assert_allclose(got_mean, oracle.x, atol=1e-9)
    np.testing.assert_allclose(got, oracle.P, atol=1e-9)


def posterior_on_a_lattice(mean: np.ndarray, spread: np.ndarray, evidence: Evidence) -> tuple[Any, Any, float]:
    """Mean, covariance and log evidence of a Gaussian prior with this evidence, by summing over a fine lattice."""
    along = np.linspace(-5.0, 5.0, 81)
    x, y, heading = (centre + np.sqrt(variance) * along for centre, variance in zip(mean, spread, strict=True))
    place = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    density = np.exp(-0.5 * along**2)
    prior = (density[:, None, None] * density[:, None] * density).reshape(-1, 81) / density.sum() ** 3
    joint = prior * np.exp(evidence.log_likelihood(place, heading[None]))
    poses = np.column_stack([np.repeat(place, 81, axis=0), np.tile(heading, len(place))])
    expected_mean, covariance = mean_and_covariance(poses, joint.ravel(), np.zeros(3))
    return expected_mean, covariance, float(np.log(joint.sum()))


@pytest.mark.parametrize("make", PURE, ids=["kalman", "multi-gaussian"])
def test_doubt_between_hypotheses_and_floor_is_in_the_moments(make: Callable[[], Any]) -> None:
    mean, spread = np.array([0.5, 0.5, 0.4]), np.array([0.16, 0.09, 0.04])
    evidence = hypotheses(
        [[0.1, 0.3, 0.2], [1.0, 0.9, 0.7], [0.4, 1.2, 0.5]], np.array([0.5, 1.0, -0.5]), 0.2, 60.0, 0.0
    )
    estimator = started(make, WeightedPoses.uniform(mean[None], spread))
    log_evidence = estimator.update(evidence)
    expected_mean, expected, expected_log_evidence = posterior_on_a_lattice(mean, spread, evidence)
    got_mean, got = moments(estimator)
    # a von Mises of concentration 60 is off a Gaussian by 1 / (8 kappa) = 0.2 % in weight and 1 % in variance
    assert log_evidence == pytest.approx(expected_log_evidence, abs=0.005)
    np.testing.assert_allclose(got_mean, expected_mean, atol=0.002)
    sd = np.sqrt(np.diag(expected))
    assert (np.abs(got - expected) < 0.01 * np.outer(sd, sd)).all()
    assert np.sqrt(got[0, 0]) > 0.3  # where one of the hypotheses alone would leave 0.18


def test_who_knows_no_heading_has_no_say_in_the_mean_heading() -> None:
    """Floor and hypothesis are equally likely here; the mean direction is theirs by resultant, 0.19 against 0.98."""
    kalman = started(Kalman, WeightedPoses.uniform([[0.0, 0.0, 0.0]], [1e-6, 1e-6, ANY_HEADING]))
    likelihood = (
        2.0 * np.pi * np.exp(-(2.5**2) / (2.0 * (ANY_HEADING + 0.02))) / np.sqrt(2.0 * np.pi * (ANY_HEADING + 0.02))
    )
    kalman.update(hypotheses([0.0, 0.0, 2.5], 0.0, 1.0, 50.0, log_floor=float(np.log(likelihood))))
    told = 2.5 * ANY_HEADING / (ANY_HEADING + 0.02)
    variance = 1.0 / (1.0 / ANY_HEADING + 50.0)
    expected = np.angle(np.exp(-ANY_HEADING / 2.0) + np.exp(1j * told - variance / 2.0))
    assert moments(kalman)[0][2] == pytest.approx(expected, abs=1e-5)


def test_merged_to_one_the_sum_of_gaussians_is_the_kalman_filter() -> None:
    prior = WeightedPoses.uniform([[0.5, 0.5, 0.4]], [0.16, 0.09, 0.04])
    kalman = started(Kalman, prior)
    config = MultiGaussian.Config(recovery=0.0, overlap=1e-30, negligible=0.0)
    several = started(lambda: MultiGaussian(config), prior)
    for step in range(5):
        evidence = evidence_for(MAP, (0.5 + 0.1 * step, 0.5, 0.4 + 0.1 * step))
        assert kalman.update(evidence) == pytest.approx(several.update(evidence), abs=1e-9)
        for estimator in (kalman, several):
            estimator.predict(CURVE)
        same_after_turning(kalman.belief, several.belief, 0.0, (0.0, 0.0))


def test_a_sharp_look_at_a_lost_pose_leaves_the_looks_covariance() -> None:
    kalman = started(Kalman, WeightedPoses.uniform([[0.0, 0.0, 0.0]]))
    kalman.predict(Motion(np.array([1.0, 0.0, 0.0]), np.diag([1e12, 1e12, 1.0])))
    kalman.update(hypotheses([5.0, -3.0, 1.0], 0.0, 1e-3, 1e6, log_floor=-np.inf))
    mean, covariance = moments(kalman)
    np.testing.assert_allclose(mean, [5.0, -3.0, 1.0], atol=1e-3)
    np.testing.assert_allclose(np.diag(covariance), 1e-6, rtol=1e-3)


@pytest.mark.parametrize("make", ALL)
def test_whole_turns_of_a_hypothesis_change_nothing(make: Callable[[], Any]) -> None:
    plain, turned = started(make), started(make)
    for step in range(3):
        evidence = evidence_for(MAP, (0.3, 0.2, 3.0 + 0.1 * step))
        whole_turns = 2.0 * np.pi * np.arange(-3, 3)
        plain.update(evidence)
        turned.update(replace(evidence, poses=evidence.poses + whole_turns[:, None] * [0.0, 0.0, 1.0]))
        same_after_turning(plain.belief, turned.belief, 0.0, (0.0, 0.0))


@pytest.mark.parametrize("make", ALL)
def test_blind_and_impossible_frames_leave_the_belief_as_predicted(make: Callable[[], Any]) -> None:
    estimator = started(make, WeightedPoses.uniform([[0.2, 0.1, 0.3]], [0.04, 0.04, 0.02]))
    estimator.predict(CURVE)
    before = estimator.belief
    assert estimator.update(Evidence.blind()) is None
    assert estimator.update(hypotheses([0.0, 0.0, 0.0], -np.inf, log_floor=-np.inf)) == -np.inf
    assert np.array_equal(estimator.belief.poses, before.poses)
    assert np.array_equal(estimator.belief.log_weights, before.log_weights)


@pytest.mark.parametrize("make", ALL)
def test_nothing_but_the_floor_says_nothing(make: Callable[[], Any]) -> None:
    prior = WeightedPoses.uniform([[0.2, 0.1, 0.3]], [0.04, 0.04, 0.02])
    estimator, before = started(make, prior), moments(started(make, prior))
    assert estimator.update(hypotheses([0.0, 0.0, 0.0], -np.inf, log_floor=-3.0)) == pytest.approx(-3.0)
    share = MultiGaussian.Config().recovery if make is MultiGaussian else 0.0  # that may be anywhere now
    assert estimator.belief.weights[:6].sum() == pytest.approx(1.0 - share)
    np.testing.assert_allclose(cut(estimator, 6)[0], before[0], atol=1e-9)
    np.testing.assert_allclose(cut(estimator, 6)[1], before[1], atol=1e-9)


def cut(estimator: Estimator, count: int) -> tuple[np.ndarray, np.ndarray]:
    return mean_and_covariance(estimator.belief.poses[:count], estimator.belief.weights[:count], np.zeros(3))


# --- how they start -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", ALL)
def test_before_any_match_the_robot_may_be_anywhere(make: Callable[[], Any]) -> None:
    estimator = started(make)
    for _ in range(3):
        estimator.predict(CURVE)
        assert estimator.update(Evidence.blind()) is None
    assert len(estimator.belief.poses) == 4 * 6
    estimate = estimate_from(estimator.belief, MAP)
    assert estimate.node is None and estimate.status is Status.LOST


def test_kalman_starts_at_the_best_match() -> None:
    kalman = started(Kalman)
    assert kalman.update(evidence_for(MAP, (1.0, 1.0, 0.5))) is None
    mean, covariance = moments(kalman)
    np.testing.assert_allclose(mean, [1.0, 1.0, 0.5], atol=1e-12)
    np.testing.assert_allclose(covariance, np.diag([0.16, 0.16, 0.05]), atol=1e-12)


@pytest.mark.parametrize("make", ALL)
def test_a_prior_of_many_poses_keeps_its_moments(make: Callable[[], Any]) -> None:
    rng = np.random.default_rng(3)
    clusters = np.concatenate([rng.normal([0, 0, 3.1], 0.2, (1500, 3)), rng.normal([2, 1, 0.5], 0.2, (500, 3))])
    poses = np.column_stack([clusters[:, :2], wrap(clusters[:, 2])])
    prior = WeightedPoses(poses, np.append(np.zeros(1998), [-np.inf, -1e4]), np.array([0.01, 0.01, 0.0]))
    estimator = started(make, prior)
    mean, covariance = moments(estimator)
    expected_mean, expected = mean_and_covariance(prior.poses, prior.weights, prior.spread)
    np.testing.assert_allclose(mean, expected_mean, atol=0.02)  # headings: of poses on the circle and of pools of them
    np.testing.assert_allclose(covariance[:2, :2], expected[:2, :2], atol=1e-9)
    if make is MultiGaussian:
        assert len(estimator.belief.poses) <= 6 * MultiGaussian.Config().components
        assert np.abs(node_masses(estimator.belief, MAP) - node_masses(prior, MAP)).max() < 0.03


# --- sums of Gaussians, grid and particles are three forms of one posterior -------------------------------------------


def three(reach_m: float = 2.0) -> list[Estimator]:
    """With so much reach that the border of the free area, which a Gaussian does not know, plays no part."""
    return [
        MarkovGrid(MarkovGrid.Config(resolution_m=0.125, headings=48, recovery=0.01, reach_m=reach_m)),
        ParticleFilter(ParticleFilter.Config(particles=20_000, recovery=0.01, reach_m=reach_m)),
        MultiGaussian(MultiGaussian.Config(recovery=0.01, reach_m=reach_m)),
    ]


def look_alikes(robot: np.ndarray, kappa: float) -> Evidence:
    """Evidence for a pose and, as strong, for its look-alike at the other end of the map."""
    both = [evidence_for(MAP, robot), evidence_for(MAP, (2.2 - robot[0], 0.9 * robot[1], robot[2] + 2.0))]
    poses = np.concatenate([one.poses for one in both])
    return hypotheses(poses, 0.5 * np.concatenate([one.log_likelihoods for one in both]) - 0.5, 0.4, kappa, -2.0)


def drive(estimator: Estimator, kappa: float) -> tuple[np.ndarray, np.ndarray]:
    """Node masses (8, K) and log evidence (8,) along eight motions."""
    estimator.reset(MAP, np.random.default_rng(11))
    robot, motion = np.array([0.0, 0.0, 0.2]), Motion(np.array([0.25, 0.02, 0.2]), np.diag([0.004, 0.004, 0.006]))
    masses, log_evidence = [], []
    for _ in range(8):
        robot = compose(robot, motion.delta)
        estimator.predict(motion)
        log_evidence.append(estimator.update(look_alikes(robot, kappa)))
        masses.append(node_masses(estimator.belief, MAP))
    return np.array(masses), np.array(log_evidence)


@pytest.mark.parametrize("kappa", [30.0, 8.0, 0.0])
def test_node_masses_and_log_evidence_are_those_of_grid_and_particles(kappa: float) -> None:
    (grid, grid_log), (particles, particles_log), (gaussians, gaussians_log) = (drive(one, kappa) for one in three())
    assert 0.3 < grid.max() < 0.95  # informed, and never settled
    assert 0.5 * np.abs(grid - particles).sum(axis=1).max() < 0.1
    # six points stand for a Gaussian's share of a node: a few hundredths to either side of a node's border
    assert 0.5 * np.abs(grid - gaussians).sum(axis=1).max() < 0.12
    # against 0.4 to 0.7 of log evidence between one step and the next; 1 / (8 kappa) is 0.016 at kappa = 8
    assert np.abs(gaussians_log - grid_log).max() < 0.15
    assert abs((gaussians_log - grid_log).mean()) < 0.06
    assert np.abs(particles_log - grid_log).max() < 0.15


def test_first_log_evidence_is_the_uniform_priors() -> None:
    evidence = look_alikes(np.array([0.2, 0.1, 0.3]), 8.0)
    border = MultiGaussian(MultiGaussian.Config())
    grid = MarkovGrid(MarkovGrid.Config(resolution_m=0.25, headings=24))
    for estimator in (border, grid):
        estimator.reset(MAP, np.random.default_rng(0))
    # 64 points tell how much of a hypothesis lies inside, cells of 0.25 m how much of a cell does: a hundredth each
    assert border.update(evidence) == pytest.approx(grid.update(evidence), abs=0.02)
    inland = started(lambda: MultiGaussian(MultiGaussian.Config(reach_m=3.0)))
    area = MAP.free_cells(0.25, 3.0)[2].sum() / 16.0
    expected = np.log(np.exp(evidence.log_floor) + np.exp(evidence.log_mass) / area)
    assert inland.update(evidence) == pytest.approx(expected, abs=1e-9)


def test_hypotheses_outside_the_free_area_start_nothing() -> None:
    several = started(MultiGaussian)
    assert several.update(hypotheses([50.0, 0.0, 0.0], 20.0, log_floor=-3.0)) == pytest.approx(-3.0)
    assert len(several.belief.poses) == 4 * 6


# --- several places -------------------------------------------------------------------------------------------------


def test_two_look_alikes_are_kept_until_they_are_told_apart() -> None:
    several = started(MultiGaussian)
    here, there, sigma = np.array([0.0, 0.0, 0.3]), np.array([2.0, 1.0, -1.5]), 0.2
    for _ in range(8):
        several.update(hypotheses([here, there], 6.0, sigma, log_floor=-6.0))
        np.testing.assert_allclose(node_masses(several.belief, MAP)[[0, 5]], 0.5, atol=0.01)
        several.predict(STILL)
    assert estimate_from(several.belief, MAP).probability < 0.6
    for _ in range(2):
        several.update(hypotheses([here, there], np.array([6.0, 0.0]), sigma, log_floor=-6.0))
    assert node_masses(several.belief, MAP)[0] > 0.99


def test_motion_tells_the_heading_where_no_sensor_does() -> None:
    the_map = toy_map(8, 4)
    several = started(MultiGaussian, the_map=the_map)
    robot, motion = np.array([0.5, 1.0, 0.3]), Motion(np.array([0.5, 0.0, 0.0]), np.diag([0.002, 0.002, 0.002]))
    several.update(evidence_for(the_map, robot, heading_known=False))
    heading_sd = [np.sqrt(moments(several)[1][2, 2])]
    for _ in range(8):
        robot = compose(robot, motion.delta)
        several.predict(motion)
        several.update(evidence_for(the_map, robot, heading_known=False))
        heading_sd.append(float(np.sqrt(moments(several)[1][2, 2])))
    mean, covariance = moments(several)
    assert heading_sd[0] > 1.5 and heading_sd[-1] < 0.3
    assert abs(wrap(mean[2] - robot[2])) < 3.0 * np.sqrt(covariance[2, 2])


@pytest.mark.parametrize(("kappa", "low", "high"), [(0.5, 0.15, 0.25), (0.0, 0.0, 0.01)])
def test_a_vague_heading_is_born_around_the_circle(kappa: float, low: float, high: float) -> None:
    several = started(MultiGaussian)
    several.update(hypotheses([1.0, 0.0, 2.0], 9.0, 0.2, kappa, log_floor=-9.0))
    belief = several.belief
    assert len(belief.poses) == 6 * 6
    resultant = (belief.weights * np.exp(1j * belief.poses[:, 2])).sum()
    assert low <= abs(resultant) < high  # a von Mises has I1(kappa) / I0(kappa): 0.24, 0
    assert low == 0.0 or abs(wrap(np.angle(resultant) - 2.0)) < 1e-6


def test_what_exceeds_the_components_counts_as_anywhere() -> None:
    few = started(lambda: MultiGaussian(MultiGaussian.Config(components=2)))
    poses = np.column_stack([MAP.positions, np.zeros(6)])
    few.update(hypotheses(poses, 8.0, 0.2))
    belief = few.belief
    assert len(belief.poses) == 2 * 6 + 4 * 6
    assert belief.weights[:12].sum() == pytest.approx(2.0 / 6.0, abs=0.01)
    assert few.update(hypotheses(poses[5], 8.0, 0.2)) is not None
    assert node_masses(few.belief, MAP)[5] > 0.95


def test_the_negligible_is_dropped_and_the_alike_are_merged() -> None:
    several = started(MultiGaussian)
    for _ in range(6):
        several.update(evidence_for(MAP, (1.0, 0.0, 0.5)))
        several.predict(STILL)
    assert len(several.belief.poses) <= 6 * 6
    unmerged = started(lambda: MultiGaussian(MultiGaussian.Config(overlap=1.0, negligible=0.0)))
    for _ in range(6):
        unmerged.update(evidence_for(MAP, (1.0, 0.0, 0.5)))
        unmerged.predict(STILL)
    assert len(unmerged.belief.poses) == 6 * 50
    for got, expected in zip(moments(several), moments(unmerged), strict=True):
        np.testing.assert_allclose(got, expected, atol=0.01)


def test_alike_are_gaussians_of_one_place_heading_and_width() -> None:
    two = WeightedPoses.uniform([[0.1, 0.2, np.pi - 0.05], [0.1, 0.2, -np.pi + 0.05]], [0.04, 0.04, 0.09])
    one = started(PURE[1], two)
    one.update(hypotheses([0.0, 0.0, 0.0], -np.inf))  # nothing but the floor
    assert len(one.belief.poses) == 6
    mean, covariance = moments(one)
    assert abs(wrap(mean[2] - np.pi)) < 1e-9
    np.testing.assert_allclose(np.diag(covariance), [0.04, 0.04, 0.09 + 0.05**2], atol=1e-9)

    wide = started(PURE[1], WeightedPoses.uniform([[0.1, 0.2, 1.0]], [1.0, 1.0, 0.5]))
    wide.update(hypotheses([0.1, 0.2, 1.0], 0.0, 0.1, 50.0, log_floor=-2.0))  # as likely right as not
    assert len(wide.belief.poses) == 2 * 6


@pytest.mark.parametrize("make", ALL)
def test_five_hundred_hypotheses(make: Callable[[], Any]) -> None:
    rng = np.random.default_rng(8)
    the_map = TopoMap("many nodes", Camera(), toy_map(25, 20).nodes, edges=np.zeros((0, 2), dtype=np.int64))
    pose = np.array([12.2, 9.1, 0.7])
    everywhere = np.column_stack([the_map.positions, rng.uniform(-np.pi, np.pi, 500)])
    everywhere[240] = pose
    estimator = started(make, WeightedPoses.uniform([pose], [0.3, 0.3, 0.1]), the_map)
    for _ in range(3):
        assert np.isfinite(estimator.update(hypotheses(everywhere, 2.0)))
        estimator.predict(STILL)
    mean, covariance = moments(estimator)
    assert np.linalg.norm(mean[:2] - pose[:2]) < 0.2 and np.sqrt(covariance[0, 0]) < 0.5


# --- kidnapped ------------------------------------------------------------------------------------------------------


def test_kidnapped_robot_is_found_by_several_and_never_by_one() -> None:
    kalman, several = started(Kalman), started(MultiGaussian)
    log_evidence = []
    for place in [(0.0, 0.0, 0.5)] * 8 + [(2.0, 1.0, -2.0)] * 8:
        for estimator in (kalman, several):
            estimator.predict(STILL)
        several.update(evidence_for(MAP, place))
        log_evidence.append(kalman.update(evidence_for(MAP, place)))
        if len(log_evidence) == 8:
            before = moments(kalman)[1]
        if len(log_evidence) == 11:
            assert node_masses(several.belief, MAP)[5] > 0.9  # within three updates
    assert node_masses(several.belief, MAP)[5] > 0.95
    mean, covariance = moments(kalman)
    assert np.linalg.norm(mean[:2]) < 0.5  # it stays, and tells that it is lost:
    assert max(log_evidence[8:]) < -3.5 < 1.0 < min(log_evidence[1:8])
    assert np.trace(covariance) > np.trace(before) + 8 * 0.9 * np.trace(STILL.covariance)


def test_recovery_weighs_like_the_particle_filters() -> None:
    """One update from a tight prior at the wrong end of the map: what is born there is as heavy as what is drawn."""
    prior = WeightedPoses.uniform([[0.0, 0.0, 0.0]], [0.01, 0.01, 0.02])
    several = started(lambda: MultiGaussian(MultiGaussian.Config(recovery=0.02, reach_m=2.0)), prior)
    config = ParticleFilter.Config(particles=40_000, recovery=0.02, reach_m=2.0)
    particles = started(lambda: ParticleFilter(config), prior)
    evidence = evidence_for(MAP, (2.0, 1.0, 1.0))
    # 800 recovered particles: three per cent of their weight, and of the moments of what is half of the belief
    assert several.update(evidence) == pytest.approx(particles.update(evidence), abs=0.03)
    (mean, covariance), (expected_mean, expected) = moments(several), moments(particles)
    assert 0.4 < mean[0] < 1.6  # both parts matter
    np.testing.assert_allclose(mean, expected_mean, atol=0.05)
    np.testing.assert_allclose(covariance, expected, atol=0.05)


# --- consistency ----------------------------------------------------------------------------------------------------

SIDE, SEEN, SIGMA, KAPPA = 10.0, 0.9, 0.3, 30.0
CORNERS = SIDE / 2.0 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
OPEN = TopoMap("open", Camera(), (Node("a", "middle", 0.0, 0.0),), free=(CORNERS,))


def clutter_evidence(robot: np.ndarray, false_ones: float, rng: np.random.Generator) -> Evidence:
    """Drawn from the model that the evidence states: the true hypothesis with its own noise, if seen, among false ones.

    p(hypotheses | pose) ~ (1 - seen) + seen sum_m N(z_m) / (density of false ones), which is floor + sum_m w_m K h.
    """
    low, high = np.array([*CORNERS[0], -np.pi]), np.array([*CORNERS[2], np.pi])
    false = rng.uniform(low, high, (rng.poisson(false_ones), 3))
    true = [*(robot[:2] + SIGMA * rng.normal(size=2)), wrap(rng.vonmises(robot[2], KAPPA))]
    poses = np.concatenate([false, [true]] if rng.random() < SEEN else [false])
    log_likelihood = np.log(SEEN * SIDE**2 / (false_ones * 2.0 * np.pi * SIGMA**2))
    return hypotheses(rng.permutation(poses), log_likelihood, SIGMA, KAPPA, np.log(1.0 - SEEN))


def squared_errors(make: Callable[[], Any], false_ones: float, seed: int, looks: tuple[int, ...]) -> list[float]:
    """Normalised estimation error squared at some of the steps of a drive."""
    rng = np.random.default_rng(seed)
    start, spread = np.array([1.0, -2.0, 0.3]), np.array([0.2, 0.2, 0.1])
    robot, estimator = start + rng.normal(size=3) * np.sqrt(spread), make()
    estimator.reset(OPEN, rng, WeightedPoses.uniform(start[None], spread))
    errors = []
    for step in range(looks[-1] + 1):
        robot = sample_motion(robot[None], CURVE, rng)[0]
        estimator.predict(CURVE)
        estimator.update(clutter_evidence(robot, false_ones, rng))
        if step in looks:
            mean, covariance = moments(estimator)
            difference = np.array([*(robot - mean)[:2], wrap(robot[2] - mean[2])])
            errors.append(float(difference @ np.linalg.solve(covariance, difference)))
    return errors


def ratios(make: Callable[[], Any], false_ones: float, seeds: range, looks: tuple[int, ...]) -> tuple[Any, Any]:
    """Squared errors by degree of freedom (L,), which a consistent filter has at 1, and the bounds (2,) on them.

    Seeds are independent, so the sum over them is chi-square with three degrees of freedom a seed. Both sides together
    0.1 % at each look: a consistent filter fails at three looks for 3 of 1000 choices of the seeds.
    """
    errors = np.array([squared_errors(make, false_ones, seed, looks) for seed in seeds])
    freedom = 3 * len(seeds)
    return errors.sum(axis=0) / freedom, chi2.ppf([0.0005, 0.9995], freedom) / freedom


# one Gaussian is right where a false hypothesis near the true one is rare (0.1 a square metre), several at 0.4 too
CONSISTENT = [pytest.param(PURE[0], 10.0, id="kalman"), pytest.param(PURE[1], 40.0, id="multi-gaussian")]


@pytest.mark.parametrize(("make", "false_ones"), CONSISTENT)
def test_squared_errors_lie_inside_their_bounds(make: Callable[[], Any], false_ones: float) -> None:
    ratio, (low, high) = ratios(make, false_ones, range(50), (0, 3, 7))
    assert (low < ratio).all() and (ratio < high).all()


@pytest.mark.slow
@pytest.mark.parametrize(("make", "false_ones"), CONSISTENT)
def test_squared_errors_of_longer_drives_lie_inside_their_bounds(make: Callable[[], Any], false_ones: float) -> None:
    ratio, (low, high) = ratios(make, false_ones, range(1000, 1150), (9, 14, 29))
    assert (low < ratio).all() and (ratio < high).all()


@pytest.mark.slow
def test_recovery_makes_it_cautious_where_nobody_is_carried_off() -> None:
    """A share of a ten-thousandth ten metres away is as much variance as a standard deviation of 0.1 m."""
    ratio, (_, high) = ratios(MultiGaussian, 10.0, range(1000, 1150), (9, 14, 29))
    assert (ratio > 0.5).all() and (ratio < high).all()


# --- turning the world, the order of hypotheses ---------------------------------------------------------------------


def turned_poses(poses: np.ndarray, angle: float, shift: tuple[float, float]) -> np.ndarray:
    return np.column_stack([rotate(poses[:, :2], angle) + shift, wrap(poses[:, 2] + angle)])


def belief_in_world(make: Callable[[], Any], angle: float, shift: tuple[float, float], prior: bool) -> WeightedPoses:
    places = turned_poses(np.column_stack([MAP.positions, np.zeros(6)]), angle, shift)
    nodes = tuple(replace(node, x=x, y=y) for node, (x, y, _) in zip(MAP.nodes, places, strict=True))
    start = WeightedPoses.uniform(turned_poses(np.array([[0.1, 0.2, 0.3]]), angle, shift), [0.1, 0.1, 0.3])
    estimator = started(make, start if prior else None, TopoMap("turned", Camera(), nodes))
    for pose in [(0.2, 0.1, 0.4), (0.6, 0.3, 0.7), (1.0, 0.6, 1.0)]:
        evidence = evidence_for(MAP, pose)
        estimator.update(replace(evidence, poses=turned_poses(evidence.poses, angle, shift)))
        estimator.predict(Motion(np.array([0.45, 0.03, 0.3]), FULL))
    belief: WeightedPoses = estimator.belief
    return belief


def same_after_turning(plain: WeightedPoses, other: WeightedPoses, angle: float, shift: tuple[float, float]) -> None:
    """Component by component; the points within one depend on the axes."""
    assert len(plain.poses) == len(other.poses)
    turn = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])
    for at in range(0, len(plain.poses), 6):
        six = slice(at, at + 6)
        mean, covariance = mean_and_covariance(plain.poses[six], np.ones(6), plain.spread)
        other_mean, other_covariance = mean_and_covariance(other.poses[six], np.ones(6), other.spread)
        difference = other_mean - turned_poses(mean[None], angle, shift)[0]
        np.testing.assert_allclose([*difference[:2], wrap(difference[2])], 0.0, atol=1e-9)
        np.testing.assert_allclose(other_covariance, turn @ covariance @ turn.T, atol=1e-9)
    np.testing.assert_allclose(other.log_weights, plain.log_weights, atol=1e-9)


@pytest.mark.parametrize("angle", [0.4, 2.0, -2.9, np.pi])
@pytest.mark.parametrize("make", PURE, ids=["kalman", "multi-gaussian"])
def test_belief_turns_with_the_world_exactly(make: Callable[[], Any], angle: float) -> None:
    plain = belief_in_world(make, 0.0, (0.0, 0.0), prior=True)
    same_after_turning(plain, belief_in_world(make, angle, (3.0, -7.0), prior=True), angle, (3.0, -7.0))


@pytest.mark.parametrize("make", ALL)
def test_belief_from_nowhere_shifts_with_the_world_exactly(make: Callable[[], Any]) -> None:
    plain = belief_in_world(make, 0.0, (0.0, 0.0), prior=False)
    same_after_turning(plain, belief_in_world(make, 0.0, (3.0, -7.0), prior=False), 0.0, (3.0, -7.0))


@pytest.mark.parametrize("angle", [0.4, 2.0, -2.9])
def test_belief_from_nowhere_turns_with_the_world_but_for_the_free_areas_cells(angle: float) -> None:
    plain = belief_in_world(MultiGaussian, 0.0, (0.0, 0.0), prior=False)
    other = belief_in_world(MultiGaussian, angle, (3.0, -7.0), prior=False)
    mean, _ = mean_and_covariance(plain.poses, plain.weights, plain.spread)
    other_mean, _ = mean_and_covariance(other.poses, other.weights, other.spread)
    # cells cut the border otherwise in each world, so hypotheses near it weigh a few hundredths more or less
    difference = other_mean - turned_poses(mean[None], angle, (3.0, -7.0))[0]
    assert np.linalg.norm(difference[:2]) < 0.01 and abs(wrap(difference[2])) < 0.01


@pytest.mark.parametrize("make", ALL)
@settings(max_examples=10, deadline=None)
@given(st.permutations(range(12)))
def test_the_order_of_hypotheses_changes_nothing(make: Callable[[], Any], order: list[int]) -> None:
    beliefs = []
    for chosen in (list(range(12)), order):
        estimator = started(make)
        for pose in [(0.2, 0.1, 0.4), (0.6, 0.3, 0.7)]:
            evidence = look_alikes(np.array(pose), 20.0)
            names = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
            estimator.update(replace(evidence, **{name: getattr(evidence, name)[chosen] for name in names}))
            estimator.predict(CURVE)
        beliefs.append(estimator.belief)
    same_after_turning(beliefs[0], beliefs[1], 0.0, (0.0, 0.0))


# --- whatever comes -------------------------------------------------------------------------------------------------

GOOD = evidence_for(MAP, (0.3, 0.1, 0.5))
EVIDENCES = {
    "good": GOOD,
    "blind": Evidence.blind(),
    "impossible": replace(GOOD, log_likelihoods=np.full(6, -np.inf), log_floor=-np.inf),
    "no floor": replace(GOOD, log_floor=-np.inf),
    "nothing but the floor": replace(GOOD, log_likelihoods=np.full(6, -np.inf)),
    "far away": replace(GOOD, poses=GOOD.poses + np.array([1e4, 0.0, 0.0]), log_floor=-np.inf),
    "huge": replace(GOOD, log_likelihoods=GOOD.log_likelihoods + 1e6),
    "tiny without floor": replace(GOOD, log_likelihoods=GOOD.log_likelihoods - 1e6, log_floor=-np.inf),
    "no heading": replace(GOOD, kappa=np.zeros(6)),
    "nearly no heading": replace(GOOD, kappa=np.full(6, 1e-9)),
    "heading to a hair": replace(GOOD, kappa=np.full(6, 1e6)),
}
MOTIONS = {
    "curve": CURVE,
    "exact": Motion(np.array([0.07, -0.02, 3.0]), np.zeros((3, 3))),
    "singular": Motion(np.array([0.3, 0.0, 0.1]), SINGULAR),
    "far": Motion(np.array([40.0, 0.0, 0.0]), np.diag([1e-3, 1e-3, 1e-3])),
    "wild": Motion(np.zeros(3), np.diag([1e4, 1e4, 1e4])),
}


@pytest.mark.parametrize("make", ALL)
@pytest.mark.parametrize("prior", [None, WeightedPoses.uniform([[0.3, 0.1, 0.5]])], ids=["anywhere", "exact"])
@settings(max_examples=25, deadline=None)
@given(st.lists(st.tuples(st.sampled_from(sorted(MOTIONS)), st.sampled_from(sorted(EVIDENCES))), max_size=6))
def test_weights_sum_to_one_after_anything(
    make: Callable[[], Any], prior: WeightedPoses | None, path: list[tuple[str, str]]
) -> None:
    estimator = started(make, prior)
    for motion, evidence in path:
        estimator.predict(MOTIONS[motion])
        log_evidence = estimator.update(EVIDENCES[evidence])
        assert log_evidence is None or not np.isnan(log_evidence)
        belief = estimator.belief
        # a share of "anywhere" below 0.001 is not handed out; before the start the weights have no scale
        told = prior is not None or len(belief.poses) != 24
        assert not told or -0.0011 < logsumexp(belief.log_weights) < 1e-9
        assert np.isfinite(belief.poses).all() and np.isfinite(estimate_from(belief, MAP).covariance).all()
        assert ((belief.poses[:, 2] >= -np.pi) & (belief.poses[:, 2] < np.pi)).all()


@pytest.mark.parametrize("make", ALL)
def test_contract(make: Callable[[], Estimator]) -> None:
    check_estimator(make)


@pytest.mark.parametrize(
    "wrong",
    [
        {"components": 0},
        {"recovery": -0.1},
        {"recovery": 1.0},
        {"negligible": 1.0},
        {"negligible": -1e-9},
        {"overlap": 0.0},
        {"overlap": 1.1},
        {"resolution_m": 0.0},
        {"resolution_m": 1.0, "reach_m": 0.5},
    ],
)
def test_settings_that_cannot_work_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"^\w+ is [^\n]*; it must [^\n]*$"):
        MultiGaussian.Config(**wrong)
