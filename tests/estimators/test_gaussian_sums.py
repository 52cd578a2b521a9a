"""Gaussians all at once against the same one by one: filterpy's unscented filter, and formulas written out."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import UnscentedKalmanFilter
from numpy.polynomial.hermite_e import hermegauss

import estimators.gaussian_sum
from estimators.gaussian import ANY_HEADING, cubature_points, cubature_poses
from estimators.gaussian_look import Branches, Measurements
from estimators.gaussian_motion import moved
from estimators.gaussian_sum import GRAIN, Gaussians, bounded, collapsed, merged, pooled
from topoloc.geometry import circular_mean, covariance_root, wrap
from topoloc.types import Evidence, Motion

CORRELATED = np.array([[0.003, 0.001, -0.0005], [0.001, 0.002, 0.0008], [-0.0005, 0.0008, 0.004]])


def drawn(seed: int, count: int, widest: float = 1.0) -> Gaussians:
    """Gaussians of all widths and correlations, the first known exactly, the second but for its heading."""
    rng = np.random.default_rng(seed)
    roots = rng.normal(size=(count, 3, 3)) * rng.uniform(0.02, widest, (count, 1, 1))
    roots[:1] = 0.0
    roots[1:2, :2] = 0.0
    means = np.column_stack([rng.normal(0.0, 2.0, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    return Gaussians(rng.normal(0.0, 2.0, count), means, bounded(roots @ roots.swapaxes(1, 2)))


# --- the motion -----------------------------------------------------------------------------------------------------


class SigmaPoints:
    """For filterpy: a quadrature's points along the heading, with the position that goes along, and two more pairs."""

    def __init__(self) -> None:
        nodes, weights = hermegauss(11)
        self.nodes, self.weights = nodes, weights / weights.sum()
        self.away = np.delete(nodes, 5)
        self.Wm = self.Wc = np.concatenate([np.delete(self.weights, 5), np.full(4, self.weights[5] / 4.0)])

    def num_sigmas(self) -> int:
        return 14

    def sigma_points(self, mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        deviation = np.sqrt(covariance[2, 2])
        along = covariance[:, 2] / deviation if deviation > 0.0 else np.zeros(3)
        across = np.zeros((2, 3))
        rest = covariance_root(covariance[:2, :2] - np.outer(along[:2], along[:2]))
        across[:, :2] = np.sqrt(2.0 / self.weights[5]) * rest.T
        return np.asarray(mean + np.concatenate([self.away[:, None] * along, across, -across]))


def rotation(heading: float) -> np.ndarray:
    cos, sin = np.cos(heading), np.sin(heading)
    return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])


def by_filterpy(mean: np.ndarray, covariance: np.ndarray, motion: Motion) -> tuple[np.ndarray, np.ndarray]:
    points = SigmaPoints()

    def fx(pose: np.ndarray, dt: float) -> np.ndarray:
        return np.asarray(pose + rotation(pose[2]) @ motion.delta)

    ukf = UnscentedKalmanFilter(dim_x=3, dim_z=3, dt=1.0, hx=None, fx=fx, points=points)
    headings = mean[2] + np.sqrt(covariance[2, 2]) * points.nodes
    noises = [rotation(heading) @ motion.covariance @ rotation(heading).T for heading in headings]
    ukf.x, ukf.P, ukf.Q = mean, covariance, np.tensordot(points.weights, noises, axes=1)
    ukf.predict()
    return np.array([*ukf.x[:2], wrap(ukf.x[2])]), bounded(ukf.P[None])[0]


