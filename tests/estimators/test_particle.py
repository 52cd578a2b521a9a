from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.stats import kstest

from estimators.free_area import FreeArea
from estimators.particle import ParticleFilter
from estimators.resampling import RESAMPLERS
from estimators.sampling import sample_motion, sample_poses, standard_normals
from estimators.weights import WEIGHTINGS, WeightingConfig
from topoloc.estimate import mean_and_covariance, node_masses
from topoloc.geometry import between, covariance_root
from topoloc.testing import evidence_for, toy_map
from topoloc.types import Evidence, Motion, WeightedPoses

STILL = Motion(np.zeros(3), np.diag([4e-4, 4e-4, 1e-4]))
SINGULAR = np.outer([0.1, -0.05, 0.02], [0.1, -0.05, 0.02])
FULL = SINGULAR + np.diag([0.01, 0.002, 0.003])


def filter_on(prior: WeightedPoses | None = None, seed: int = 0, **settings: Any) -> ParticleFilter:
    particles = ParticleFilter(ParticleFilter.Config(**settings))
    particles.reset(toy_map(), np.random.default_rng(seed), prior)
    return particles


@pytest.mark.parametrize("covariance", [FULL, SINGULAR, np.zeros((3, 3))])
def test_motion_samples_have_the_motions_moments(covariance: np.ndarray) -> None:
    start, delta = np.array([1.0, -2.0, 2.5]), np.array([0.4, 0.1, 1.2])
    moved = sample_motion(np.tile(start, (40_000, 1)), Motion(delta, covariance), np.random.default_rng(1))
    mean, sampled = mean_and_covariance(between(start, moved), np.ones(len(moved)), np.zeros(3))
    # 5 standard errors: sd / 200 for the mean, var sqrt(2) / 200 for the covariance
    np.testing.assert_allclose(mean, delta, atol=5 * 0.15 / 200)
    np.testing.assert_allclose(sampled, covariance, atol=5 * 0.02 * np.sqrt(2.0) / 200)


@pytest.mark.parametrize("covariance", [FULL, SINGULAR, np.zeros((3, 3))])
def test_covariance_root(covariance: np.ndarray) -> None:
    root = covariance_root(covariance)
    np.testing.assert_allclose(root @ root.T, covariance, atol=1e-15)


