"""``topoloc camera`` as a user types it: what it prints, and what it puts into ``camera.toml``."""

from __future__ import annotations

import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from topoloc.camera.chessboard import ChessboardLens
from topoloc.camera.field_of_view import FieldOfView
from topoloc.camera.mount_yaw import MountYaw
from topoloc.camera.turn_fit import TurnedPoints
from topoloc.cli.main import run
from topoloc.files import read_image
from topoloc.lens import Lens
from topoloc.recording import Recording
from topoloc.topo_map import Camera

LENS = '[lens]\nmodel = "pinhole"\nfx = 250.0\nfy = 250.0\ncx = 160.0\ncy = 120.0\n'


@pytest.fixture
def turning(circle: Path, tmp_path: Path) -> Path:
    """A copy of the turn that a test may spoil; its camera.toml tells more than a camera."""
    folder = tmp_path / "turning"
    shutil.copytree(circle, folder)
    (folder / "camera.toml").write_text("hfov_deg = 50\nbaseline_m = 0.12\n\n[mount]\nx = 0.0\nyaw_deg = 3.0\n")
    return folder


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> FieldOfView:
    """What ``topoloc camera turn`` is told, so that the commands are tried without measuring."""
    rng = np.random.default_rng(0)
    points = TurnedPoints(
        rng.uniform(-1, 1, (80, 2)), rng.uniform(-1, 1, (80, 2)), np.ones(80), np.zeros((80, 3)), np.arange(80) // 20
    )
    residuals = rng.normal(0.0, 0.01, (80, 2))
    told = FieldOfView(61.987, 0.31, 4, 369.4, 1.0, 0.1, 0.93, True, 1.031, (320, 240), points, residuals, 2, False)
    monkeypatch.setattr("topoloc.camera.field_of_view.estimate_field_of_view", lambda *_: told)
    return told


@pytest.mark.usefixtures("found")
class TestTurn:
    def test_tells_what_to_write(self, turning: Path, capsys: pytest.CaptureFixture[str]) -> None:
        before = (turning / "camera.toml").read_text()
        assert run(["camera", "turn", str(turning)]) == 0
        out = capsys.readouterr().out
        assert "field of view: 61.99 degrees across (standard deviation 0.31)" in out
        assert "a full circle closed: true turns are 1.031 times the odometer's" in out
        assert "full circles followed from picture to picture: 2; they are the measure" in out
        assert "3 % for each 0.1 m. The standard deviation allows for 0.2 m" in out
        assert out.splitlines()[-1].startswith("next: add --write")
        told = tomllib.loads("\n".join(line for line in out.splitlines() if " = " in line))
        assert told == {"hfov_deg": 61.99, "width": 320, "height": 240}
        assert (turning / "camera.toml").read_text() == before

    def test_write_keeps_all_else(self, turning: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["camera", "turn", str(turning), "--write"]) == 0
        table = tomllib.loads((turning / "camera.toml").read_text())
        kept = {"baseline_m": 0.12, "mount": {"x": 0.0, "yaw_deg": 3.0}}
        assert table == {"hfov_deg": 61.99, "width": 320, "height": 240, **kept}
        assert Recording.load(turning).camera == Camera(61.99, 320, 240)
        out = capsys.readouterr().out
        assert "hfov_deg = 61.99 (before: 50)" in out and "width = 320 (before: not told)" in out
        assert out.splitlines()[-1] == f"next: topoloc check {turning}"

    def test_another_file(self, turning: Path, tmp_path: Path) -> None:
        before = (turning / "camera.toml").read_text()
        assert run(["camera", "turn", str(turning), "-o", str(tmp_path / "mine.toml")]) == 0
        assert tomllib.loads((tmp_path / "mine.toml").read_text())["hfov_deg"] == 61.99
        assert (turning / "camera.toml").read_text() == before

    def test_picture(self, turning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        place = tmp_path / "off.png"
        assert run(["camera", "turn", str(turning), "--picture", str(place)]) == 0
        assert read_image(place).std() > 5.0
        assert run(["camera", "turn", str(turning), "--picture", str(place)]) == 2
        assert "already exists" in capsys.readouterr().err
        assert run(["camera", "turn", str(turning), "--picture", str(place), "--overwrite"]) == 0

    def test_lens_is_not_contradicted(self, turning: Path, capsys: pytest.CaptureFixture[str]) -> None:
        text = f"width = 320\nheight = 240\n{LENS}"
        (turning / "camera.toml").write_text(text)
        assert run(["camera", "turn", str(turning), "--write"]) == 2
        assert "has a [lens], which tells the field of view" in capsys.readouterr().err
        assert (turning / "camera.toml").read_text() == text
        assert run(["camera", "turn", str(turning)]) == 0
        assert "with it 65.24 is told" in capsys.readouterr().out

    def test_folder_for_a_file(self, turning: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["camera", "turn", str(turning), "-o", str(turning)]) == 2
        assert "is a folder; name the file" in capsys.readouterr().err


def test_yaw_keeps_the_place(
    turning: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    told = MountYaw(-34.96, 0.4, 30, 2.4, 0.97)
    monkeypatch.setattr("topoloc.camera.mount_yaw.estimate_mount_yaw", lambda *_: told)
    assert run(["camera", "yaw", str(turning), "--write"]) == 0
    assert tomllib.loads((turning / "camera.toml").read_text())["mount"] == {"x": 0.0, "yaw_deg": -35.0}
    assert "mount.yaw_deg = -35.0 (before: 3.0)" in capsys.readouterr().out


class TestChessboard:
    def test_lens_is_written(self, turning: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        lens = Lens("fisheye", 150.0, 150.5, 160.0, 119.0, (0.05, -0.01, 0.002, 0.0))
        camera = Camera(lens.hfov_deg(320), 320, 240)
        asked: list[object] = []

        def told(*arguments: object) -> ChessboardLens:
            asked.extend(arguments[:3])
            return ChessboardLens(lens, camera, 0.2, 0.15, 14, 20, (0.9, 0.8))

        monkeypatch.setattr("topoloc.camera.chessboard.lens_from_chessboards", told)
        options = ["--board", "7x5", "--model", "fisheye", "-o", str(turning / "camera.toml")]
        assert run(["camera", "chessboard", str(turning), *options]) == 0
        recording = Recording.load(turning)
        assert (recording.lens, recording.camera) == (lens, camera)
        assert (recording.baseline_m, recording.mount.yaw_deg) == (0.12, 3.0)
        pictures, *rest = asked
        assert isinstance(pictures, list) and len(pictures) == 21
        assert rest == [(7, 5), "fisheye"]

    @pytest.mark.parametrize("board", ["9", "9x", "axb", "9,6"])
    def test_boards_that_are_none(self, turning: Path, board: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["camera", "chessboard", str(turning), "--board", board]) == 2
        assert "write inner corners as columns x rows" in capsys.readouterr().err

    def test_no_folder(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["camera", "chessboard", str(tmp_path / "none")]) == 2
        assert "no such folder" in capsys.readouterr().err
