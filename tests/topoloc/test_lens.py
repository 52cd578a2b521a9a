"""Lenses: a straightened picture shows points where a pinhole camera would, and camera.toml tells of them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topoloc.errors import InputError, UserError
from topoloc.files import write_image
from topoloc.lens import Lens, pinhole_matrix
from topoloc.recording import Recording
from topoloc.rig_file import Mount, Rig, read_rig, write_rig
from topoloc.topo_map import Camera
from topoloc.types import Image

SIZE = (320, 240)
BARREL = Lens("pinhole", 200.0, 205.0, 158.0, 121.5, (-0.2, 0.04, 0.001, -0.0005, 0.01))
FISHEYE = Lens("fisheye", 150.0, 150.0, 160.0, 119.0, (0.05, -0.01, 0.002, 0.0))


def recorded_at(lens: Lens, points: np.ndarray) -> np.ndarray:
    """Where a lens records points (N, 3) of its optical frame: pixels (N, 2), by OpenCV's own projection."""
    matrix = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    zero, bent = np.zeros(3), np.array(lens.coefficients)
    if lens.model == "fisheye":
        seen, _ = cv2.fisheye.projectPoints(points[:, None], zero, zero, matrix, bent)
    else:
        seen, _ = cv2.projectPoints(points, zero, zero, matrix, bent)
    return np.asarray(seen).reshape(-1, 2)


def with_dots(places: np.ndarray) -> Image:
    """A dark picture with a soft dot at each place (N, 2)."""
    columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
    picture = np.zeros(SIZE[::-1])
    for x, y in places:
        picture += 255.0 * np.exp(-((columns - x) ** 2 + (rows - y) ** 2) / 4.0)
    return np.repeat(picture.clip(0, 255).astype(np.uint8)[:, :, None], 3, axis=2)


@pytest.mark.parametrize("lens", [BARREL, FISHEYE], ids=lambda lens: lens.model)
def test_points_come_to_lie_where_a_pinhole_camera_sees_them(lens: Lens) -> None:
    camera = Camera(70.0, *SIZE)
    points = np.array([[0.0, 0.0, 1.0], [0.5, 0.2, 1.0], [-0.45, -0.3, 1.0], [0.3, -0.35, 1.0]])
    straight = lens.straighten(with_dots(recorded_at(lens, points)), camera)[:, :, 0].astype(float)
    for wanted in (points @ pinhole_matrix(camera).T)[:, :2]:
        column, row = wanted.round().astype(int)
        window = straight[row - 6 : row + 7, column - 6 : column + 7]
        rows, columns = np.mgrid[row - 6 : row + 7, column - 6 : column + 7]
        found = [(columns * window).sum() / window.sum(), (rows * window).sum() / window.sum()]
        assert np.abs(found - wanted).max() < 0.3


def test_straight_lens_changes_nothing() -> None:
    camera = Camera(60.0, *SIZE)
    focal = pinhole_matrix(camera)
    lens = Lens("pinhole", focal[0, 0], focal[0, 0], focal[0, 2], focal[1, 2])
    picture = np.random.default_rng(0).integers(0, 256, (240, 320, 3)).astype(np.uint8)
    assert lens.hfov_deg(SIZE[0]) == pytest.approx(60.0)
    assert np.array_equal(lens.straighten(picture, camera), picture)


def test_depth_is_not_interpolated() -> None:
    depth = np.random.default_rng(1).choice([0, 5000, 20000], (240, 320)).astype(np.uint16)
    straight = BARREL.straighten(depth, Camera(70.0, *SIZE))
    assert straight.dtype == np.uint16
    assert set(np.unique(straight)) <= {0, 5000, 20000}


@pytest.mark.parametrize(
    ("change", "told"), [({"coefficients": (0.1,)}, "4 or 5 or 8"), ({"fx": 0.0}, "above 0"), ({"fy": -1.0}, "above 0")]
)
def test_impossible_lenses_are_refused(change: dict[str, Any], told: str) -> None:
    with pytest.raises(ValueError, match=told):
        replace(BARREL, **change)


lengths = st.floats(0.5, 5000.0)
offsets = st.floats(-5.0, 5.0)


@given(
    lens=st.none()
    | st.builds(
        Lens,
        st.just("pinhole"),
        lengths,
        lengths,
        lengths,
        lengths,
        st.lists(offsets, min_size=5, max_size=5).map(tuple),
    ),
    mount=st.builds(Mount, offsets, offsets, st.floats(-180.0, 180.0)),
    baseline=st.none() | st.floats(0.01, 1.0),
    hfov=st.floats(1.0, 179.0),
    truth_of=st.sampled_from([None, "robot", "optical"]),
)
def test_camera_toml_comes_back(
    tmp_path_factory: pytest.TempPathFactory, lens: Lens, mount: Mount, baseline: float, hfov: float, truth_of: None
) -> None:
    path = tmp_path_factory.mktemp("rig") / "camera.toml"
    rig = Rig(Camera(hfov, *SIZE), mount, baseline, lens=lens, groundtruth_of=truth_of)
    write_rig(path, rig)
    assert read_rig(path) == rig


