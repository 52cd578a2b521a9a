"""Oxford RobotCar and folders of pictures named by UTM, made in their documented layouts."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from oracles.made_public_sets import (
    BEGIN_S,
    CAR_STEPS,
    EASTING,
    NORTHING,
    car_way,
    make_robotcar,
    mosaic,
    times_of,
    view,
)

from topoloc.cli import main
from topoloc.cli.main import run
from topoloc.errors import InputError, UnreadableImage, UserError
from topoloc.files import read_image, write_image
from topoloc.importing.public.origin import Origin, poses_from_utm, read_origin
from topoloc.importing.public.robotcar import RobotCarConfig, read_robotcar
from topoloc.importing.public.robotcar_pictures import SIZE, PictureMaker, in_colours, read_lut, rig_of
from topoloc.importing.public.utm_names import read_utm_names
from topoloc.recording import Recording

EAST, NORTH, WEST = 0.0, 0.5 * np.pi, -np.pi


@pytest.fixture(scope="module", autouse=True)
def one_app() -> Iterator[None]:
    """The command line is put together once."""
    app = main.build_app()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", lambda: app)
        yield


@pytest.fixture(scope="module")
def traversal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_robotcar(tmp_path_factory.mktemp("oxford") / "2014-06-26-08-53-56", BEGIN_S)


class TestFrame:
    @pytest.mark.parametrize(
        ("clockwise", "ours"), [(0.0, NORTH), (0.5 * np.pi, EAST), (np.pi, -NORTH), (-0.5 * np.pi, WEST)]
    )
    def test_headings(self, clockwise: float, ours: float) -> None:
        pose = poses_from_utm(np.array([12.0]), np.array([25.0]), np.array([clockwise]), Origin(10.0, 20.0))[0]
        np.testing.assert_allclose(pose[:2], [2.0, 5.0])
        assert np.cos(pose[2] - ours) == pytest.approx(1.0)

    def test_origins(self, tmp_path: Path) -> None:
        assert read_origin("10.5,-20") == Origin(10.5, -20.0)
        (tmp_path / "origin.toml").write_text("easting = 1.0\nnorthing = 2.0\n")
        assert read_origin(str(tmp_path)) == read_origin(str(tmp_path / "origin.toml")) == Origin(1.0, 2.0)
        for words in ("10", "10,x", "nan,1", "1,2,3"):
            with pytest.raises(UserError, match="--origin is"):
                read_origin(words)


class TestRobotCar:
    def test_a_recording_is_made(self, traversal: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        words = ["import", "oxford", str(traversal), "-o", str(tmp_path / "made"), "--every", "0", "--width", "64"]
        assert run(words) == 0
        made = Recording.load(tmp_path / "made")
        assert made.truth is not None and made.odometry is not None and made.camera is not None
        times = [picture.time for picture in made.pictures["rgb"]]
        np.testing.assert_allclose(times, times_of(2 * CAR_STEPS), atol=1e-5)
        truth = np.array([made.truth.at(time) for time in times])
        np.testing.assert_allclose(truth, car_way(), atol=1e-3)
        odometry = np.array([made.odometry.at(time) for time in times])
        np.testing.assert_allclose(odometry, car_way(), atol=1e-2)
        assert made.camera.hfov_deg == pytest.approx(66.1, abs=0.1)
        image = made.frame(made.pictures["rgb"][0]).images["rgb"]
        assert image.shape == (48, 64, 3)
        told = capsys.readouterr()
        assert "0.0 degrees in the median" in told.out and "without 1 rows of another status" in told.out
        assert not told.err

    def test_two_traversals_share_a_frame(self, traversal: Path, tmp_path: Path) -> None:
        other = make_robotcar(tmp_path / "2014-06-23-15-36-04", BEGIN_S + 500.0, shift=(3.0, -4.0))
        words = ["--width", "64", "--every", "1"]
        assert run(["import", "oxford", str(traversal), "-o", str(tmp_path / "a"), *words]) == 0
        words += ["--origin", str(tmp_path / "a")]
        assert run(["import", "oxford", str(other), "-o", str(tmp_path / "b"), *words]) == 0
        a, b = Recording.load(tmp_path / "a").truth, Recording.load(tmp_path / "b").truth
        assert a is not None and b is not None
        np.testing.assert_allclose(b.poses - a.poses, np.tile([3.0, -4.0, 0.0], (len(a.poses), 1)), atol=1e-3)
        assert read_origin(str(tmp_path / "a")) == read_origin(str(tmp_path / "b")) == Origin(EASTING, NORTHING)

    def test_yaw_of_the_wrong_sign_is_told(self, tmp_path: Path) -> None:
        folder = make_robotcar(tmp_path / "t", BEGIN_S)
        path = folder / "gps" / "ins.csv"
        rows = path.read_text().splitlines()
        turned = [row.rsplit(",", 1)[0] + f",{-float(row.rsplit(',', 1)[1])}" for row in rows[1:]]
        path.write_text("\n".join([rows[0], *turned]) + "\n")
        drive, _ = read_robotcar(folder, RobotCarConfig())
        assert any(note.startswith("warning: headings differ") for note in drive.notes)

    def test_pictures_without_truth_are_left_out(self, traversal: Path, tmp_path: Path) -> None:
        folder = tmp_path / "t"
        make_robotcar(folder, BEGIN_S)
        late = folder / "stereo" / "centre" / f"{round(1e6 * (BEGIN_S + 60.0))}.png"
        write_image(late, mosaic(view(0, SIZE)))
        write_image(late.with_name("thumbnail.png"), mosaic(view(0, SIZE)))
        drive, _ = read_robotcar(folder, RobotCarConfig())
        assert len(drive.shots) == 2 * CAR_STEPS
        assert drive.dropped == {
            "no true pose within 0.5 s": 1,
            "its name is no time in microseconds": 1,
        }

    @pytest.mark.parametrize(
        ("below", "says"),
        [
            ("..", "it is too high; name one of the sequences in it: 2014-06-26-08-53-56"),
            ("stereo/centre", "too low; name "),
            ("../none", "no such folder"),
        ],
    )
    def test_levels(self, traversal: Path, below: str, says: str) -> None:
        with pytest.raises(InputError, match=says):
            read_robotcar((traversal / below).resolve(), RobotCarConfig())

    def test_what_is_missing_is_named(self, traversal: Path, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="--camera"):
            read_robotcar(traversal, RobotCarConfig("left"))
        folder = make_robotcar(tmp_path / "t", BEGIN_S)
        whole = (folder / "gps" / "ins.csv").read_text()
        for old, new, says in (
            ("northing", "north", "has no column northing"),
            ("INS_SOLUTION_GOOD", "INS_INACTIVE", "no row has the status"),
        ):
            (folder / "gps" / "ins.csv").write_text(whole.replace(old, new))
            with pytest.raises(InputError, match=says):
                read_robotcar(folder, RobotCarConfig())
        (folder / "gps" / "ins.csv").unlink()
        with pytest.raises(InputError, match="gps archive"):
            read_robotcar(folder, RobotCarConfig())

    def test_pictures_of_another_size_are_refused(self, tmp_path: Path) -> None:
        folder = make_robotcar(tmp_path / "t", BEGIN_S, (64, 48))
        with pytest.raises(InputError, match="64x48"):
            read_robotcar(folder, RobotCarConfig())


class TestPictures:
    def test_the_mosaic_gets_its_colours(self, tmp_path: Path) -> None:
        picture = np.zeros((32, 32, 3), dtype=np.uint8)
        picture[:] = (200, 100, 50)
        write_image(tmp_path / "mosaic.png", mosaic(picture))
        np.testing.assert_array_equal(in_colours(tmp_path / "mosaic.png"), picture)
        write_image(tmp_path / "colours.png", picture)
        np.testing.assert_array_equal(in_colours(tmp_path / "colours.png"), picture)

    def test_a_damaged_one_is_unreadable(self, tmp_path: Path) -> None:
        (tmp_path / "cut.png").write_bytes(b"\x89PNG\r\n")
        for name in ("cut.png", "none.png"):
            with pytest.raises(UnreadableImage):
                in_colours(tmp_path / name)

    def test_the_table_moves_pixels(self, tmp_path: Path) -> None:
        columns, rows = np.meshgrid(np.arange(SIZE[0]), np.arange(SIZE[1]))
        table = np.stack([columns + 7.0, rows + 3.0]).astype(np.float64)
        table.tofile(tmp_path / "stereo_narrow_left_distortion_lut.bin")
        read = read_lut(tmp_path, "centre")
        np.testing.assert_array_equal(read, table)
        picture = view(3, SIZE)
        write_image(tmp_path / "colours.png", picture)
        data = PictureMaker(SIZE[0], read)(tmp_path / "colours.png").data
        assert isinstance(data, np.ndarray)
        np.testing.assert_array_equal(data[:-3, :-7], picture[3:, 7:])
        (tmp_path / "stereo_wide_left_distortion_lut.bin").write_bytes(b"12345678")
        with pytest.raises(InputError, match="holds 1 numbers"):
            read_lut(tmp_path, "left")
        with pytest.raises(InputError, match="robotcar-dataset-sdk"):
            read_lut(tmp_path, "right")

    def test_a_narrower_picture_has_the_same_field_of_view(self) -> None:
        wide, narrow = rig_of(1280), rig_of(640)
        assert wide.camera is not None and narrow.camera is not None and narrow.lens is not None
        assert wide.camera.hfov_deg == pytest.approx(narrow.camera.hfov_deg)
        assert (narrow.camera.width, narrow.camera.height) == (640, 480)
        assert narrow.lens.cx == pytest.approx(643.646973 / 2, abs=0.3)


class TestUtmNames:
    def make(self, folder: Path, headings: bool = True, times: bool = True) -> Path:
        for i, (x, y, angle) in enumerate(car_way()):
            heading = f"{round(90.0 - np.rad2deg(angle)):03d}" if headings else ""
            time = f"20140626_0853{i:02d}" if times else ""
            place = f"@{EASTING + x:010.2f}@{NORTHING + y:010.2f}@30@U@051.75000@-001.25000"
            write_image(folder / f"{place}@{i:05d}@@{heading}@@@@{time}@@.jpg", view(i, (64, 48)))
        return folder

    @pytest.mark.parametrize("headings", [True, False])
    @pytest.mark.parametrize("times", [True, False])
    def test_poses(self, tmp_path: Path, headings: bool, times: bool) -> None:
        drive, origin = read_utm_names(self.make(tmp_path / "database", headings, times))
        assert origin == Origin(EASTING, NORTHING)
        poses = np.array([shot.pose for shot in drive.shots])
        np.testing.assert_allclose(poses[:, :2], car_way()[:, :2], atol=0.01)
        same = np.cos(poses[:, 2] - car_way()[:, 2]) > 0.99
        assert same.sum() >= 2 * CAR_STEPS - (0 if headings else 1)  # at the bend the way alone tells another
        np.testing.assert_allclose(np.diff([shot.time for shot in drive.shots]), 1.0)

    def test_a_recording_is_made(self, tmp_path: Path) -> None:
        self.make(tmp_path / "database" / "tile")
        write_image(tmp_path / "database" / "plan.jpg", view(0, (64, 48)))
        words = ["import", "oxford", str(tmp_path / "database"), "-o", str(tmp_path / "made"), "--hfov-deg", "90"]
        assert run(words) == 0
        made = Recording.load(tmp_path / "made")
        assert len(made) == 2 * CAR_STEPS and made.camera is not None and made.camera.hfov_deg == 90.0
        np.testing.assert_array_equal(
            read_image(made.pictures["rgb"][5].path), read_image(sorted((tmp_path / "database" / "tile").iterdir())[5])
        )

    def test_no_position_is_an_error(self, tmp_path: Path) -> None:
        write_image(tmp_path / "@here@there@.jpg", view(0, (64, 48)))
        with pytest.raises(InputError, match="easting and northing"):
            read_utm_names(tmp_path)
