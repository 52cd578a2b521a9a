"""COLD and KTH-IDOL2, made in their documented layouts: truth, rooms, odometry, and what is wrong with a folder."""

from __future__ import annotations

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from oracles.made_public_sets import BEGIN_S, STEPS, make_cold, make_idol2, times_of, way

from topoloc.cli import main
from topoloc.cli.main import run
from topoloc.errors import InputError
from topoloc.importing.public.cold import read_cold
from topoloc.importing.public.heading_check import heading_off
from topoloc.importing.public.idol2 import read_idol2
from topoloc.importing.public.pose_names import PoseName, read_pose_name
from topoloc.recording import Recording


@pytest.fixture(scope="module", autouse=True)
def one_app() -> Iterator[None]:
    """The command line is put together once."""
    app = main.build_app()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", lambda: app)
        yield


def rooms_of(folder: Path) -> list[tuple[float, str]]:
    with (folder / "rooms.csv").open() as file:
        return [(float(row["timestamp"]), row["room"]) for row in csv.DictReader(file)]


class TestNames:
    @pytest.mark.parametrize(
        ("stem", "wanted"),
        [
            (
                "t1152886490.040076_x0.205133_y0.000557_a0.002507",
                PoseName(1152886490.040076, 0.205133, 0.000557, 0.002507, None),
            ),
            ("t1.5_rBO_x-2.25_y3_a-1.5", PoseName(1.5, -2.25, 3.0, -1.5, "BO")),
            ("t1.5_x-2.25_y3e-1_a90_2PO1-A", PoseName(1.5, -2.25, 0.3, 90.0, "2PO1-A")),
            ("t1.5_x2_y3", None),
            ("frame0001", None),
            ("t1.5_x2_y3_a1_~", None),
            ("", None),
        ],
    )
    def test_they_are_read(self, stem: str, wanted: PoseName | None) -> None:
        assert read_pose_name(stem) == wanted


