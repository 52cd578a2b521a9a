"""Values: beliefs, motions and evidence, the latter against a literal double loop over section 4 of EQUATIONS.md."""

from __future__ import annotations

import math
from dataclasses import FrozenInstanceError, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.special import i0e
from scipy.stats import norm, vonmises

from topoloc.geometry import circular_mean, compose, cos_sin, inverse, wrap
from topoloc.mixture import Mixture
from topoloc.types import Evidence, Frame, Motion, WeightedPoses

NAMES = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")


def evidence_of(count: int = 4, seed: int = 0, log_floor: float = -4.0, **fields: object) -> Evidence:
    rng = np.random.default_rng(seed)
    values = {
        "poses": np.column_stack([rng.uniform(-2, 2, (count, 2)), rng.uniform(-np.pi, np.pi, count)]),
        "nodes": rng.integers(0, 3, count),
        "match": rng.uniform(0, 1, count),
        "distance": rng.uniform(0, 2, count),
        "log_likelihoods": rng.normal(0, 2, count),
        "sigma": rng.uniform(0.2, 1.0, count),
        "kappa": rng.uniform(1, 30, count),
    }
    return Evidence(**{**values, **fields}, log_floor=log_floor)  # type: ignore[arg-type]


def literal(evidence: Evidence, x: float, y: float, theta: float) -> float:
    """log(floor + sum w K h), with densities divided by what makes K 1 at its peak and h 1 in the mean."""
    total = math.exp(evidence.log_floor)
    for m in range(len(evidence.poses)):
        x_m, y_m, theta_m = evidence.poses[m]
        sigma, kappa = evidence.sigma[m], evidence.kappa[m]
        place = norm.pdf(x, x_m, sigma) * norm.pdf(y, y_m, sigma) * 2 * math.pi * sigma**2
        heading = vonmises.pdf(theta - theta_m, kappa) * 2 * math.pi if kappa > 0 else 1.0
        total += math.exp(evidence.log_likelihoods[m]) * place * heading
    return math.log(total)


def term_by_term(evidence: Evidence, positions: np.ndarray, headings: np.ndarray) -> np.ndarray:
    """The same at any size: every term of every pose as a logarithm, summed beside the largest. (P, 2), (P, H)."""
    squared = ((positions[:, None] - evidence.poses[:, :2]) ** 2).sum(axis=2)
    turned = np.cos(headings[:, :, None] - evidence.poses[:, 2])
    log_heading = evidence.kappa * (turned - 1.0) - np.log(i0e(evidence.kappa))
    terms = (evidence.log_likelihoods - squared / (2.0 * evidence.sigma**2))[:, None, :] + log_heading
    peak = terms.max(axis=2)
    scale = np.where(np.isfinite(peak), peak, 0.0)
    with np.errstate(divide="ignore"):
        mixture = scale + np.log(np.exp(terms - scale[..., None]).sum(axis=2))
    return np.asarray(np.logaddexp(evidence.log_floor, mixture))


def assert_equal(got: np.ndarray, expected: np.ndarray) -> None:
    """Rounding may cost 1e-9 of a value, and 1e-15 of the parts of a multiplied-out square, which are at most 1e8."""
    np.testing.assert_allclose(got, expected, rtol=1e-9, atol=2e-7)


