"""Transforms are chained in either direction and at any time, and put the camera on the robot."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from topoloc.errors import UserError
from topoloc.importing.bags.intrinsics import intrinsics
from topoloc.importing.bags.mounting import mounting
from topoloc.importing.bags.poses import flattened
from topoloc.importing.bags.transforms import Transforms

OPTICAL = Rotation.from_euler("ZYX", [-np.pi / 2, 0.0, -np.pi / 2])
"""A camera's optical frame in a frame that has x ahead and z up: z ahead, y down."""


def pose(x: float, y: float, z: float, turn: Rotation) -> tuple[float, ...]:
    return (x, y, z, *turn.as_quat())


def about_z(degrees: float) -> Rotation:
    return Rotation.from_euler("z", degrees, degrees=True)


def robot() -> Transforms:
    """A robot that drives along y at 1 m/s for 10 s, half a metre off the middle of its odometer's frame."""
    known = Transforms()
    known.add("/map", "odom", None, pose(1.0, 2.0, 0.0, about_z(90.0)))
    for time in range(11):
        known.add("odom", "/base_link", 100.0 + time, pose(float(time), 0.5, 0.0, about_z(2.0 * time)))
    known.add("base_link", "camera", None, pose(0.2, 0.0, 0.3, about_z(0.0)))
    return known


def test_a_chain_is_followed_and_interpolated() -> None:
    positions, turns = robot().at("map", "base_link", np.array([100.0, 102.5, 110.0]))
    headings = np.deg2rad([90.0, 95.0, 110.0])
    expected = np.column_stack([[0.5, 0.5, 0.5], [2.0, 4.5, 12.0], headings])
    assert flattened(positions, turns) == pytest.approx(expected)


def test_a_chain_is_followed_backwards() -> None:
    times = np.array([103.3])
    there, here = robot().at("map", "camera", times), robot().at("camera", "map", times)
    assert there[0] + there[1].apply(here[0]) == pytest.approx(np.zeros((1, 3)))
    assert (there[1] * here[1]).magnitude() == pytest.approx(0.0, abs=1e-9)


def test_times_are_those_at_which_all_that_changes_is_known() -> None:
    known = robot()
    assert known.times("map", "base_link").tolist() == [100.0 + i for i in range(11)]
    for time in (104.5, 120.0):
        known.add("map", "odom", time, pose(1.0, 2.0, 0.0, about_z(90.0)))
    assert known.times("map", "base_link").tolist() == [104.5, *(105.0 + i for i in range(6))]
    known.add("far", "map", 200.0, pose(0.0, 0.0, 0.0, about_z(0.0)))
    known.add("far", "map", 201.0, pose(0.0, 0.0, 0.0, about_z(0.0)))
    with pytest.raises(UserError, match="never sent at the same time"):
        known.times("far", "base_link")


def test_two_parents_are_both_known() -> None:
    known = robot()
    for time in (100.0, 110.0):
        known.add("map", "base_link", time, pose(-3.0, 0.0, 0.0, about_z(0.0)))
    assert known.at("map", "base_link", np.array([105.0]))[0].tolist() == [[-3.0, 0.0, 0.0]]
    assert known.at("odom", "base_link", np.array([105.0]))[0] == pytest.approx(np.array([[5.0, 0.5, 0.0]]))


def test_mistakes_name_what_there_is() -> None:
    with pytest.raises(UserError, match="no transform leads from world to base_link; the bag has: base_link > camera"):
        robot().at("world", "base_link", np.array([100.0]))
    with pytest.raises(UserError, match="no transform on the way ever changes"):
        robot().times("base_link", "camera")


@pytest.mark.parametrize(("yaw", "optical"), [(0.0, True), (90.0, True), (-135.0, True), (30.0, False)])
def test_the_mount_is_where_the_camera_looks(yaw: float, optical: bool) -> None:
    known = robot()
    turn = about_z(yaw) * OPTICAL if optical else about_z(yaw)
    known.add("camera", "eye", None, pose(0.0, 0.1, 0.0, turn))
    mount, strange = mounting(known, "base_link", "eye", (100.0, 110.0))
    assert (mount.x, mount.y, mount.yaw_deg) == pytest.approx((0.2, 0.1, yaw))
    assert not strange


