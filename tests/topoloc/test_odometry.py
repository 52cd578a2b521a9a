from __future__ import annotations

import math

import numpy as np
import pytest

from topoloc.odometry import MotionGate, OdometryNoise

START, AHEAD = np.array([3.0, -1.0, 3.1]), np.zeros(3)


def moved(distance: float, degrees: float, direction: float = 0.4) -> np.ndarray:
    return np.asarray(
        START + np.array([distance * math.cos(direction), distance * math.sin(direction), math.radians(degrees)])
    )


@pytest.mark.parametrize(
    ("distance", "degrees", "opens"),
    [
        (0.0, 0.0, False),
        (0.0, 9.99, False),
        (0.0, -9.99, False),
        (0.0, 10.0, True),
        (0.0, -10.0, True),
        (0.299, 0.0, False),
        (0.3, 0.0, True),
        (0.299, 9.99, False),
        (0.299, 10.0, True),
        (0.0, 359.0, False),
    ],
)
def test_the_gate_opens_at_ten_degrees_or_thirty_centimetres(distance: float, degrees: float, opens: bool) -> None:
    assert MotionGate().opens(START, AHEAD, moved(distance, degrees), AHEAD) == opens


def test_a_turn_of_the_pan_head_opens_it() -> None:
    turned = np.array([0.0, 0.0, math.radians(10.0)])
    assert MotionGate().opens(START, AHEAD, START, turned)
    assert not MotionGate().opens(START, AHEAD, START, 0.999 * turned)
    back = moved(0.0, -10.0)
    assert not MotionGate().opens(START, AHEAD, back, turned), "the camera still looks the same way"


def test_it_is_the_camera_that_must_move() -> None:
    """A camera 2 m ahead of the axis is swept 0.35 m sideways by a turn of ten degrees."""
    mount = np.array([2.0, 0.0, 0.0])
    gate = MotionGate(min_rotation_deg=90.0)
    assert gate.opens(START, mount, moved(0.0, 10.0), mount)
    assert not gate.opens(START, AHEAD, moved(0.0, 10.0), AHEAD)


def test_its_limits_can_be_set() -> None:
    assert not MotionGate(20.0, 1.0).opens(START, AHEAD, moved(0.5, 15.0), AHEAD)
    assert MotionGate(0.0, 0.0).opens(START, AHEAD, START, AHEAD)


class TestNoise:
    def test_the_motion_is_in_the_robots_frame(self) -> None:
        motion = OdometryNoise().motion((1.0, 1.0, math.pi / 2), (1.0, 3.0, -math.pi + 0.1))
        assert motion.delta == pytest.approx([2.0, 0.0, math.pi / 2 + 0.1])

    def test_deviations_add_in_quadrature(self) -> None:
        noise = OdometryNoise(0.2, 0.03, 0.1, 0.05, 0.02)
        covariance = noise.motion((0.0, 0.0, 0.0), (3.0, 4.0, -0.5)).covariance
        position = 0.05**2 + (0.2 * 5.0) ** 2
        heading = 0.02**2 + (0.03 * 5.0) ** 2 + (0.1 * 0.5) ** 2
        assert covariance == pytest.approx(np.diag([position, position, heading]))

    def test_a_robot_that_stands_still_is_not_perfectly_sure(self) -> None:
        assert (np.diag(OdometryNoise().motion(START, START).covariance) > 0.0).all()

    def test_without_an_odometer_the_motion_is_zero_and_says_how_uncertain(self) -> None:
        motion = OdometryNoise(unknown_distance=0.7, unknown_heading=0.9).unknown()
        assert np.array_equal(motion.delta, np.zeros(3))
        assert motion.covariance == pytest.approx(np.diag([0.49, 0.49, 0.81]))


def test_a_negative_deviation_is_refused() -> None:
    with pytest.raises(ValueError, match="base_distance is -1"):
        OdometryNoise(base_distance=-1.0)
