"""ROS 2's messages and our values."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from topoloc.dds import messages as ros
from topoloc.dds.convert import ENCODINGS, MAX_PARTICLES, cloud, pixels, planar_pose, seconds, stamp, thinned
from topoloc.errors import UserError
from topoloc.types import WeightedPoses

YUV = ("yuv422", "uyvy", "yuv422_yuy2", "yuyv")


def odometry(quaternion: tuple[float, ...]) -> ros.Odometry:
    return ros.Odometry(pose=ros.PoseWithCovariance(ros.Pose(ros.Point(1.0, 2.0, 3.0), ros.Quaternion(*quaternion))))


@given(st.integers(-(2**31), 2**31 - 1), st.integers(0, 999_999_999))
def test_a_stamp_comes_back_to_a_microsecond(sec: int, nanosec: int) -> None:
    again = stamp(seconds(ros.Time(sec, nanosec)))
    assert abs((again.sec - sec) * 10**9 + again.nanosec - nanosec) < 1000
    assert 0 <= again.nanosec < 10**9


@pytest.mark.parametrize(("time", "sec"), [(3e9, 2**31 - 1), (-3e9, -(2**31))])
def test_a_clock_beyond_ros(time: float, sec: int) -> None:
    assert stamp(time).sec == sec


@given(st.floats(-3.1, 3.1), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5), st.floats(0.5, 2.0))
def test_the_heading_of_a_robot_on_a_slope(yaw: float, pitch: float, roll: float, length: float) -> None:
    """The heading is where its x axis points in the plane; a quaternion of another length is the same rotation."""
    turned = Rotation.from_euler("ZYX", [yaw, pitch, roll])
    assert planar_pose(odometry(tuple(length * turned.as_quat()))) == pytest.approx([1.0, 2.0, yaw])


def test_a_quaternion_that_was_never_filled_in_is_no_heading() -> None:
    assert np.isnan(planar_pose(odometry((0.0, 0.0, 0.0, 0.0)))).all()


@pytest.mark.parametrize("encoding", [name for name in ENCODINGS if name not in YUV])
def test_every_encoding_gives_the_same_red(encoding: str) -> None:
    """A red picture, rows padded; a Bayer pattern is checked in its middle, and grey is grey."""
    depth, _ = ENCODINGS[encoding]
    row = {"rgb8": [200, 10, 10], "bgr8": [10, 10, 200], "8UC3": [10, 10, 200]}
    row |= {"rgba8": [200, 10, 10, 255], "bgra8": [10, 10, 200, 255], "mono8": [67], "8UC1": [67]}
    if encoding.startswith("bayer"):
        letters = encoding.removeprefix("bayer_").removesuffix("8")
        tile = np.array([200 if letter == "r" else 10 for letter in letters]).reshape(2, 2)
        table = np.tile(tile, (4, 4))
    else:
        table = np.tile(row[encoding], (8, 8))
    padded = np.hstack([table, np.zeros((8, 3), dtype=int)]).astype(np.uint8)
    image = pixels(ros.Image(ros.Header(), 8, 8, encoding, 0, 8 * depth + 3, padded.tobytes()))
    assert image.shape == (8, 8, 3) and image.dtype == np.uint8
    wanted = [67, 67, 67] if encoding in ("mono8", "8UC1") else [200, 10, 10]
    assert (image[2:-2, 2:-2] == wanted).all()


@pytest.mark.parametrize("encoding", YUV)
def test_yuv_is_bright_where_y_is(encoding: str) -> None:
    white_and_black = [128, 235, 128, 16] if encoding in ("yuv422", "uyvy") else [235, 128, 16, 128]
    image = pixels(ros.Image(ros.Header(), 1, 2, encoding, 0, 4, bytes(white_and_black)))
    assert image.tolist() == [[[255, 255, 255], [0, 0, 0]]]


@pytest.mark.parametrize(
    ("message", "says"),
    [
        (ros.Image(height=1, width=1, encoding="32FC1", step=4, data=bytes(4)), "'32FC1'; publish one of rgb8, "),
        (ros.Image(height=2, width=2, encoding="mono8", step=2, data=bytes(3)), "2x2 with 2 bytes a row, and 3 bytes"),
        (ros.Image(height=1, width=2, encoding="rgb8", step=2, data=bytes(6)), "mend its publisher"),
        (ros.Image(height=0, width=2, encoding="rgb8", step=6), "2x0"),
        (ros.Image(height=2, width=3, encoding="yuv422", step=6, data=bytes(12)), "3x2 .*, in yuv422; mend"),
    ],
    ids=["unknown encoding", "too few bytes", "rows too short", "no rows", "half a pair of columns"],
)
def test_no_picture(message: ros.Image, says: str) -> None:
    with pytest.raises(UserError, match=says):
        pixels(message)


def test_a_large_belief_is_thinned_out() -> None:
    """Its mean stays, and poses of the same weight are taken evenly. Seed 0."""
    rng = np.random.default_rng(0)
    poses = np.column_stack([np.sort(rng.normal(size=20_000)), np.zeros((20_000, 2))])
    belief = WeightedPoses(poses, rng.normal(size=20_000))
    kept, weights = thinned(belief)
    assert len(kept) <= MAX_PARTICLES and weights.sum() == pytest.approx(1.0)
    assert weights @ kept[:, 0] == pytest.approx(belief.weights @ poses[:, 0], abs=0.01)
    assert np.isin(kept[:, 0], poses[:, 0]).all()


def test_a_small_belief_is_told_as_it_is() -> None:
    belief = WeightedPoses(np.array([[0.0, 1.0, 2.0], [3.0, 4.0, -2.0], [5.0, 5.0, 0.0]]), np.log([0.25, 0.75, 1e-300]))
    particles = cloud(belief, ros.Time(1)).particles
    assert [particle.weight for particle in particles] == pytest.approx([0.25, 0.75, 0.0])
    assert [particle.pose.position.y for particle in particles] == [1.0, 4.0, 5.0]
    turned = particles[1].pose.orientation
    assert 2.0 * np.arctan2(turned.z, turned.w) == pytest.approx(-2.0)


def test_poses_of_no_weight_are_not_told() -> None:
    belief = WeightedPoses(np.zeros((3, 3)), np.array([0.0, -np.inf, 0.0]))
    assert [particle.weight for particle in cloud(belief, ros.Time(1)).particles] == [0.5, 0.5]