def test_noise_is_normal_and_independent() -> None:
    drawn = standard_normals(3, 200_001, np.random.default_rng(11)).astype(np.float64)
    for row in drawn:
        assert kstest(row, "norm").pvalue > 1e-3
    # 5 standard errors of 600,000: of the mean, the variance and the fourth moment
    assert drawn.mean() == pytest.approx(0.0, abs=5.0 / np.sqrt(6e5))
    assert (drawn**2).mean() == pytest.approx(1.0, abs=5.0 * np.sqrt(2.0 / 6e5))
    assert (drawn**4).mean() == pytest.approx(3.0, abs=5.0 * np.sqrt(96.0 / 6e5))
    # both of a pair come from one radius: their squares must not know of each other
    flat = drawn.ravel()
    first, second = flat[: flat.size // 2], flat[(flat.size + 1) // 2 :]
    assert abs(np.corrcoef(first, second)[0, 1]) < 5.0 / np.sqrt(3e5)
    assert abs(np.corrcoef(first**2, second**2)[0, 1]) < 5.0 / np.sqrt(3e5)


@pytest.mark.parametrize("number", [0.0, 0.25, 0.5, 1.0 - 2.0**-24])
def test_noise_is_finite_whatever_the_numbers(number: float) -> None:
    class Same(np.random.Generator):
        def random(self, size: Any = None, dtype: Any = None, out: Any = None) -> Any:
            return np.full(size, number, dtype=dtype)

    assert (np.abs(standard_normals(3, 5, Same(np.random.PCG64(0)))) < 5.8).all()
    assert standard_normals(3, 0, np.random.default_rng(0)).shape == (3, 0)


def test_poses_are_drawn_by_weight_and_spread() -> None:
    two = WeightedPoses(
        np.array([[0.0, 0.0, 3.1], [5.0, 0.0, 0.0]]), np.log([0.25, 0.75]), np.array([0.04, 0.01, 0.09])
    )
    drawn = sample_poses(two, 20_000, np.random.default_rng(2))
    first = drawn[drawn[:, 0] < 2.5]
    assert len(first) == 5000
    mean, covariance = mean_and_covariance(first, np.ones(len(first)), np.zeros(3))
    np.testing.assert_allclose(mean, [0.0, 0.0, 3.1], atol=0.02)
    np.testing.assert_allclose(np.diag(covariance), [0.04, 0.01, 0.09], rtol=0.1)
    assert (np.abs(drawn[:, 2]) <= np.pi).all()


def test_free_area_is_the_grids() -> None:
    xs, ys, free = toy_map().free_cells(0.25, 0.75)
    area = FreeArea(toy_map(), 0.25, 0.75)
    centres = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    assert np.array_equal(area.contains(centres), free.ravel())
    assert area.size == pytest.approx(free.sum() / 16.0)
    assert not area.contains(np.array([[-5.0, 0.0], [1e300, 0.0], [0.0, 2.0]])).any()
    drawn = area.sample(20_000, np.random.default_rng(3))
    assert area.contains(drawn[:, :2]).all()
    inside = (np.abs(drawn[:, :2] - [0.5, 0.5]) < 0.25).all(axis=1).mean()
    assert inside == pytest.approx(0.25 / area.size, abs=5 * np.sqrt(0.25 / area.size / 20_000))


def test_log_evidence_and_posterior_are_those_of_the_mixed_prior() -> None:
    # prior' = 0.98 a tight Gaussian + 0.02 even over the free area, integrated over fine cells
    the_map, prior = toy_map(), WeightedPoses.uniform([[0.0, 0.0, 0.0]], [0.01, 0.01, 0.02])
    evidence = evidence_for(the_map, (2.0, 1.0, 1.0))
    xs, ys, _ = the_map.free_cells(0.05, 0.75)
    coarse = FreeArea(the_map, 0.25, 0.75)
    place = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1).reshape(-1, 2)
    place = place[coarse.contains(place)]
    heading = np.linspace(-np.pi, np.pi, 72, endpoint=False)
    likelihood = np.exp(evidence.log_likelihood(place, heading[None]))
    tight = np.exp(-((place**2).sum(axis=1) / 0.02)[:, None] - heading**2 / 0.04)
    joint = (0.98 * tight / tight.sum() + 0.02 / likelihood.size) * likelihood
    masses = np.bincount(the_map.nearest_node(place), weights=joint.sum(axis=1)) / joint.sum()

    particles = filter_on(prior, particles=40_000, recovery=0.02)
    assert particles.update(evidence) == pytest.approx(np.log(joint.sum()), abs=0.1)
    assert 0.2 < masses[5] < 0.95  # both parts of the prior matter
    assert np.abs(node_masses(particles.belief, the_map) - masses).max() < 0.03


def test_evidence_outside_the_free_area_recovers_nothing() -> None:
    particles = filter_on(recovery=0.5)
    good = evidence_for(toy_map(), (0.0, 0.0, 0.0), log_floor=-4.0)
    far = replace(good, poses=good.poses + np.array([100.0, 0.0, 0.0]))
    assert particles.update(far) == pytest.approx(np.log(0.5) - 4.0)
    assert (particles.belief.poses[particles.belief.weights > 0.0, 0] < 10.0).all()


def test_impossible_evidence_leaves_the_belief_as_predicted() -> None:
    particles = filter_on()
    before, good = particles.belief, evidence_for(toy_map(), (0.0, 0.0, 0.0), log_floor=-np.inf)
    assert particles.update(replace(good, log_likelihoods=np.full(len(good.poses), -np.inf))) == -np.inf
    assert np.array_equal(particles.belief.poses, before.poses)
    assert np.array_equal(particles.belief.log_weights, before.log_weights)


