"""The laws of SE(2), with angles on either side of the seam."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st

from topoloc.geometry import between, circular_mean, compose, inverse, nearest_on_segment, rotate, wrap

metres = st.floats(-50.0, 50.0)
angles = st.floats(-math.pi, math.pi, exclude_max=True)
poses = st.tuples(metres, metres, angles).map(np.array)


def same_pose(a: np.ndarray, b: np.ndarray) -> bool:
    return bool(
        np.allclose(a[..., :2], b[..., :2], atol=1e-9) and np.allclose(wrap(a[..., 2] - b[..., 2]), 0, atol=1e-9)
    )


@given(st.floats(-1e6, 1e6))
@example(math.pi)
@example(-math.pi)
@example(math.nextafter(-math.pi, -10.0))
@example(math.nextafter(math.pi, 10.0))
@example(-3.0 * math.pi)
@example(math.nextafter(-3.0 * math.pi, -10.0))
def test_wrap_lands_in_the_half_open_range_and_keeps_the_direction(angle: float) -> None:
    wrapped = float(wrap(angle))
    assert -math.pi <= wrapped < math.pi
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-8)
    assert math.sin(wrapped) == pytest.approx(math.sin(angle), abs=1e-8)


@pytest.mark.parametrize("turns", [-2, -1, 0, 1, 2])
def test_wrap_takes_whole_turns_off(turns: int) -> None:
    assert float(wrap(0.3 + turns * 2.0 * math.pi)) == pytest.approx(0.3, abs=1e-12)


def test_wrap_keeps_the_shape() -> None:
    assert wrap(np.zeros((2, 3))).shape == (2, 3)
    assert wrap(0.0).shape == ()


@given(poses)
def test_inverse_undoes_from_both_sides(a: np.ndarray) -> None:
    assert same_pose(compose(a, inverse(a)), np.zeros(3))
    assert same_pose(compose(inverse(a), a), np.zeros(3))
    assert same_pose(inverse(inverse(a)), a)


@given(poses, poses)
def test_between_is_what_compose_adds(a: np.ndarray, b: np.ndarray) -> None:
    assert same_pose(compose(a, between(a, b)), b)
    assert same_pose(between(a, compose(a, b)), b)
    assert same_pose(inverse(compose(a, b)), compose(inverse(b), inverse(a)))


@given(poses, poses, poses)
def test_compose_is_associative(a: np.ndarray, b: np.ndarray, c: np.ndarray) -> None:
    assert same_pose(compose(compose(a, b), c), compose(a, compose(b, c)))


@given(poses, poses, poses)
def test_a_common_change_of_frame_does_not_change_what_lies_between(
    a: np.ndarray, b: np.ndarray, frame: np.ndarray
) -> None:
    assert same_pose(between(compose(frame, a), compose(frame, b)), between(a, b))


def test_compose_by_hand() -> None:
    """One metre ahead of a robot that looks along +y, which then turns left by 90 degrees: counter-clockwise."""
    assert compose((2.0, 3.0, math.pi / 2), (1.0, 0.0, math.pi / 2)) == pytest.approx([2.0, 4.0, -math.pi])
    assert rotate((1.0, 0.0), math.pi / 2) == pytest.approx([0.0, 1.0], abs=1e-15)


def test_compose_broadcasts_like_one_at_a_time() -> None:
    rng = np.random.default_rng(0)
    many, one = rng.normal(size=(4, 5, 3)), rng.normal(size=3)
    left, right = compose(one, many), compose(many, one)
    assert left.shape == right.shape == (4, 5, 3)
    assert np.array_equal(left[2, 3], compose(one, many[2, 3]))
    assert np.array_equal(right[2, 3], compose(many[2, 3], one))


@settings(max_examples=60)
@given(st.lists(st.tuples(st.floats(-1.5, 1.5), st.floats(0.1, 5.0)), min_size=1, max_size=6), st.floats(-10.0, 10.0))
def test_circular_mean_turns_with_its_angles(pairs: list[tuple[float, float]], turn: float) -> None:
    angle, weight = np.array(pairs).T
    mean = circular_mean(angle, weight)
    assert -math.pi <= mean < math.pi
    assert float(wrap(circular_mean(angle + turn, weight) - mean - turn)) == pytest.approx(0.0, abs=1e-8)


@given(st.lists(st.floats(-3.1, 3.1), min_size=1, max_size=6), st.floats(0.01, 100.0))
def test_circular_mean_ignores_the_scale_of_weights(angle: list[float], scale: float) -> None:
    vector = np.exp(1j * np.array(angle)).sum()
    assume(abs(vector) > 1e-3)
    plain, scaled = circular_mean(angle), circular_mean(angle, np.full(len(angle), scale))
    assert float(wrap(plain - scaled)) == pytest.approx(0.0, abs=1e-9)
    assert float(wrap(plain - np.angle(vector))) == pytest.approx(0.0, abs=1e-9)


def test_circular_mean_across_the_seam() -> None:
    assert abs(circular_mean([math.pi - 0.1, -math.pi + 0.1])) == pytest.approx(math.pi)
    assert circular_mean([math.pi - 0.1, -math.pi + 0.3]) == pytest.approx(-math.pi + 0.1)
    assert circular_mean([0.0, math.pi / 2], [0.0, 1.0]) == pytest.approx(math.pi / 2)


@given(st.lists(st.tuples(*[st.floats(-9, 9)] * 6), min_size=1, max_size=9))
def test_nearest_point_of_a_segment(rows: list[tuple[float, ...]]) -> None:
    """Against a fine search along it; a segment each, and one for all, agree."""
    table = np.array(rows)
    point, start, end = table[:, :2], table[:, 2:4], table[:, 4:]
    foot = nearest_on_segment(point, start, end)
    along = start[:, None] + np.linspace(0.0, 1.0, 201)[:, None] * (end - start)[:, None]
    searched = np.linalg.norm(along - point[:, None], axis=2).min(axis=1)
    distance = np.linalg.norm(foot - point, axis=1)
    assert (distance <= searched + 1e-9).all()
    assert (distance >= searched - 26.0 / 200.0).all()
    np.testing.assert_allclose(nearest_on_segment(point, start[0], end[0])[0], foot[0], atol=1e-12)
