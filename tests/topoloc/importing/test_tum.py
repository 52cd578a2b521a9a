"""TUM RGB-D sequences, made in the documented layout: they run as they are, and an import adds their camera."""

from __future__ import annotations

import json
import shutil
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from oracles.spoil import rewrite

from topoloc.cli import main
from topoloc.cli.main import run
from topoloc.files import write_image
from topoloc.geometry import Floats, wrap
from topoloc.importing.tum import KINECTS, PAIRS, kinect_of, read_sequence
from topoloc.recording import Recording
from topoloc.rig_file import read_rig
from topoloc.types import Image

BEGIN = 1311868164.363181  # as the times of the real sequences look
STEP = 1.0 / 30.0
PLACES = 3
TURNS = 12
"""Pictures at each place, one every 30 degrees."""


@pytest.fixture(scope="module", autouse=True)
def one_app() -> Iterator[None]:
    """The command line is put together once: it is run many times here."""
    app = main.build_app()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", lambda: app)
        yield


def quaternion(heading: float, down: float = 0.0) -> Floats:
    """(4,) of the optical frame, z ahead and y down, of a camera that looks so far below the horizon [rad]."""
    from scipy.spatial.transform import Rotation

    right = np.array([np.sin(heading), -np.cos(heading), 0.0])
    ahead = np.array([np.cos(heading) * np.cos(down), np.sin(heading) * np.cos(down), -np.sin(down)])
    matrix: Floats = np.column_stack([right, np.cross(ahead, right), ahead])
    return np.asarray(Rotation.from_matrix(matrix).as_quat())


def drive() -> Floats:
    """(F, 3) poses of the camera at each picture: a full turn at each place, a metre apart."""
    return np.array([[float(k), 0.5, float(wrap(2 * np.pi * i / TURNS))] for k in range(PLACES) for i in range(TURNS)])


