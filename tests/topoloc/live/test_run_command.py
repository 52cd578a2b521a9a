"""``topoloc run`` as a user types it: what it says and leaves behind, and the one line that each mistake gets."""

from __future__ import annotations

import io
import json
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, ClassVar

import cv2
import numpy as np
import pytest
from cyclopts import App, CycloptsError

from sensors.images import cut_views
from topoloc.cli.main import run
from topoloc.cli.run import run as command
from topoloc.errors import UserError
from topoloc.geometry import compose
from topoloc.importing.video import Video
from topoloc.live.messages import Odometry, Picture, beside
from topoloc.live.report import LiveReport
from topoloc.live.run_log import RunLog
from topoloc.recording import Track
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 96, 72)
PLACES = {
    "U": (0.0, 0.0, 0),
    "A": (1.0, 0.0, 1),
    "B": (2.0, 0.0, 2),
    "V": (0.0, 9.0, 3),
    "A2": (1.0, 9.0, 1),
    "B2": (2.0, 9.0, 2),
}
"""Position and picture of each node: A and B have twins in the other room, the entries U and V have none."""
DRIVE = ("U", "U", "A", "A", "B", "B", "B")
VIEWS = (0, 2, 2, 4, 4, 6, 8)
"""At each frame, which of the 24 views of its node."""


def noise_circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


def view(place: str, number: int) -> tuple[Image, np.ndarray[tuple[int], np.dtype[np.float64]]]:
    """A picture cut from a node's panorama, and the true pose."""
    x, y, picture = PLACES[place]
    image, heading = cut_views(noise_circle(picture), 1.0, CAMERA)[number]
    return image, np.array([x, y, heading])


def record(folder: Path, frames: Sequence[int], start: float, step: float) -> None:
    writer = RecordingWriter(folder, CAMERA)
    for i in frames:
        image, truth = view(DRIVE[i], VIEWS[i])
        writer.add(Frame(start + step * i, compose((3.0, -2.0, 2.0), truth), np.zeros(3), {"rgb": image}))
    writer.close()