def poses_around(evidence: Evidence, rng: np.random.Generator, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions (P, 2) and headings (P, 2): at hypotheses, about a deviation beside them, and far from all."""
    which = rng.integers(len(evidence.poses), size=count)
    aside = rng.choice([0.0, 1.0, 5.0, 40.0, 1e5], size=(count, 1)) * evidence.sigma[which, None]
    places = evidence.poses[which, :2] + aside * rng.normal(size=(count, 2))
    turns = rng.choice([0.0, 1.0, 5.0], size=(count, 1)) / np.sqrt(evidence.kappa[which, None] + 1.0)
    return places, evidence.poses[which, 2:] + turns * rng.normal(size=(count, 2))


@st.composite
def extreme_evidence(draw: st.DrawFn) -> Evidence:
    """Evidence as it comes and as bad as it gets: far from the origin, wide, sure, hopeless, without a floor."""
    count, rng = draw(st.integers(1, 6)), np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    origin, width = draw(st.sampled_from([0.0, 1e4, 3e6])), draw(st.sampled_from([0.0, 5.0, 300.0, 1e4]))
    logs = draw(st.lists(st.sampled_from([0.0, 20.0, -300.0, -650.0, 1e6, -1e6, -np.inf]), min_size=1, max_size=count))
    return evidence_of(
        count,
        poses=np.column_stack([origin + rng.uniform(-width, width, (count, 2)), rng.uniform(-np.pi, np.pi, count)]),
        log_likelihoods=np.resize(logs, count) + rng.normal(size=count),
        sigma=rng.choice([0.02, 0.4, 3.0], count),
        kappa=rng.choice(draw(st.sampled_from([[0.0], [0.0, 20.0], [0.3, 1e4, 1e6]])), count),
        log_floor=draw(st.sampled_from([-4.0, 2.0, -600.0, -645.0, -700.0, -1e6, -np.inf])),
    )


class TestCosSin:
    @given(st.lists(st.floats(-1e6, 1e6), max_size=20))
    def test_equals_numpys_cosine_and_sine(self, angles: list[float]) -> None:
        cos, sin = cos_sin(np.array(angles, dtype=np.float64))
        np.testing.assert_allclose(cos, np.cos(angles), rtol=0.0, atol=4e-16)
        np.testing.assert_allclose(sin, np.sin(angles), rtol=0.0, atol=4e-16)

    def test_at_quarters_of_the_circle_where_tangents_are_largest(self) -> None:
        angles = np.array([quarters * np.pi / 2.0 for quarters in range(-8, 9)])
        angles = np.concatenate([np.nextafter(angles, -np.inf), angles, np.nextafter(angles, np.inf)])
        np.testing.assert_allclose(cos_sin(angles), (np.cos(angles), np.sin(angles)), rtol=0.0, atol=4e-16)


class TestWeightedPoses:
    def test_weights_sum_to_one_whatever_the_common_constant(self) -> None:
        logs = np.array([0.0, -1.0, -np.inf])
        for constant in (-1e5, 0.0, 1e5):
            weights = WeightedPoses(np.zeros((3, 3)), logs + constant).weights
            assert weights.sum() == pytest.approx(1.0)
            assert weights[0] / weights[1] == pytest.approx(math.e)
            assert weights[2] == 0.0

    def test_uniform(self) -> None:
        belief = WeightedPoses.uniform(np.arange(12.0).reshape(4, 3), (0.1, 0.2, 0.3))
        assert belief.weights == pytest.approx(np.full(4, 0.25))
        assert belief.spread == pytest.approx([0.1, 0.2, 0.3])

    @pytest.mark.parametrize(
        ("poses", "logs"),
        [
            (np.zeros((0, 3)), np.zeros(0)),
            (np.zeros((2, 2)), np.zeros(2)),
            (np.zeros((2, 3)), np.zeros(3)),
            (np.full((1, 3), np.nan), np.zeros(1)),
            (np.zeros((2, 3)), np.full(2, -np.inf)),
            (np.zeros((2, 3)), np.array([0.0, np.nan])),
            (np.zeros((2, 3)), np.array([0.0, np.inf])),
        ],
        ids=["none", "two columns", "lengths differ", "NaN pose", "all weights zero", "NaN weight", "infinite weight"],
    )
    def test_refuses(self, poses: np.ndarray, logs: np.ndarray) -> None:
        with pytest.raises(ValueError, match=r"shape|finite"):
            WeightedPoses(poses, logs)

    def test_keeps_its_own_read_only_copy(self) -> None:
        poses = np.zeros((2, 3))
        belief = WeightedPoses(poses, np.zeros(2))
        poses[0, 0] = 9.0
        assert belief.poses[0, 0] == 0.0
        for array in (belief.poses, belief.log_weights, belief.spread):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
        with pytest.raises(FrozenInstanceError):
            belief.poses = poses  # type: ignore[misc]


class TestMotionAndFrame:
    @pytest.mark.parametrize(
        ("delta", "covariance"),
        [
            (np.zeros(2), np.eye(3)),
            (np.zeros(3), np.eye(2)),
            (np.array([0, np.nan, 0]), np.eye(3)),
            (np.zeros(3), np.inf * np.ones((3, 3))),
        ],
        ids=["two values", "two by two", "NaN", "infinite covariance"],
    )
    def test_a_motion_is_three_finite_numbers(self, delta: np.ndarray, covariance: np.ndarray) -> None:
        with pytest.raises(ValueError, match=r"shape|finite"):
            Motion(delta, covariance)

    def test_arrays_are_read_only(self) -> None:
        motion, frame = Motion(np.zeros(3), np.eye(3)), Frame(0.0, np.zeros(3), np.zeros(3), {})
        assert frame.odometry is not None
        for array in (motion.delta, motion.covariance, frame.odometry, frame.camera):
            with pytest.raises(ValueError, match="read-only"):
                array[0] = 1.0
        assert Frame(0.0, None, np.zeros(3), {}).odometry is None


class TestLogLikelihood:
    @settings(max_examples=30, deadline=None)
    @given(
        seed=st.integers(0, 2**32 - 1),
        count=st.integers(1, 5),
        kappa=st.sampled_from([0.0, 0.5, 20.0, 300.0]),
        floor=st.floats(-8, 0),
    )
    def test_equals_the_double_loop(self, seed: int, count: int, kappa: float, floor: float) -> None:
        evidence = evidence_of(count, seed, floor, kappa=np.full(count, kappa))
        rng = np.random.default_rng(seed)
        place, heading = rng.uniform(-3, 3, (3, 2)), rng.uniform(-7, 7, (3, 4))
        got = evidence.log_likelihood(place, heading)
        assert got.shape == (3, 4)
        for p in range(3):
            for h in range(4):
                assert got[p, h] == pytest.approx(
                    literal(evidence, place[p, 0], place[p, 1], heading[p, h]), rel=1e-9, abs=1e-9
                )

    @settings(max_examples=300, deadline=None)
    @given(extreme_evidence(), st.integers(0, 2**32 - 1))
    def test_all_ways_equal_the_sum_term_by_term(self, evidence: Evidence, seed: int) -> None:
        places, headings = poses_around(evidence, np.random.default_rng(seed), 7)
        expected = term_by_term(evidence, places, headings)
        assert_equal(evidence.log_likelihood(places, headings), expected)
        assert_equal(evidence.log_likelihood(places, headings[:, :1]), expected[:, :1])
        shared = term_by_term(evidence, places, np.tile(headings[:1], (7, 1)))
        assert_equal(evidence.log_likelihood(places, headings[:1]), shared)
        crossings = np.stack(np.meshgrid(places[:4, 0], places[:, 1], indexing="ij"), axis=-1).reshape(-1, 2)
        on_grid = term_by_term(evidence, crossings, np.full((28, 1), headings[0, 0])).reshape(4, 7)
        got = evidence.log_likelihood_on_grid(places[:4, 0], places[:, 1], headings[0, 0])
        assert_equal(got, on_grid)

    def test_where_exponentials_begin_to_underflow(self) -> None:
        """One hypothesis, sigma 1: the sum is exp(-d^2 / 2), and loses its digits, then all, from exp(-708) on."""
        one = evidence_of(1, poses=np.zeros((1, 3)), sigma=[1.0], kappa=[0.0], log_likelihoods=[0.0], log_floor=-np.inf)
        away = np.sqrt(2.0 * np.linspace(600.0, 800.0, 401))
        places, zeros = np.column_stack([away, 0.0 * away]), np.zeros((401, 1))
        np.testing.assert_allclose(one.log_likelihood(places, zeros)[:, 0], -(away**2) / 2.0, rtol=1e-12)
        np.testing.assert_allclose(one.log_likelihood(places, zeros[:1])[:, 0], -(away**2) / 2.0, rtol=1e-12)
        np.testing.assert_allclose(one.log_likelihood_on_grid(away, [0.0], 0.0)[:, 0], -(away**2) / 2.0, rtol=1e-12)

    @pytest.mark.parametrize("origin", [0.0, 1e4, 3e6])
    def test_a_map_far_from_the_origin_is_as_exact_and_as_fast(
        self, origin: float, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        """UTM coordinates of a map 40 m wide; the parts of its squares stay below 1e5, so rounding below 1e-10."""
        rng = np.random.default_rng(5)
        poses = np.column_stack([origin + rng.uniform(-20, 20, (9, 2)), rng.uniform(-3, 3, 9)])
        evidence = evidence_of(9, poses=poses)
        places, headings = poses_around(evidence, rng, 500)

        def exactly(mixture: Mixture, at: np.ndarray, *_: np.ndarray) -> np.ndarray:
            assert len(at) == 0, "the slow way was taken"
            return np.zeros(0)

        monkeypatch.setattr(Mixture, "_exactly", exactly)
        got = evidence.log_likelihood(places, headings[:, :1])
        np.testing.assert_allclose(got, term_by_term(evidence, places, headings[:, :1]), rtol=1e-11, atol=1e-10)

    @pytest.mark.parametrize("count", [1, 3, 70_000])
    def test_many_poses_and_many_hypotheses_are_taken_in_parts(self, count: int) -> None:
        evidence, rng = evidence_of(count, kappa=np.full(count, 3.0)), np.random.default_rng(8)
        places, headings = rng.uniform(-2, 2, (max(3, 200_000 // count), 2)), rng.uniform(-3, 3, (1, 1))
        each = np.repeat(headings, len(places), axis=0)
        got = evidence.log_likelihood(places, each)
        assert np.allclose(got, evidence.log_likelihood(places, headings), atol=1e-9)
        some = [0, len(places) // 2, -1]
        assert np.allclose(got[some], term_by_term(evidence, places[some], each[some]), atol=1e-9)

    def test_no_positions_and_no_headings(self) -> None:
        evidence = evidence_of()
        assert evidence.log_likelihood(np.zeros((0, 2)), np.zeros((0, 1))).shape == (0, 1)
        assert evidence.log_likelihood(np.zeros((0, 2)), np.zeros((1, 3))).shape == (0, 3)
        assert evidence.log_likelihood(np.zeros((2, 2)), np.zeros((1, 0))).shape == (2, 0)
        assert evidence.log_likelihood_on_grid(np.zeros(0), np.zeros(3), 0.0).shape == (0, 3)

    def test_headings_shared_by_all_positions_equal_the_same_for_each(self) -> None:
        evidence, place = evidence_of(), np.random.default_rng(1).uniform(-2, 2, (5, 2))
        shared = np.array([[0.0, 1.0, -2.0]])
        assert np.allclose(
            evidence.log_likelihood(place, shared),
            evidence.log_likelihood(place, np.repeat(shared, 5, axis=0)),
            atol=1e-12,
        )

    def test_a_blind_frame_says_zero_everywhere(self) -> None:
        blind = Evidence.blind()
        assert blind.is_blind and not evidence_of().is_blind
        assert np.array_equal(blind.log_likelihood(np.ones((3, 2)), np.ones((1, 4))), np.zeros((3, 4)))
        assert np.array_equal(blind.log_likelihood(np.ones((3, 2)), np.ones((3, 2))), np.zeros((3, 2)))
        assert np.array_equal(blind.log_likelihood_on_grid(np.ones(3), np.ones(2), 0.5), np.zeros((3, 2)))
        assert blind.log_mass == -np.inf
        assert len(blind.best_per_node()) == 0
        assert blind.of_robot((0.1, 0.0, 1.0)).is_blind

    def test_without_kappa_the_heading_does_not_matter(self) -> None:
        values = evidence_of(kappa=np.zeros(4)).log_likelihood(np.zeros((1, 2)), np.linspace(-3, 3, 9)[None])
        assert np.ptp(values) == pytest.approx(0.0, abs=1e-12)

    def test_a_heading_known_to_a_hair_does_not_overflow(self) -> None:
        evidence = evidence_of(1, poses=np.array([[0.0, 0.0, 1.0]]), kappa=[1e6], log_likelihoods=[0.0])
        at, aside = evidence.log_likelihood(np.zeros((1, 2)), np.array([[1.0, 1.1]]))[0]
        assert at == pytest.approx(0.5 * math.log(2 * math.pi * 1e6), abs=0.1)  # peak of a narrow Gaussian, mean 1
        assert aside == pytest.approx(-4.0)

    @pytest.mark.parametrize("size", [1e3, 1e5, 1e8])
    def test_huge_log_likelihoods_do_not_overflow(self, size: float) -> None:
        pose = np.array([[0.0, 0.0, 0.0]])
        up = evidence_of(1, poses=pose, log_likelihoods=[size], kappa=[0.0], sigma=[0.5])
        assert up.log_likelihood(np.array([[0.5, 0.0]]), np.zeros((1, 1)))[0, 0] == pytest.approx(size - 0.5)
        down = evidence_of(1, poses=pose, log_likelihoods=[-size], kappa=[0.0])
        assert down.log_likelihood(np.zeros((1, 2)), np.zeros((1, 1)))[0, 0] == pytest.approx(-4.0)

    @pytest.mark.parametrize("size", [0.0, 20.0, 1e3, 1e5])
    def test_never_below_the_floor(self, size: float) -> None:
        """However sure a hypothesis is, far from it the floor remains: wrong evidence must not kill the truth."""
        evidence = evidence_of(log_floor=-3.0, log_likelihoods=np.full(4, size))
        values = evidence.log_likelihood(np.array([[0.0, 0.0], [1e4, 0.0], [-1e6, 1e6]]), np.zeros((1, 1)))[:, 0]
        assert (values >= -3.0 - 1e-9).all()
        assert values[1:] == pytest.approx([-3.0, -3.0])

    def test_nor_where_only_the_heading_is_wrong(self) -> None:
        pose = np.array([[0.0, 0.0, 0.0]])
        evidence = evidence_of(1, log_floor=-3.0, poses=pose, log_likelihoods=[900.0], kappa=[1e6])
        assert evidence.log_likelihood(pose[:, :2], np.array([[3.0]]))[0, 0] == pytest.approx(-3.0)

    def test_a_floor_of_zero_is_allowed(self) -> None:
        evidence = evidence_of(log_floor=-np.inf)
        near, far = evidence.log_likelihood(np.array([[0.0, 0.0], [1e6, 0.0]]), np.zeros((1, 1)))[:, 0]
        assert np.isfinite(near) and far < -1e10
        nothing = evidence_of(log_floor=-np.inf, log_likelihoods=np.full(4, -np.inf))
        assert nothing.log_likelihood(np.zeros((1, 2)), np.zeros((1, 1)))[0, 0] == -np.inf

    @pytest.mark.parametrize("kappa", [0.0, 0.3, 8.0, 500.0, 1e4])
    def test_the_heading_factor_has_mean_one_over_the_circle(self, kappa: float) -> None:
        evidence = evidence_of(
            1, log_floor=-np.inf, poses=np.array([[0.0, 0.0, 0.5]]), kappa=[kappa], log_likelihoods=[0.0]
        )
        circle = wrap(np.arange(20_000) * 2 * np.pi / 20_000)
        with np.errstate(under="ignore"):
            values = np.exp(evidence.log_likelihood(np.zeros((1, 2)), circle[None]))
        assert values.mean() == pytest.approx(1.0, rel=1e-6)

    @given(st.permutations(range(5)), st.integers(0, 1000))
    def test_the_order_of_hypotheses_changes_nothing(self, order: list[int], seed: int) -> None:
        evidence = evidence_of(5, seed)
        other = replace(evidence, **{name: getattr(evidence, name)[order] for name in NAMES})
        place, heading = np.random.default_rng(2).uniform(-2, 2, (6, 2)), np.linspace(-3, 3, 5)[None]
        assert np.allclose(evidence.log_likelihood(place, heading), other.log_likelihood(place, heading), atol=1e-12)
        assert other.log_mass == pytest.approx(evidence.log_mass)

    def test_splitting_a_hypothesis_in_two_halves_changes_nothing(self) -> None:
        evidence = evidence_of(2)
        twice: dict[str, Any] = {name: np.repeat(getattr(evidence, name), 2, axis=0) for name in NAMES}
        twice["log_likelihoods"] = twice["log_likelihoods"] - math.log(2.0)
        split = replace(evidence, **twice)
        place, heading = np.random.default_rng(2).uniform(-2, 2, (6, 2)), np.linspace(-3, 3, 5)[None]
        assert np.allclose(evidence.log_likelihood(place, heading), split.log_likelihood(place, heading), atol=1e-12)


class TestMassAndSample:
    def test_log_mass_is_the_integral_over_the_plane(self) -> None:
        """Integrated in polar coordinates around each hypothesis, the heading averaged to one."""
        evidence = evidence_of(3, log_floor=-np.inf)
        total = 0.0
        for m in range(3):
            one = replace(evidence, **{name: getattr(evidence, name)[m : m + 1] for name in NAMES})
            x, y, theta = one.poses[0]
            circle = theta + np.arange(720) * 2 * np.pi / 720

            def ring(r: float, one: Evidence = one, x: float = x, y: float = y, circle: np.ndarray = circle) -> float:
                values = np.exp(one.log_likelihood(np.array([[x + r, y]]), circle[None]))
                return float(values.mean()) * 2 * math.pi * r

            total += quad(ring, 0.0, 8.0 * float(one.sigma[0]))[0]
        assert evidence.log_mass == pytest.approx(math.log(total), abs=1e-6)
        assert replace(evidence, log_floor=3.0).log_mass == evidence.log_mass

    def test_log_mass_of_huge_log_likelihoods(self) -> None:
        assert evidence_of(1, log_likelihoods=[1e5], sigma=[1.0]).log_mass == pytest.approx(1e5 + math.log(2 * math.pi))

    def test_moments_of_a_sample(self) -> None:
        """20,000 draws: means within 4 standard errors (0.015 m, 0.03 in a share, 0.02 rad)."""
        evidence = evidence_of(
            2,
            poses=np.array([[0.0, 0.0, 3.0], [5.0, 1.0, -1.0]]),
            log_likelihoods=[math.log(3.0), 0.0],
            sigma=[0.25, 0.5],
            kappa=[10.0, 0.0],
        )
        drawn = evidence.sample(20_000, np.random.default_rng(7))
        assert drawn.shape == (20_000, 3)
        assert ((drawn[:, 2] >= -np.pi) & (drawn[:, 2] < np.pi)).all()
        first = drawn[:, 0] < 2.5
        weight = 3.0 * 0.25**2 / (3.0 * 0.25**2 + 0.5**2)  # mass, not height
        assert first.mean() == pytest.approx(weight, abs=0.015)
        assert drawn[first, :2].mean(axis=0) == pytest.approx([0.0, 0.0], abs=0.015)
        assert drawn[first, :2].std(axis=0) == pytest.approx([0.25, 0.25], abs=0.015)
        assert drawn[~first, :2].std(axis=0) == pytest.approx([0.5, 0.5], abs=0.03)
        assert float(wrap(circular_mean(drawn[first, 2]) - 3.0)) == pytest.approx(0.0, abs=0.02)
        assert np.cos(drawn[first, 2] - 3.0).mean() == pytest.approx(1.0 - vonmises(10.0).var() / 2, abs=0.02)
        assert np.abs(np.exp(1j * drawn[~first, 2]).mean()) < 0.04

    def test_a_sample_is_repeatable(self) -> None:
        evidence = evidence_of()
        first, second = (evidence.sample(5, np.random.default_rng(3)) for _ in range(2))
        assert np.array_equal(first, second)

    def test_extremes_can_be_sampled(self) -> None:
        sure = evidence_of(2, log_likelihoods=[1e5, -np.inf], kappa=[1e6, 0.0])
        drawn = sure.sample(50, np.random.default_rng(0))
        assert np.abs(wrap(drawn[:, 2] - sure.poses[0, 2])).max() < 0.01

    @pytest.mark.parametrize(
        "evidence", [Evidence.blind(), evidence_of(log_likelihoods=np.full(4, -np.inf))], ids=["blind", "all zero"]
    )
    def test_nothing_cannot_be_sampled(self, evidence: Evidence) -> None:
        with pytest.raises(ValueError, match="sample"):
            evidence.sample(1, np.random.default_rng(0))


class TestOfRobot:
    @given(st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.floats(-3, 3)))
    def test_the_mount_composed_with_the_robot_is_the_camera(self, mount: tuple[float, float, float]) -> None:
        evidence = evidence_of()
        robot = evidence.of_robot(mount)
        camera = compose(robot.poses, np.array(mount))
        assert np.allclose(camera[:, :2], evidence.poses[:, :2], atol=1e-9)
        assert np.allclose(wrap(camera[:, 2] - evidence.poses[:, 2]), 0.0, atol=1e-9)

    def test_there_and_back(self) -> None:
        evidence, mount = evidence_of(), np.array([0.2, -0.1, 2.0])
        back = evidence.of_robot(mount).of_robot(inverse(mount))
        assert np.allclose(back.poses, evidence.poses)

    def test_only_the_poses_change(self) -> None:
        evidence = evidence_of(log_floor=-2.5)
        moved = evidence.of_robot((0.2, 0.0, 0.5))
        for name in NAMES[1:]:
            assert np.array_equal(getattr(moved, name), getattr(evidence, name))
        assert moved.log_floor == -2.5

    def test_where_the_heading_is_unknown_the_position_stays(self) -> None:
        evidence = evidence_of(2, kappa=[0.0, 5.0])
        moved = evidence.of_robot((0.3, 0.0, 0.5))
        assert np.array_equal(moved.poses[0, :2], evidence.poses[0, :2])
        assert float(wrap(evidence.poses[0, 2] - moved.poses[0, 2])) == pytest.approx(0.5)
        assert np.hypot(*(moved.poses[1, :2] - evidence.poses[1, :2])) == pytest.approx(0.3)


class TestEvidence:
    def test_best_per_node(self) -> None:
        evidence = evidence_of(5, nodes=[2, 0, 2, 0, 5], match=[0.1, 0.8, 0.9, 0.3, 0.2])
        assert evidence.best_per_node().tolist() == [1, 2, 4]

    @given(st.integers(0, 2**32 - 1), st.integers(1, 30))
    def test_best_per_node_is_the_first_of_all_sorted(self, seed: int, count: int) -> None:
        """Among equal matches, too; poses that are the same decide by their place in the list."""
        rng = np.random.default_rng(seed)
        evidence = evidence_of(
            count,
            poses=rng.integers(0, 2, (count, 3)),
            nodes=rng.integers(-1, 5, count),
            match=rng.integers(0, 3, count) / 3.0,
        )
        x, y, heading = evidence.poses.T
        order = np.lexsort((heading, y, x, -evidence.match, evidence.nodes))
        _, first = np.unique(evidence.nodes[order], return_index=True)
        assert np.array_equal(evidence.best_per_node(), order[first])

    @given(st.permutations(range(6)))
    def test_best_per_node_in_any_order(self, order: list[int]) -> None:
        evidence = evidence_of(6, nodes=[2, 0, 2, 0, 5, 0])
        other = replace(evidence, **{name: getattr(evidence, name)[order] for name in NAMES})
        assert np.array_equal(other.match[other.best_per_node()], evidence.match[evidence.best_per_node()])

    @pytest.mark.parametrize("name", NAMES)
    def test_arrays_are_read_only_and_of_one_length(self, name: str) -> None:
        evidence = evidence_of()
        with pytest.raises(ValueError, match="read-only"):
            getattr(evidence, name)[0] = 0
        with pytest.raises(ValueError, match="shape"):
            replace(evidence, **{name: getattr(evidence, name)[:-1]})
        with pytest.raises(FrozenInstanceError):
            setattr(evidence, name, None)

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("poses", np.full((4, 3), np.nan)),
            ("log_likelihoods", np.full(4, np.nan)),
            ("log_likelihoods", np.full(4, np.inf)),
            ("sigma", np.zeros(4)),
            ("sigma", np.full(4, np.nan)),
            ("sigma", np.full(4, np.inf)),
            ("kappa", np.full(4, -1.0)),
            ("kappa", np.full(4, np.nan)),
            ("log_floor", np.nan),
            ("log_floor", np.inf),
        ],
    )
    def test_refuses(self, name: str, value: Any) -> None:
        with pytest.raises(ValueError, match=r"finite|infinity|positive|negative"):
            replace(evidence_of(), **{name: value})