@pytest.mark.parametrize("covariance", [np.zeros((3, 3)), CORRELATED, np.diag([0.1, 0.2, 2.0])])
@pytest.mark.parametrize("delta", [(0.3, 0.02, 0.2), (-2.0, 1.0, 3.0), (0.0, 0.0, 0.0)])
def test_a_motion_is_that_of_filterpys_unscented_filter(delta: tuple[float, ...], covariance: np.ndarray) -> None:
    gaussians, motion = drawn(3, 40, widest=1.5), Motion(np.array(delta), covariance)
    after = moved(gaussians, motion)
    np.testing.assert_array_equal(after.log_weights, gaussians.log_weights)
    for index in range(40):
        mean, spread = by_filterpy(gaussians.means[index], gaussians.covariances[index], motion)
        difference = after.means[index] - mean
        np.testing.assert_allclose([*difference[:2], wrap(difference[2])], 0.0, atol=1e-12)
        np.testing.assert_allclose(after.covariances[index], spread, atol=1e-12)


def test_no_gaussians_move_nowhere() -> None:
    assert len(moved(Gaussians.none(), Motion(np.ones(3), CORRELATED)).means) == 0


# --- the look -------------------------------------------------------------------------------------------------------


def seen(seed: int, count: int) -> Evidence:
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.normal(0.0, 2.0, (count, 2)), rng.uniform(-9.0, 9.0, count)])
    one, kappa = np.ones(count), rng.choice([0.0, 0.2, 5.0, 400.0], count)
    nodes = np.zeros(count, dtype=np.int64)
    return Evidence(poses, nodes, one, one, rng.normal(size=count), rng.uniform(0.1, 1.0, count), kappa, -3.0)


def test_branches_are_kalman_updates_one_by_one() -> None:
    gaussians, evidence = drawn(5, 12), seen(6, 15)
    branches = Branches.of(gaussians, Measurements.of(evidence))
    for m in range(15):
        rows = np.eye(3)[: 3 if evidence.kappa[m] > 1.0 / ANY_HEADING else 2]
        variance = evidence.sigma[m] ** 2
        noise = np.diag([variance, variance, 1.0 / max(evidence.kappa[m], 0.1)])[: len(rows), : len(rows)]
        for c in range(12):
            covariance = gaussians.covariances[c]
            difference = evidence.poses[m] - gaussians.means[c]
            innovation = rows @ [*difference[:2], wrap(difference[2])]
            spread = rows @ covariance @ rows.T + noise
            gain = covariance @ rows.T @ np.linalg.inv(spread)
            log_volume = np.log(2.0 * np.pi * variance) + (np.log(2.0 * np.pi) if len(rows) == 3 else 0.0)
            squared = innovation @ np.linalg.inv(spread) @ innovation
            log_density = -0.5 * (squared + np.log(np.linalg.det(2.0 * np.pi * spread)))
            log_weight = gaussians.log_weights[c] + evidence.log_likelihoods[m] + log_volume + log_density
            got = branches.corrected(np.array([c]), np.array([m]))
            assert got.log_weights[0] == pytest.approx(log_weight, abs=1e-9)
            np.testing.assert_allclose(got.means[0], gaussians.means[c] + gain @ innovation, atol=1e-9)
            np.testing.assert_allclose(got.covariances[0], covariance - gain @ spread @ gain.T, atol=1e-9)


# --- sums -----------------------------------------------------------------------------------------------------------


def pooled_by_hand(gaussians: Gaussians) -> tuple[float, np.ndarray, np.ndarray]:
    weights = np.exp(gaussians.log_weights)
    share = weights / weights.sum()
    pull = np.exp(-0.5 * gaussians.covariances[:, 2, 2])
    mean = np.array([*(share @ gaussians.means[:, :2]), circular_mean(gaussians.means[:, 2], share * pull)])
    covariance = np.zeros((3, 3))
    for part, centre, own in zip(share, gaussians.means, gaussians.covariances, strict=True):
        apart = np.array([*(centre - mean)[:2], wrap(centre[2] - mean[2])])
        covariance += part * (own + np.outer(apart, apart))
    return float(np.log(weights.sum())), mean, bounded(covariance[None])[0]