def test_hypotheses_of_likelihood_zero_leave_the_floor() -> None:
    good = evidence_for(toy_map(), (0.0, 0.0, 0.0), log_floor=-4.0)
    assert filter_on().update(replace(good, log_likelihoods=np.full(6, -np.inf))) == pytest.approx(-4.0)


def test_particles_that_leave_the_free_area_have_no_weight() -> None:
    two = WeightedPoses(np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.log([0.3, 0.7]))
    particles = filter_on(two)
    particles.predict(Motion(np.array([1.5, 0.0, 0.0]), np.zeros((3, 3))))
    belief = particles.belief
    assert (belief.poses[belief.weights > 0.0, 0] < 2.0).all()
    assert belief.weights.sum() == pytest.approx(1.0)


def test_where_all_particles_have_left_they_are_kept() -> None:
    particles = filter_on()
    before = particles.belief.weights
    particles.predict(Motion(np.array([100.0, 0.0, 0.0]), np.zeros((3, 3))))
    np.testing.assert_allclose(particles.belief.weights, before)


def test_the_heaviest_particle_is_not_lost_by_lot() -> None:
    """One particle carries nearly all of the posterior: whatever the seats of recovered ones, its mass stays."""
    cloud = np.tile([0.0, 0.0, 0.0], (999, 1))
    lone = WeightedPoses.uniform(np.concatenate([cloud, [[2.0, 1.0, 0.0]]]))
    good = evidence_for(toy_map(), (2.0, 1.0, 0.0))
    look = replace(good, log_likelihoods=np.where(np.arange(6) == 5, 9.0, -20.0), sigma=np.full(6, 0.1))
    alone = []
    for seed in range(200):
        particles = filter_on(lone, seed, recovery=0.02, ess_threshold=0.0)
        particles.update(look)
        alone.append((np.abs(particles.belief.poses - [2.0, 1.0, 0.0]).max(axis=1) < 1e-9).any())
    assert all(alone)


def test_resampling_waits_until_few_particles_carry_the_weight() -> None:
    sharp = evidence_for(toy_map(), (0.0, 0.0, 0.0))
    always, never = filter_on(ess_threshold=1.0, recovery=0.0), filter_on(ess_threshold=0.0, recovery=0.0)
    always.update(sharp)
    never.update(sharp)
    assert np.ptp(always.belief.log_weights) == 0.0
    assert np.ptp(never.belief.log_weights) > 1.0


@pytest.mark.parametrize("name", RESAMPLERS)
def test_every_resampler_localizes(name: str) -> None:
    particles = filter_on(resampling=name)
    for _ in range(3):
        particles.predict(STILL)
        particles.update(evidence_for(toy_map(), (1.0, 1.0, 0.5)))
    assert np.argmax(node_masses(particles.belief, toy_map())) == 3


def test_blind_frame_changes_nothing() -> None:
    particles = filter_on()
    before = particles.belief
    assert particles.update(Evidence.blind()) is None
    assert np.array_equal(particles.belief.poses, before.poses)


@pytest.mark.parametrize("seed", range(5))
def test_kidnapped_robot_is_found_within_three_updates(seed: int) -> None:
    the_map, particles = toy_map(), filter_on(seed=seed)
    for place in [(0.0, 0.0, 0.5)] * 8 + [(2.0, 1.0, -2.0)] * 3:
        particles.predict(STILL)
        particles.update(evidence_for(the_map, place))
    # ten recovered particles stand for the whole recovered part, so the mass scatters by a few hundredths
    assert node_masses(particles.belief, the_map)[5] > 0.8