@pytest.mark.parametrize(
    ("turn", "told"),
    [
        (about_z(0.0) * OPTICAL * about_z(180.0), "hangs upside down"),
        (Rotation.from_euler("y", 20.0, degrees=True) * OPTICAL, "looks 20 degrees down"),
        (Rotation.from_euler("y", -20.0, degrees=True) * OPTICAL, "looks 20 degrees up"),
    ],
)
def test_a_strange_mount_is_told(turn: Rotation, told: str) -> None:
    known = robot()
    known.add("camera", "eye", None, pose(0.0, 0.0, 0.0, turn))
    mount, strange = mounting(known, "base_link", "eye", (100.0, 110.0))
    assert mount.yaw_deg == pytest.approx(0.0, abs=1e-6)
    assert len(strange) == 1 and told in strange[0]


def test_a_camera_that_pans_is_told() -> None:
    known = robot()
    known.add("camera", "eye", 100.0, pose(0.0, 0.0, 0.0, about_z(0.0) * OPTICAL))
    known.add("camera", "eye", 110.0, pose(0.0, 0.0, 0.0, about_z(40.0) * OPTICAL))
    assert "turned on the robot by 40 degrees" in mounting(known, "base_link", "eye", (100.0, 110.0))[1][0]


def test_a_camera_that_looks_at_the_ceiling_has_no_mount() -> None:
    known = robot()
    known.add(
        "camera", "eye_optical", None, pose(0.0, 0.0, 0.0, Rotation.from_euler("y", -90.0, degrees=True) * OPTICAL)
    )
    with pytest.raises(UserError, match="looks up or down"):
        mounting(known, "base_link", "eye_optical", (100.0, 110.0))


class Info:
    """A ``CameraInfo`` of a camera of 640x480."""

    def __init__(
        self, model: str = "plumb_bob", d: tuple[float, ...] = (0.0,) * 5, cx: float = 319.5, fx: float = 500.0
    ) -> None:
        self.width, self.height, self.distortion_model, self.d = 640, 480, model, d
        self.k = [fx, 0.0, cx, 0.0, 500.0, 239.5, 0.0, 0.0, 1.0]
        self.p = [450.0, 0.0, 300.0, 0.0, 0.0, 460.0, 239.5, 0.0, 0.0, 0.0, 1.0, 0.0]


def test_a_straight_camera_has_no_lens() -> None:
    camera, lens = intrinsics(Info(), rectified=False)
    assert lens is None and (camera.width, camera.height) == (640, 480)
    assert camera.hfov_deg == pytest.approx(np.rad2deg(2.0 * np.arctan(0.64)))


@pytest.mark.parametrize(
    ("info", "model", "count"),
    [
        (Info(d=(0.1, 0.0, 0.0, 0.0, 0.0)), "pinhole", 5),
        (Info("rational_polynomial", (0.1,) * 8), "pinhole", 8),
        (Info("equidistant", (0.1, 0.0, 0.0, 0.0)), "fisheye", 4),
        (Info(cx=340.0), "pinhole", 4),
    ],
)
def test_lenses(info: Info, model: str, count: int) -> None:
    _, lens = intrinsics(info, rectified=False)
    assert lens is not None
    assert (lens.model, len(lens.coefficients), lens.fx, lens.cx) == (model, count, info.k[0], info.k[2])


def test_rectified_pictures_have_the_projection_in_place_of_the_lens() -> None:
    camera, lens = intrinsics(Info(d=(0.1,) * 5), rectified=True)
    assert lens is not None, "its axis is not in the middle"
    assert (lens.fx, lens.fy, lens.cx, lens.cy, set(lens.coefficients)) == (450.0, 460.0, 300.0, 239.5, {0.0})
    assert camera.hfov_deg == pytest.approx(np.rad2deg(2.0 * np.arctan(320.0 / 450.0)))


@pytest.mark.parametrize(
    ("info", "why"),
    [
        (Info(fx=0.0), "not calibrated"),
        (Info("double_sphere", (0.1, 0.5)), "the distortion model 'double_sphere' is not known"),
        (Info(d=(0.1,) * 6), "6 coefficients"),
    ],
)
def test_infos_of_which_nothing_can_be_made(info: Info, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        intrinsics(info, rectified=False)