class TestCold:
    def test_a_recording_is_made(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        make_cold(tmp_path / "seq1_cloudy1")
        assert run(["import", "cold", str(tmp_path / "seq1_cloudy1"), "-o", str(tmp_path / "made")]) == 0
        made = Recording.load(tmp_path / "made")
        assert made.truth is not None and made.odometry is not None and made.camera is not None
        assert (made.camera.hfov_deg, made.camera.width, made.camera.height) == (68.9, 64, 48)
        times = [picture.time for picture in made.pictures["rgb"]]
        np.testing.assert_allclose(times, times_of(2 * STEPS), atol=1e-5)
        truth = np.array([made.truth.at(time) for time in times])
        np.testing.assert_allclose(truth, way(), atol=1e-5)
        odometry = np.array([made.odometry.at(time) for time in times])
        np.testing.assert_allclose(odometry, way() + np.array([5.0, -3.0, 0.0]), atol=1e-3)
        assert [room for _, room in rooms_of(tmp_path / "made")] == ["CR-A"] * STEPS + ["2PO1-A"] * STEPS
        original = next((tmp_path / "seq1_cloudy1" / "std_cam").glob("*_x0.000000_y0.000000*"))
        assert made.pictures["rgb"][0].path.read_bytes() == original.read_bytes()
        assert "0.0 degrees in the median" in capsys.readouterr().out

    def test_omnidirectional_pictures_stay_as_they_are(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        make_cold(tmp_path / "seq", omni=True)
        words = ["import", "cold", str(tmp_path / "seq"), "-o", str(tmp_path / "made"), "--camera", "omni"]
        assert run(words) == 0
        made = Recording.load(tmp_path / "made")
        assert made.kind == "omni" and made.camera is None and not made.panorama
        assert len(rooms_of(tmp_path / "made")) == 2 * STEPS
        assert "topoloc unwrap" in capsys.readouterr().out

    def test_thinning_thins_rooms_too(self, tmp_path: Path) -> None:
        make_cold(tmp_path / "seq")
        assert run(["import", "cold", str(tmp_path / "seq"), "-o", str(tmp_path / "made"), "--every", "1"]) == 0
        made = Recording.load(tmp_path / "made")
        assert len(made) == len(rooms_of(tmp_path / "made")) == 5

    def test_malformed_names_are_told(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        folder = make_cold(tmp_path / "seq")
        first = sorted((folder / "std_cam").iterdir())[0]
        first.rename(first.with_name("copy of it.jpeg"))
        assert run(["import", "cold", str(folder), "-o", str(tmp_path / "made")]) == 0
        assert "dropped: 1 x picture: its name tells no time and pose" in capsys.readouterr().out
        assert len(Recording.load(tmp_path / "made")) == 2 * STEPS - 1

    def test_angles_of_another_sign_are_told(self, tmp_path: Path) -> None:
        folder = make_cold(tmp_path / "seq")
        for path in list((folder / "std_cam").iterdir()):
            path.rename(path.with_name(path.name.replace("_a1.57", "_a-1.57")))
        assert any("warning" in note and "degrees in the median" in note for note in read_cold(folder).notes)

    @pytest.mark.parametrize(
        ("below", "says"),
        [
            ("", "it is too high; name one of the sequences in it: cold/seq1_cloudy1"),
            ("cold/seq1_cloudy1/std_cam", "too low; name "),
            ("cold/nothing", "no such folder"),
            ("elsewhere", "holds no std_cam or omni_cam; name the folder of a sequence"),
        ],
    )
    def test_a_wrong_folder_is_one_line(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str], below: str, says: str
    ) -> None:
        make_cold(tmp_path / "set" / "cold" / "seq1_cloudy1")
        (tmp_path / "set" / "elsewhere").mkdir()
        assert run(["import", "cold", str(tmp_path / "set" / below), "-o", str(tmp_path / "made")]) == 2
        told = capsys.readouterr().err
        assert says in told and told.count("\n") == 1
        assert not (tmp_path / "made").exists()

    @pytest.mark.parametrize(
        ("file", "text", "says"),
        [
            ("localization/places.lst", "alone\n", "'alone' is no picture and its room"),
            ("odom_scans/odom.tdf", "0 0 0 10 0\n", "fewer than 12 columns"),
            ("odom_scans/odom.tdf", "0 0 0 10 0 2 0 6 one 2 0 3 0 0\n", "no table of numbers"),
        ],
    )
    def test_a_broken_file_is_named(self, tmp_path: Path, file: str, text: str, says: str) -> None:
        folder = make_cold(tmp_path / "seq")
        (folder / file).write_text(text)
        with pytest.raises(InputError, match=says):
            read_cold(folder)

    def test_without_labels_and_odometry(self, tmp_path: Path) -> None:
        folder = make_cold(tmp_path / "seq")
        (folder / "localization/places.lst").unlink()
        (folder / "odom_scans/odom.tdf").unlink()
        drive = read_cold(folder)
        assert drive.odometry is None and all(shot.room is None for shot in drive.shots)
        assert {"no localization/places.lst: no rooms", "no odom_scans/odom.tdf: no odometry"} < set(drive.notes)

    def test_another_camera_is_proposed(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="--camera std"):
            read_cold(make_cold(tmp_path / "seq"), "omni")

    def test_no_folder_no_output(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["import", "cold"]) == 2 and "name the folder to import" in capsys.readouterr().err
        assert run(["import", "cold", str(tmp_path)]) == 2 and "-o DIR" in capsys.readouterr().err


class TestIdol2:
    @pytest.mark.parametrize("degrees", [False, True])
    def test_truth_rooms_and_units(self, tmp_path: Path, degrees: bool) -> None:
        drive = read_idol2(make_idol2(tmp_path / "min_cloudy1", degrees=degrees))
        np.testing.assert_allclose([shot.pose for shot in drive.shots], way(), atol=1e-3)
        np.testing.assert_allclose([shot.time for shot in drive.shots], times_of(2 * STEPS), atol=1e-6)
        assert [shot.room for shot in drive.shots] == ["CR"] * STEPS + ["KT"] * STEPS
        assert any("read as degrees" in note for note in drive.notes) is degrees

    def test_a_recording_is_made(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        make_idol2(tmp_path / "dum_night2")
        assert run(["import", "idol2", str(tmp_path / "dum_night2"), "-o", str(tmp_path / "made")]) == 0
        made = Recording.load(tmp_path / "made")
        assert made.truth is not None and made.odometry is None and made.camera is None
        assert "give --hfov-deg" in capsys.readouterr().out
        words = ["import", "idol2", str(tmp_path / "dum_night2"), "-o", str(tmp_path / "seen"), "--hfov-deg", "50"]
        assert run(words) == 0
        camera = Recording.load(tmp_path / "seen").camera
        assert camera is not None and (camera.hfov_deg, camera.width) == (50.0, 64)

    def test_pictures_may_lie_in_the_folder_itself(self, tmp_path: Path) -> None:
        make_idol2(tmp_path / "min_sunny3")
        (tmp_path / "min_sunny3" / "png").rename(tmp_path / "flat")
        assert len(read_idol2(tmp_path / "flat").shots) == 2 * STEPS

    def test_levels(self, tmp_path: Path) -> None:
        make_idol2(tmp_path / "set" / "min_sunny3")
        with pytest.raises(InputError, match="name one of the sequences in it: min_sunny3"):
            read_idol2(tmp_path / "set")
        with pytest.raises(InputError, match=r"too low; name .*min_sunny3"):
            read_idol2(tmp_path / "set" / "min_sunny3" / "png")


class TestHeadingCheck:
    def test_signs_and_units(self) -> None:
        poses = way()
        assert heading_off(poses, 0.1) == pytest.approx(0.0, abs=1e-9)
        assert heading_off(poses + np.array([0.0, 0.0, np.pi]), 0.1) == pytest.approx(180.0, abs=1e-9)
        bend = np.column_stack([np.cos(a := np.linspace(0.5, 2.0, 30)), np.sin(a), a + 0.5 * np.pi])
        assert heading_off(bend, 0.01) == pytest.approx(0.0, abs=0.1)
        assert (heading_off(bend * [1.0, 1.0, -1.0], 0.01) or 0.0) > 30.0
        assert (heading_off(bend * [1.0, 1.0, np.pi / 180.0], 0.01) or 0.0) > 30.0

    def test_too_few_steps_tell_nothing(self) -> None:
        assert heading_off(way()[:4], 0.1) is None
        assert heading_off(way(), 100.0) is None


def test_samples_have_the_documented_names(tmp_path: Path) -> None:
    folder = make_cold(tmp_path / "seq")
    names = sorted(path.name for path in (folder / "std_cam").iterdir())
    assert names[0] == f"t{BEGIN_S:.6f}_x0.000000_y0.000000_a0.000000.jpeg"