def test_pools_have_the_weight_and_the_moments_of_their_members() -> None:
    gaussians, labels = drawn(7, 30), np.random.default_rng(8).permutation(np.arange(30) % 4)
    pools = pooled(gaussians, labels)
    for label in range(4):
        log_weight, mean, covariance = pooled_by_hand(gaussians.part(labels == label))
        assert pools.log_weights[label] == pytest.approx(log_weight, abs=1e-12)
        np.testing.assert_allclose(pools.means[label], mean, atol=1e-12)
        np.testing.assert_allclose(pools.covariances[label], covariance, atol=1e-12)
    one = collapsed(gaussians)
    log_weight, mean, covariance = pooled_by_hand(gaussians)
    np.testing.assert_allclose(one.means[0], mean, atol=1e-12)
    np.testing.assert_allclose(one.covariances[0], covariance, atol=1e-12)


def merged_by_hand(gaussians: Gaussians, overlap: float, most: int) -> tuple[list[Any], float]:
    """The pools of the greedy way, one comparison after the other; the weights differ, so their order is clear."""
    rest = list(np.argsort(-gaussians.log_weights))
    pools: list[Any] = []
    while rest and len(pools) < most:
        first, alike = rest[0], []
        for other in rest:
            difference = gaussians.means[other] - gaussians.means[first]
            difference[2] = wrap(difference[2])
            one, two = gaussians.covariances[first] + GRAIN, gaussians.covariances[other] + GRAIN
            middle = 0.5 * (one + two)
            volumes = np.sqrt(np.sqrt(np.linalg.det(one) * np.linalg.det(two)) / np.linalg.det(middle))
            if other == first or volumes * np.exp(-difference @ np.linalg.inv(middle) @ difference / 8.0) >= overlap:
                alike.append(other)
        pools.append(pooled_by_hand(gaussians.part(np.array(alike))))
        rest = [other for other in rest if other not in alike]
    return pools, float(np.exp(gaussians.log_weights[rest]).sum())


@pytest.mark.parametrize("most", [100, 5])
@pytest.mark.parametrize("overlap", [1.0, 0.8, 0.3])
@pytest.mark.parametrize("pairs", [1, 2000])
def test_merging_is_the_greedy_way_one_by_one(
    overlap: float, most: int, pairs: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(estimators.gaussian_sum, "PAIRS", pairs)
    rng = np.random.default_rng(9)
    some = drawn(10, 12)
    chosen = rng.integers(12, size=90)
    near = some.means[chosen] + 0.1 * rng.normal(size=(90, 3))
    gaussians = Gaussians(rng.normal(size=90), near, some.covariances[chosen] + 0.01 * np.eye(3))
    got, left = merged(gaussians, overlap, most)
    pools, expected_left = merged_by_hand(gaussians, overlap, most)
    assert overlap == 1.0 or most == 5 or 12 <= len(pools) < 60
    assert left == pytest.approx(expected_left, abs=1e-12)
    assert len(got.means) == len(pools)
    for index, (log_weight, mean, covariance) in enumerate(pools):
        assert got.log_weights[index] == pytest.approx(log_weight, abs=1e-12)
        np.testing.assert_allclose(got.means[index, :2], mean[:2], atol=1e-12)
        assert abs(wrap(got.means[index, 2] - mean[2])) < 1e-12
        np.testing.assert_allclose(got.covariances[index], covariance, atol=1e-12)


def test_cubature_points_of_many_are_those_of_each() -> None:
    gaussians = drawn(11, 20, widest=2.0)
    poses = cubature_poses(gaussians.means, gaussians.covariances)
    for index, (mean, covariance) in enumerate(zip(gaussians.means, gaussians.covariances, strict=True)):
        own = poses[6 * index : 6 * index + 6]
        np.testing.assert_allclose(own, cubature_points(mean, covariance).poses, atol=1e-12)
        shrink = np.diag([1.0, 1.0, min(1.0, np.sqrt(0.999 * ANY_HEADING / max(covariance[2, 2], 1e-9)))])
        deviations = own - mean
        deviations[:, 2] = wrap(deviations[:, 2])
        np.testing.assert_allclose(deviations[:3], -deviations[3:], atol=1e-12)
        np.testing.assert_allclose(deviations.T @ deviations / 6.0, shrink @ covariance @ shrink, atol=1e-12)
