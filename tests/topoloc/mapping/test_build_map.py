"""``topoloc map build``: from a small made recording to a map that localizes, and each mistake in one line."""

from __future__ import annotations

import csv
import json
import shlex
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from topoloc.cli.main import run
from topoloc.errors import UserError
from topoloc.files import read_image, write_image
from topoloc.geometry import Floats, compose, wrap
from topoloc.mapping.building import BuildConfig, build_map
from topoloc.recording import Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Frame, Image

CAMERA = Camera(60.0, 64, 48)
PLACES = ((0.0, 0.0), (2.0, 0.0), (4.0, 0.0))
MOUNT = np.array([0.0, 0.0, np.deg2rad(20.0)])
START = np.array([3.0, -7.0, 1.2])
"""Where the odometer begins to count."""
COLUMNS = CAMERA.panorama_columns()


def surroundings() -> list[Image]:
    """A full circle for each place; the left edge looks at 180 degrees."""
    rng = np.random.default_rng(0)
    noise = [gaussian_filter(rng.normal(size=(48, COLUMNS, 3)), (1.5, 3.0, 0.5), mode="wrap") for _ in PLACES]
    return [np.asarray((128.0 + 50.0 * one / one.std()).clip(0, 255).astype(np.uint8)) for one in noise]


CIRCLES = surroundings()


def circle_at(pose: Floats) -> Image:
    return CIRCLES[int(np.argmin([np.hypot(x - pose[0], y - pose[1]) for x, y in PLACES]))]


def view(pose: Floats) -> Image:
    """What the camera sees from a pose, of things on a far cylinder."""
    focal = CAMERA.width / 2.0 / np.tan(np.deg2rad(CAMERA.hfov_deg) / 2.0)
    right = np.arctan((np.arange(CAMERA.width) + 0.5 - CAMERA.width / 2.0) / focal)
    column = np.mod(np.pi - pose[2] + right, 2.0 * np.pi) / (2.0 * np.pi) * COLUMNS
    return circle_at(pose)[:, column.astype(int) % COLUMNS]


def circle_from(heading: float, pose: Floats) -> Image:
    """The full circle whose left edge looks along a heading."""
    return np.roll(circle_at(pose), -round((np.pi - heading) / (2.0 * np.pi) * COLUMNS), axis=1)


def drive(turn_deg: float = 360.0, step_deg: float = 20.0, phase: float = 0.0) -> Floats:
    """Poses of a robot that turns on each place and drives on."""
    poses = []
    for (x, y), (next_x, _) in zip(PLACES, (*PLACES[1:], (4.8, 0.0)), strict=True):
        poses += [(x, y, float(wrap(phase - np.deg2rad(degrees)))) for degrees in np.arange(0.0, turn_deg, step_deg)]
        poses += [(along, y, 0.0) for along in np.arange(x + 0.2, next_x - 0.1, 0.2)]
    return np.array(poses)


def record(
    folder: Path, poses: Floats, truth: bool = True, odometry: bool = True, scale: float = 1.0, told: bool = True
) -> Path:
    """A recording; the odometer's turns are so much too large."""
    writer = RecordingWriter(folder, CAMERA)
    turned = np.unwrap(poses[:, 2])
    bent = np.column_stack([poses[:, :2], wrap(turned[0] + scale * (turned - turned[0]))])
    for number, (pose, reading) in enumerate(zip(poses, bent, strict=True)):
        frame = Frame(
            0.1 * number, compose(START, reading) if odometry else None, MOUNT, {"rgb": view(compose(pose, MOUNT))}
        )
        writer.add(frame, pose if truth else None)
    writer.close()
    if not told:
        (folder / "camera.toml").unlink()
    return folder


