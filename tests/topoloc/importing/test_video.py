"""Videos become recordings: times, turned phones, cut files, odometry on another clock."""

from __future__ import annotations

import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topoloc.cli import main
from topoloc.cli.main import run
from topoloc.errors import UserError
from topoloc.importing.alongside import Alongside
from topoloc.importing.thinning import Thinning
from topoloc.importing.video import Video, every_of
from topoloc.recording import Recording, Track
from topoloc.rig_file import read_rig
from topoloc.types import Image

FRAMES, FPS = 40, 10.0


@pytest.fixture(scope="module", autouse=True)
def one_app() -> Iterator[None]:
    """The command line is put together once: it is run many times here."""
    app = main.build_app()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(main, "build_app", lambda: app)
        yield


def picture(index: int) -> Image:
    """RGB 48x64: red above, blue below, and as light as the index says at the right."""
    image = np.zeros((48, 64, 3), np.uint8)
    image[:24, :, 0], image[24:, :, 2] = 200, 200
    image[:, 48:] = 6 * index
    return image


def film(path: Path, codec: str) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*codec), FPS, (64, 48))
    assert writer.isOpened()
    for index in range(FRAMES):
        writer.write(cv2.cvtColor(picture(index), cv2.COLOR_RGB2BGR))
    writer.release()
    return path