def test_field_of_view_is_the_lens_s_where_none_is_told(tmp_path: Path) -> None:
    write_rig(tmp_path / "camera.toml", Rig(Camera(50.0, *SIZE), lens=BARREL))
    told = (tmp_path / "camera.toml").read_text()
    (tmp_path / "camera.toml").write_text(told.replace("hfov_deg = 50.0", ""))
    camera = read_rig(tmp_path / "camera.toml").camera
    assert camera is not None
    assert camera.hfov_deg == pytest.approx(2.0 * np.rad2deg(np.arctan(160.0 / 200.0)))


def test_size_alone_is_no_camera(tmp_path: Path) -> None:
    """The field of view is not made up."""
    (tmp_path / "camera.toml").write_text("width = 320\nheight = 240\n")
    assert read_rig(tmp_path / "camera.toml").camera is None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ('width = 320\nheight = 240\n[lens]\nmodel = "pinhole"\nfx = 1.0\n', "lacks fy, cx, cy"),
        ('[lens]\nmodel = "pinhole"\nfx = 1\nfy = 1\ncx = 0\ncy = 0\n', "no width"),
        ('width = 9\nheight = 9\n[lens]\nmodel = "round"\nfx = 1\nfy = 1\ncx = 0\ncy = 0\n', "choose from: pinhole"),
        ('groundtruth_of = "wheel"\n', "choose from: robot, optical"),
    ],
)
def test_mistakes_in_camera_toml_are_named(tmp_path: Path, text: str, told: str) -> None:
    (tmp_path / "camera.toml").write_text(text)
    with pytest.raises(UserError, match=told) as caught:
        read_rig(tmp_path / "camera.toml")
    assert "camera.toml" in str(caught.value)


def make_recording(folder: Path, rows: int = 240) -> None:
    picture = with_dots(recorded_at(BARREL, np.array([[0.4, 0.3, 1.0]])))[:rows]
    write_image(folder / "a.png", picture)
    (folder / "rgb.txt").write_text("1.0 a.png\n")
    write_rig(folder / "camera.toml", Rig(Camera(70.0, *SIZE), lens=BARREL))


def test_pictures_of_a_recording_are_straightened_when_read(tmp_path: Path) -> None:
    make_recording(tmp_path)
    (frame,) = Recording.load(tmp_path)
    expected = (pinhole_matrix(Camera(70.0, *SIZE)) @ [0.4, 0.3, 1.0])[:2].round().astype(int)
    brightest = np.unravel_index(frame.images["rgb"][:, :, 0].argmax(), (240, 320))
    assert np.abs(np.array(brightest)[::-1] - expected).max() <= 1


def test_picture_of_another_size_than_the_lens_is_named(tmp_path: Path) -> None:
    make_recording(tmp_path, rows=200)
    (frame,) = Recording.load(tmp_path)
    with pytest.raises(InputError, match=r"rgb.txt, line 1: a.png is 320x200, but its lens is told for 320x240"):
        frame.images["rgb"]


def test_truth_of_an_optical_frame_is_recognised(tmp_path: Path) -> None:
    """TUM RGB-D has poses of the optical frame; the robot's heading is that of its z axis, less the mount's yaw."""
    from scipy.spatial.transform import Rotation

    make_recording(tmp_path)
    heading, yaw = 0.7, np.deg2rad(20.0)
    level = Rotation.from_matrix(np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]))  # z ahead along x
    turn = Rotation.from_euler("z", heading + yaw) * level * Rotation.from_euler("x", 0.2)  # tilted a little, too
    words = " ".join(f"{value:.9f}" for value in turn.as_quat())
    (tmp_path / "groundtruth.txt").write_text(f"1.0 3.0 4.0 1.2 {words}\n")
    write_rig(tmp_path / "camera.toml", Rig(Camera(70.0, *SIZE), Mount(0.5, 0.0, 20.0)))
    truth = Recording.load(tmp_path).truth
    assert truth is not None
    expected = [3.0 - 0.5 * np.cos(heading), 4.0 - 0.5 * np.sin(heading), heading]
    assert truth.poses[0] == pytest.approx(expected, abs=1e-6)
    write_rig(tmp_path / "camera.toml", Rig(Camera(70.0, *SIZE), groundtruth_of="robot"))
    as_robot = Recording.load(tmp_path).truth
    assert as_robot is not None
    assert abs(as_robot.poses[0, 2] - heading) > 0.1, "told that they are the robot's, they are taken as such"
