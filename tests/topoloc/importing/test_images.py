"""A folder of pictures becomes a recording: where the times come from, and what is left out."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image as Pictures

from topoloc.cli import main
from topoloc.cli.main import run
from topoloc.importing.name_times import name_times
from topoloc.recording import Recording

NOON = 1715524257.0
"""2024-05-12 14:30:57 UTC [s since 1970]."""
Shown = pytest.CaptureFixture[str]


@pytest.fixture(scope="module", autouse=True)
def one_app() -> Iterator[None]:
    """The command line is put together once: it is run many times here."""
    app = main.build_app()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", lambda: app)
        yield


def jpeg(
    level: int, size: tuple[int, int] = (32, 24), taken: str = "", fraction: str = "", lying: bool = False
) -> bytes:
    """An encoded picture, with what its camera noted in EXIF."""
    exif = Pictures.Exif()
    if taken:
        exif.get_ifd(0x8769)[36867] = taken
    if fraction:
        exif.get_ifd(0x8769)[37521] = fraction
    if lying:
        exif[0x0112] = 6
    data = io.BytesIO()
    Pictures.new("RGB", size, (level, level, level)).save(data, "JPEG", exif=exif)
    return data.getvalue()


def folder_of(path: Path, names: list[str], make: Callable[[int], bytes] = jpeg) -> Path:
    path.mkdir()
    for level, name in enumerate(names):
        (path / name).write_bytes(make(level))
    return path


def imported(folder: Path, *words: str) -> Recording:
    output = folder.parent / "rec"
    assert run(["import", "images", str(folder), "-o", str(output), *words]) == 0
    return Recording.load(output)


def times(recording: Recording) -> list[float]:
    return [picture.time for picture in recording.pictures["rgb"]]


class TestTimes:
    @pytest.mark.parametrize(
        ("names", "expected"),
        [
            (["1305031102.175304.jpg", "1305031102.211214.jpg"], [1305031102.175304, 1305031102.211214]),
            (["1403636579763555584.jpg", "1403636579813555456.jpg"], [1403636579.763556, 1403636579.813555]),
            (["cam0_1700000000123.jpg", "cam0_1700000000323.jpg"], [1700000000.123, 1700000000.323]),
            (["1418381798086398.jpg", "1418381798148890.jpg"], [1418381798.086398, 1418381798.148890]),
            (["left-0.500_s.jpg", "left-0.750_s.jpg"], [0.5, 0.75]),
            (["t0.9.jpg", "t0.95.jpg", "t1.2.jpg", "t10.05.jpg"], [0.9, 0.95, 1.2, 10.05]),
            (["20240512143057.jpg", "20240512143100.jpg"], [NOON, NOON + 3.0]),
            (["2024-05-12_14.30.57.jpg", "2024-05-12_14.30.58.jpg"], [NOON, NOON + 1.0]),
            (["2024-05-12T14-30-57.25.jpg", "2024-05-12T14-30-58.jpg"], [NOON + 0.25, NOON + 1.0]),
            (["PXL_20240512_143057123.jpg", "PXL_20240512_143059001.jpg"], [NOON + 0.123, NOON + 2.001]),
            (["2024-05-12_14-30-57_500000.jpg", "2024-05-12_14-30-58_000001.jpg"], [NOON + 0.5, NOON + 1.000001]),
            (["20240512_143057_1.jpg", "20240512_143057_2.jpg", "20240512_143058_1.jpg"], [NOON, NOON + 0.5, NOON + 1]),
            (
                ["run_20240512_143057_1700000000123.jpg", "run_20240512_143057_1700000000323.jpg"],
                [1.7e9 + 0.123, 1.7e9 + 0.323],
            ),
        ],
    )
    def test_in_the_names(self, names: list[str], expected: list[float], tmp_path: Path, capsys: Shown) -> None:
        recording = imported(folder_of(tmp_path / "pics", names))
        np.testing.assert_allclose(times(recording), expected, rtol=0, atol=1e-6)
        assert f"times from the files' names, such as {names[0]}" in capsys.readouterr().out

    @pytest.mark.parametrize(
        "stems",
        [
            ["000123", "000124"],
            ["IMG_2024", "IMG_2025"],
            ["20240501", "20240502"],
            ["0000000012", "0000000013"],
            ["a", "b"],
            ["cam_v1.2_57", "cam_v1.2_58"],
            ["v1.3_57", "v1.2_58", "v1.1_59"],
            ["202405121430", "202405121431"],  # to the minute; as milliseconds it would be 1976
            ["20240512143077", "20240512143078"],  # no such second; as milliseconds it would be 2611
            ["99990512143057", "99990512143058"],
            ["run_20240512_143057_000001", "run_20240512_143057_000002"],
            ["cam_1234567890_1", "cam_1234567890_2"],
        ],
    )
    def test_other_numbers_are_no_times(self, stems: list[str]) -> None:
        assert name_times(stems) is None

    @given(seconds=st.floats(1e9 + 1, 3e9), unit=st.sampled_from(["s", "ms", "us", "ns"]))
    def test_any_clock_since_1970(self, seconds: float, unit: str) -> None:
        counted = {
            "s": f"{seconds:.6f}",
            **{u: str(int(seconds * s)) for u, s in (("ms", 1e3), ("us", 1e6), ("ns", 1e9))},
        }
        read = name_times([f"cam1_{counted[unit]}"])
        assert read is not None and read.times[0] is not None and abs(read.times[0] - seconds) <= 1.1e-3

    def test_a_steady_rate_in_the_order_of_the_numbers(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["f10.jpg", "f9.jpg", "f2.jpg"])
        recording = imported(folder, "--fps", "4")
        assert times(recording) == [0.0, 0.25, 0.5]
        assert [int(frame.images["rgb"][0, 0, 0]) for frame in recording] == [2, 1, 0]
        assert "times 4 pictures a second, in the files' order" in capsys.readouterr().out

    def test_exif(self, tmp_path: Path, capsys: Shown) -> None:
        def make(level: int) -> bytes:
            return jpeg(level, taken=f"2024:05:01 12:00:0{level // 2}", fraction="25" if level == 3 else "")

        recording = imported(folder_of(tmp_path / "pics", [f"IMG_{i:04d}.JPG" for i in range(4)], make))
        np.testing.assert_allclose(np.array(times(recording)) - 1714564800.0, [0.0, 0.5, 1.0, 1.25], atol=1e-6)
        assert "EXIF" in capsys.readouterr().out

    def test_a_list(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["a.jpg", "b.jpg", "c.jpg"])
        (tmp_path / "t.csv").write_text("file;t [ms];note\npics/b.jpg;100;x\na.jpg;200;\n")
        recording = imported(folder, "--times", str(tmp_path / "t.csv"))
        assert times(recording) == pytest.approx([0.1, 0.2])
        assert [int(frame.images["rgb"][0, 0, 0]) for frame in recording] == [1, 0]
        assert "dropped: 1 x picture: is not in t.csv" in capsys.readouterr().out

    def test_one_without_a_time_among_many_is_left_out(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["1.5.jpg", "1.7.jpg", "thumb.jpg"])
        assert len(imported(folder)) == 2
        assert "dropped: 1 x picture: has no time in its name, as most have" in capsys.readouterr().out

    def test_none_told_is_a_mistake(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["1.jpg", "2.jpg"])
        assert run(["import", "images", str(folder), "-o", str(tmp_path / "rec")]) == 2
        assert "neither the names nor the EXIF of the pictures tell when they were taken; give --fps" in (
            capsys.readouterr().err
        )
        assert not (tmp_path / "rec").exists()


class TestPictures:
    def test_they_are_copied_to_the_byte(self, tmp_path: Path) -> None:
        folder = folder_of(tmp_path / "pics", ["1.5.JPEG", "2.5.JPEG"])
        recording = imported(folder, "--hfov-deg", "62", "--mount-yaw-deg", "180")
        assert recording.pictures["rgb"][1].path.read_bytes() == (folder / "2.5.JPEG").read_bytes()
        assert recording.pictures["rgb"][1].path.suffix == ".jpeg"
        assert recording.camera is not None and (recording.camera.width, recording.camera.height) == (32, 24)
        assert recording.mount.yaw_deg == 180.0

    def test_what_is_no_picture_or_of_another_size_is_told(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["0.1.jpg", "0.2.jpg", "0.3.jpg", "0.4.jpg"])
        (folder / "0.2.jpg").write_bytes(b"no picture")
        (folder / "0.3.jpg").write_bytes(jpeg(9)[:-120])
        (folder / "0.5.jpg").write_bytes(jpeg(9, (24, 32)))
        (folder / "notes.txt").write_text("not looked at")
        assert len(imported(folder)) == 2
        shown = capsys.readouterr().out
        assert "dropped: 2 x picture: does not decode as a picture, such as 0.2.jpg" in shown
        assert "dropped: 1 x picture: is not 32x24 as most are" in shown

    def test_a_picture_that_lies_has_the_size_it_is_shown_with(self, tmp_path: Path) -> None:
        folder = folder_of(
            tmp_path / "pics", ["0.1.jpg", "0.2.jpg"], lambda level: jpeg(level, (24, 32), lying=level == 0)
        )
        (folder / "0.1.jpg").write_bytes(jpeg(0, (32, 24), lying=True))
        recording = imported(folder, "--hfov-deg", "40")
        assert len(recording) == 2 and recording.camera is not None
        assert (recording.camera.width, recording.camera.height) == (24, 32)
        assert {frame.images["rgb"].shape for frame in recording} == {(32, 24, 3)}

    def test_a_pattern(self, tmp_path: Path) -> None:
        folder = folder_of(tmp_path / "pics", ["0.1_left.jpg", "0.1_right.jpg", "0.2_left.jpg"])
        assert len(imported(folder, "--pattern", "*_left*")) == 2

    def test_odometry_beside_them(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", [f"{i}.jpg" for i in range(4)])
        (tmp_path / "o.csv").write_text("time_s,left_ticks,right_ticks\n10,0,0\n11,100,100\n12,100,100\n")
        words = ["--odometry", str(tmp_path / "o.csv"), "--wheel-base-m", "0.3", "--ticks-per-metre", "100"]
        recording = imported(folder, "--fps", "1", "--offset-s", "10", *words)
        assert [float(frame.odometry[0]) for frame in recording if frame.odometry is not None] == [0.0, 1.0, 2.0]
        assert "dropped: 1 x picture: no odometer pose within 0.5 s" in (shown := capsys.readouterr().out)
        assert "o.csv: 2.00 m driven, 0 degrees turned in 2.0 s" in shown


class TestMistakes:
    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (["--fps", "3", "--times", "t.csv"], "--fps and --times both tell when"),
            (["--fps", "0"], "--fps is 0; "),
            (["--pattern", "*.png"], "pics: holds no pictures called '*.png'; "),
            (["--times", "gone.csv"], "gone.csv: no such file; "),
        ],
    )
    def test_options(self, words: list[str], expected: str, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["1.jpg"])
        assert run(["import", "images", str(folder), "-o", str(tmp_path / "rec"), *words]) == 2
        assert expected in capsys.readouterr().err
        assert not (tmp_path / "rec").exists()

    @pytest.mark.parametrize(
        ("text", "expected"),
        [
            ("name,size\n1.jpg,3\n", "t.csv: has no column 'time_s'; "),
            ("time_s,size\n1,3\n", "t.csv: has no column 'file'; "),
            ("file,time_s\n1.jpg,soon\n", "t.csv, line 2: column 'time_s': 'soon' is not a finite number; "),
            ("file,t_m\n1.jpg,2\n", "t.csv: the column 't_m' is in 'm'; "),
            ("file,time\n1.jpg,0\n2.jpg,200\n", "t.csv: column 'time' has no unit, and steps by 200; name it time_ms"),
            ("file,time\n1.jpg,7\n2.jpg,5\n", "t.csv: column 'time' has no unit, and steps by 2; name it time_ms"),
        ],
    )
    def test_lists(self, text: str, expected: str, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["1.jpg"])
        (tmp_path / "t.csv").write_text(text)
        words = ["import", "images", str(folder), "-o", str(tmp_path / "rec"), "--times", str(tmp_path / "t.csv")]
        assert run(words) == 2
        assert expected in capsys.readouterr().err

    def test_one_folder_too_high(self, tmp_path: Path, capsys: Shown) -> None:
        folder_of(tmp_path / "pics", ["1.jpg"])
        assert run(["import", "images", str(tmp_path), "-o", str(tmp_path / "rec"), "--fps", "1"]) == 2
        assert "holds no pictures called '*'; name one of its folders: pics" in capsys.readouterr().err

    @pytest.mark.parametrize(("name", "expected"), [("a.mp4", "'topoloc import video'"), ("gone", "no such folder")])
    def test_no_folder(self, name: str, expected: str, tmp_path: Path, capsys: Shown) -> None:
        (tmp_path / "a.mp4").write_bytes(b"")
        assert run(["import", "images", str(tmp_path / name), "-o", str(tmp_path / "rec")]) == 2
        assert expected in capsys.readouterr().err

    def test_none_that_decodes(self, tmp_path: Path, capsys: Shown) -> None:
        folder = folder_of(tmp_path / "pics", ["1.jpg"], lambda _: b"nothing")
        assert run(["import", "images", str(folder), "-o", str(tmp_path / "rec")]) == 2
        assert "nothing was imported: " in (error := capsys.readouterr().err)
        assert "(1 picture: does not decode as a picture, such as 1.jpg)" in error
        assert not (tmp_path / "rec").exists()