@pytest.fixture(scope="module")
def twins(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of two rooms that look the same but for their entries, and a drive through one of them; once in 70 ms."""
    folder = tmp_path_factory.mktemp("twins")
    nodes = tuple(Node(name, f"place {name}", x, y, 1.0, noise_circle(k)) for name, (x, y, k) in PLACES.items())
    TopoMap("twins", CAMERA, nodes).save(folder / "map")
    record(folder / "recording", range(7), 10.0, 1.0)
    record(folder / "quick", range(7), 10.0, 0.01)
    return folder


@pytest.fixture
def place(twins: Path, tmp_path: Path) -> Path:
    shutil.copytree(twins, tmp_path, dirs_exist_ok=True)
    return tmp_path


def live(place: Path, *more: str) -> list[str]:
    return ["run", str(place / "map"), *more]


def recorded(place: Path, *more: str) -> list[str]:
    return live(place, "--recording", str(place / ("recording" if "--fast" in more else "quick")), *more)


def reports(out: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in out.splitlines()]


class TestRecording:
    def test_fast_gives_the_answers_of_localize_to_the_byte(
        self, place: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        out, log = str(place / "run"), str(place / "log")
        words = ["--estimator", "particle", "--seed", "3", "--set", "estimator.particles=300"]
        assert run(["localize", str(place / "map"), str(place / "recording"), "-o", out, *words]) == 0
        assert run(recorded(place, "--fast", "--log", log, *words)) == 0
        for name in ("steps.csv", "trajectory.txt"):
            assert (place / "log" / name).read_bytes() == (place / "run" / name).read_bytes()
        assert "7 pictures: 7 used\n" in capsys.readouterr().out

    def test_at_its_own_pace_each_line_is_a_report(self, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
        assert run(recorded(place, "--json", "--log", str(place / "log"))) == 0
        out, err = capfd.readouterr()
        told = reports(out)
        assert told[-1]["node"] == "B" and told[-1]["name"] == "place B" and told[-1]["status"] == "LOCALIZED"
        assert told[-1]["timestamp"] == pytest.approx(10.06)
        counts = told[-1]["counts"]
        assert counts["frames"] == 7 == counts["used"] + counts["dropped"] and counts["used"] == len(told)
        assert "7 pictures" in err and "log: trajectory.txt, steps.csv" in err
        assert len((place / "log" / "steps.csv").read_text().splitlines()) == len(told) + 1

    def test_without_its_odometry(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(recorded(place, "--fast", "--odometry", "none", "--json")) == 0
        assert {report["counts"]["odometry"] for report in reports(capsys.readouterr().out)} == {0}

    def test_lines_for_people_come_at_changes(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(recorded(place)) == 0
        lines = capsys.readouterr().out.splitlines()
        assert len(lines) < 7 and re.search(r"LOCALIZED  U place U  x .* p 0\.\d\d  dropped \d/\d", lines[0])
        assert re.match(r"7 pictures: \d used", lines[-1])

    def test_a_rate(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(recorded(place, "--fast", "--rate", "0.5")) == 0
        assert "7 pictures: 4 used, 3 passed over" in capsys.readouterr().out


def interrupting(monkeypatch: pytest.MonkeyPatch, number: signal.Signals, at: Any) -> None:
    """Send this process a signal when a report is told of which ``at`` holds."""
    from topoloc.live import lines

    tell = lines.as_json

    def tell_and_interrupt(report: LiveReport, topo_map: TopoMap) -> str:
        if at(report):
            signal.raise_signal(number)
        return tell(report, topo_map)

    monkeypatch.setattr(lines, "as_json", tell_and_interrupt)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_what_ends_it_leaves_belief_and_log(
    number: signal.Signals, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    interrupting(monkeypatch, number, lambda report: report.counts.used == 3)
    words = ["--json", "--fast", "--log", str(place / "log"), "--state", str(place / "belief")]
    assert run(recorded(place, *words)) == 130
    out, err = capfd.readouterr()
    assert len(reports(out)) == 2 and err.endswith("topoloc: stopped\n")
    assert len((place / "log" / "steps.csv").read_text().splitlines()) == 4
    assert (place / "belief").exists()
    assert signal.getsignal(signal.SIGTERM) is signal.SIG_DFL


class TestLog:
    def test_without_it_no_step_is_kept(self, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def kept(*_: object) -> None:
            pytest.fail("nobody asked for a log")

        monkeypatch.setattr(RunLog, "add", kept)
        assert run(recorded(place, "--fast")) == 0

    def test_it_is_on_the_disk_as_it_goes(self, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        found = []

        def lines(report: LiveReport) -> bool:
            (steps,) = place.glob(".log.*/steps.csv")
            found.append(len(steps.read_text().splitlines()))
            return False

        interrupting(monkeypatch, signal.SIGINT, lines)
        assert run(recorded(place, "--json", "--fast", "--log", str(place / "log"))) == 0
        assert found == list(range(2, 9)) and not list(place.glob(".log.*"))

    def test_a_closed_pipe_does_not_cost_it(self, place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        def broken(*_: object) -> str:
            raise BrokenPipeError

        monkeypatch.setattr("topoloc.live.lines.as_json", broken)
        monkeypatch.setattr("topoloc.live.lines.summary", broken)
        words = recorded(place, "--json", "--fast", "--log", str(place / "log"))
        app = App(result_action="return_value")
        app.default(command)
        with pytest.raises(BrokenPipeError):
            app(words[1:], exit_on_error=False)
        assert len((place / "log" / "steps.csv").read_text().splitlines()) == 2

    @pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
    def test_a_full_disk_ends_the_log_and_not_the_run(
        self, place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
    ) -> None:
        add, logged = RunLog.add, []

        def full_at_the_third(log: RunLog, report: LiveReport) -> None:
            logged.append(report)
            if len(logged) == 3:
                log._files[1].close()
                log._files[1] = Path("/dev/full").open("w")  # noqa: SIM115 - the log closes it
            add(log, report)

        monkeypatch.setattr(RunLog, "add", full_at_the_third)
        assert run(recorded(place, "--json", "--fast", "--log", str(place / "log"))) == 2
        out, err = capfd.readouterr()
        assert len(reports(out)) == 7 and "the log ends at 12.000 s (No space left on device)" in err
        assert len((place / "log" / "steps.csv").read_text().splitlines()) == 3


class TestState:
    def killed(self, place: Path, after: str) -> None:
        """Run in another process, until it names a node; kill it in the middle of the drive, without a warning."""
        words = recorded(place, "--json", "--state", str(place / "belief"), "--set", "live.save_every_s=0")
        command = [sys.executable, "-m", "topoloc", *words]
        with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
            assert process.stdout is not None
            for line in process.stdout:
                if json.loads(line)["node"] == after:
                    break
            else:
                pytest.fail(f"it never named {after}")
            process.kill()

    def test_a_killed_run_comes_back_to_its_place(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        shutil.rmtree(place / "quick")
        record(place / "quick", [0, 1, 2], 10.0, 0.25)
        listed = place / "quick" / "rgb.txt"
        listed.write_text(listed.read_text() + "1000.0 rgb/000002.png\n")  # so that it waits there
        self.killed(place, "A")
        shutil.rmtree(place / "recording")
        record(place / "recording", [4, 5, 6], 10.0, 0.25)
        first = {}
        for name, words in (("fresh", []), ("restarted", ["--state", str(place / "belief")])):
            assert run(recorded(place, "--fast", "--json", "--estimator", "activity", *words)) == 0
            first[name] = reports(capsys.readouterr().out)[0]
        assert first["fresh"]["status"] != "LOCALIZED", "the rooms look the same, or this test shows nothing"
        assert (first["restarted"]["node"], first["restarted"]["status"]) == ("B", "LOCALIZED")
        assert first["restarted"]["why"] == "started from the saved belief, moved by the odometry since"

    def test_another_maps_belief_is_refused(self, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
        state = ["--state", str(place / "belief")]
        assert run(recorded(place, "--fast", *state)) == 0
        TopoMap.load(place / "map").save(place / "map2")
        text = (place / "map2" / "map.toml").read_text()
        (place / "map2" / "map.toml").write_text(text.replace("twins", "other"))
        capfd.readouterr()
        assert run(["run", str(place / "map2"), "--recording", str(place / "recording"), *state]) == 2
        assert "is a belief on another map than 'other'; name another file" in capfd.readouterr().err


@pytest.fixture
def video(place: Path) -> Path:
    path = place / "drive.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (96, 72))
    for name, number in zip(DRIVE, VIEWS, strict=True):
        writer.write(cv2.cvtColor(view(name, number)[0], cv2.COLOR_RGB2BGR))
    writer.release()
    rows = [(0.04 * i, *view(name, number)[1]) for i, (name, number) in enumerate(zip(DRIVE, VIEWS, strict=True))]
    lines = [f"{time:.3f},{x * 100:.1f},{y:.3f},{np.rad2deg(theta):.2f}" for time, x, y, theta in rows]
    (place / "odometry.csv").write_text("\n".join(["time_s,x_cm,y_m,heading_deg", *lines, ""]))
    return path


class TestVideo:
    def test_with_odometry_from_a_table(self, video: Path, capsys: pytest.CaptureFixture[str]) -> None:
        place = video.parent
        words = ["--video", str(video), "--odometry", str(place / "odometry.csv"), "--fast", "--json"]
        assert run(live(place, *words)) == 0
        told = reports(capsys.readouterr().out)
        assert [report["node"] for report in told] == list(DRIVE)
        assert [report["timestamp"] for report in told] == pytest.approx([0.04 * i for i in range(7)])
        assert told[-1]["counts"]["odometry"] == 7 and told[-1]["counts"]["jumps"] == 2  # a metre in 40 ms

    def test_with_odometry_from_standard_input(
        self, video: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(sys, "stdin", io.StringIO("0 0 0 0\n0.1 0.05 0 0\nnonsense\n0.2 0.1 0 0\n0.4 0.2 0 0\n"))
        assert run(live(video.parent, "--video", str(video), "--odometry", "-", "--json")) == 0
        counts = reports(capsys.readouterr().out)[-1]["counts"]
        assert (counts["odometry"], counts["bad"], counts["frames"]) == (5, 1, 7)

    def test_mount_and_lens_of_a_camera_toml(self, video: Path, capsys: pytest.CaptureFixture[str]) -> None:
        place = video.parent
        (place / "camera.toml").write_text("hfov_deg = 40\nwidth = 96\nheight = 72\n[mount]\nyaw_deg = 90\n")
        words = ["--video", str(video), "--camera-toml", str(place / "camera.toml"), "--fast", "--json"]
        assert run(live(place, *words)) == 0
        turned = view("U", 0)[1][2] - np.pi / 2
        assert reports(capsys.readouterr().out)[0]["heading_deg"] == pytest.approx(np.rad2deg(turned), abs=3.0)

    def test_one_that_does_not_tell_how_long_it_is(self, video: Path, capsys: pytest.CaptureFixture[str]) -> None:
        place = video.parent
        pictures = [cv2.imencode(".jpg", view(name, number)[0])[1] for name, number in zip(DRIVE, VIEWS, strict=True)]
        (place / "drive.mjpeg").write_bytes(b"".join(picture.tobytes() for picture in pictures))
        words = ["--video", str(place / "drive.mjpeg"), "--fast", "--json", "--odometry"]
        assert run(live(place, *words, str(place / "odometry.csv"))) == 0
        assert reports(capsys.readouterr().out)[-1]["counts"]["used"] == 7
        (place / "before.csv").write_text("time_s,x_m,y_m,heading_deg\n-9,0,0,0\n-8,0,0,0\n")
        assert run(live(place, *words, str(place / "before.csv"))) == 2
        assert "before.csv: tells -9 to -8 s, the video 0 to the end; tell when" in capsys.readouterr().err

    def test_odometry_of_a_clock_that_is_ahead(self, video: Path, capsys: pytest.CaptureFixture[str]) -> None:
        table = (video.parent / "odometry.csv").read_text().splitlines()
        later = [",".join([str(float(row.split(",")[0]) + 3.0), *row.split(",")[1:]]) for row in table[1:]]
        (video.parent / "later.csv").write_text("\n".join([table[0], *later]))
        words = ["--video", str(video), "--fast", "--json", "--odometry", str(video.parent / "later.csv")]
        assert run(live(video.parent, *words)) == 2
        assert "--offset-s" in capsys.readouterr().err
        assert run(live(video.parent, *words, "--offset-s", "3.0")) == 0
        assert reports(capsys.readouterr().out)[0]["counts"]["odometry"] > 0

    @pytest.mark.parametrize("how", ["at its end", "a signal", "no such sensor", "no moment in common"])
    def test_it_is_closed_whatever_happens(self, how: str, video: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        opened: list[Video] = []
        begin = Video.__init__

        def opening(self: Video, path: Path) -> None:
            begin(self, path)
            opened.append(self)

        monkeypatch.setattr(Video, "__init__", opening)
        if how == "a signal":
            interrupting(monkeypatch, signal.SIGINT, lambda report: report.counts.used == 2)
        table = video.parent / "odometry.csv"
        if how == "no moment in common":
            table.write_text("time_s,x_m,y_m,heading_deg\n900,0,0,0\n901,0,0,0\n")
        words = ["--video", str(video), "--odometry", str(table), "--fast", "--json"]
        code = run(live(video.parent, *words, *(["--sensor", "nosuch"] if how == "no such sensor" else [])))
        assert code == {"at its end": 0, "a signal": 130}.get(how, 2)
        assert opened and not any(one._capture.isOpened() for one in opened)


class FakeCamera:
    """What OpenCV would open: a few pictures, then none."""

    opened: ClassVar[list[int | str]] = []

    def __init__(self, device: int | str) -> None:
        self.opened.append(device)
        self._pictures: Iterator[Image] = iter([view("U", 0)[0][..., ::-1]] * 3 if len(self.opened) == 1 else [])

    def isOpened(self) -> bool:
        return True

    def set(self, what: int, value: float) -> None:
        pass

    def read(self) -> tuple[bool, Image | None]:
        picture = next(self._pictures, None)
        return picture is not None, picture

    def release(self) -> None:
        pass


def test_a_camera_that_falls_silent(
    place: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", FakeCamera)
    silent: list[LiveReport] = []

    def silent_twice(report: LiveReport) -> bool:
        silent.extend([report] if report.step is None else [])
        return len(silent) == 2

    interrupting(monkeypatch, signal.SIGINT, silent_twice)
    quick = [
        f"--set=live.{word}" for word in ("camera_silent_s=0.02", "tell_silence_every_s=0.001", "odometry_wait_s=0")
    ]
    assert run(live(place, "--camera", "0", "--json", *quick)) == 130
    told = reports(capfd.readouterr().out)
    assert FakeCamera.opened[0] == 0
    assert told[0]["node"] == "U" and told[0]["status"] == "LOCALIZED"
    assert told[-1]["node"] == "U" and told[-1]["status"] == "LOST"
    assert told[-1]["why"].startswith("the camera is silent for 0.")


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "give one of --camera 0, --video FILE, --recording FOLDER"),
        (["--camera", "0", "--video", "x"], "give one of --camera 0"),
        (["--camera", "0", "--fast"], "--fast plays what is on the disk"),
        (["--camera", "0", "--odometry", "odometry.csv"], "write --odometry -"),
        (["--recording", "recording", "--odometry", "odometry.csv"], "a recording has its own odometry.txt"),
        (["--recording", "recording", "--camera-toml", "camera.toml"], "a recording has its own camera.toml"),
        (["--recording", "recording", "--rate", "0"], "--rate"),
        (["--recording", "recording", "--sensor", "fourier"], "fourier needs omni pictures"),
        (["--recording", "recording", "--set", "live.nosuch=1"], "nothing is called 'nosuch' here"),
        (["--recording", "recording", "--set", "live.camera_silent_s=-1"], "it must be 0 or more"),
        (["--recording", "recording", "--log", "map"], "already exists; name another place, or add --overwrite"),
        (["--recording", "recording", "--state", "map"], "cannot be read"),
        (["--camera", "/no/such/camera"], "camera /no/such/camera: cannot be opened"),
        (["--video", "nosuch.avi"], "nosuch.avi: no such file"),
        (["--video", "text.avi"], "is no video that can be read"),
        (["--video", "drive.avi", "--odometry", "text.avi"], "text.avi"),
        (["--video", "drive.avi", "--odometry", "late.csv"], "late.csv: tells 900 to 901 s, the video 0 to 0.3 s"),
        (["--video", "drive.avi", "--odometry", "bare.csv"], "rename it theta_rad or theta_deg"),
        (["--video", "drive.avi", "--camera-toml", "nosuch.toml"], "nosuch.toml: no such file"),
        (["--video", "drive.avi", "--camera-toml", "wide.toml"], "hfov_deg is 90, but the map was made with 40"),
        (["--video", "square.avi", "--fast"], "is 64x64, but the map's camera has 96x72, another aspect ratio; set"),
    ],
)  # fmt: skip
def test_mistakes_are_told(words: list[str], says: str, video: Path) -> None:
    place = video.parent
    (place / "text.avi").write_text("hello, this is no video\n" * 50)
    (place / "late.csv").write_text("time_s,x_m,y_m,heading_deg\n900,0,0,0\n901,0,0,0\n")
    (place / "bare.csv").write_text("time_s,x_m,y_m,theta\n0,0,0,0\n1,0,0,0\n")
    (place / "wide.toml").write_text("hfov_deg = 90\nwidth = 96\nheight = 72\n")
    writer = cv2.VideoWriter(str(place / "square.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25.0, (64, 64))
    writer.write(np.full((64, 64, 3), 50, np.uint8))
    writer.release()
    there = {path.name for path in place.iterdir()}
    named = [str(place / word) if word in there or word.startswith("nosuch") else word for word in words]
    app = App(result_action="return_value")  # of one command, which takes less time to set up than all
    app.default(command)
    with pytest.raises((UserError, CycloptsError), match=re.escape(says)):
        app(live(place, *named)[1:], exit_on_error=False, print_error=False)
    assert {path.name for path in place.iterdir()} == there


def test_a_mistake_gets_one_line(place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    (place / "text.avi").write_text("hello, this is no video\n" * 50)
    assert run(live(place, "--video", str(place / "text.avi"))) == 2
    out, err = capfd.readouterr()
    own = [line for line in err.splitlines() if "is left out" not in line]
    assert out == "" and len(own) == 1 and "text.avi: is no video that can be read" in own[0]


def test_pictures_beyond_the_odometry_are_no_standing_still() -> None:
    """A video's odometry may begin later, or end sooner."""
    track = Track(np.array([3.0, 4.0]), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]))
    told = list(beside([Picture(float(time), b"") for time in range(7)], track, reach_s=0.5))
    assert [message.time for message in told if isinstance(message, Odometry)] == [3.0, 4.0]
    assert [message.time for message in told if isinstance(message, Picture)] == [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