def view(index: int, size: tuple[int, int]) -> Image:
    blocks = np.random.default_rng(index).integers(0, 256, (6, 8, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(blocks, size, interpolation=cv2.INTER_NEAREST), dtype=np.uint8)


def made(folder: Path, size: tuple[int, int], poses: Floats, down: float = 0.0) -> Path:
    """A sequence in the layout of the benchmark: headers, times that are not equal, truth at 100 Hz.

    The truth begins 0.1 s after the first picture; each depth picture is 7 ms late, and every fifth one is missing.
    """
    times = BEGIN + STEP * np.arange(len(poses))
    colour, depth = [], []
    for i, time in enumerate(times):
        write_image(folder / f"rgb/{time:.6f}.png", view(i, size))
        colour.append(f"{time:.6f} rgb/{time:.6f}.png")
        if i % 5 != 4:
            write_image(folder / f"depth/{time + 0.007:.6f}.png", np.full((size[1], size[0]), 5000, np.uint16))
            depth.append(f"{time + 0.007:.6f} depth/{time + 0.007:.6f}.png")
    truth = []
    for time in np.arange(times[0] + 0.1, times[-1] - 0.1, 0.01):
        pose = poses[int(np.abs(times - time).argmin())]
        place = f"{pose[0]:.4f} {pose[1]:.4f} 0.9000"
        truth.append(f"{time:.4f} {place} {' '.join(f'{q:.4f}' for q in quaternion(pose[2], down))}")
    heads = {
        "rgb": ("color images", "timestamp filename", colour),
        "depth": ("depth maps", "timestamp filename", depth),
        "groundtruth": ("ground truth trajectory", "timestamp tx ty tz qx qy qz qw", truth),
        "accelerometer": ("accelerometer data", "timestamp ax ay az", [f"{times[0]:.6f} -0.08 7.24 -6.66"]),
    }
    for name, (what, columns, lines) in heads.items():
        head = [f"# {what}", f"# file: '{folder.name}.bag'", f"# {columns}"]
        (folder / f"{name}.txt").write_text("\n".join([*head, *lines]) + "\n")
    return folder


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sequence of small pictures, which nothing that runs on it as it is minds."""
    return made(tmp_path_factory.mktemp("tum") / "rgbd_dataset_freiburg2_pioneer_made", (64, 48), drive())


@pytest.fixture(scope="module")
def full(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sequence of pictures of a Kinect's size, of a camera that is held steeply down."""
    folder = tmp_path_factory.mktemp("tum") / "rgbd_dataset_freiburg1_made"
    return made(folder, (640, 480), drive()[:: PLACES * TURNS // 12], down=1.2)


class TestAsItIs:
    def test_it_loads(self, small: Path) -> None:
        recording = Recording.load(small)
        assert len(recording) == PLACES * TURNS and recording.truth is not None and recording.odometry is None
        picture = recording.pictures["rgb"][20]
        assert set(recording.frame(picture).images) == {"rgb", "depth"}
        np.testing.assert_allclose(recording.truth.at(picture.time), drive()[20], atol=2e-3)

    def test_it_is_checked(self, small: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["check", str(small)]) == 1
        found = [line for line in capsys.readouterr().out.splitlines() if line.startswith("- ")]
        assert len(found) == 2, "its pictures, their times and the truth are in order"
        assert found[0].startswith("- warning: ") and "there is no odometry.txt" in found[0]
        assert found[1].startswith("- note: ") and "nobody tells the field of view" in found[1]

    def test_a_map_is_built_of_it_and_it_is_localized(self, small: Path, tmp_path: Path) -> None:
        assert run(["map", "build", str(small), "-o", str(tmp_path / "map"), "--hfov-deg", "62"]) == 0
        words = ["localize", str(tmp_path / "map"), str(small), "-o", str(tmp_path / "run")]
        assert run([*words, "--sensor", "pca", "--estimator", "particle"]) == 0
        metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
        assert metrics["node_accuracy"] > 0.8


class TestImport:
    def test_the_camera_is_the_published_one(self, full: Path, tmp_path: Path) -> None:
        assert run(["import", "tum", str(full), "-o", str(tmp_path / "rec"), "--every", "0"]) == 0
        rig = read_rig(tmp_path / "rec" / "camera.toml")
        assert rig.lens == KINECTS["freiburg1"] and rig.camera is not None
        assert (rig.camera.width, rig.camera.height) == (640, 480)
        assert rig.camera.hfov_deg == pytest.approx(63.5, abs=0.1)
        picture = next(iter(Recording.load(tmp_path / "rec"))).images["rgb"]
        assert picture.shape == (480, 640, 3)

    def test_pictures_are_copied_to_the_byte_and_depth_is_joined(self, full: Path, tmp_path: Path) -> None:
        assert run(["import", "tum", str(full), "-o", str(tmp_path / "rec"), "--every", "0.1"]) == 0
        source, recording = Recording.load(full), Recording.load(tmp_path / "rec")
        assert [p.time for p in recording.pictures["rgb"]] == [p.time for p in source.pictures["rgb"][::3]]
        assert recording.pictures["rgb"][1].path.read_bytes() == source.pictures["rgb"][3].path.read_bytes()
        with_depth = ["depth" in frame.images for frame in recording]
        assert with_depth == [True, True, True, False], "every fifth depth picture is missing: that of picture 9"

    def test_the_heading_is_the_optical_axis_however_the_camera_is_held(self, full: Path, tmp_path: Path) -> None:
        assert run(["import", "tum", str(full), "-o", str(tmp_path / "rec"), "--every", "0"]) == 0
        recording = Recording.load(tmp_path / "rec")
        assert recording.truth is not None
        pose = drive()[:: PLACES * TURNS // 12][6]
        np.testing.assert_allclose(recording.truth.at(BEGIN + 6 * STEP), pose, atol=2e-3)

    def test_pictures_that_the_motion_capture_lost_are_left_out(
        self, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        """As in freiburg2_desk, where it reached 69 of 99 s."""
        folder = tmp_path / full.name
        shutil.copytree(full, folder)
        lines = (folder / "groundtruth.txt").read_text().splitlines()
        late = [f"{float(line.split()[0]) + 0.62:.4f} {line.split(' ', 1)[1]}" for line in lines[3:]]
        (folder / "groundtruth.txt").write_text("\n".join([*lines[:3], *late]))
        assert run(["import", "tum", str(folder), "-o", str(tmp_path / "rec"), "--every", "0"]) == 0
        assert "dropped: 7 x frame: no true pose within 0.5 s" in capsys.readouterr().out
        assert len(Recording.load(tmp_path / "rec")) == 5

    def test_a_validation_sequence_has_no_truth(
        self, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        folder = tmp_path / "seq"
        shutil.copytree(full, folder)
        (folder / "groundtruth.txt").unlink()
        assert run(["import", "tum", str(folder), "-o", str(tmp_path / "rec"), "--set", "freiburg3"]) == 0
        assert "no groundtruth.txt: as the _validation sequences" in capsys.readouterr().out
        assert read_rig(tmp_path / "rec" / "camera.toml").lens == KINECTS["freiburg3"]

    def test_a_stretch_and_its_published_pair(
        self, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        folder = tmp_path / "rgbd_dataset_freiburg2_xyz"
        shutil.copytree(full, folder)
        assert run(["import", "tum", str(folder), "--start", "0.2", "-o", str(tmp_path / "rec"), "--every", "0"]) == 0
        assert "published pair: map of freiburg2_xyz --end 30, localized freiburg2_xyz --start 30 (" in (
            capsys.readouterr().out
        )
        assert Recording.load(tmp_path / "rec").pictures["rgb"][0].time == pytest.approx(BEGIN + 0.2, abs=1e-5)


@pytest.mark.parametrize(
    ("name", "told", "expected"),
    [
        ("rgbd_dataset_freiburg1_xyz", None, "freiburg1"),
        ("rgbd_dataset_freiburg3_long_office_household_validation", None, "freiburg3"),
        ("fr2_desk", None, "freiburg2"),
        ("rgbd_dataset_freiburg1_xyz", "freiburg2", "freiburg2"),
    ],
)
def test_the_kinect_is_in_the_name(name: str, told: str | None, expected: str, tmp_path: Path) -> None:
    assert kinect_of(tmp_path / name, told) == expected  # type: ignore[arg-type]


def test_lenses_are_the_published_ones() -> None:
    """The published table, and one value that follows from it."""
    assert [(lens.fx, lens.fy, lens.cx, lens.cy) for lens in KINECTS.values()] == [
        (517.3, 516.5, 318.6, 255.3),
        (520.9, 521.0, 325.1, 249.7),
        (535.4, 539.2, 320.1, 247.6),
    ]
    assert not any(KINECTS["freiburg3"].coefficients)
    assert all(pair.source for pair in PAIRS)


class TestMistakes:
    @pytest.mark.parametrize("name", ["office", "freiburg4_desk", "freiburg12"])
    def test_a_name_without_a_kinect(
        self, name: str, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(["import", "tum", str(tmp_path / name), "-o", str(tmp_path / "rec")]) == 2
        assert f"{name}: its name does not tell the Kinect; add --set freiburg1" in capsys.readouterr().err

    def test_one_folder_too_high(self, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        words = ["import", "tum", str(full.parent), "-o", str(tmp_path / "rec"), "--set", "freiburg1"]
        assert run(words) == 2
        assert "holds no rgb.txt; name one of: rgbd_dataset_freiburg1_made" in capsys.readouterr().err

    def test_pictures_of_another_size(self, small: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["import", "tum", str(small), "-o", str(tmp_path / "rec")]) == 2
        assert "the pictures are 64x48, those of a Kinect 640x480; " in capsys.readouterr().err
        assert not (tmp_path / "rec").exists()

    def test_a_broken_truth_names_its_line(
        self, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        folder = tmp_path / full.name
        shutil.copytree(full, folder)
        rewrite("groundtruth.txt", " 0.9000 ", " high ")(folder)
        assert run(["import", "tum", str(folder), "-o", str(tmp_path / "rec")]) == 2
        assert "groundtruth.txt, line 4: 'high' is not a finite number" in capsys.readouterr().err

    def test_commas_between_the_numbers_of_the_truth(self, full: Path, tmp_path: Path) -> None:
        """``Recording.load`` reads them, too."""
        folder = tmp_path / full.name
        shutil.copytree(full, folder)
        lines = (folder / "groundtruth.txt").read_text().splitlines()
        (folder / "groundtruth.txt").write_text("\n".join([*lines[:3], *(",".join(one.split()) for one in lines[3:])]))
        written, wanted = read_sequence(folder).truth, read_sequence(full).truth
        assert written is not None and wanted is not None
        np.testing.assert_array_equal(written.poses, wanted.poses)

    def test_an_impossible_stretch(self, full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        words = ["import", "tum", str(full), "-o", str(tmp_path / "rec"), "--start", "3", "--end", "2"]
        assert run(words) == 2
        assert "--start is 3 and --end 2; " in capsys.readouterr().err


def test_a_picture_that_is_gone_is_told(full: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / full.name
    shutil.copytree(full, folder)
    Recording.load(folder).pictures["rgb"][3].path.unlink()
    assert run(["import", "tum", str(folder), "-o", str(tmp_path / "rec"), "--every", "0"]) == 0
    assert "dropped: 1 x frame: cannot be read (No such file or directory)" in capsys.readouterr().out


def test_the_truth_of_a_camera_held_down_is_read_as_the_cameras(full: Path) -> None:
    truth = read_sequence(full).truth
    assert truth is not None
    assert abs(float(wrap(truth.at(BEGIN + 6 * STEP)[2] - drive()[:: PLACES * TURNS // 12][6, 2]))) < 2e-3
