"""A recording as a folder: written, read back, interpolated, and each mistake named with its line and a remedy."""

from __future__ import annotations

import math
import re
import weakref
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.spoil import Spoil, rewrite, write

from topoloc.errors import InputError, UnreadableImage, UserError
from topoloc.files import write_image
from topoloc.geometry import wrap
from topoloc.recording import LazyImages, Recording, Track, write_track
from topoloc.recording_folder import RecordingWriter
from topoloc.rig_file import Mount
from topoloc.topo_map import Camera
from topoloc.types import Frame, Pixels

CAMERA = Camera(40.0, 16, 12)
RNG = np.random.default_rng(0)


def depth_picture() -> np.ndarray:
    return RNG.integers(0, 1 << 16, (12, 16)).astype(np.uint16)


def picture(rows: int = 12, columns: int = 16) -> np.ndarray:
    return RNG.integers(0, 256, (rows, columns, 3)).astype(np.uint8)


class TestRoundTrip:
    def test_everything_comes_back(self, tmp_path: Path) -> None:
        mount = np.array([0.1, -0.05, 0.4])
        poses = [np.array([0.1 * i, -0.2 * i, wrap(3.0 + 0.1 * i)]) for i in range(4)]
        truth = [np.array([5.0, 0.3 * i, wrap(-3.0 - 0.1 * i)]) for i in range(4)]
        frames = [Frame(1.5 + i / 3, pose, mount, {"rgb": picture()}) for i, pose in enumerate(poses)]
        writer = RecordingWriter(tmp_path / "r", CAMERA)
        for frame, true in zip(frames, truth, strict=True):
            writer.add(frame, true)
        writer.close()
        recording = Recording.load(tmp_path / "r")
        assert (recording.kind, recording.camera, len(recording)) == ("rgb", CAMERA, 4)
        assert (recording.mount.x, recording.mount.y) == (0.1, -0.05)
        assert recording.mount.yaw_deg == pytest.approx(math.degrees(0.4))
        assert recording.truth is not None and recording.pan is None
        for frame, true, read in zip(frames, truth, recording, strict=True):
            assert read.timestamp == pytest.approx(frame.timestamp, abs=1e-6)
            assert read.odometry is not None and frame.odometry is not None
            assert read.odometry == pytest.approx(frame.odometry, abs=1e-6)
            assert read.camera == pytest.approx(mount)
            assert recording.truth.at(read.timestamp) == pytest.approx(true, abs=1e-6)
            assert set(read.images) == {"rgb"}
            assert np.array_equal(read.images["rgb"], frame.images["rgb"])

    def test_without_odometry_and_truth(self, tmp_path: Path) -> None:
        writer = RecordingWriter(tmp_path / "r", CAMERA)
        writer.add(Frame(0.0, None, np.zeros(3), {"rgb": picture()}))
        writer.close()
        recording = Recording.load(tmp_path / "r")
        assert recording.odometry is None and recording.truth is None
        assert next(iter(recording)).odometry is None

    def test_a_trajectory_is_a_tum_file(self, tmp_path: Path) -> None:
        write_track(tmp_path / "t.txt", [0.0, 1.0], np.array([[1.0, 2.0, 0.0], [0.0, 0.0, math.pi / 2]]))
        rows = [line.split() for line in (tmp_path / "t.txt").read_text().splitlines() if not line.startswith("#")]
        assert [len(row) for row in rows] == [8, 8]
        assert [float(word) for word in rows[0]] == pytest.approx([0, 1, 2, 0, 0, 0, 0, 1])
        assert [float(word) for word in rows[1]] == pytest.approx([1, 0, 0, 0, 0, 0, math.sqrt(0.5), math.sqrt(0.5)])


def write_frames(folder: Path, frames: list[Frame], **options: Any) -> Recording:
    writer = RecordingWriter(folder, CAMERA, **options)
    for frame in frames:
        writer.add(frame)
    writer.close()
    return Recording.load(folder)


def pictures_of(kinds: Sequence[str]) -> dict[str, Pixels]:
    return {kind: depth_picture() if kind == "depth" else picture() for kind in kinds}


