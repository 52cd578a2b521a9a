"""Pictures that lie the wrong way round, do not close, look alike, or are of another field of view (simulated)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from topoloc import plugins
from topoloc.checks import Finding, check_map, check_pair
from topoloc.checks.alike import alike_findings
from topoloc.checks.field_of_view import Look, Placed, fitted_field, frame_findings, placed_on
from topoloc.checks.panoramas import panorama_findings, seam, way_round_findings
from topoloc.checks.poses_of_frames import pose_findings
from topoloc.checks.turn_sense import sense_findings
from topoloc.geometry import compose
from topoloc.going_through import in_silence
from topoloc.recording import Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera, TopoMap, View
from topoloc.types import Frame, Image

SEED = 1000
NOWHERE = Look(np.zeros((8, 8), dtype=np.uint8), None)
Change = Callable[[Image], Image]


def mirror(picture: Image) -> Image:
    return np.ascontiguousarray(picture[:, ::-1])


def half_turn(picture: Image) -> Image:
    return np.ascontiguousarray(picture[::-1, ::-1])


def upside_down(picture: Image) -> Image:
    return np.ascontiguousarray(picture[::-1])


def as_it_is(picture: Image) -> Image:
    return picture


def without(degrees: float) -> Change:
    """A circle that lacks so much of the turn, stretched to a full one."""

    def cut(panorama: Image) -> Image:
        rows, columns = panorama.shape[:2]
        kept = np.ascontiguousarray(panorama[:, round(columns * degrees / 360.0) :])
        return np.asarray(cv2.resize(kept, (columns, rows)), dtype=np.uint8)

    return cut


def narrower(share: float) -> Change:
    """The middle of a picture, enlarged: as a camera of a smaller field of view sees it."""

    def crop(picture: Image) -> Image:
        rows, columns = picture.shape[:2]
        down, across = (round(size * (1.0 - share) / 2.0) for size in (rows, columns))
        middle = np.ascontiguousarray(picture[down : rows - down, across : columns - across])
        return np.asarray(cv2.resize(middle, (columns, rows)), dtype=np.uint8)

    return crop


@dataclass(frozen=True)
class Drive:
    """A simulated laboratory and some frames of a drive in it."""

    topo_map: TopoMap
    frames: list[Frame]
    truth: np.ndarray

    def looks(self, change: Change = as_it_is) -> list[Look]:
        """A third of the frames."""
        return [
            Look(change(f.images["rgb"]), compose(pose, f.camera))
            for f, pose in list(zip(self.frames, self.truth, strict=True))[::3]
        ]

    def placed(self, change: Change = as_it_is) -> list[Placed]:
        return placed_on(self.topo_map, self.looks(change), in_silence)

    def with_panoramas(self, change: Change, *numbers: int) -> TopoMap:
        nodes = [
            replace(node, panorama=change(node.panorama)) if i in numbers and node.panorama is not None else node
            for i, node in enumerate(self.topo_map.nodes)
        ]
        return replace(self.topo_map, nodes=tuple(nodes))


@pytest.fixture(scope="module")
def drive() -> Drive:
    made = plugins.make(plugins.WORLDS, "lab", {"laps": 1.0}).simulate(SEED)
    frames = [replace(frame, images={"rgb": frame.images["rgb"]}) for frame in made.frames]
    return Drive(made.topo_map, frames, np.array(made.truth))


def whats(findings: list[Finding]) -> str:
    return "\n".join(finding.what for finding in findings)


@pytest.mark.slow
def test_nothing_is_wrong_with_the_laboratory(drive: Drive) -> None:
    assert not list(way_round_findings(drive.topo_map, "map", in_silence))
    assert not list(panorama_findings(drive.topo_map, "map", in_silence))
    assert not list(alike_findings(drive.topo_map, "map", in_silence))
    assert not list(frame_findings(drive.topo_map, drive.placed(), "rgb.txt"))


@pytest.mark.parametrize(
    ("change", "told"),
    [
        pytest.param(mirror, "mirrored", id="mirrored"),
        pytest.param(half_turn, "rotated by 180 degrees", id="half a turn", marks=pytest.mark.slow),
        pytest.param(upside_down, "upside down", id="upside down", marks=pytest.mark.slow),
    ],
)
class TestWayRound:
    def test_single_panoramas_are_outvoted_by_their_neighbours(self, change: Change, told: str, drive: Drive) -> None:
        spoiled = drive.with_panoramas(change, 1, 5)
        found = list(way_round_findings(spoiled, "map", in_silence))
        ids = [drive.topo_map.nodes[i].id for i in (1, 5)]
        assert sorted(f.what.split(f" is {told}")[0] for f in found) == [f"the panorama of node {i}" for i in ids]
        assert all(f.severity == "serious" for f in found)

    @pytest.mark.slow
    def test_frames_lie_otherwise_than_the_panoramas(self, change: Change, told: str, drive: Drive) -> None:
        (found,) = frame_findings(drive.topo_map, drive.placed(change), "rgb.txt")
        assert f"are {told}" in found.what


@pytest.mark.parametrize(
    ("change", "wrong"), [(as_it_is, False), (mirror, True), (half_turn, True), (upside_down, False)]
)
def test_pictures_that_move_the_wrong_way_in_turns(change: Change, wrong: bool, drive: Drive, tmp_path: Path) -> None:
    """Top to bottom alone does not change left and right."""
    found = list(sense_findings(written(drive, tmp_path, change)))
    assert len(found) == wrong


@pytest.mark.parametrize("degrees", [15.0, 40.0])
def test_circle_that_lacks_a_part_does_not_close(degrees: float, drive: Drive) -> None:
    nodes = range(len(drive.topo_map.nodes))
    found = list(panorama_findings(drive.with_panoramas(without(degrees), *nodes), "map", in_silence))
    assert len([f for f in found if "does not close" in f.what]) >= len(nodes) - 1


def test_map_of_views_alone_is_looked_over(drive: Drive, tmp_path: Path) -> None:
    """As a drive that never turns makes it: there is no panorama to hold anything against."""
    nodes = tuple(replace(node, panorama=None) for node in drive.topo_map.nodes)
    views = tuple(View(pose, frame.images["rgb"]) for frame, pose in zip(drive.frames, drive.truth, strict=True))[:6]
    report = check_map(replace(drive.topo_map, nodes=nodes, views=views), tmp_path)
    (found,) = report.findings
    assert found.severity == "note" and "8 of 8 nodes have no panorama" in found.what
    assert not check_pair(replace(drive.topo_map, nodes=nodes), written(drive, tmp_path / "r", step=9)).findings


Shift = Callable[[np.ndarray, int], np.ndarray]


@pytest.fixture(scope="module")
def placed(drive: Drive) -> list[Placed]:
    return placed_on(drive.topo_map, drive.looks()[:14], in_silence)


@pytest.mark.parametrize(
    ("shift", "told"),
    [
        (lambda pose, _: pose, None),
        (lambda pose, _: pose + np.array([0.0, 0.0, np.pi / 2.0]), "headings are off by -"),
        (lambda pose, _: pose * [1.0, 1.0, -1.0], "headings grow the other way"),
        (lambda pose, i: pose + np.array([0.0, 0.0, 2.4 * i]), "headings have nothing to do"),
        (
            lambda pose, _: pose * np.array([-1.0, -1.0, 1.0]) + np.array([0.0, 2.0, 0.0]),
            "frames are found on panoramas elsewhere",
        ),
    ],
    ids=["right", "yaw", "clockwise", "shuffled", "elsewhere"],
)
def test_poses_beside_what_frames_show(shift: Shift, told: str | None, drive: Drive, placed: list[Placed]) -> None:
    moved = [
        replace(one, look=replace(one.look, pose=shift(one.look.pose.copy(), i)))
        for i, one in enumerate(placed)
        if one.look.pose is not None
    ]
    found = [finding.what for finding in pose_findings(drive.topo_map, moved, "groundtruth.txt")]
    assert len(moved) >= 6
    assert found == [] if told is None else any(told in what for what in found)


def rolled(panorama: Image) -> Image:
    return np.roll(panorama, panorama.shape[1] // 4, axis=1)


def half_twice(panorama: Image) -> Image:
    half = panorama[:, : panorama.shape[1] // 2]
    return np.concatenate([half, half], axis=1)


def test_panorama_that_is_turned_is_told(drive: Drive) -> None:
    (found,) = way_round_findings(drive.with_panoramas(rolled, 2), "map", in_silence)
    assert "panorama of node 3 is turned by -" in found.what and found.severity == "serious"


def test_panorama_that_shows_the_same_twice_is_told(drive: Drive) -> None:
    found = whats(list(panorama_findings(drive.with_panoramas(half_twice, 2), "map", in_silence)))
    assert "the panorama of node 3 shows the same again 180 degrees on" in found


def test_copied_panorama_is_told_though_the_nodes_are_near(drive: Drive) -> None:
    copied = drive.topo_map.nodes[5].panorama
    found = whats(list(alike_findings(drive.with_panoramas(lambda _: np.asarray(copied), 2), "map", in_silence)))
    assert "nodes 3 and 6 look alike: 12 of 12" in found


def test_seam_of_a_closed_circle_is_a_step_like_others(drive: Drive) -> None:
    for node in drive.topo_map.nodes:
        assert node.panorama is not None
        assert seam(node.panorama)[0] < 4.0


@pytest.mark.slow
def test_field_of_view_is_found_by_matching(drive: Drive) -> None:
    """A camera that sees half as wide as it is told: tan is what scales."""
    true = 2.0 * np.rad2deg(np.arctan(0.6 * np.tan(np.deg2rad(20.0))))
    (found,) = frame_findings(drive.topo_map, drive.placed(narrower(0.6)), "rgb.txt")
    assert found.severity == "serious" and "is told as 40 degrees" in found.what
    assert float(found.what.split()[-1]) == pytest.approx(true, rel=0.15)


def test_field_of_view_of_exact_points() -> None:
    columns = np.linspace(-0.9, 0.9, 30)
    angles = 0.4 - np.arctan(columns * np.tan(np.deg2rad(35.0)))
    assert fitted_field([Placed(NOWHERE, 0, "same", len(columns), columns, angles)]) == 70.0


@pytest.mark.slow
def test_twins_look_alike_and_neighbours_do_not_count() -> None:
    made = plugins.make(plugins.WORLDS, "twins").simulate(SEED)
    found = list(alike_findings(made.topo_map, "map", in_silence))
    assert {finding.what.split(" look alike")[0] for finding in found[:4]} <= {
        f"nodes {a}{k} and {b}{k}" for a in "AB" for b in "AB" for k in range(1, 12)
    }
    assert found[0].severity == "warning"
    assert "towards" in found[0].what and "at best 0.9" in found[0].what


def written(
    drive: Drive,
    folder: Path,
    change: Change = as_it_is,
    moved: float = 0.0,
    camera: Camera | None = None,
    step: int = 1,
) -> Recording:
    writer = RecordingWriter(folder, camera or drive.topo_map.camera)
    for frame, pose in list(zip(drive.frames, drive.truth, strict=True))[::step]:
        seen = replace(frame, images={"rgb": change(frame.images["rgb"])})
        writer.add(seen, pose + np.array([moved, 0.0, 0.0]))
    writer.close()
    return Recording.load(folder)


@pytest.mark.slow
def test_map_and_recording_together(drive: Drive, tmp_path: Path) -> None:
    assert not check_pair(drive.topo_map, written(drive, tmp_path / "fits", step=3)).findings
    far = check_pair(drive.topo_map, written(drive, tmp_path / "far", moved=20.0, step=9)).findings
    assert "half of the true poses lie" in whats(list(far))
    wide = check_pair(drive.topo_map, written(drive, tmp_path / "wide", camera=Camera(60.0, 384, 288), step=9)).findings
    assert "hfov_deg is 60, but the map was made with 40" in whats(list(wide))
