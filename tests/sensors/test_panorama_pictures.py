"""The pictures of ``topoloc panorama --debug``, of both methods, and when there are some."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from sensors.panorama_pictures import _files
from topoloc.cli.main import run
from topoloc.files import read_image, write_image


@pytest.fixture
def snapshots(tmp_path: Path) -> Path:
    """Twelve of 40 degrees, 30 apart, cut from a circle of coarse noise; the second is a BMP of the first's name."""
    coarse = np.random.default_rng(0).integers(0, 256, (12, 144)).astype(np.uint8)
    whole = np.kron(coarse, np.ones((6, 6), np.uint8))
    folder = tmp_path / "snapshots"
    folder.mkdir()
    for number in range(12):
        name = f"{number:02d}.png" if number != 1 else "00a.bmp"
        write_image(folder / name, whole[:, (number * 72 + np.arange(96)) % 864])
    return folder


def made(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


@pytest.mark.slow
@pytest.mark.parametrize(("method", "more"), [("circle", {"overview.png"}), ("thesis", set())])
def test_one_picture_an_insertion(method: str, more: set[str], snapshots: Path, tmp_path: Path) -> None:
    out, why = tmp_path / "p.png", tmp_path / "why"
    assert run(["panorama", str(snapshots), "-o", str(out), "--method", method, "--debug", str(why)]) == 0
    assert made(why) == {f"{Path(name).stem}.png" for name in made(snapshots)} | more
    pictures = {path.name: read_image(path) for path in why.iterdir()}
    assert all(300 < picture.shape[1] < 1000 and picture.std() > 5.0 for picture in pictures.values())
    assert not np.array_equal(pictures["02.png"], pictures["03.png"])


def test_they_are_there_where_the_panorama_is_refused(
    snapshots: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    for number in range(6, 12):
        (snapshots / f"{number:02d}.png").unlink()
    command = ["panorama", str(snapshots), "-o", str(tmp_path / "p.png"), "--step-deg", "30"]
    assert run([*command, "--debug", str(tmp_path / "why")]) == 2
    assert made(tmp_path) == {"snapshots", "why"}
    assert "overview.png" in made(tmp_path / "why")
    err = capfd.readouterr().err
    assert "05.png and 00.png leave 1" in err and err.count("\n") == 1


def test_a_folder_that_holds_something_is_refused(
    snapshots: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    why = tmp_path / "why"
    why.mkdir()
    (why / "mine.txt").write_text("mine")
    command = ["panorama", str(snapshots), "-o", str(tmp_path / "p.png"), "--debug", str(why)]
    assert run(command) == 2
    assert "why: already exists" in capfd.readouterr().err
    assert made(tmp_path) == {"snapshots", "why"} and made(why) == {"mine.txt"}
    assert run([*command, "--overwrite"]) == 0
    assert {"mine.txt", "00.png", "overview.png"} < made(why)


@pytest.mark.parametrize(("method", "option"), [("circle", "--slots"), ("thesis", "--step-deg")])
def test_a_setting_of_the_other_method_is_refused(
    method: str, option: str, snapshots: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    command = ["panorama", str(snapshots), "-o", str(tmp_path / "p.png"), "--method", method, option, "15"]
    assert run(command) == 2
    assert option.removeprefix("--").replace("-", "_") in capfd.readouterr().err


def test_names_that_differ_in_their_endings_only_keep_them() -> None:
    assert _files(["1.jpg", "1.png", "2.png", "overview.png"]) == [
        "1.jpg.png",
        "1.png.png",
        "2.png",
        "overview.png.png",
    ]