@pytest.fixture(scope="module")
def turning(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record(tmp_path_factory.mktemp("turning") / "r", drive())


@pytest.fixture(scope="module")
def passing(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """It never turns on the spot."""
    along = np.arange(0.0, 4.8, 0.2)
    return record(tmp_path_factory.mktemp("passing") / "r", np.column_stack([along, np.zeros((len(along), 2))]))


def likeness(one: Image, other: Image) -> float:
    return float(np.corrcoef(one.ravel().astype(float), other.ravel().astype(float))[0, 1])


class TestMap:
    def test_nodes_where_it_turned_and_between(self, turning: Path) -> None:
        built = build_map(Recording.load(turning), BuildConfig(spacing_m=1.0))
        nodes = built.topo_map.nodes
        assert [(round(node.x, 6), round(node.y, 6)) for node in nodes] == [(0, 0), (1, 0), (2, 0), (3, 0), (4, 0)]
        assert [node.has_panorama for node in nodes] == [True, False, True, False, True]
        assert [node.id for node in nodes] == ["N0", "N1", "N2", "N3", "N4"]
        assert np.asarray(built.topo_map.edges).tolist() == [[0, 1], [1, 2], [2, 3], [3, 4]]
        assert (built.source, built.turns, built.left_out, built.notes) == ("truth", 3, {}, ())
        assert built.length_m == pytest.approx(4.6)

    @pytest.mark.parametrize(("by", "places"), [("headings", 3), ("circle", 1)])
    def test_panoramas_show_what_is_there(self, by: Literal["headings", "circle"], places: int, tmp_path: Path) -> None:
        recording = Recording.load(record(tmp_path / "r", drive()[: 18 if places == 1 else None]))
        built = build_map(recording, BuildConfig(nodes="panoramas", panoramas=by))
        assert len(built.topo_map.nodes) == places
        for node, wanted in zip(built.topo_map.nodes, CIRCLES[:places], strict=True):
            assert abs(wrap(node.heading - np.pi)) < np.deg2rad(2.0)
            panorama = node.panorama
            assert panorama is not None and panorama.shape == wanted.shape
            middle = slice(12, 36)  # rows are scaled about the horizon: this world has its things at no height
            aside = likeness(np.roll(panorama, COLUMNS // 8, axis=1)[middle], wanted[middle])
            assert likeness(panorama[middle], wanted[middle]) > max(0.6, aside + 0.4)

    def test_odometry_begins_at_the_origin(self, turning: Path) -> None:
        built = build_map(
            Recording.load(turning), BuildConfig(poses="odometry", nodes="panoramas", panoramas="headings")
        )
        assert built.source == "odometry"
        positions = built.topo_map.positions
        assert positions[0] == pytest.approx([0.0, 0.0], abs=1e-9)
        assert positions == pytest.approx(np.array(PLACES), abs=1e-5)

    def test_with_odometry_pictures_correct_the_turn(self, tmp_path: Path) -> None:
        """An odometer whose turns are 4 % too large: pasted by its headings the circle does not fit."""
        poses = drive()[: round(360 / 20)]
        recording = Recording.load(record(tmp_path / "r", poses, truth=False, scale=1.04))
        fits = {}
        methods: tuple[Literal["headings", "circle"], ...] = ("headings", "circle")
        for by in methods:
            [node] = build_map(recording, BuildConfig(panoramas=by)).topo_map.nodes
            assert node.panorama is not None
            middle, shifts = slice(18, 30), range(-8, 9)
            fits[by] = max(likeness(np.roll(node.panorama, s, axis=1)[middle], CIRCLES[0][middle]) for s in shifts)
        assert fits["circle"] > fits["headings"] + 0.1

    def test_views_look_along_the_camera(self, turning: Path) -> None:
        recording = Recording.load(turning)
        topo_map = build_map(recording, BuildConfig(view_spacing_m=0.3, view_turn_deg=15.0)).topo_map
        assert len(topo_map.views) > 3 * 18
        for one in topo_map.views[::7]:
            assert np.array_equal(one.image, view(one.pose))

    def test_it_comes_back_from_its_folder(self, turning: Path, tmp_path: Path) -> None:
        built = build_map(Recording.load(turning), BuildConfig()).topo_map
        built.save(tmp_path / "map")
        read = TopoMap.load(tmp_path / "map")
        assert (read.nodes, read.camera, len(read.views)) == (built.nodes, built.camera, len(built.views))
        assert np.array_equal(read.views[5].image, built.views[5].image)

    def test_pictures_are_scaled(self, turning: Path) -> None:
        topo_map = build_map(Recording.load(turning), BuildConfig(view_size=(32, 24))).topo_map
        assert (topo_map.camera.width, topo_map.views[0].image.shape) == (32, (24, 32, 3))
        panorama = topo_map.nodes[0].panorama
        assert panorama is not None and panorama.shape[:2] == (24, 192)

    def test_a_turn_that_ends_short_has_no_panorama(self, tmp_path: Path) -> None:
        built = build_map(Recording.load(record(tmp_path / "r", drive(turn_deg=260.0))), BuildConfig())
        assert not any(node.has_panorama for node in built.topo_map.nodes)
        assert len(built.notes) == 3 and built.notes[0].startswith(
            "node N0, pictures 000000.png to 000012.png: no panorama: 60 degrees"
        )

    def test_a_little_that_is_missing_stays_black(self, tmp_path: Path) -> None:
        built = build_map(
            Recording.load(record(tmp_path / "r", drive(turn_deg=290.0, step_deg=15.0)[:25])), BuildConfig()
        )
        assert "stay black" in built.notes[0] and built.topo_map.nodes[0].has_panorama

    def test_pictures_that_contradict_the_poses_are_placed_by_these(self, tmp_path: Path) -> None:
        """Of a turn by the odometer the camera saw two frames exchanged."""
        folder = record(tmp_path / "r", drive()[:18], truth=False)
        files = sorted((folder / "rgb").iterdir())
        for a, b in ((4, 13), (2, 9)):
            one, other = files[a].read_bytes(), files[b].read_bytes()
            files[a].write_bytes(other)
            files[b].write_bytes(one)
        built = build_map(Recording.load(folder), BuildConfig(panoramas="circle"))
        assert "its frames stand where the poses say, since by what it shows 0000" in built.notes[0]
        assert built.notes[0].startswith("node N0, pictures 000000.png to 000016.png: ")
        assert built.topo_map.nodes[0].has_panorama

    def test_a_wrong_field_of_view_is_told_once(self, turning: Path) -> None:
        """The camera that is told as 60 degrees wide is taken for one of 40: no turn closes."""
        recording = replace(Recording.load(turning), camera=Camera(40.0, 64, 48))
        [note] = build_map(recording, BuildConfig(panoramas="circle")).notes
        assert note.startswith("at 3 of 3 turns (nodes N0, N2, N4) ")
        assert f"is hfov_deg right? 'topoloc camera turn {turning}' measures it" in note

    def test_stereo_pairs_come_along(self, tmp_path: Path) -> None:
        writer = RecordingWriter(tmp_path / "r", CAMERA, baseline_m=0.1)
        for number, pose in enumerate(drive()[:6]):
            both = {"rgb": view(compose(pose, MOUNT)), "right": np.full((48, 64, 3), 40 + number, dtype=np.uint8)}
            writer.add(Frame(0.1 * number, None, MOUNT, both), pose)
        writer.close()
        topo_map = build_map(Recording.load(tmp_path / "r")).topo_map
        assert topo_map.baseline_m == 0.1
        rights = [one.right for one in topo_map.views]
        assert [int(right.max()) for right in rights if right is not None] == [40, 41, 42, 43, 44, 45]

    def test_unwrapped_pictures_are_turned_to_one_heading(self, tmp_path: Path) -> None:
        writer = RecordingWriter(tmp_path / "r", CAMERA, panorama=True)
        poses = np.array([(0.3 * i, 0.0, wrap(0.4 * i)) for i in range(14)])
        for number, pose in enumerate(poses):
            circle = circle_from(float(compose(pose, MOUNT)[2]), pose)
            writer.add(Frame(0.1 * number, None, MOUNT, {"omni": circle}), pose)
        writer.close()
        topo_map = build_map(Recording.load(tmp_path / "r"), BuildConfig(spacing_m=0.5)).topo_map
        assert len(topo_map.nodes) == 7 and not topo_map.views
        for node in topo_map.nodes:
            panorama = node.panorama
            assert panorama is not None and abs(wrap(node.heading - np.pi)) <= np.pi / COLUMNS + 1e-9
            rolls = [
                np.abs(np.roll(panorama, s, axis=1).astype(int) - circle_at(np.array([node.x, 0.0]))).mean()
                for s in (-1, 0, 1)
            ]
            assert min(rolls) == 0.0


class TestLeftOut:
    def test_what_shows_nothing_or_cannot_be_read(self, turning: Path, tmp_path: Path) -> None:
        folder = tmp_path / "r"
        record(folder, drive())
        files = sorted((folder / "rgb").iterdir())
        files[20].write_bytes(b"")
        write_image(files[21], np.full((48, 64, 3), 7, dtype=np.uint8))
        write_image(files[22], np.zeros((24, 32, 3), dtype=np.uint8))
        built = build_map(Recording.load(folder))
        assert built.left_out == {
            "the picture cannot be read": 1,
            "the picture has another size": 1,
            "the picture is of one colour: a covered lens": 1,
        }
        assert built.frames == len(files) - 2

    def test_frames_without_a_pose(self, passing: Path, tmp_path: Path) -> None:
        folder = tmp_path / "r"
        along = np.arange(0.0, 4.8, 0.2)
        record(folder, np.column_stack([along, np.zeros((len(along), 2))]))
        lines = (folder / "groundtruth.txt").read_text().splitlines()
        (folder / "groundtruth.txt").write_text("\n".join(lines[:11]) + "\n")
        built = build_map(Recording.load(folder))
        assert built.left_out == {"no truth within 0.5 s": 9}
        assert built.frames == 15

    def test_a_covered_snapshot_of_a_turn(self, tmp_path: Path) -> None:
        folder = record(tmp_path / "r", drive(step_deg=40.0))
        write_image(sorted((folder / "rgb").iterdir())[3], np.full((48, 64, 3), 7, dtype=np.uint8))
        built = build_map(Recording.load(folder), BuildConfig())
        assert "20 degrees of its panorama stay black" in built.notes[0]


class TestCommand:
    def test_what_it_says(self, turning: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        assert run(["map", "build", str(turning), "-o", str(tmp_path / "map"), "--nodes", "panoramas"]) == 0
        told = capsys.readouterr().out
        assert "3 nodes, 3 with panoramas, 2 edges" in told and "ground truth" in told
        assert "camera: 64x48, 60 degrees wide" in told
        assert f"next: topoloc map show {tmp_path / 'map'}" in told and "the odometry's" not in told

    def test_what_to_type_next_may_be_copied(
        self, passing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        out = tmp_path / "my map"
        assert run(["map", "build", str(passing), "-o", str(out), "--poses", "odometry"]) == 0
        frame, *steps = capsys.readouterr().out.splitlines()[-4:]
        assert frame.startswith("the map's frame is the odometry's: metrics of recordings with ground truth in another")
        assert [shlex.split(step)[1:5] for step in steps] == [
            ["topoloc", "map", "show", str(out)],
            ["topoloc", "check", str(out)],
            ["topoloc", "localize", str(out), "ANOTHER_RECORDING"],
        ]

    @pytest.mark.parametrize(
        "sensor", ["ima", *(pytest.param(name, marks=pytest.mark.slow) for name in ("local", "pca", "histogram"))]
    )
    def test_another_drive_is_localized(self, sensor: str, turning: Path, tmp_path: Path) -> None:
        """Its frames look 4 degrees aside of the map's; at 9 this fine noise has nothing in common with itself."""
        build_map(Recording.load(turning), BuildConfig(nodes="panoramas")).topo_map.save(tmp_path / "map")
        other = record(tmp_path / "other", drive(phase=np.deg2rad(4.0))[::3])
        arguments = [str(tmp_path / "map"), str(other), "-o", str(tmp_path / "run"), "--sensor", sensor]
        assert run(["localize", *arguments, "--estimator", "best-match"]) == 0
        metrics = json.loads((tmp_path / "run" / "metrics.json").read_text())
        assert metrics["node_accuracy"] > 0.8

    def test_the_map_is_drawn_into_its_folder(self, passing: Path, tmp_path: Path) -> None:
        out = tmp_path / "map"
        assert run(["map", "build", str(passing), "-o", str(out)]) == 0
        assert {path.name for path in out.iterdir()} == {
            "map.toml", "nodes.csv", "edges.csv", "views.csv", "views", "map.png",
        }  # fmt: skip
        assert read_image(out / "map.png").shape[1] > 500

    def test_without_turns_it_says_what_ima_needs(
        self, passing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        assert run(["map", "build", str(passing), "-o", str(tmp_path / "map"), "--poses", "odometry"]) == 0
        told = capsys.readouterr()
        assert "ima needs a panorama at every node, and N0, N1, N2, N3, N4 have none" in told.err
        assert "odometry drifts" in told.err and "--sensor local" in told.out

    def test_along_a_line(self, tmp_path: Path) -> None:
        along = np.arange(0.0, 4.8, 0.2)
        poses = np.column_stack([along, np.zeros((len(along), 2))])
        folder = record(tmp_path / "r", poses, truth=False, odometry=False, told=False)
        line = ["--poses", "line", "--speed-m-s", "2", "--hfov-deg", "60"]
        assert run(["map", "build", str(folder), "-o", str(tmp_path / "map"), *line]) == 0
        with (tmp_path / "map" / "nodes.csv").open(newline="") as file:
            assert [float(row["x"]) for row in csv.DictReader(file)] == pytest.approx([0.0, 1.0, 2.0, 3.0, 4.0])

    def test_an_old_map_leaves_nothing_behind(self, passing: Path, tmp_path: Path) -> None:
        old = (Node("OLD", "old", 0.0, 0.0, 0.0, CIRCLES[0]), Node("OLDER", "older", 1.0, 0.0))
        TopoMap("old", CAMERA, old, views=(View(np.zeros(3), view(np.zeros(3))),)).save(tmp_path / "map")
        assert run(["map", "build", str(passing), "-o", str(tmp_path / "map"), "--overwrite"]) == 0
        fresh = TopoMap.load(tmp_path / "map")
        assert [node.id for node in fresh.nodes] == ["N0", "N1", "N2", "N3", "N4"] and len(fresh.views) > 5
        assert not any(node.has_panorama for node in fresh.nodes)


def _nothing(folder: Path) -> None:
    """Leave it as it is."""


def _drop(*names: str) -> Callable[[Path], None]:
    def spoil(folder: Path) -> None:
        for name in names:
            (folder / name).unlink()

    return spoil


def _one_frame(folder: Path) -> None:
    (folder / "rgb.txt").write_text("\n".join((folder / "rgb.txt").read_text().splitlines()[:2]) + "\n")


def _empty_pictures(folder: Path) -> None:
    for path in (folder / "rgb").iterdir():
        path.write_bytes(b"")


MISTAKES = {
    "no poses": (_drop("groundtruth.txt", "odometry.txt"), [], "holds no groundtruth.txt or odometry.txt"),
    "no truth": (_drop("groundtruth.txt"), ["--poses", "truth"], "holds no groundtruth.txt"),
    "no field of view": (_drop("camera.toml"), [], "give --hfov-deg, or let 'topoloc camera turn' estimate it"),
    "two fields of view": (_nothing, ["--hfov-deg", "40"], "hfov_deg is 60, but --hfov-deg says 40"),
    "one frame": (_one_frame, [], "has 1 frames for a map"),
    "empty pictures": (_empty_pictures, [], "none of its pictures can be read"),
    "no spacing": (_nothing, ["--spacing-m", "0"], "spacing_m is 0.0; it must be above 0"),
    "negative views": (_nothing, ["--view-turn-deg=-3"], "view_turn_deg is -3.0; it must be above 0"),
    "another aspect": (_nothing, ["--view-size", "30x30"], "keep the aspect ratio"),
    "no size": (_nothing, ["--view-size", "small"], "write columns x rows"),
    "a line without speed": (_nothing, ["--poses", "line"], "--poses line --speed-m-s 0.5"),
    "no panoramas": (_nothing, ["--nodes", "panoramas"], "let the robot turn full circle at the nodes"),
}


@pytest.mark.parametrize(("spoil", "options", "told"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_one_line(
    spoil: Callable[[Path], None],
    options: list[str],
    told: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    along = np.arange(0.0, 2.0, 0.4)
    folder = record(tmp_path / "r", np.column_stack([along, np.zeros((len(along), 2))]))
    spoil(folder)
    assert run(["map", "build", str(folder), "-o", str(tmp_path / "map"), *options]) == 2
    error = [line for line in capsys.readouterr().err.splitlines() if "is left out" not in line]
    assert len(error) == 1 and told in error[0]
    assert not (tmp_path / "map").exists()


def test_a_map_that_is_there_stays(passing: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "map").mkdir()
    (tmp_path / "map" / "mine.txt").write_text("mine")
    assert run(["map", "build", str(passing), "-o", str(tmp_path / "map")]) == 2
    assert "already exists" in capsys.readouterr().err
    assert [path.name for path in (tmp_path / "map").iterdir()] == ["mine.txt"]


def test_omni_pictures_must_be_unwrapped(tmp_path: Path) -> None:
    writer = RecordingWriter(tmp_path / "r", CAMERA)
    for number in range(3):
        writer.add(Frame(float(number), None, MOUNT, {"omni": CIRCLES[0]}), np.array([0.5 * number, 0.0, 0.0]))
    writer.close()
    with pytest.raises(UserError, match="topoloc unwrap"):
        build_map(Recording.load(tmp_path / "r"))
