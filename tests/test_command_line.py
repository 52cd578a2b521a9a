"""The command line as a user types it: what it writes, and the one line that each mistake gets."""

from __future__ import annotations

import csv
import json
import re
import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.spoil import Spoil, remove, rewrite, write

from sensors.images import cut_views
from topoloc import __version__, plugins
from topoloc.cli.main import run
from topoloc.files import read_image, write_image
from topoloc.geometry import compose, wrap
from topoloc.metrics import METRICS
from topoloc.picture_index import STORE_FOLDER
from topoloc.recording import Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.settings import Setting, parse_words
from topoloc.thesis_map import ThesisMapSettings, load_thesis_map, save_thesis_map
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image, Status

CAMERA = Camera(40.0, 96, 72)
STEP_COLUMNS = ["timestamp", "x", "y", "heading_deg", "node", "probability", "status", "match", "kind"]
DRIVE = (  # node, which of its 24 views, metres on from the node: the fourth frame lies within the motion gate
    (0, 0, 0.0),
    (0, 2, 0.0),
    (1, 2, 0.0),
    (1, 2, 0.05),
    (1, 4, 0.0),
    (2, 4, 0.0),
    (2, 6, 0.0),
)


def noise_circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


@pytest.fixture(scope="session")
def tiny(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A map of three nodes with noise for panoramas, and a recording of seven views cut from them."""
    folder = tmp_path_factory.mktemp("tiny")
    nodes = tuple(Node(f"N{k}", f"place {k}", float(k), 0.5, 1.0, noise_circle(k)) for k in range(3))
    TopoMap("tiny", CAMERA, nodes).save(folder / "map")
    lines = [f"N{k},place {k},{k},0.5,57.2957795,panoramas/N{k}.png" for k in range(3)]
    (folder / "map" / "nodes.csv").write_text("\n".join(["id,name,x,y,heading,panorama", *lines, ""]))
    writer = RecordingWriter(folder / "recording", CAMERA)
    for time, (k, view, ahead) in enumerate(DRIVE):
        panorama = nodes[k].panorama
        assert panorama is not None
        image, heading = cut_views(panorama, nodes[k].heading, CAMERA)[view]
        truth = np.array([nodes[k].x + ahead, nodes[k].y, heading])
        odometry = compose((3.0, -2.0, 2.0), truth)  # the odometer's own frame
        writer.add(Frame(10.0 + time, odometry, np.zeros(3), {"rgb": image}), truth)
    writer.close()
    return folder


@pytest.fixture
def place(tiny: Path, tmp_path: Path) -> Path:
    """A copy of the tiny map and recording that a test may spoil."""
    shutil.copytree(tiny, tmp_path, dirs_exist_ok=True)
    return tmp_path


def content(folder: Path) -> dict[str, bytes | None]:
    """All that lies there, but what maps keep for themselves (``topoloc.map_store``)."""
    paths = [path for path in folder.rglob("*") if STORE_FOLDER not in path.parts]
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else None for path in paths}


def rows_of(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def localize(place: Path, *more: str) -> list[str]:
    return ["localize", str(place / "map"), str(place / "recording"), "-o", str(place / "run"), *more]


def topoloc(*arguments: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "topoloc", *arguments], capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def done(tiny: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What ``topoloc localize`` writes for the tiny recording."""
    out = tmp_path_factory.mktemp("done") / "deep" / "run"
    assert run(["localize", str(tiny / "map"), str(tiny / "recording"), "-o", str(out)]) == 0
    return out


class TestLocalize:
    def test_writes_these_files_and_no_others(self, done: Path) -> None:
        assert {p.name for p in done.iterdir()} == {"trajectory.txt", "steps.csv", "plan.png", "metrics.json"}
        assert [p.name for p in done.parent.iterdir()] == ["run"]

    def test_steps(self, done: Path) -> None:
        rows = rows_of(done / "steps.csv")
        assert (done / "steps.csv").read_text().splitlines()[0].split(",") == STEP_COLUMNS
        assert [float(row["timestamp"]) for row in rows] == [10.0 + time for time in range(len(DRIVE))]
        assert [row["kind"] for row in rows] == ["update", "update", "update", "gated", "update", "update", "update"]
        assert {row["status"] for row in rows} <= {status.value for status in Status}
        assert {row["node"] for row in rows} <= {"N0", "N1", "N2", ""}
        assert rows[3]["match"] == "" and all(0.0 <= float(row["match"]) <= 1.0 for row in rows if row["match"])
        for row in rows:
            assert 0.0 <= float(row["probability"]) <= 1.0
            assert np.isfinite([float(row[key]) for key in ("x", "y", "heading_deg")]).all()

    def test_the_robot_is_where_it_was(self, done: Path, tiny: Path) -> None:
        rows = rows_of(done / "steps.csv")
        truth = Recording.load(tiny / "recording").truth
        assert truth is not None
        assert [row["node"] for row in rows[2:]] == ["N1", "N1", "N1", "N2", "N2"]
        for row, pose in zip(rows[2:], truth.poses[2:], strict=True):
            assert np.hypot(float(row["x"]) - pose[0], float(row["y"]) - pose[1]) < 0.3
            assert abs(float(wrap(np.deg2rad(float(row["heading_deg"])) - pose[2]))) < np.deg2rad(10.0)

    def test_the_trajectory_is_a_tum_file_of_the_same_poses(self, done: Path) -> None:
        lines = (done / "trajectory.txt").read_text().splitlines()
        table = np.array([[float(word) for word in line.split()] for line in lines if not line.startswith("#")])
        assert table.shape == (len(DRIVE), 8)
        rows = rows_of(done / "steps.csv")
        steps = np.array([[float(row[key]) for key in ("timestamp", "x", "y", "heading_deg")] for row in rows])
        assert table[:, :3] == pytest.approx(steps[:, :3], abs=1e-4)
        assert (table[:, 3:6] == 0.0).all()
        turned = wrap(2.0 * np.arctan2(table[:, 6], table[:, 7]) - np.deg2rad(steps[:, 3]))
        assert np.abs(turned).max() < 1e-3

    @pytest.mark.parametrize(
        ("words", "problem"),
        [
            (["estimator.particles=1"], "particles is 1; it must be at least 2"),
            (["estimator.weighting=pw8"], "use one of: likelihood, pw1"),
            (["estimator.nosuch=1"], "nothing is called 'nosuch' here"),
            (["sensor.slots=0"], "slots is 0"),
            (["particles=100"], "use one of: estimator, odometry, sensor"),
        ],
    )
    def test_settings_that_cannot_be(
        self, place: Path, words: list[str], problem: str, capsys: pytest.CaptureFixture[str]
    ) -> None:
        settings = [part for word in words for part in ("--set", word)]
        assert run(localize(place, "--estimator", "particle", *settings)) == 2
        told = capsys.readouterr().err.strip()
        assert problem in told and "\n" not in told
        assert not (place / "run").exists()

    def test_settings_reach_the_estimator_and_the_sensor(self, place: Path) -> None:
        tracks = []
        for words in ([], ["estimator.weighting=pw1", "estimator.weights.neighbours=2"], ["sensor.kappa=1"]):
            settings = [part for word in words for part in ("--set", word)]
            assert run(localize(place, "--estimator", "particle", "--overwrite", *settings)) == 0
            tracks.append([row["x"] for row in rows_of(place / "run" / "steps.csv")])
        assert tracks[0] != tracks[1] and tracks[0] != tracks[2]

    def test_metrics(self, done: Path) -> None:
        values = json.loads((done / "metrics.json").read_text())
        assert list(values) == [metric.name for metric in METRICS]
        assert values["steps"] == 6
        assert values["node_accuracy"] >= 4 / 6
        assert values["recovery_steps"] is None

    def test_the_plan_is_a_picture(self, done: Path) -> None:
        plan = read_image(done / "plan.png")
        assert min(plan.shape[:2]) > 300 and plan.std() > 5.0

    def test_the_same_seed_gives_the_same_bytes(self, place: Path) -> None:
        for out, seed in (("a", "5"), ("b", "5"), ("c", "6")):
            command = localize(place, "--estimator", "particle", "--seed", seed)
            assert run([word.replace(str(place / "run"), str(place / out)) for word in command]) == 0
        first, second, third = ((place / out / "steps.csv").read_bytes() for out in "abc")
        assert first == second != third

    def test_says_what_came_of_it(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(localize(place)) == 0
        out, err = capsys.readouterr()
        assert "7 frames: 1 gated, 6 update" in out and "node_accuracy" in out and "metrics.json" in out
        assert err == ""

    def test_without_truth_there_are_no_metrics(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        (place / "recording" / "groundtruth.txt").unlink()
        assert run(localize(place)) == 0
        assert {p.name for p in (place / "run").iterdir()} == {"trajectory.txt", "steps.csv", "plan.png"}
        assert "7 frames" in capsys.readouterr().out

    def test_without_odometry_every_frame_is_looked_at(self, place: Path) -> None:
        (place / "recording" / "odometry.txt").unlink()
        assert run(localize(place, "--estimator", "best-match")) == 0
        rows = rows_of(place / "run" / "steps.csv")
        assert [row["kind"] for row in rows] == ["update"] * 7
        assert [row["node"] for row in rows] == [f"N{k}" for k, _, _ in DRIVE]
        true = np.rad2deg(1.0) - 20.0 - 15.0 * np.array([view for _, view, _ in DRIVE])
        assert [float(row["heading_deg"]) for row in rows] == pytest.approx(true, abs=1.0)

    @pytest.mark.parametrize("what", ["a text", "no bytes", "missing"])
    def test_an_unreadable_picture_in_the_middle(
        self, what: str, place: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        picture = place / "recording" / "rgb" / "000002.png"
        picture.unlink() if what == "missing" else picture.write_bytes(b"hello" if what == "a text" else b"")
        assert run(localize(place)) == 0
        out, err = capfd.readouterr()
        rows = rows_of(place / "run" / "steps.csv")
        assert [row["kind"] for row in rows].count("unreadable") == 1
        assert (rows[2]["kind"], rows[2]["match"]) == ("unreadable", "")
        assert (len(rows), rows[-1]["node"]) == (len(DRIVE), "N2")
        assert "1 unreadable" in out
        assert err.count("\n") == 1 and "000002.png" in err and "Traceback" not in err

    def test_a_truncated_picture_in_the_middle_is_reported_once(
        self, place: Path, capfd: pytest.CaptureFixture[str]
    ) -> None:
        picture = place / "recording" / "rgb" / "000002.png"
        picture.write_bytes(picture.read_bytes()[:-300])
        assert run(localize(place)) == 0
        assert rows_of(place / "run" / "steps.csv")[2]["kind"] == "unreadable"
        assert capfd.readouterr().err.count("\n") == 1

    def test_overwriting_keeps_other_files(self, place: Path) -> None:
        (place / "run").mkdir()
        (place / "run" / "steps.csv").write_text("old")
        (place / "run" / "notes.txt").write_text("mine")
        assert run(localize(place, "--overwrite")) == 0
        assert (place / "run" / "notes.txt").read_text() == "mine"
        assert len(rows_of(place / "run" / "steps.csv")) == len(DRIVE)


def snapshots_of(folder: Path, step_deg: int = 30, camera: Camera = CAMERA, seed: int = 9) -> Path:
    """Snapshots cut from a circle of noise, turning clockwise, the first at its very left."""
    circle, columns = noise_circle(seed), camera.panorama_columns()
    folder.mkdir()
    for i in range(360 // step_deg):
        left = round(i * step_deg * columns / 360)
        write_image(folder / f"{i:02d}.png", circle[:, (left + np.arange(camera.width)) % columns])
    return folder


class TestPanorama:
    def test_of_noise(self, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        folder = snapshots_of(tmp_path / "snapshots")
        (folder / "yaws.csv").write_text("not a picture\n")
        out = tmp_path / "out" / "p.png"
        assert run(["panorama", str(folder), "-o", str(out), "--start-deg", "90"]) == 0
        assert {p.name for p in out.parent.iterdir()} == {"p.png", "p.csv"}
        assert read_image(out).shape == (72, 864, 3)
        rows = rows_of(out.with_suffix(".csv"))
        assert list(rows[0]) == ["file", "column", "heading_deg"]
        assert [row["file"] for row in rows] == [f"{i:02d}.png" for i in range(12)]
        for i, row in enumerate(rows):
            assert abs((int(row["column"]) - 72 * i + 432) % 864 - 432) <= 2
            assert abs((float(row["heading_deg"]) - (90.0 - 30.0 * i) + 180.0) % 360.0 - 180.0) < 1.0
            assert -180.0 <= float(row["heading_deg"]) <= 180.0
        text, err = capfd.readouterr()
        assert re.search(r"864 x 72, heading 1(09\.[5-9]|10\.[0-5])\d degrees", text)  # these views are no pin-hole's
        assert "from 12 snapshots" in text
        assert all("seem" in line for line in err.splitlines())

    def test_in_colour_it_is_the_circle_itself(self, tmp_path: Path) -> None:
        folder, out = snapshots_of(tmp_path / "snapshots"), tmp_path / "p.png"
        assert run(["panorama", str(folder), "-o", str(out), "--no-clahe"]) == 0
        assert np.abs(read_image(out).astype(int) - noise_circle(9)).mean() < 25.0  # a column off here and there

    def test_a_gap_is_told(self, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        folder = snapshots_of(tmp_path / "snapshots")
        for i in range(6, 12):
            (folder / f"{i:02d}.png").unlink()
        assert run(["panorama", str(folder), "-o", str(tmp_path / "p.png"), "--method", "thesis"]) == 0
        gap = re.search(r"warning: (\d+) degrees", capfd.readouterr().err)
        assert gap is not None and abs(int(gap.group(1)) - 170) <= 3

    @pytest.mark.parametrize("present", ["p.png", "p.csv"])
    def test_overwriting(self, present: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        folder = snapshots_of(tmp_path / "snapshots")
        (tmp_path / present).write_text("mine")
        command = ["panorama", str(folder), "-o", str(tmp_path / "p.png")]
        refused(command, tmp_path, capfd, present, "--overwrite")
        assert run([*command, "--overwrite"]) == 0
        assert read_image(tmp_path / "p.png").shape == (72, 864, 3)
        assert len(rows_of(tmp_path / "p.csv")) == 12


def refused(arguments: Sequence[str], folder: Path, capfd: pytest.CaptureFixture[str], *says: str) -> None:
    """Exit code 2, one line that says all this (regular expressions), and not a byte in the folder changed."""
    before = content(folder)
    capfd.readouterr()
    code = run(list(arguments))
    out, err = capfd.readouterr()
    assert "Traceback" not in err
    assert (code, out) == (2, "")
    assert err.startswith("topoloc: ") and err.endswith("\n") and err.count("\n") == 1
    assert ";" in err or re.search(r"See 'topoloc[a-z ]* --help'", err), "a remedy"
    for words in says:
        assert re.search(words, err), err
    assert content(folder) == before


def picture(name: str, rows: int, columns: int) -> Spoil:
    noise = np.random.default_rng(0).integers(0, 256, (rows, columns, 3)).astype(np.uint8)
    return lambda place: write_image(place / name, noise)


def truncate(name: str) -> Spoil:
    return lambda place: (place / name).write_bytes((place / name).read_bytes()[:-200])


def line_of(name: str, line: int, change: Callable[[list[str]], list[str]]) -> Spoil:
    """Change the words of one line (1-based) of a TUM file."""

    def spoil(place: Path) -> None:
        lines = (place / name).read_text().splitlines()
        lines[line - 1] = " ".join(change(lines[line - 1].split()))
        (place / name).write_text("\n".join(lines) + "\n")

    return spoil


def all_pictures_unreadable(place: Path) -> None:
    for path in (place / "recording" / "rgb").iterdir():
        path.write_text("hello")


MAP_TOML, NODES, EDGES = "map/map.toml", "map/nodes.csv", "map/edges.csv"
RGB, ODOMETRY, CAMERA_TOML, N1 = (
    "recording/rgb.txt",
    "recording/odometry.txt",
    "recording/camera.toml",
    "map/panoramas/N1.png",
)

BAD_INPUT: dict[str, tuple[Spoil, str]] = {
    "map folder missing": (remove("map"), r"map: no such folder"),
    "recording folder missing": (remove("recording"), r"recording: no such folder"),
    "map.toml missing": (remove(MAP_TOML), r"map\.toml: no such file"),
    "nodes.csv missing": (remove(NODES), r"nodes\.csv: no such file"),
    "nodes.csv empty": (write(NODES, ""), r"nodes\.csv, line 1"),
    "an empty map": (write(NODES, "id,name,x,y,heading,panorama\n"), r"nodes\.csv: the map has no nodes"),
    "repeated id": (rewrite(NODES, "N2,", "N1,"), r"nodes\.csv, line 4.*'N1'"),
    "NaN in x": (rewrite(NODES, "place 1,1,", "place 1,nan,"), r"nodes\.csv, line 3.*'nan'"),
    "inf in y": (rewrite(NODES, "place 1,1,0.5", "place 1,1,inf"), r"nodes\.csv, line 3.*'inf'"),
    "letters in a heading": (rewrite(NODES, "57.2957795", "north"), r"nodes\.csv, line 2.*'north'"),
    "a value too many": (rewrite(NODES, "place 1,1,", "place 1,1,1,"), r"nodes\.csv, line 3: 7 values under 6"),
    "a column lacking": (rewrite(NODES, "heading,", ""), r"nodes\.csv, line 1: .*heading"),
    "binary nodes.csv": (write(NODES, np.random.default_rng(0).bytes(3000)), r"nodes\.csv"),
    "NULs in nodes.csv": (rewrite(NODES, "panoramas/N1", "pano\0ramas/N1"), r"nodes\.csv, line 3"),
    "a panorama that is a text": (write(N1, "hello"), r"nodes\.csv, line 3: .*N1\.png"),
    "a panorama without bytes": (write(N1, ""), r"nodes\.csv, line 3: .*N1\.png"),
    "a truncated panorama": (truncate(N1), r"nodes\.csv, line 3: .*N1\.png"),
    "a panorama missing": (remove(N1), r"nodes\.csv, line 3: .*N1\.png"),
    "a panorama of another width": (picture(N1, 72, 800), r"nodes\.csv, line 3: .*800.*864"),
    "no panorama where ima needs one": (rewrite(NODES, "panoramas/N1.png", ""), r"map.*ima needs a panorama.*N1"),
    "an edge to nowhere": (write(EDGES, "a,b\nN0,N7\n"), r"edges\.csv, line 2.*'N7'"),
    "TOML syntax": (rewrite(MAP_TOML, "width = ", "width "), r"map\.toml.*line \d"),
    "unknown TOML key": (rewrite(MAP_TOML, "width", "with"), r"map\.toml.*'with'.*width"),
    "hfov 0": (rewrite(MAP_TOML, "hfov_deg = 40.0", "hfov_deg = 0"), r"map\.toml.*hfov_deg"),
    "hfov negative": (rewrite(MAP_TOML, "hfov_deg = 40.0", "hfov_deg = -40"), r"map\.toml.*hfov_deg"),
    "hfov a text": (rewrite(MAP_TOML, "hfov_deg = 40.0", 'hfov_deg = "40 deg"'), r"map\.toml.*hfov_deg"),
    "camera is a number": (write(MAP_TOML, "camera = 5\n"), r"map\.toml.*camera"),
    "rgb.txt missing": (remove(RGB), r"recording: holds neither rgb\.txt"),
    "rgb.txt empty": (write(RGB, ""), r"rgb\.txt: lists no pictures"),
    "binary rgb.txt": (write(RGB, np.random.default_rng(0).bytes(3000)), r"rgb\.txt"),
    "pictures back in time": (line_of(RGB, 4, lambda words: ["3.0", words[1]]), r"rgb\.txt, line 4: .*3\.0.*11\.0"),
    "letters in odometry": (line_of(ODOMETRY, 3, lambda w: [w[0], "two", *w[2:]]), r"odometry\.txt, line 3: 'two'"),
    "NaN in odometry": (line_of(ODOMETRY, 3, lambda w: [w[0], "nan", *w[2:]]), r"odometry\.txt, line 3: 'nan'"),
    "a zero quaternion": (line_of(ODOMETRY, 5, lambda w: [*w[:4], *"0000"]), r"odometry\.txt, line 5: .*quaternion"),
    "odometry back in time": (line_of(ODOMETRY, 5, lambda w: ["1", *w[1:]]), r"odometry\.txt, line 5: .*time"),
    "too few values": (line_of(ODOMETRY, 5, lambda w: w[:-1]), r"odometry\.txt, line 5: 7 values"),
    "pictures of another aspect ratio": (
        picture("recording/rgb/000002.png", 72, 128),
        r"rgb\.txt, line 4: .*128x72.*96x72",
    ),
    "another field of view": (rewrite(CAMERA_TOML, "hfov_deg = 40.0", "hfov_deg = 60"), r"camera\.toml: .*60.*40"),
    "all pictures unreadable": (all_pictures_unreadable, r"rgb\.txt: none of its pictures.*000000\.png"),
    "all pictures missing": (remove("recording/rgb"), r"rgb\.txt: none of its pictures.*000000\.png"),
}


@pytest.mark.parametrize("case", BAD_INPUT)
def test_bad_input(case: str, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    spoil, says = BAD_INPUT[case]
    spoil(place)
    refused(localize(place), place, capfd, says)


@pytest.mark.parametrize("case", ["map.toml missing", "repeated id", "a panorama that is a text", "hfov 0"])
def test_check_refuses_a_map_that_cannot_be_read(case: str, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    spoil, says = BAD_INPUT[case]
    spoil(place)
    refused(["check", str(place / "map")], place, capfd, says)


@pytest.mark.parametrize("case", ["letters in odometry", "rgb.txt empty"])
def test_check_refuses_a_recording_that_cannot_be_read(
    case: str, place: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    spoil, says = BAD_INPUT[case]
    spoil(place)
    refused(["check", str(place / "recording")], place, capfd, says)


LOCALIZE = ["localize", "{0}/map", "{0}/recording"]
PANORAMA = ["panorama", "{0}/recording/rgb", "--method", "thesis"]

BAD_COMMANDS: dict[str, tuple[list[str], str]] = {
    "unknown command": (["locate"], r"locate.*localize"),
    "unknown sensor": ([*LOCALIZE, "-o", "{0}/run", "--sensor", "imma"], r"no sensor is called 'imma'.*histogram, ima"),
    "unknown estimator": ([*LOCALIZE, "-o", "{0}/run", "--estimator", "kalm"], r"estimator.*'kalm'.*activity"),
    "unknown option": ([*LOCALIZE, "-o", "{0}/run", "--sensr", "ima"], r"--sensr"),
    "output not named": (LOCALIZE, r"--output"),
    "recording not named": (["localize", "{0}/map", "-o", "{0}/run"], r"(?i)recording"),
    "an argument too many": ([*LOCALIZE, "more", "-o", "{0}/run"], r"more"),
    "seed in letters": ([*LOCALIZE, "-o", "{0}/run", "--seed", "x"], r"(?i)seed"),
    "seed negative": ([*LOCALIZE, "-o", "{0}/run", "--seed", "-1"], r"(?i)seed"),
    "output exists": ([*LOCALIZE, "-o", "{0}/map"], r"map: already exists.*--overwrite"),
    "output seen before any work": (["localize", "{0}/no", "{0}/no", "-o", "{0}/map"], r"map: already exists"),
    "output is a file": ([*LOCALIZE, "-o", "{0}/map/map.toml"], r"map\.toml: already exists.*--overwrite"),
    "output is a file, overwriting": ([*LOCALIZE, "-o", "{0}/map/map.toml", "--overwrite"], r"map\.toml: "),
    "output below a file": ([*LOCALIZE, "-o", "{0}/map/map.toml/run"], r"map\.toml/run: cannot be written"),
    "a map for a recording": (["localize", "{0}/map", "{0}/map", "-o", "{0}/run"], r"map: holds neither rgb\.txt"),
    "a recording for a map": (["localize", "{0}/recording", "{0}/map", "-o", "{0}/run"], r"recording/map\.toml"),
    "check nothing": (["check"], r"(?i)path"),
    "check nowhere": (["check", "{0}/nowhere"], r"nowhere: no such folder"),
    "check a file": (["check", "{0}/map/map.toml"], r"map\.toml"),
    "check neither": (["check", "{0}"], r"neither a map nor a recording"),
    "list something else": (["list", "cameras"], r"cameras.*sensors"),
    "list an unknown sensor": (["list", "sensors", "imma"], r"no sensor is called 'imma'.*histogram, ima"),
    "unknown world": (["simulate", "moon", "-o", "{0}/run"], r"no world is called 'moon'.*lab"),
    "unknown setting": (["simulate", "lab", "-o", "{0}/run", "--set", "lap=1"], r"'lap'.*laps"),
    "unknown nested setting": (["simulate", "lab", "-o", "{0}/run", "--set", "drift.x=1"], r"'x'"),
    "no setting": (["simulate", "lab", "-o", "{0}/run", "--set", "laps"], r"'laps'.*key=value"),
    "setting of letters": (["simulate", "lab", "-o", "{0}/run", "--set", "laps=two"], r"laps is 'two'"),
    "setting out of range": (["simulate", "lab", "-o", "{0}/run", "--set", "age=7"], r"age is 7"),
    "simulate with a negative seed": (["simulate", "lab", "-o", "{0}/run", "--seed", "-1"], r"(?i)seed"),
    "simulate over something": (["simulate", "lab", "-o", "{0}/map"], r"map: already exists.*--overwrite"),
    "simulate nowhere": (["simulate", "lab"], r"--output"),
    "snapshots missing": (["panorama", "{0}/nowhere", "-o", "{0}/p.png"], r"nowhere: no such folder"),
    "snapshots a file": (["panorama", "{0}/map/map.toml", "-o", "{0}/p.png"], r"map\.toml: "),
    "no snapshots": (["panorama", "{0}/recording", "-o", "{0}/p.png"], r"recording: holds 0 pictures"),
    "unknown method": (["panorama", "{0}/recording/rgb", "-o", "{0}/p.png", "--method", "magic"], r"'magic'.*thesis"),
    "no field of view": ([*PANORAMA, "-o", "{0}/p.png", "--hfov-deg", "0"], r"hfov_deg"),
    "field of view in letters": ([*PANORAMA, "-o", "{0}/p.png", "--hfov-deg", "wide"], r"(?i)hfov.deg"),
    "field of view NaN": ([*PANORAMA, "-o", "{0}/p.png", "--hfov-deg", "nan"], r"hfov_deg"),
    "no slots": ([*PANORAMA, "-o", "{0}/p.png", "--slots", "0"], r"slots is 0"),
    "no format": ([*PANORAMA, "-o", "{0}/p"], r"/p: .*\.png"),
    "a format that is none": ([*PANORAMA, "-o", "{0}/p.csv"], r"p\.csv: .*\.png"),
    "panorama below a file": ([*PANORAMA, "-o", "{0}/map/map.toml/p.png"], r"p\.png: cannot be written"),
    "panorama not named": (PANORAMA, r"--output"),
}


@pytest.mark.parametrize("case", BAD_COMMANDS)
def test_bad_commands(case: str, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
    arguments, says = BAD_COMMANDS[case]
    refused([word.format(place) for word in arguments], place, capfd, says)


BAD_SNAPSHOTS: dict[str, tuple[Spoil, str]] = {
    "only one": (
        lambda folder: all(remove(f"{i:02d}.png")(folder) is None for i in range(1, 12)),
        r"snapshots: holds 1 picture",
    ),
    "one is a text": (write("03.png", "hello"), r"03\.png: does not decode"),
    "one is truncated": (truncate("03.png"), r"03\.png: does not decode"),
    "one has no bytes": (write("03.png", ""), r"03\.png: does not decode"),
    "one of another size": (picture("03.png", 36, 48), r"/snapshots.*sizes.*48x36"),
}


@pytest.mark.parametrize("case", BAD_SNAPSHOTS)
def test_bad_snapshots(case: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    spoil, says = BAD_SNAPSHOTS[case]
    folder = snapshots_of(tmp_path / "snapshots")
    spoil(folder)
    refused(["panorama", str(folder), "-o", str(tmp_path / "p.png")], tmp_path, capfd, says)


class TestCheck:
    def test_nothing_found(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["check", str(place / "map")]) == 0
        out = capsys.readouterr().out
        assert "map 'tiny': 3 nodes, 2 edges, 3 panoramas, 0 views" in out and "nothing found" in out
        assert run(["check", str(place / "recording")]) == 0
        assert "recording: 7 frames in 6.0 s, with odometry, truth" in capsys.readouterr().out

    @pytest.mark.parametrize(
        ("spoil", "path", "says"),
        [
            (lambda place: write_image(place / N1, np.full((72, 864, 3), 5, np.uint8)), "map", "node N1 is very dark"),
            (lambda place: write_image(place / N1, noise_circle(1) * (np.arange(864) < 648)[:, None].astype(np.uint8)),
             "map", "90 degrees of the panorama of node N1 are black"),
            (rewrite(NODES, "panoramas/N1.png", ""), "map", "without a panorama: N1"),
            (rewrite(NODES, "place 1,1,", "place 1,0.01,"), "map", "nodes N0 and N1 are less than 5 cm apart"),
            (write("recording/rgb/000003.png", "hello"), "recording", r"rgb\.txt, line 5: 000003\.png does not decode"),
            (picture("recording/rgb/000003.png", 36, 48), "recording", r"rgb\.txt: .*sizes.*48x36 \(line 5\)"),
            (remove(ODOMETRY), "recording", r"there is no odometry\.txt"),
            (line_of(ODOMETRY, 4, lambda w: [w[0], "900", *w[2:]]), "recording", r"odometry\.txt: .*odometer moves"),
            (line_of(RGB, 8, lambda w: ["100.0", w[1]]), "recording", r"rgb\.txt: line 8 comes 85\.0 s after"),
        ],
        ids=["dark", "black", "no panorama", "close", "unreadable", "sizes", "no odometry", "jump", "gap"],
    )  # fmt: skip
    def test_findings_come_with_a_place_and_a_remedy(
        self, spoil: Spoil, path: str, says: str, place: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        spoil(place)
        assert run(["check", str(place / path)]) == 1
        findings = [line for line in capsys.readouterr().out.splitlines() if line.startswith("- ")]
        assert any(re.search(says, line) and "; " in line for line in findings), findings


class TestList:
    @pytest.mark.parametrize("kind", ["sensors", "estimators", "worlds", "panoramas", "commands"])
    def test_one_kind(self, kind: str, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["list", kind]) == 0
        out = capsys.readouterr().out
        assert out.lstrip().startswith(kind)
        assert all(re.search(rf"\b{name}\b", out) for name in plugins.names(f"topoloc.{kind}"))

    def test_all(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["list"]) == 0
        out = capsys.readouterr().out
        for title in ("sensors", "estimators", "worlds", "panoramas", "commands"):
            assert re.search(rf"^\s*{title}\s*$", out, re.MULTILINE)
        assert re.search(r"^ slots +│ 8 +│ column regions N_s", out, re.MULTILINE) and "best-match" in out
        assert max(map(len, out.splitlines())) <= 80 and "\x1b" not in out

    def test_one_thing(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["list", "estimators", "grid"]) == 0
        out = capsys.readouterr().out
        assert re.search(r"^grid: The belief", out, re.MULTILINE) and "particle" not in out
        assert re.search(r"^ resolution_m +│ 0\.25 +│ side of a cell \[m\]\.", out, re.MULTILINE)
        assert run(["list", "commands", "check"]) == 0
        assert "localize" not in capsys.readouterr().out

    def test_what_all_of_a_kind_share_is_told_once(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(plugins, "names", lambda group: ["one", "two", "three"])
        monkeypatch.setattr(plugins, "load", lambda group, name: object)
        common = [Setting(f"common{i}", "1", f"text {i} [m].") for i in range(7)]
        mine = Setting("mine", "true", "of its own.")
        kinds = iter([[*common], [Setting("common0", "2", "text 0 [m]."), *common[1:]], [*common, mine]])
        monkeypatch.setattr(plugins, "settings_of", lambda thing: next(kinds))
        assert run(["list", "worlds"]) == 0
        out = capsys.readouterr().out
        one, two, three, shared = re.split(r"^(?:two:|three:|settings of every world)", out, flags=re.MULTILINE)
        assert "no settings of its own" in one and "common" not in one
        assert re.findall(r"^ (\w+) +│ (\S+)", two, re.MULTILINE) == [("common0", "2")]
        assert re.findall(r"^ (\w+) +│", three, re.MULTILINE) == ["mine"]
        assert re.findall(r"^ (\w+) +│ 1 ", shared, re.MULTILINE) == [setting.name for setting in common]

    def test_a_few_settings_in_common_stay_where_they_are(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        monkeypatch.setattr(plugins, "names", lambda group: ["one", "two"])
        monkeypatch.setattr(plugins, "load", lambda group, name: object)
        monkeypatch.setattr(plugins, "settings_of", lambda thing: [Setting("a", "1", "it."), Setting("b", "2", "it.")])
        assert run(["list", "worlds"]) == 0
        out = capsys.readouterr().out
        assert "every world" not in out and len(re.findall(r"^ a +│ 1 ", out, re.MULTILINE)) == 2


class TestInAProcessOfItsOwn:
    def test_version(self) -> None:
        done = topoloc("--version")
        assert (done.returncode, done.stdout.strip(), done.stderr) == (0, __version__, "")

    def test_a_mistake(self, tmp_path: Path) -> None:
        done = topoloc("localize", str(tmp_path / "map"), "rec", "-o", str(tmp_path / "run"))
        assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
        assert done.stderr.startswith(f"topoloc: {tmp_path / 'map'}: no such folder; ")
        assert list(tmp_path.iterdir()) == []

    def test_a_truncated_panorama(self, place: Path) -> None:
        """Whatever an image library writes to the error stream by itself must not be seen."""
        truncate(N1)(place)
        done = topoloc("check", str(place / "map"))
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert "N1.png" in done.stderr

    @pytest.mark.parametrize("arguments", [["--help"], ["localize", "--help"], ["list", "--help"]])
    def test_help_is_quick_because_it_loads_little(self, arguments: list[str]) -> None:
        code = (
            "import sys\nfrom topoloc.cli.main import run\n"
            f"code = run({arguments!r})\n"
            "print(code, *sorted({name.partition('.')[0] for name in sys.modules}), file=sys.stderr)"
        )
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
        code_and_modules = done.stderr.split()
        assert code_and_modules[0] == "0" and "Usage: topoloc" in done.stdout
        assert not {"cv2", "sklearn", "matplotlib", "joblib", "sensors", "estimators"} & set(code_and_modules)

    def test_without_arguments_it_shows_the_commands(self) -> None:
        done = topoloc()
        assert done.returncode == 0 and "localize" in done.stdout and done.stderr == ""


def test_a_defect_of_ours_is_not_blamed_on_the_user(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken(group: str, name: str) -> object:
        raise ZeroDivisionError("ours")

    monkeypatch.setattr("topoloc.cli.group.load", broken)
    assert run(["check", "x"]) == 70
    err = capsys.readouterr().err
    assert "ZeroDivisionError: ours" in err and "defect of topoloc" in err


def test_from_nothing_to_a_located_robot(tmp_path: Path) -> None:
    """simulate lab -> check -> localize, as the README says it."""
    made = topoloc("simulate", "lab", "-o", str(tmp_path / "lab"), "--seed", "1", "--set", "updates=3")
    assert (made.returncode, made.stderr) == (0, "")
    assert "8 nodes" in made.stdout and "3 frames" in made.stdout and "next: topoloc localize" in made.stdout
    assert {p.name for p in (tmp_path / "lab").iterdir()} == {"map", "recording"}
    for part in ("map", "recording"):
        assert run(["check", str(tmp_path / "lab" / part)]) == 0
    assert run(["localize", *(str(tmp_path / "lab" / part) for part in ("map", "recording")), "-o",
                str(tmp_path / "run"), "--estimator", "best-match"]) == 0  # fmt: skip
    rows = rows_of(tmp_path / "run" / "steps.csv")
    ids = [node.id for node in TopoMap.load(tmp_path / "lab" / "map").nodes]
    assert len(rows) == 3 and len(ids) == 8 and {row["node"] for row in rows} <= {*ids, ""}
    assert json.loads((tmp_path / "run" / "metrics.json").read_text())["steps"] >= 1
    assert read_image(tmp_path / "run" / "plan.png").ndim == 3


WORLDS = {
    "lab": ["turned_at=1", "stereo_baseline_m=0.12", "depth=true"],
    "lab_corridor": ["age=0.5", "people=0.5", "doors=0.9", "covered=none"],
    "office": ["bulbs=0.6"],
    "image_grid": ["grid=6x8", "daylight=0.5"],
    "twins": ["age=0.5", "route.random=true"],
    "building": ["rooms=4", "people=0.5"],
}


SLOW_WORLDS = ("building", "image_grid", "lab_corridor", "twins")
"""Worlds of many panoramas; all of them are looked over by ``check``."""
ALIKE_WORLDS = ("building", "twins")
"""Worlds with rooms that are furnished alike, on purpose."""


@pytest.mark.parametrize(
    "world", [pytest.param(name, marks=pytest.mark.slow) if name in SLOW_WORLDS else name for name in WORLDS]
)
def test_every_world_is_written_and_read_back(world: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Map and recording are what the world makes; ``check`` finds nothing wrong, but rooms made alike.

    The laboratory is looked over by ``test_from_nothing_to_a_located_robot``.
    """
    settings = ["updates=3", *WORLDS[world]]
    options = [word for setting in settings for word in ("--set", setting)]
    assert run(["simulate", world, "-o", str(tmp_path / "out"), "--seed", "2", *options]) == 0
    made = plugins.make(plugins.WORLDS, world, parse_words(settings)).simulate(2)
    out = capsys.readouterr().out
    assert f"{len(made.topo_map.nodes)} nodes" in out and "simulated" in out
    if made.topo_map.views:
        assert f"{len(made.topo_map.views)} views" in out
    for part in ("map", "recording") if world in SLOW_WORLDS else ():
        run(["check", str(tmp_path / "out" / part)])
        found = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("- warning", "- serious"))]
        assert all(world in ALIKE_WORLDS and "look alike" in line for line in found)
    read, recording = TopoMap.load(tmp_path / "out" / "map"), Recording.load(tmp_path / "out" / "recording")
    assert [node.id for node in read.nodes] == [node.id for node in made.topo_map.nodes]
    assert len(read.views) == len(made.topo_map.views)
    for frame, expected, pose in zip(recording.on(read.camera), made.frames, made.truth, strict=True):
        assert set(frame.images) == set(expected.images)
        assert all((frame.images[kind] == image).all() for kind, image in expected.images.items())
        assert frame.camera == pytest.approx(expected.camera, abs=1e-6)
        assert recording.truth is not None
        assert recording.truth.at(frame.timestamp) == pytest.approx(pose, abs=1e-5)


@pytest.mark.parametrize(
    ("world", "setting", "named"),
    [
        ("lab", "updates=3 kidnap_at=7", "kidnap_at is 7"),
        ("lab", "bulbs=0.8 daylight=0.8", "bulbs 0.8 and daylight 0.8"),
        ("lab", "scan.step_sd_deg=300", "step_sd_deg is 300"),
        ("lab", "route.step_m=-1", "step_m is -1"),
        ("lab", "effects.jpeg_quality=200", "jpeg_quality is 200"),
        ("lab", "drift.slip_share=2", "slip_share is 2"),
        ("image_grid", "grid=7x7", "'7x7'.*35x10"),
        ("image_grid", "depth=true", "depth is True"),
        ("building", "rooms=3", "rooms is 3"),
        ("lab_corridor", "doors=0.5", "doors is 0.5.*0.9 to 1"),
        ("lab", "drift.curvature_sd_deg=-1", "curvature_sd_deg is -1"),
        ("office", "scan.short_deg=10", "scan is set"),
        ("office", "pan_deg=400", "pan_deg is 400"),
    ],
)
def test_a_world_that_cannot_be_is_one_line(
    world: str, setting: str, named: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = [word for one in setting.split() for word in ("--set", one)]
    assert run(["simulate", world, "-o", str(tmp_path / "out"), *options]) == 2
    err = capsys.readouterr().err
    assert err.count("\n") == 1 and re.search(named, err)
    assert not (tmp_path / "out").exists()


OMNI = """hfov_deg = 40
width = 96
height = 72
[omni]
model = "equirectangular"
left_deg = 0
upper_deg = 15
lower_deg = -15
"""


def omni_pictures(folder: Path) -> list[Path]:
    """Two equirectangular pictures, all noise, about as high and wide as ``CAMERA``'s panoramas."""
    (folder / "camera.toml").write_text(OMNI)
    paths = [folder / "a.jpg.png", folder / "b.png"]
    for seed, path in enumerate(paths):
        write_image(path, noise_circle(seed))
    return paths


class TestUnwrap:
    def test_a_folder_of_panoramas(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        """Turned by the ten degrees that are asked for: 24 columns, three blocks of the noise."""
        paths, out = omni_pictures(tmp_path), tmp_path / "deep" / "panoramas"
        options = ["--camera", str(tmp_path / "camera.toml"), "-o", str(out), "--heading-deg", "10"]
        assert run(["unwrap", *map(str, paths), *options]) == 0
        assert capsys.readouterr().out == (
            f"{out}: 2 x 864x72, left edge 10 degrees from the camera's heading\n"
            "2.8% of a panorama are black: the picture does not show them\n"
        )
        assert sorted(path.name for path in out.iterdir()) == ["a.jpg.png", "b.png"]
        for seed, path in enumerate(paths):
            circle = read_image(out / path.name)
            there = np.roll(noise_circle(seed), 24, axis=1)
            assert circle.shape == (72, 864, 3) and np.abs(circle[36] - there[36].astype(float)).mean() < 5.0

    def test_one_picture_to_a_file(self, tmp_path: Path) -> None:
        first, _ = omni_pictures(tmp_path)
        command = ["unwrap", str(first), "--camera", str(tmp_path / "camera.toml"), "-o", str(tmp_path / "p.png")]
        assert run(command) == 0
        made = read_image(tmp_path / "p.png")
        assert made.shape == (72, 864, 3)
        assert run(command) == 2 and run([*command, "--overwrite"]) == 0

    @pytest.mark.parametrize(
        ("spoil", "says"),
        [
            (remove("camera.toml"), r"camera\.toml: no such file; .*formats\.md"),
            (write("camera.toml", "hfov_deg = 40\n"), r"camera\.toml: has no table \[omni\]; "),
            (write("camera.toml", "[omni]\nmodel = 'equirectangular'\n"), r"camera\.toml: tells no field of view; "),
            (rewrite("camera.toml", "left_deg", "left"), r"camera\.toml \[omni\]: nothing is called 'left' here; "),
            (rewrite("camera.toml", "equirectangular", "flat"), r"camera\.toml \[omni\]: model is 'flat'; choose"),
            (rewrite("camera.toml", "upper_deg = 15", "upper_deg = -14.99"), r"camera\.toml: .* shows no part.*; look"),
            (write("b.png", "hello"), r"b\.png: does not decode"),
            (lambda folder: write_image(folder / "b.png", noise_circle(0)[:50]), r"b\.png: .*864x50, not 864x72; "),
        ],
        ids=["no file", "no table", "no lens", "unknown key", "unknown model", "nothing seen", "text", "size"],
    )  # fmt: skip
    def test_mistakes(self, spoil: Spoil, says: str, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        paths = omni_pictures(tmp_path)
        spoil(tmp_path)
        options = ["--camera", str(tmp_path / "camera.toml"), "-o", str(tmp_path / "out")]
        refused(["unwrap", *map(str, paths), *options], tmp_path, capfd, says)

    def test_pictures_that_share_a_name_or_none(self, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
        first, _ = omni_pictures(tmp_path)
        options = ["--camera", str(tmp_path / "camera.toml"), "-o", str(tmp_path / "out")]
        refused(["unwrap", str(first), str(first), *options], tmp_path, capfd, "two pictures have the same name; ")
        refused(["unwrap", *options], tmp_path, capfd, r"(?i)pictures")


def text_map(place: Path, reference_deg: float = 0.0) -> tuple[Path, ThesisMapSettings]:
    """The tiny map as a text map, its panoramas rolled so that their first snapshot looks there."""
    the_map = TopoMap.load(place / "map")
    columns, turn = 864, the_map.nodes[0].heading - np.deg2rad(reference_deg + 20.0)
    roll = -round(turn / (2.0 * np.pi) * columns)
    nodes = tuple(
        replace(node, name=node.id, heading=node.heading + roll * 2.0 * np.pi / columns, panorama=rolled(node, roll))
        for node in the_map.nodes
    )
    return place / "tiny.txt", save_thesis_map(replace(the_map, nodes=nodes), place / "tiny.txt")


def rolled(node: Node, columns: int) -> Image:
    assert node.panorama is not None
    return np.roll(node.panorama, columns, axis=1)


class TestImportMap:
    def test_a_text_map_becomes_a_folder(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        file, known = text_map(place, 90.0)
        options = ["--reference-deg", str(known.reference_deg), "--hfov-deg", "40"]
        assert run(["import", "map", str(file), "-o", str(place / "folder"), *options]) == 0
        out = capsys.readouterr().out
        assert f"{place / 'folder'}: 3 nodes with panoramas, 2 edges" in out and "camera 96x72, 40 degrees" in out
        made, expected = TopoMap.load(place / "folder"), load_thesis_map(file, known)
        assert [node.heading for node in made.nodes] == pytest.approx([known.first_column] * 3)
        for node, one in zip(expected.nodes, made.nodes, strict=True):
            assert node == replace(one, heading=node.heading)
        assert run(["check", str(place / "folder")]) == 0

    def test_localize_takes_either(self, place: Path) -> None:
        """The text map read as it is, and the folder made of it: the same steps, at the nodes of the drive."""
        file, _ = text_map(place)
        assert run(["import", "map", str(file), "-o", str(place / "folder")]) == 0
        for number, topo_map in enumerate((file, place / "folder")):
            assert run(["localize", str(topo_map), str(place / "recording"), "-o", str(place / f"run{number}")]) == 0
        first, second = (rows_of(place / f"run{number}" / "steps.csv") for number in (0, 1))
        assert first == second and [row["node"] for row in first] == [f"N{node}" for node, _, _ in DRIVE]

    def test_filtered_panoramas_say_so(self, place: Path) -> None:
        file, _ = text_map(place)
        assert run(["import", "map", str(file), "-o", str(place / "folder"), "--filtered"]) == 0
        assert TopoMap.load(place / "folder").filtered

    @pytest.mark.parametrize(
        ("arguments", "says"),
        [
            (["{0}/nowhere.txt", "-o", "{0}/new"], r"nowhere\.txt: no such file; "),
            (["{0}/tiny.txt", "-o", "{0}/map"], r"map: already exists.*--overwrite"),
            (["{0}/tiny.txt"], r"--output"),
            (["{0}/tiny.txt", "-o", "{0}/new", "--hfov-deg", "0"], r"hfov_deg is 0\.0; it must lie"),
            (["{0}/tiny.txt", "-o", "{0}/new", "--reference-deg", "nan"], r"reference_deg"),
            (["{0}/map/nodes.csv", "-o", "{0}/new"], r"nodes\.csv, line 2: "),
        ],
        ids=["no file", "output exists", "no output", "field of view", "reference", "not a text map"],
    )  # fmt: skip
    def test_mistakes(self, arguments: list[str], says: str, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
        text_map(place)
        refused(["import", "map", *(word.format(place) for word in arguments)], place, capfd, says)

    def test_a_mistake_in_the_file_is_one_line(self, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
        text_map(place)
        rewrite("tiny.txt", "N1 1000", "N1 metre")(place)
        for command in (["import", "map"], ["localize"]):
            arguments = [*command, str(place / "tiny.txt"), "-o", str(place / "new")]
            arguments += [str(place / "recording")] * (command == ["localize"])
            refused(arguments, place, capfd, r"tiny\.txt, line 3: x is 'metre', not a finite number; ")

    def test_the_group_lists_what_can_be_imported(self, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["import", "--help"]) == 0
        assert re.search(r"^│ map +Make a map folder", capsys.readouterr().out, re.MULTILINE)


@pytest.fixture
def moved(place: Path) -> Path:
    """The tiny map, and a recording of five looks at its first node, in which two slots look otherwise by now."""
    the_map = TopoMap.load(place / "map")
    panorama = the_map.nodes[0].panorama
    assert panorama is not None
    world = panorama.copy()
    world[:, 96:120] = noise_circle(9)[:, 96:120]
    shutil.rmtree(place / "recording")
    writer = RecordingWriter(place / "recording", CAMERA)
    views = cut_views(world, the_map.nodes[0].heading, CAMERA)
    for time, view in enumerate((2, 1, 2, 1, 2)):
        image, heading = views[view]
        pose = np.array([0.0, 0.5, heading])
        writer.add(Frame(float(time), pose, np.zeros(3), {"rgb": image}), pose)
    writer.close()
    return place


class TestUpkeep:
    OPTIONS = ("--set", "upkeep.visit_updates=1", "--set", "upkeep.probability=0.3", "--set", "upkeep.match=0.4")

    def test_writes_the_map_refreshed_and_the_panoramas_before(
        self, moved: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        before, new = content(moved / "map"), moved / "deep" / "new"
        assert run(localize(moved, "--upkeep", str(new), *self.OPTIONS)) == 0
        assert f"{new}: the map; panoramas refreshed: N0\n" in capsys.readouterr().out
        assert content(moved / "map") == before
        assert [path.name for path in (new / "before").iterdir()] == ["N0.png"]
        was, now, kept = (
            read_image(path / "N0.png") for path in (moved / "map" / "panoramas", new / "panoramas", new / "before")
        )
        assert np.array_equal(kept, was) and not np.array_equal(now, was)
        written, given = TopoMap.load(new), TopoMap.load(moved / "map")
        assert written.nodes == given.nodes
        for one, other in zip(written.nodes[1:], given.nodes[1:], strict=True):
            assert one.panorama is not None and other.panorama is not None
            assert np.array_equal(one.panorama, other.panorama)

    def test_without_a_change_it_is_the_map(self, place: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(localize(place, "--upkeep", str(place / "new"))) == 0
        assert "panoramas refreshed: none" in capsys.readouterr().out
        assert not (place / "new" / "before").exists()

    @pytest.mark.parametrize(
        ("options", "says"),
        [
            (("--upkeep", "map"), r"map: exists already; name another folder"),
            (("--upkeep", "run"), r"run: is named by both --upkeep and --output; "),
            (("--upkeep", "new", "--sensor", "histogram"), r"cannot serve ColorHistogram; take the sensor ima"),
            (("--upkeep", "new", "--set", "upkeep.match=2"), r"settings of upkeep: match is 2.0; "),
            (("--upkeep", "new", "--set", "upkeep.eagerness=2"), r"settings of upkeep: .*'eagerness'"),
            (("--set", "upkeep.match=0.6"), r"--set: .*'upkeep'"),
        ],
    )
    def test_mistakes(self, options: Sequence[str], says: str, place: Path, capfd: pytest.CaptureFixture[str]) -> None:
        words = [str(place / word) if word in ("map", "run", "new") else word for word in options]
        refused(localize(place, *words), place, capfd, says)