def test_without_recovery_a_kidnapped_robot_stays_lost() -> None:
    the_map, particles = toy_map(), filter_on(recovery=0.0)
    for place in [(0.0, 0.0, 0.5)] * 8 + [(2.0, 1.0, -2.0)] * 3:
        particles.predict(STILL)
        particles.update(evidence_for(the_map, place))
    assert node_masses(particles.belief, the_map)[5] < 0.1


def test_adapted_number_of_particles_falls_once_localized() -> None:
    particles = filter_on(adaptive=True, particles=5000)
    counts = []
    for _ in range(5):
        particles.predict(STILL)
        particles.update(evidence_for(toy_map(), (1.0, 1.0, 0.5)))
        counts.append(len(particles.belief.poses))
    assert counts[0] > 2 * counts[-1] >= 2 * particles.config.kld.least
    assert node_masses(particles.belief, toy_map())[3] > 0.9


def test_adapted_number_rises_again_after_a_kidnapping() -> None:
    particles = filter_on(adaptive=True, particles=5000)
    counts = []
    for place in [(0.0, 0.0, 0.5)] * 6 + [(2.0, 1.0, -2.0)] * 4:
        particles.predict(STILL)
        particles.update(evidence_for(toy_map(), place, log_floor=-2.0))
        counts.append(len(particles.belief.poses))
    assert max(counts[6:]) > 1.2 * counts[5]
    assert node_masses(particles.belief, toy_map())[5] > 0.8


def test_recovery_takes_as_many_particles_as_it_has_of_the_posterior() -> None:
    """Hardly any while the evidence is as foretold, half of all when it is elsewhere."""
    recovered = []
    for place in [(0.0, 0.0, 0.5), (2.0, 1.0, -2.0)]:
        particles = filter_on(WeightedPoses.uniform([[0.0, 0.0, 0.5]]), ess_threshold=0.0, recovery=0.01)
        particles.update(evidence_for(toy_map(), place, log_floor=-9.0))
        recovered.append((np.linalg.norm(particles.belief.poses, axis=1) > 1.0).mean())
    assert recovered[0] < 0.01
    assert recovered[1] > 0.3


@pytest.mark.parametrize("name", WEIGHTINGS)
def test_every_weighting_of_the_third_seed_tracks(name: str) -> None:
    """From a known start all seven follow the robot, as the seed says of local localization."""
    weights = WeightingConfig(neighbours=2)  # of more, PW2 and PW4 follow the middle
    particles = filter_on(WeightedPoses.uniform([[0.0, 0.0, 0.0]], [0.02, 0.02, 0.01]), weighting=name, weights=weights)
    for step in range(1, 9):
        particles.predict(Motion(np.array([0.25, 0.0, 0.0]), STILL.covariance))
        assert particles.update(evidence_for(toy_map(), (0.25 * step, 0.0, 0.0))) is not None
    mean, _ = mean_and_covariance(particles.belief.poses, particles.belief.weights, np.zeros(3))
    assert np.linalg.norm(mean[:2] - [2.0, 0.0]) < 0.3


def test_log_evidence_of_a_weighting_is_a_ratio_to_anywhere() -> None:
    """Particles that are anywhere find a frame as likely as anywhere: 0, whatever the scale of the formula."""
    for name in ("pw1", "pw2", "pw7"):
        particles = filter_on(weighting=name, particles=20_000)
        log_evidence = particles.update(evidence_for(toy_map(), (1.0, 0.0, 0.0)))
        assert log_evidence == pytest.approx(0.0, abs=0.3)  # 28 times 4 of the 4096 anywhere are near: 9 %, thrice


@pytest.mark.parametrize(
    "wrong",
    [
        {"particles": 1},
        {"weighting": "pw8"},
        {"resampling": "lottery"},
        {"ess_threshold": 2.0},
        {"recovery": -0.1},
        {"resolution_m": 0.0},
    ],
)
def test_settings_that_cannot_work_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=r"must|use one of: (systematic|likelihood)"):
        ParticleFilter.Config(**wrong)