@pytest.fixture(scope="module")
def mp4(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return film(tmp_path_factory.mktemp("video") / "drive.mp4", "mp4v")


@pytest.fixture(scope="module")
def mkv(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return film(tmp_path_factory.mktemp("video") / "drive.mkv", "MJPG")


def odometry(path: Path, begin: float, seconds: float = 4.0) -> Path:
    times = np.arange(begin, begin + seconds, 0.05)
    rows = [f"{time:.3f},{100 * (time - begin):.2f},0,90,11.8" for time in times]
    path.write_text("\n".join(["time_s,x [mm],y [mm],yaw_deg,battery_v", *rows]))
    return path


def turned(source: Path, path: Path) -> Path:
    """A copy whose header says, as a phone's would, that it is to be shown turned by 90 degrees clockwise."""
    data = bytearray(source.read_bytes())
    matrix = data.find(b"tkhd") + 4 + 4 + 20 + 16  # past version, times and layer of the track's header
    data[matrix : matrix + 36] = struct.pack(">9i", 0, 1 << 16, 0, -1 << 16, 0, 0, 48 << 16, 0, 1 << 30)
    path.write_bytes(data)
    return path


def imported(words: Sequence[str], output: Path) -> Recording:
    assert run(["import", "video", *words, "-o", str(output)]) == 0
    return Recording.load(output)


def level(recording: Recording, index: int) -> float:
    """The number of the frame in the video that a picture is, as its right side shows it."""
    image = recording.frame(recording.pictures["rgb"][index]).images["rgb"]
    return float(image[:, 56:].mean()) / 6.0


class TestFrames:
    def test_one_every_so_often_at_its_time(self, mp4: Path, tmp_path: Path) -> None:
        recording = imported([str(mp4)], tmp_path / "rec")
        np.testing.assert_allclose([p.time for p in recording.pictures["rgb"]], np.arange(20) * 0.2, atol=1e-6)
        np.testing.assert_allclose([level(recording, i) for i in (0, 7, 19)], [0, 14, 38], atol=0.8)
        image = next(iter(recording)).images["rgb"]
        assert image.shape == (48, 64, 3)
        assert image[8, 8, 0] > 150 > image[8, 8, 2] and image[40, 8, 2] > 150 > image[40, 8, 0], "colours in order"
        assert recording.odometry is None and recording.camera is None

    @pytest.mark.parametrize(
        ("words", "first", "count"),
        [
            (["--every", "0"], 0.0, 40),
            (["--fps", "2"], 0.0, 8),
            (["--every", "0.3", "--start", "1", "--end", "2"], 1.0, 4),
            (["--start", "3.5"], 3.5, 2 + 1),
        ],
    )
    def test_stretches(self, words: list[str], first: float, count: int, mp4: Path, tmp_path: Path) -> None:
        times = [picture.time for picture in imported([str(mp4), *words], tmp_path / "rec").pictures["rgb"]]
        assert times[0] == pytest.approx(first) and len(times) == count

    def test_a_phone_held_upright(self, mp4: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        phone = turned(mp4, tmp_path / "phone.mp4")
        image = next(iter(imported([str(phone), "--hfov-deg", "40"], tmp_path / "rec"))).images["rgb"]
        assert image.shape == (64, 48, 3)
        assert image[8, 40, 0] > 150 and image[8, 8, 2] > 150, "what was above is now at the right"
        assert "48x64, turned upright by 90 degrees" in capsys.readouterr().out
        camera = read_rig(tmp_path / "rec" / "camera.toml").camera
        assert camera is not None and (camera.width, camera.height) == (48, 64)

    def test_scaled_down(self, mp4: Path, tmp_path: Path) -> None:
        recording = imported([str(mp4), "--width", "32", "--hfov-deg", "62", "--mount-yaw-deg", "90"], tmp_path / "rec")
        assert next(iter(recording)).images["rgb"].shape == (24, 32, 3)
        assert recording.camera is not None and recording.camera.hfov_deg == 62.0
        assert recording.mount.yaw_deg == 90.0


class TestOdometry:
    def test_frames_are_put_on_its_clock(self, mp4: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        csv = odometry(tmp_path / "o.csv", 1700000000.0)
        words = [str(mp4), "--odometry", str(csv), "--truth", str(csv), "--offset-s", "1700000001"]
        recording = imported(words, tmp_path / "rec")
        first = next(iter(recording))
        assert first.timestamp == pytest.approx(1700000001.0)
        assert first.odometry is not None and recording.truth is not None
        np.testing.assert_allclose(first.odometry, [0.1, 0.0, np.pi / 2], atol=1e-4)
        shown = capsys.readouterr().out
        assert "o.csv: 0.40 m driven, 0 degrees turned in 4.0 s; if not so, a unit is wrong" in shown
        assert "read: time_s, x [mm], y [mm], yaw_deg; the clock counts s" in shown
        assert "ignored: battery_v" in shown
        assert "dropped: 2 x frame: no odometer pose within 0.5 s" in shown

    def test_another_clock_is_named(self, mp4: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        csv = odometry(tmp_path / "o.csv", 1700000000.0)
        assert run(["import", "video", str(mp4), "-o", str(tmp_path / "rec"), "--odometry", str(csv)]) == 2
        assert "the pictures run from 0.000 to 4.000 s, the odometer poses from 1700000000.000 to" in (
            error := capsys.readouterr().err
        )
        assert "give --offset-s" in error and not (tmp_path / "rec").exists()

    def test_a_gap_loses_the_frames_in_it_alone(self) -> None:
        times = np.concatenate([np.arange(0.0, 2.0, 0.1), np.arange(6.0, 8.0, 0.1)])
        beside = Alongside(odometry=Track(times, np.zeros((len(times), 3))))
        assert [beside.lack(t) is None for t in (-0.6, -0.4, 1.0, 2.3, 4.0, 5.6, 8.2, 9.0)] == [
            False, True, True, True, False, True, True, False,
        ]  # fmt: skip

    def test_rare_readings_reach_to_the_next(self) -> None:
        times = np.arange(0.0, 20.0, 4.0)
        assert Alongside(truth=Track(times, np.zeros((5, 3)))).lack(2.0) is None


class TestClock:
    """What OpenCV says of a frame's time may be wrong; a capture that plays such stamps stands for it."""

    class Playing:
        def __init__(self, stamps_ms: Sequence[float]) -> None:
            self.stamps, self.at = stamps_ms, -1

        def grab(self) -> bool:
            self.at += 1
            return self.at < len(self.stamps)

        def get(self, what: int) -> float:
            assert what == cv2.CAP_PROP_POS_MSEC
            return self.stamps[self.at]

    def times(self, mp4: Path, stamps_ms: Sequence[float], fps: float = 10.0) -> tuple[list[float], int]:
        video = Video(mp4)
        video.close()
        video._capture, video.fps = self.Playing(stamps_ms), fps
        return list(video.times()), video.guessed

    def test_uneven_frames_keep_their_times(self, mp4: Path) -> None:
        times, guessed = self.times(mp4, [33.0, 66.0, 300.0, 310.0])
        assert times == pytest.approx([0.0, 0.033, 0.267, 0.277]) and guessed == 0

    def test_zeros_at_the_end_are_counted_on(self, mp4: Path) -> None:
        """opencv/opencv, issues 20550 and 22141."""
        times, guessed = self.times(mp4, [0.0, 100.0, 200.0, 0.0, 0.0])
        assert times == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4]) and guessed == 2

    def test_no_times_at_all(self, mp4: Path) -> None:
        times, guessed = self.times(mp4, [0.0, 0.0, 0.0])
        assert times == pytest.approx([0.0, 0.1, 0.2]) and guessed == 2

    def test_neither_times_nor_a_rate(self, mp4: Path) -> None:
        with pytest.raises(UserError, match=r"drive\.mp4: tells neither times nor a frame rate; .*ffmpeg"):
            self.times(mp4, [0.0, 0.0], np.nan)

    @given(stamps=st.lists(st.floats(-1e6, 1e7), min_size=2, max_size=20))
    def test_times_always_increase(self, mp4: Path, stamps: list[float]) -> None:
        times, _ = self.times(mp4, stamps)
        assert len(times) == len(stamps) and (np.diff(times) > 0.0).all()


@given(every=st.floats(0.05, 2.0), step=st.floats(0.01, 0.2), start=st.floats(0.0, 3.0))
def test_thinning_keeps_pace(every: float, step: float, start: float) -> None:
    """However the frames fall, one is taken in each stretch of so many seconds that has some."""
    thinning = Thinning(every, start)
    taken: list[float] = []
    for time in np.arange(0.0, 8.0, step):
        if thinning.takes(float(time), taken[-1] if taken else None):
            taken.append(float(time))
    assert taken[0] < start + step + 2e-3
    assert max(np.diff(taken), default=0.0) < every + step + 2e-3
    assert len(taken) <= (8.0 - start) / every + 2


class TestMistakes:
    def test_cut_short_what_was_read_is_kept(
        self, mkv: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        cut = tmp_path / "cut.mkv"
        cut.write_bytes(mkv.read_bytes()[: mkv.stat().st_size // 2])
        recording = imported([str(cut), "--every", "0"], tmp_path / "rec")
        shown = capsys.readouterr().out
        assert 10 < len(recording) < 30
        lost = FRAMES - len(recording)
        assert f"dropped: {lost} x frame: is announced but cannot be read; the file is damaged or cut short" in shown

    def test_a_whole_video_loses_nothing(self, mkv: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        imported([str(mkv), "--end", "1"], tmp_path / "rec")
        assert "dropped" not in capsys.readouterr().out

    @pytest.mark.parametrize(
        ("name", "content", "expected"),
        [
            ("empty.mp4", b"", "empty.mp4: is no video"),
            ("text.avi", b"hello" * 50, "text.avi: is no video"),
            ("a.jpg", b"", "a.jpg: is a picture; 'topoloc import images' takes a folder of pictures"),
            (".", None, "is a folder; 'topoloc import images'"),
            ("gone.mp4", None, "gone.mp4: no such file; "),
        ],
    )
    def test_what_is_no_video(
        self, name: str, content: bytes | None, expected: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        if content is not None:
            (tmp_path / name).write_bytes(content)
        assert run(["import", "video", str(tmp_path / name), "-o", str(tmp_path / "rec")]) == 2
        assert expected in capsys.readouterr().err
        assert not (tmp_path / "rec").exists()

    def test_a_phone_that_died_gets_one_line_and_none_of_ffmpegs(self, mp4: Path, tmp_path: Path) -> None:
        """In a process of its own: FFmpeg is told once how much to say."""
        (tmp_path / "cut.mp4").write_bytes(mp4.read_bytes()[:600])
        words = ["import", "video", str(tmp_path / "cut.mp4"), "-o", str(tmp_path / "rec")]
        done = subprocess.run([sys.executable, "-m", "topoloc", *words], capture_output=True, text=True, check=False)
        error = [line for line in done.stderr.splitlines() if "is left out" not in line]
        assert done.returncode == 2 and len(error) == 1
        assert "cut.mp4: is no video that can be read, or it lacks its end; copy it again" in error[0]

    @pytest.mark.parametrize(
        ("words", "expected"),
        [
            (["--every", "1", "--fps", "3"], "--every and --fps say the same thing"),
            (["--fps", "0"], "--fps is 0; "),
            (["--every", "-1"], "--every is -1; "),
            (["--start", "9"], "(40 frame: lies outside of --start and --end)"),
            (["--width", "0"], "--width"),
            (["--hfov-deg", "180"], "--hfov-deg"),
        ],
    )
    def test_options(
        self, words: list[str], expected: str, mp4: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(["import", "video", str(mp4), "-o", str(tmp_path / "rec"), *words]) == 2
        assert expected in capsys.readouterr().err
        assert not (tmp_path / "rec").exists()

    def test_nothing_is_overwritten_unasked(self, mp4: Path, tmp_path: Path) -> None:
        (tmp_path / "rec").mkdir()
        (tmp_path / "rec" / "odometry.txt").write_text("1 0 0 0 0 0 0 1\n")
        assert run(["import", "video", str(mp4), "-o", str(tmp_path / "rec")]) == 2
        for name in ("pan.txt", "omni.txt", "groundtruth.txt", "camera.toml", "rooms.csv", "origin.toml"):
            (tmp_path / "rec" / name).write_text("0 90\n")
        (tmp_path / "rec" / "notes.txt").write_text("mine")
        assert run(["import", "video", str(mp4), "-o", str(tmp_path / "rec"), "--overwrite"]) == 0
        left = {path.name for path in (tmp_path / "rec").iterdir()}
        assert left == {"rgb", "rgb.txt", "notes.txt"}, "what belongs to the earlier recording is gone"


def test_the_file_is_let_go_of_on_a_mistake(mp4: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    closed = 0

    def close(video: Video) -> None:
        nonlocal closed
        closed += 1

    monkeypatch.setattr(Video, "close", close)
    csv = odometry(tmp_path / "o.csv", 1700000000.0)
    assert run(["import", "video", str(mp4), "--odometry", str(csv), "-o", str(tmp_path / "rec")]) == 2
    assert closed == 1


def test_how_often() -> None:
    assert (every_of(None, None, 0.2), every_of(0.0, None, 0.2), every_of(None, 5.0, 0.3)) == (0.2, 0.0, 0.2)