class TestEveryKind:
    @pytest.mark.parametrize(
        "kinds", [("rgb", "right", "depth", "omni"), ("depth", "rgb"), ("omni",), ("omni", "depth")], ids="-".join
    )
    def test_comes_back(self, kinds: Sequence[str], tmp_path: Path) -> None:
        """The frames lie closer together than pictures of one frame may."""
        frames = [Frame(i / 50, None, np.zeros(3), pictures_of(kinds)) for i in range(3)]
        recording = write_frames(tmp_path, frames)
        assert recording.kind == ("rgb" if "rgb" in kinds else "omni")
        for frame, read in zip(frames, recording, strict=True):
            assert set(read.images) == set(kinds)
            for kind in kinds:
                assert read.images[kind].dtype == (np.uint16 if kind == "depth" else np.uint8)
                assert np.array_equal(read.images[kind], frame.images[kind])
        lists = [(tmp_path / f"{kind}.txt").read_text().splitlines() for kind in kinds]
        assert len({tuple(line.split()[0] for line in lines) for lines in lists}) == 1, "the same timestamps"
        files = {f"{kind}/{i:06d}.png" for kind in kinds for i in range(3)} | {f"{kind}.txt" for kind in kinds}
        assert {str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*.*")} == files | {"camera.toml"}

    def test_no_picture_is_kept(self, tmp_path: Path) -> None:
        writer = RecordingWriter(tmp_path, CAMERA)
        images = pictures_of(["rgb", "depth"])
        watched = [weakref.ref(image) for image in images.values()]
        writer.add(Frame(0.0, None, np.zeros(3), images))
        del images
        assert [reference() for reference in watched] == [None, None]

    def test_stereo_and_panorama_are_told(self, tmp_path: Path) -> None:
        frames = [Frame(0.0, None, np.array([0.1, 0.0, 0.2]), pictures_of(["omni"]))]
        recording = write_frames(tmp_path / "a", frames, baseline_m=0.12, panorama=True)
        assert (recording.baseline_m, recording.panorama, recording.camera) == (0.12, True, CAMERA)
        assert recording.mount.x == 0.1
        plain = write_frames(tmp_path / "b", frames)
        assert (plain.baseline_m, plain.panorama) == (None, False)

    @pytest.mark.parametrize(
        ("images", "says"),
        [
            ({}, "give rgb or omni"),
            ({"right": picture()}, "give rgb or omni"),
            ({"rgb": picture(), "heat": picture()}, "'heat'"),
            ({"rgb": depth_picture()}, "rgb is uint16.*must be uint8"),
            ({"rgb": picture(), "depth": picture()[..., 0]}, "depth is uint8.*must be uint16"),
            ({"rgb": picture(), "depth": picture().astype(np.uint16)}, r"depth is uint16 \(12, 16, 3\)"),
        ],
        ids=["nothing", "no main one", "unknown", "rgb of 16 bits", "depth of 8 bits", "coloured depth"],
    )
    def test_pictures_that_could_not_be_read_back(self, images: dict[str, Pixels], says: str, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match=says):
            RecordingWriter(tmp_path, CAMERA).add(Frame(0.0, None, np.zeros(3), images))

    def test_each_frame_has_the_same_kinds(self, tmp_path: Path) -> None:
        writer = RecordingWriter(tmp_path, CAMERA)
        writer.add(Frame(0.0, None, np.zeros(3), pictures_of(["rgb", "right"])))
        with pytest.raises(ValueError, match=r"\['rgb'\], the first \['rgb', 'right'\]"):
            writer.add(Frame(1.0, None, np.zeros(3), pictures_of(["rgb"])))

    def test_a_recording_has_a_frame(self, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="needs a frame"):
            RecordingWriter(tmp_path, CAMERA).close()

    @pytest.mark.parametrize("baseline", [0.0, -0.1, float("nan")])
    def test_a_baseline_is_above_0(self, baseline: float, tmp_path: Path) -> None:
        with pytest.raises(ValueError, match="baseline_m"):
            RecordingWriter(tmp_path, CAMERA, baseline_m=baseline)


class TestPan:
    def test_comes_back(self, tmp_path: Path) -> None:
        """Over the seam, and with a turn of more than half a circle between two frames."""
        headings = [0.4, 0.4, 3.1, -3.1, 0.2, -2.9]
        cameras = [np.array([0.1, -0.05, heading]) for heading in headings]
        frames = [Frame(0.3 * i, None, camera, {"rgb": picture()}) for i, camera in enumerate(cameras)]
        recording = write_frames(tmp_path, frames)
        assert recording.mount.yaw_deg == pytest.approx(math.degrees(0.4))
        assert (tmp_path / "pan.txt").read_text().splitlines()[:2] == ["# timestamp degrees", "0.000000 0.000000000"]
        for camera, read in zip(cameras, recording, strict=True):
            assert read.camera == pytest.approx(camera, abs=1e-9)

    def test_a_camera_that_stays_has_no_pan(self, tmp_path: Path) -> None:
        camera = np.array([0.1, 0.0, -math.pi])
        recording = write_frames(tmp_path, [Frame(float(i), None, camera, {"rgb": picture()}) for i in range(2)])
        assert not (tmp_path / "pan.txt").exists() and recording.pan is None
        assert np.array([frame.camera for frame in recording]) == pytest.approx(np.array([camera, camera]))

    def test_a_camera_that_moves_on_the_robot_is_refused(self, tmp_path: Path) -> None:
        writer = RecordingWriter(tmp_path, CAMERA)
        writer.add(Frame(0.0, None, np.array([0.1, 0.0, 0.0]), {"rgb": picture()}))
        with pytest.raises(ValueError, match="camera moved on the robot"):
            writer.add(Frame(1.0, None, np.array([0.1, 0.01, 0.5]), {"rgb": picture()}))


class TestTrack:
    def test_interpolates_between_readings(self) -> None:
        track = Track(np.array([0.0, 2.0]), np.array([[0.0, 4.0, 0.2], [1.0, 0.0, 0.6]]))
        assert track.at(0.5) == pytest.approx([0.25, 3.0, 0.3])

    @pytest.mark.parametrize(("start", "end"), [(3.0, -3.0), (-3.0, 3.0)])
    def test_headings_go_the_short_way_across_the_seam(self, start: float, end: float) -> None:
        track = Track(np.array([0.0, 1.0, 2.0]), np.array([[0, 0, 0.0], [0, 0, start], [0, 0, end]]))
        quarter = float(track.at(1.25)[2])
        assert abs(float(wrap(quarter - start))) == pytest.approx(0.25 * (2 * math.pi - 6.0))
        assert abs(quarter) > 3.0
        assert -math.pi <= track.at(1.5)[2] < math.pi

    def test_stands_still_before_and_after(self) -> None:
        track = Track(np.array([1.0, 2.0]), np.array([[0.0, 0.0, 0.1], [1.0, 1.0, 0.2]]))
        assert track.at(-5.0) == pytest.approx([0.0, 0.0, 0.1])
        assert track.at(99.0) == pytest.approx([1.0, 1.0, 0.2])


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A recording written by hand: three pictures, an odometer at other times, a camera."""
    where = tmp_path / "rec"
    where.mkdir()
    (where / "rgb.txt").write_text("# timestamp path\n1.0 a.png\n2.0 b.png\n\n3.0 c.png\n")
    for name in "abc":
        write_image(where / f"{name}.png", picture())
    half = math.sqrt(0.5)
    (where / "odometry.txt").write_text(
        "# timestamp tx ty tz qx qy qz qw\n0.5 0 0 0 0 0 0 1\n"
        f"2.5 2 0 0 0 0 {half} {half}\n3.5 2 1 0 0 0 {half} {half}\n"
    )
    (where / "camera.toml").write_text("hfov_deg = 40\nwidth = 16\nheight = 12\n\n[mount]\nx = 0.1\nyaw_deg = 30\n")
    return where


class TestByHand:
    def test_odometry_at_the_times_of_the_pictures(self, folder: Path) -> None:
        poses = [frame.odometry for frame in Recording.load(folder)]
        assert np.array(poses) == pytest.approx(
            np.array([[0.5, 0, math.pi / 8], [1.5, 0, 3 * math.pi / 8], [2, 0.5, math.pi / 2]])
        )

    def test_the_mount_and_the_pan_add_up(self, folder: Path) -> None:
        frames = list(Recording.load(folder))
        assert frames[0].camera == pytest.approx([0.1, 0.0, math.radians(30)])
        (folder / "pan.txt").write_text("1.0 0\n2.0 -90\n3.0 170\n")
        turned = [frame.camera for frame in Recording.load(folder)]
        assert np.array(turned)[:, 0] == pytest.approx([0.1, 0.1, 0.1])
        assert np.degrees([camera[2] for camera in turned]) == pytest.approx([30.0, -60.0, -160.0])

    def test_a_tilted_quaternion_gives_its_heading(self, folder: Path) -> None:
        """Yaw 60 degrees, then pitch 20: q = q_yaw * q_pitch; scaled, as loggers write them."""
        yaw, pitch = math.radians(60) / 2, math.radians(20) / 2
        q = np.array([-math.sin(yaw) * math.sin(pitch), math.cos(yaw) * math.sin(pitch),
                      math.sin(yaw) * math.cos(pitch), math.cos(yaw) * math.cos(pitch)])  # fmt: skip
        (folder / "odometry.txt").write_text("1 0 0 0 " + " ".join(str(3.0 * part) for part in q) + "\n")
        track = Recording.load(folder).odometry
        assert track is not None and track.poses[0, 2] == pytest.approx(math.radians(60))

    def test_pictures_are_read_only_when_asked_for_and_once(
        self, folder: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        read: list[str] = []

        def reader(path: Path) -> np.ndarray:
            read.append(path.name)
            return picture()

        monkeypatch.setattr("topoloc.recording.read_image", reader)
        frames = list(Recording.load(folder))
        assert list(frames[1].images) == ["rgb"] and len(frames[1].images) == 1
        assert read == []
        assert frames[1].images["rgb"] is frames[1].images["rgb"]
        assert read == ["b.png"]

    def test_asking_for_a_kind_does_not_read_it(self) -> None:
        def refuse() -> np.ndarray:
            raise UnreadableImage("x.png", "does not decode", "save it again")

        assert "rgb" in LazyImages({"rgb": refuse})

    def test_lazy_images_know_their_kinds(self) -> None:
        images = LazyImages({"rgb": picture})
        assert list(images) == ["rgb"] and "omni" not in images
        with pytest.raises(KeyError):
            images["omni"]

    def test_other_kinds_join_the_nearest_frame_within_50_ms(self, folder: Path) -> None:
        (folder / "right.txt").write_text("1.04 a.png\n2.06 b.png\n2.99 c.png\n")
        kinds = [set(frame.images) for frame in Recording.load(folder)]
        assert kinds == [{"rgb", "right"}, {"rgb"}, {"rgb", "right"}]

    def test_omni_pictures_alone(self, folder: Path) -> None:
        """An omnidirectional picture has no aspect ratio that a map's camera could tell."""
        (folder / "rgb.txt").rename(folder / "omni.txt")
        recording = Recording.load(folder).on(Camera(40.0, 1600, 10))
        assert recording.kind == "omni"
        assert [set(frame.images) for frame in recording] == [{"omni"}] * 3
        assert next(iter(recording)).images["omni"].shape == (12, 16, 3)

    @pytest.mark.parametrize(("columns", "fine"), [(108, True), (110, True), (111, False), (16, False)])
    def test_an_unwrapped_omni_picture_has_the_shape_of_a_panorama(
        self, columns: int, fine: bool, folder: Path
    ) -> None:
        (folder / "rgb.txt").rename(folder / "omni.txt")
        (folder / "camera.toml").write_text("panorama = true\n")
        write_image(folder / "b.png", picture(9, columns))
        images = list(Recording.load(folder).on(CAMERA))[1].images
        if fine:
            assert images["omni"].shape == (9, columns, 3)
        else:
            with pytest.raises(InputError, match=rf"omni\.txt, line 3: b\.png is {columns}x9.*144x12.*; ") as caught:
                images["omni"]
            assert not isinstance(caught.value, UnreadableImage)

    def test_a_right_picture_of_another_aspect_ratio_names_its_line(self, folder: Path) -> None:
        write_image(folder / "r.png", picture(24, 16))
        (folder / "right.txt").write_text("1.0 r.png\n")
        frame = next(iter(Recording.load(folder).on(CAMERA)))
        with pytest.raises(InputError, match=r"right\.txt, line 1: r\.png is 16x24"):
            frame.images["right"]

    def test_depth_of_8_bits_names_the_picture(self, folder: Path) -> None:
        (folder / "depth.txt").write_text("1.0 a.png\n")
        frame = next(iter(Recording.load(folder)))
        with pytest.raises(InputError, match=r"a\.png: is no grey picture of 16 bits; "):
            frame.images["depth"]

    def test_a_camera_file_that_tells_no_lens(self, folder: Path) -> None:
        (folder / "camera.toml").write_text("baseline_m = 0.1\n[mount]\nx = 0.2\n")
        recording = Recording.load(folder).on(Camera(90.0, 16, 12))
        assert (recording.camera, recording.baseline_m, recording.mount) == (None, 0.1, Mount(x=0.2))

    def test_the_table_of_an_omnidirectional_camera_is_kept_as_it_stands(self, folder: Path) -> None:
        """What a model is, and which settings it has, another room knows: ``sensors.omni.from_table``."""
        (folder / "rgb.txt").rename(folder / "omni.txt")
        table = 'model = "polynomial"\ncoefficients = [1.5, 0, -2]\nlooks = "down"\nanything = 3\n'
        (folder / "camera.toml").write_text(f"hfov_deg = 40\nwidth = 16\nheight = 12\n[omni]\n{table}")
        recording = Recording.load(folder).on(CAMERA)
        expected = {"model": "polynomial", "coefficients": [1.5, 0, -2], "looks": "down", "anything": 3}
        assert (recording.omni, recording.panorama, recording.camera) == (expected, False, CAMERA)
        assert next(iter(recording)).images["omni"].shape == (12, 16, 3), "as recorded: of any aspect ratio"

    def test_without_an_omni_table_there_is_none(self, folder: Path) -> None:
        assert Recording.load(folder).omni is None

    def test_without_a_camera_file_any_field_of_view_suits(self, folder: Path) -> None:
        (folder / "camera.toml").unlink()
        recording = Recording.load(folder).on(Camera(90.0, 16, 12))
        assert recording.camera is None and recording.mount == Mount()

    def test_an_undecodable_picture_is_an_unreadable_image(self, folder: Path) -> None:
        (folder / "b.png").write_text("not a picture")
        frames = list(Recording.load(folder))
        assert frames[0].images["rgb"].shape == (12, 16, 3)
        with pytest.raises(UnreadableImage, match=r"b\.png: does not decode"):
            frames[1].images["rgb"]

    def test_a_missing_picture_is_an_unreadable_image(self, folder: Path) -> None:
        (folder / "b.png").unlink()
        with pytest.raises(UnreadableImage, match=r"b\.png: cannot be read"):
            list(Recording.load(folder))[1].images["rgb"]

    def test_a_picture_of_another_aspect_ratio_names_its_line(self, folder: Path) -> None:
        write_image(folder / "c.png", picture(24, 16))
        frames = list(Recording.load(folder).on(CAMERA))
        assert frames[0].images["rgb"] is not None
        with pytest.raises(InputError, match=r"rgb\.txt, line 5: c\.png is 16x24.*16x12.*; ") as caught:
            frames[2].images["rgb"]
        assert not isinstance(caught.value, UnreadableImage), "it must stop the run, not pass for a blind frame"

    def test_a_picture_of_another_size_but_the_same_ratio_is_fine(self, folder: Path) -> None:
        write_image(folder / "a.png", picture(24, 32))
        assert next(iter(Recording.load(folder).on(CAMERA))).images["rgb"].shape == (24, 32, 3)

    @pytest.mark.parametrize(("hfov", "fine"), [(40.5, True), (40.9, False), (60.0, False)])
    def test_another_field_of_view_is_refused(self, hfov: float, fine: bool, folder: Path) -> None:
        recording = Recording.load(folder)
        if fine:
            assert recording.on(replace(CAMERA, hfov_deg=hfov)).expected is not None
        else:
            with pytest.raises(InputError, match=r"camera\.toml: hfov_deg is 40, but the map.*; "):
                recording.on(replace(CAMERA, hfov_deg=hfov))


BAD: dict[str, tuple[Spoil, str]] = {
    "rgb.txt missing": (lambda folder: (folder / "rgb.txt").unlink(), r"rec: holds neither rgb\.txt nor omni\.txt"),
    "rgb.txt empty": (write("rgb.txt", ""), r"rgb\.txt: lists no pictures"),
    "only comments": (write("rgb.txt", "# timestamp path\n"), r"rgb\.txt: lists no pictures"),
    "rgb.txt binary": (write("rgb.txt", bytes(range(256))), r"rgb\.txt: .*text"),
    "NUL in a path": (rewrite("rgb.txt", "b.png", "b\0.png"), r"rgb\.txt, line 3|\.png: cannot be read"),
    "one word": (rewrite("rgb.txt", "2.0 b.png", "b.png"), r"rgb\.txt, line 3: 'b.png' is a single word"),
    "letters for a time": (rewrite("rgb.txt", "2.0", "two"), r"rgb\.txt, line 3: 'two'"),
    "pictures back in time": (rewrite("rgb.txt", "2.0", "0.9"), r"rgb\.txt, line 3: .*0\.9.*1\.0"),
    "two pictures at a time": (rewrite("rgb.txt", "2.0", "1.0"), r"rgb\.txt, line 3: "),
    "letters in odometry": (rewrite("odometry.txt", "2.5 2 0", "2.5 two 0"), r"odometry\.txt, line 3: 'two'"),
    "NaN in odometry": (rewrite("odometry.txt", "2.5 2 0", "2.5 nan 0"), r"odometry\.txt, line 3: 'nan'"),
    "inf in odometry": (rewrite("odometry.txt", "2.5 2 0", "inf 2 0"), r"odometry\.txt, line 3: 'inf'"),
    "zero quaternion": (rewrite("odometry.txt", "0 0 0 1\n", "0 0 0 0\n"), r"odometry\.txt, line 2: .*quaternion"),
    "odometry back in time": (rewrite("odometry.txt", "3.5", "2.4"), r"odometry\.txt, line 4: .*2\.4.*2\.5"),
    "too few values": (rewrite("odometry.txt", "0.5 0 0 0", "0.5 0 0"), r"odometry\.txt, line 2: 7 values"),
    "too many values": (rewrite("odometry.txt", "0.5 0 0 0", "0.5 0 0 0 0"), r"odometry\.txt, line 2: 9 values"),
    "odometry empty": (write("odometry.txt", ""), r"odometry\.txt: holds no lines"),
    "truth with letters": (write("groundtruth.txt", "1 a 0 0 0 0 0 1\n"), r"groundtruth\.txt, line 1: 'a'"),
    "pan with letters": (write("pan.txt", "1 left\n"), r"pan\.txt, line 1: 'left'"),
    "pan of three values": (write("pan.txt", "1 2 3\n"), r"pan\.txt, line 1: 3 values"),
    "pan empty": (write("pan.txt", "# nothing\n"), r"pan\.txt: holds no lines"),
    "camera syntax": (rewrite("camera.toml", "width = 16", "width 16"), r"camera\.toml.*line 2"),
    "camera unknown key": (rewrite("camera.toml", "width", "with"), r"camera\.toml: .*'with'.*width"),
    "mount unknown key": (rewrite("camera.toml", "yaw_deg", "yaw"), r"camera\.toml \[mount\]: .*'yaw'.*yaw_deg"),
    "mount is a number": (write("camera.toml", "mount = 3\n"), r"camera\.toml.*mount"),
    "baseline 0": (rewrite("camera.toml", "width = 16", "baseline_m = 0"), r"camera\.toml: baseline_m is 0; .*above 0"),
    "baseline a text": (
        rewrite("camera.toml", "width = 16", "baseline_m = '1 m'"),
        r"camera\.toml: baseline_m is '1 m'",
    ),
    "panorama a number": (rewrite("camera.toml", "width = 16", "panorama = 3"), r"camera\.toml: panorama is 3"),
    "hfov 0": (rewrite("camera.toml", "40", "0"), r"camera\.toml: hfov_deg is 0"),
    "omni a text": (write("camera.toml", "omni = 'conical'\n"), r"camera\.toml: \[omni\] names no model; .*model = "),
    "omni without a model": (write("camera.toml", "[omni]\nrim_px = 3\n"), r"camera\.toml: \[omni\] names no model"),
    "omni model a number": (write("camera.toml", "[omni]\nmodel = 3\n"), r"camera\.toml: \[omni\] names no model"),
    "omni with a table": (
        write("camera.toml", "[omni]\nmodel = 'conical'\n[omni.rim]\npx = 3\n"),
        r"camera\.toml \[omni\]: rim is \{'px': 3\}; write a number",
    ),
    "omni with true": (
        write("camera.toml", "[omni]\nmodel = 'conical'\nrim_px = true\n"),
        r"camera\.toml \[omni\]: rim_px is True; write a number",
    ),
    "omni with NaN in a list": (
        write("camera.toml", "[omni]\nmodel = 'polynomial'\ncoefficients = [1, nan]\n"),
        r"camera\.toml \[omni\]: coefficients is nan; write a number",
    ),
    "omni of panoramas": (
        write("camera.toml", "panorama = true\n[omni]\nmodel = 'conical'\n"),
        r"camera\.toml: panorama = true .*\[omni\].*; take out",
    ),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_input_is_named_with_its_place(case: str, folder: Path) -> None:
    spoil, expected = BAD[case]
    spoil(folder)
    with pytest.raises(UserError) as caught:
        [frame.images["rgb"] for frame in Recording.load(folder)]
    message = str(caught.value)
    assert re.search(expected, message)
    assert "\n" not in message and ";" in message


def test_a_folder_that_does_not_exist(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nowhere: no such folder; name"):
        Recording.load(tmp_path / "nowhere")
