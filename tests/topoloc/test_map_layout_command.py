"""``topoloc map layout`` as a user types it."""

from __future__ import annotations

import csv
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from topoloc.cli.main import run
from topoloc.files import read_image, write_image
from topoloc.geometry import Floats
from topoloc.mapping import shape_error
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Image

ROWS, COLUMNS, STEP_M = 3, 4, 0.5


def circle(x: float, y: float) -> Image:
    """A full circle of stripes: as x grows they are stronger above, as y grows below."""
    angle = 2.0 * np.pi * np.arange(128) / 128
    height = np.linspace(0.0, 1.0, 28)[:, None]
    above, below = np.sin(5 * angle) * (height < 0.5), np.sin(7 * angle) * (height >= 0.5)
    return np.asarray(128.0 + 20.0 * (1.0 + x) * above + 20.0 * (1.0 + y) * below).round().astype(np.uint8)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of 3 x 4 nodes whose panoramas change with x and y, and the same pictures in a folder."""
    folder = tmp_path_factory.mktemp("layout")
    places = [(STEP_M * c, STEP_M * r) for r in range(ROWS) for c in range(COLUMNS)]
    nodes = [Node(f"N{k}", f"n {k}", *place, 0.0, circle(*place)) for k, place in enumerate(places)]
    TopoMap("stripes", Camera(45.0, 16, 28), (*nodes, Node("bare", "bare", 9.0, 9.0))).save(folder / "map")
    (folder / "pictures").mkdir()
    for number, place in enumerate(places, start=1):
        write_image(folder / "pictures" / f"{number}.png", circle(*place))
    return folder


def truth() -> Floats:
    return np.array([(STEP_M * c, STEP_M * r) for r in range(ROWS) for c in range(COLUMNS)])


def rows_of(folder: Path) -> list[dict[str, str]]:
    with (folder / "layout.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def positions_of(folder: Path) -> Floats:
    return np.array([(float(row["x"]), float(row["y"])) for row in rows_of(folder)])


def layout(source: Path, out: Path, *more: str) -> list[str]:
    return ["map", "layout", str(source), "-o", str(out), *more]


@pytest.mark.parametrize("method", ["batch", "incremental"])
def test_a_map_is_laid_out_and_compared(
    method: str, made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "deep" / "out"
    assert run(layout(made / "map", out, "--method", method)) == 0
    assert {path.name for path in out.iterdir()} == {"layout.csv", "layout.png"}
    assert [row["image"] for row in rows_of(out)] == [f"N{k}" for k in range(12)]  # not the one without a panorama
    printed = capsys.readouterr().out
    found = re.search(r"Procrustes mu ([\d.]+):", printed)
    assert found and float(found[1]) == pytest.approx(shape_error(truth(), positions_of(out)), abs=1e-4)
    assert float(found[1]) < 0.1
    assert "no known scale" in printed
    assert read_image(out / "layout.png").shape[1] > read_image(out / "layout.png").shape[0]


def test_pictures_in_file_order_and_the_scale_that_is_told(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    plain, scaled = tmp_path / "plain", tmp_path / "scaled"
    assert run(layout(made / "pictures", plain)) == 0
    assert run(layout(made / "pictures", scaled, "--spacing-m", "0.7")) == 0
    assert [row["image"] for row in rows_of(plain)] == [f"{k}.png" for k in range(1, 13)]
    for folder, spacing in ((plain, 1.0), (scaled, 0.7)):
        steps = np.linalg.norm(np.diff(positions_of(folder), axis=0), axis=1)
        assert steps.mean() == pytest.approx(spacing, rel=1e-4)
    assert "mu" not in capsys.readouterr().out
    assert shape_error(truth(), positions_of(plain)) < 0.1


def test_known_positions_change_nothing_but_the_comparison(made: Path, tmp_path: Path) -> None:
    assert run(layout(made / "map", tmp_path / "map")) == 0
    assert run(layout(made / "pictures", tmp_path / "pictures")) == 0
    np.testing.assert_array_equal(positions_of(tmp_path / "map"), positions_of(tmp_path / "pictures"))


def test_settings_reach_sensor_and_layout(made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(layout(made / "map", tmp_path / "a")) == 0
    assert run(layout(made / "map", tmp_path / "b", "--set", "sensor.components=4", "--seed", "0")) == 0
    assert run(layout(made / "map", tmp_path / "c", "--stiffness", "exponential")) == 0
    assert len({(tmp_path / name / "layout.csv").read_bytes() for name in "abc"}) == 3
    capsys.readouterr()
    assert run(layout(made / "map", tmp_path / "d", "--method", "batch", "--set", "layout.iterations=2")) == 0
    captured = capsys.readouterr()
    assert "12 images, 2 iterations" in captured.out and "not at rest" in captured.err


def test_an_earlier_layout_is_replaced_when_told(made: Path, tmp_path: Path) -> None:
    for folder in ("out", "other"):
        assert run(layout(made / "map", tmp_path / folder)) == 0
    (tmp_path / "out" / "notes.txt").write_text("mine")
    (tmp_path / "out" / "layout.csv").write_text("old")
    assert run(layout(made / "map", tmp_path / "out", "--overwrite")) == 0
    assert (tmp_path / "out" / "layout.csv").read_bytes() == (tmp_path / "other" / "layout.csv").read_bytes()
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"


MISTAKES = {
    "no such source": (["{0}/nowhere"], r"nowhere: no such folder; "),
    "no pictures": (["{0}/empty"], r"empty: holds 0 panoramas; .*3 or more"),
    "two pictures": (["{0}/two"], r"two: holds 2 panoramas"),
    "a broken picture": (["{0}/broken"], r"2\.png: does not decode"),
    "a broken map": (["{0}/spoilt"], r"nodes\.csv"),
    "all alike": (["{0}/alike"], r"all 3 images look the same to fourier"),
    "unknown sensor": (["{0}/map", "--sensor", "fourrier"], r"'fourrier'.*fourier"),
    "a sensor for frames": (["{0}/map", "--sensor", "ima"], r"ima compares no images with each other; .*fourier"),
    "unknown method": (["{0}/map", "--method", "both"], r"(?i)method.*batch"),
    "unknown stiffness": (["{0}/map", "--stiffness", "soft"], r"(?i)stiffness.*linear"),
    "unknown setting": (["{0}/map", "--set", "layout.reech=1"], r"'reech'.*reach"),
    "setting out of range": (["{0}/map", "--set", "layout.step=2"], r"step is 2"),
    "stiffness among the settings": (["{0}/map", "--set", "layout.stiffness=linear"], r"--stiffness NAME"),
    "table that is none": (["{0}/map", "--set", "springs.step=0.1"], r"'springs'.*layout, sensor"),
    "no spacing": (["{0}/map", "--spacing-m", "0"], r"(?i)spacing"),
    "output exists": (["{0}/map", "-o", "{0}/map"], r"map: already exists.*--overwrite"),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_mistakes_get_one_line_and_leave_nothing(
    case: str, made: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(made, tmp_path, dirs_exist_ok=True)
    for name, count in (("empty", 0), ("two", 2), ("broken", 3), ("alike", 3)):
        (tmp_path / name).mkdir()
        for number in range(count):
            write_image(tmp_path / name / f"{number}.png", circle(0.0, 0.0))
    (tmp_path / "broken" / "2.png").write_text("hello")
    shutil.copytree(made / "map", tmp_path / "spoilt")
    (tmp_path / "spoilt" / "nodes.csv").unlink()
    arguments, says = MISTAKES[case]
    before = sorted(tmp_path.rglob("*"))
    words = [word.format(tmp_path) for word in arguments]
    assert run(["map", "layout", *words, *(() if "-o" in words else ("-o", str(tmp_path / "out")))]) == 2
    out, err = capfd.readouterr()
    assert out == "" and err.count("\n") == 1 and re.search(says, err), err
    assert sorted(tmp_path.rglob("*")) == before
