"""Bags of every kind, written by ``rosbags``, become the recording of the drive that is in them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cyclopts import App
from oracles.bags import Messages, Sent, jpeg
from oracles.bags import write_bag as written_bag
from scipy.spatial.transform import Rotation

from sensors.images import cut_views
from topoloc.cli.import_bag import import_bag
from topoloc.cli.main import run
from topoloc.errors import UserError
from topoloc.files import read_image
from topoloc.geometry import Floats, compose, inverse, wrap
from topoloc.importing.bags import Topic, use_of
from topoloc.importing.bags.topics import is_rectified
from topoloc.lens import Lens
from topoloc.recording import Recording
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Image

CAMERA, START = Camera(40.0, 96, 72), 1000.0
FOCAL = 48.0 / np.tan(np.deg2rad(20.0))
BENT = (-0.05, 0.01, 0.001, -0.001, 0.0)
MOUNTED = np.array([0.1, -0.05, np.pi / 2])
ODOMETER = np.array([3.0, -2.0, 2.0])
"""Where the odometer's frame lies: what it tells is the true pose, seen from there."""
DRIVE = ((0, 0), (0, 2), (1, 2), (1, 4), (2, 4), (2, 6))  # a second apart: node, which of its 24 views
KINDS = (
    "ros1",
    "ros1-bz2",
    "ros1-lz4",
    "sqlite",
    "sqlite-message",
    "sqlite-file",
    "mcap",
    "mcap-storage",
    "mcap-message",
    "mcap-file",
)
RAW, PACKED = "/camera/image_raw", "/camera/image_raw/compressed"
Write = Callable[[str, str, Any, float], None]


def circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


@cache
def the_map() -> TopoMap:
    return TopoMap("tiny", CAMERA, tuple(Node(f"N{k}", "", float(k), 0.5, 1.0, circle(k)) for k in range(3)))


@cache
def looks() -> tuple[list[Image], Floats]:
    """The pictures of the drive, and the camera's headings (N,), without jumps."""
    images, headings = [], []
    for node, view in DRIVE:
        place = the_map().nodes[node]
        assert place.panorama is not None
        image, heading = cut_views(place.panorama, place.heading, CAMERA)[view]
        images.append(image)
        headings.append(heading)
    return images, np.asarray(np.unwrap(headings))


def truth_at(time: float) -> Floats:
    """True pose (3,) of the robot, whose camera looks to its left."""
    clock = START + np.arange(len(DRIVE))
    heading = float(np.interp(time, clock, looks()[1])) - MOUNTED[2]
    x = float(np.interp(time, clock, [the_map().nodes[node].x for node, _ in DRIVE]))
    return np.array([x, 0.5, float(wrap(heading))])


def odometry_at(time: float) -> Floats:
    return compose(inverse(ODOMETER), truth_at(time))


def camera_info(make: Messages, time: float) -> Any:
    return make.camera_info(time, (96, 72), FOCAL, BENT)


def drive(make: Messages) -> Iterator[Sent]:
    """All that the robot sends on its drive, each 5 ms on its way."""
    optical = Rotation.from_euler("ZYX", [-np.pi / 2, 0.0, -np.pi / 2])
    end = START + len(DRIVE) - 1
    tf, kind = "/tf_static", "tf2_msgs/TFMessage"
    left = Rotation.from_euler("z", MOUNTED[2])
    yield Sent(START, tf, kind, make.transforms(START, "base_link", "camera", [0.1, -0.05, 0.3], left))
    yield Sent(START, tf, kind, make.transforms(START, "camera", "camera_optical", [0.0, 0.0, 0.0], optical))
    yield Sent(START, "/secret", "my_robot/Secret", make.make("my_robot/Secret", "x", np.ones(3, dtype=np.float32)))
    for time in np.arange(START - 0.2, end + 0.25, 0.1):
        pose = odometry_at(time)
        yield Sent(time, "/odom", "nav_msgs/Odometry", make.odometry(time, pose))
        turn = Rotation.from_euler("z", pose[2])
        yield Sent(time, "/tf", kind, make.transforms(time, "odom", "base_link", [pose[0], pose[1], 0.0], turn))
        yield Sent(time, "/pose", "geometry_msgs/PoseStamped", make.pose_stamped(time, truth_at(time)))
    for time in np.arange(START - 0.5, end + 0.75, 0.5):
        turn = Rotation.from_euler("z", ODOMETER[2])
        yield Sent(time, "/tf", kind, make.transforms(time, "map", "odom", [ODOMETER[0], ODOMETER[1], 0.0], turn))
    for i, image in enumerate(looks()[0]):
        yield Sent(START + i, RAW, "sensor_msgs/Image", make.image(START + i, image))
        yield Sent(START + i, PACKED, "sensor_msgs/CompressedImage", make.compressed(START + i, jpeg(image)))
        yield Sent(
            START + i,
            "/camera/camera_info",
            "sensor_msgs/CameraInfo",
            make.camera_info(START + i, (96, 72), FOCAL, BENT),
        )


def write_bag(folder: Path, kind: str, sent: Callable[[Messages], Iterator[Sent]] = drive) -> Path:
    """Write a bag of a kind; returns its path."""
    return written_bag(folder, kind, sent)


@pytest.fixture(scope="module")
def bags(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Bags of the drive by kind, written when they are first asked for."""
    folder = tmp_path_factory.mktemp("bags")

    @cache
    def bag(kind: str) -> Path:
        (folder / kind).mkdir()
        return write_bag(folder / kind, kind)

    return bag


COMMAND = App(result_action="return_value")
COMMAND.default(import_bag)  # by itself: the whole command line takes half a second to set up


def imported(bag: Path, out: Path, *more: str) -> Recording:
    COMMAND([str(bag), "-o", str(out), *more], exit_on_error=False)
    return Recording.load(out)


def complaint(*arguments: str | Path) -> str:
    """The one line that a mistake gets."""
    with pytest.raises(UserError) as mistake:
        COMMAND([*map(str, arguments)], exit_on_error=False)
    assert "\n" not in str(mistake.value)
    return str(mistake.value)


@pytest.mark.parametrize("kind", KINDS)
def test_a_bag_of_every_kind_gives_the_drive(kind: str, bags: Callable[[str], Path], tmp_path: Path) -> None:
    recording = imported(bags(kind), tmp_path / "drive", "--image", RAW, "--truth-tf", "map:base_link")
    listed = recording.pictures["rgb"]
    assert [picture.time for picture in listed] == [START + i for i in range(len(DRIVE))]
    for picture, image in zip(listed, looks()[0], strict=True):
        assert (read_image(picture.path) == image).all()
    assert recording.odometry is not None and recording.truth is not None
    for time in np.arange(START, START + 5.0, 0.1):
        assert recording.odometry.at(time) == pytest.approx(odometry_at(time), abs=2e-6)
        assert recording.truth.at(time) == pytest.approx(truth_at(time), abs=2e-6)
    assert recording.camera is not None and recording.lens == Lens("pinhole", FOCAL, FOCAL, 47.5, 35.5, BENT)
    assert recording.camera.hfov_deg == pytest.approx(40.0) and recording.camera.fits(looks()[0][0])
    assert [recording.mount.x, recording.mount.y, recording.mount.yaw_deg] == pytest.approx([0.1, -0.05, 90.0])


def test_compressed_pictures_are_kept_to_the_byte(bags: Callable[[str], Path], tmp_path: Path) -> None:
    recording = imported(bags("sqlite"), tmp_path / "drive", "--image", PACKED)
    written = [picture.path for picture in recording.pictures["rgb"]]
    assert [path.read_bytes() for path in written] == [jpeg(image) for image in looks()[0]]
    assert {path.suffix for path in written} == {".jpg"}


def test_check_and_localize_take_what_was_imported(
    bags: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = tmp_path / "drive"
    assert run(["import", "bag", str(bags("mcap")), "-o", str(recording)]) == 2, "there are two topics of pictures"
    assert run(["import", "bag", str(bags("mcap")), "-o", str(recording), "--image", RAW]) == 0
    the_map().save(tmp_path / "map")
    capsys.readouterr()
    assert run(["check", str(recording)]) != 2
    found = [line for line in capsys.readouterr().out.splitlines() if line.startswith("- ")]
    # Nodes are a metre apart, which is as far as steps may be: whether that is found hangs on the sixth decimal.
    others = [line for line in found if "longer than 1 m" not in line]
    assert len(others) == 1 and others[0].startswith("- note: ") and "there are 6 frames only" in others[0]
    assert run(["localize", str(tmp_path / "map"), str(recording), "-o", str(tmp_path / "run")]) == 0
    rows = [line.split(",") for line in (tmp_path / "run" / "steps.csv").read_text().splitlines()]
    assert [row[rows[0].index("node")] for row in rows[3:]] == ["N1", "N1", "N2", "N2"]


def test_without_telling_the_truth_is_the_pose_and_what_served_is_told(
    bags: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    recording = imported(bags("ros1"), tmp_path / "drive", "--image", RAW)
    assert recording.truth is not None
    assert recording.truth.at(START + 2.5) == pytest.approx(truth_at(START + 2.5), abs=2e-6)
    shown = capsys.readouterr().out
    assert "image: /camera/image_raw (sensor_msgs/Image, 6 messages)" in shown
    assert "truth: /pose (geometry_msgs/PoseStamped, " in shown
    assert "camera: 96x72, 40.0 degrees wide, a pinhole lens" in shown
    assert "mount: camera_optical on base_link: x 0.1 m, y -0.05 m, yaw 90 degrees" in shown
    assert "dropped" not in shown and "note" not in shown


def test_odometry_from_transforms_is_that_of_the_topic(bags: Callable[[str], Path], tmp_path: Path) -> None:
    more = ("--image", RAW, "--odometry-tf", "odom:base_link", "--truth", "none")
    recording = imported(bags("ros1"), tmp_path / "drive", *more)
    assert recording.odometry is not None and recording.truth is None
    assert recording.odometry.at(START + 1.23) == pytest.approx(odometry_at(START + 1.23), abs=1e-3)
    assert len(recording.odometry.times) == 55


def test_topics_are_listed_and_nothing_is_written(
    bags: Callable[[str], Path], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "160")
    COMMAND([str(bags("sqlite")), "--list"], exit_on_error=False)
    shown = capsys.readouterr().out
    cells = [[cell.strip() for cell in line.split("│")[1:-1]] for line in shown.splitlines() if line.startswith("│")]
    uses = {name: (kind, count, use) for name, kind, count, _, use in cells}
    assert uses["/odom"] == ("Odometry", "55", "odometry")
    assert uses[RAW] == ("Image", "6", "image")
    assert uses["/tf"][2] == "transforms" and uses["/pose"][2] == "truth"
    assert uses["/secret"] == ("Secret", "1", "")
    assert "camera > camera_optical" in shown and "map > odom" in shown
    assert not list(tmp_path.iterdir())


def test_a_part_and_fewer_pictures(bags: Callable[[str], Path], tmp_path: Path) -> None:
    recording = imported(bags("mcap"), tmp_path / "a", "--image", RAW, "--start", "1.0", "--end", "4.0")
    assert [picture.time for picture in recording.pictures["rgb"]] == [START + 1.0, START + 2.0, START + 3.0]
    assert recording.odometry is not None
    assert START + 0.5 <= recording.odometry.times[0] < START + 0.7
    assert START + 3.3 < recording.odometry.times[-1] <= START + 3.5
    recording = imported(bags("mcap"), tmp_path / "b", "--image", RAW, "--every", "2")
    assert [picture.time for picture in recording.pictures["rgb"]] == [START, START + 2.0, START + 4.0]


def test_several_bags_are_one(tmp_path: Path) -> None:
    for name, begin, end in (("b", 0.0, START + 2.5), ("a", START + 2.5, np.inf)):
        (tmp_path / name).mkdir()

        def part(make: Messages, begin: float = begin, end: float = end) -> Iterator[Sent]:
            return (one for one in drive(make) if begin <= one.time < end)

        write_bag(tmp_path / name, "ros1", part)
    parts = [str(tmp_path / name / "drive.bag") for name in ("a", "b")]
    COMMAND([*parts, "-o", str(tmp_path / "drive"), "--image", RAW], exit_on_error=False)
    recording = Recording.load(tmp_path / "drive")
    assert [picture.time for picture in recording.pictures["rgb"]] == [START + i for i in range(len(DRIVE))]


@pytest.mark.parametrize(("kind", "ending"), [("sqlite", ".db3"), ("mcap-storage", ".mcap")])
def test_metadata_may_be_missing(kind: str, ending: str, tmp_path: Path) -> None:
    bag = write_bag(tmp_path, kind)
    (bag / "metadata.yaml").unlink()
    assert len(imported(bag, tmp_path / "a", "--image", RAW)) == len(DRIVE)
    assert len(imported(bag / f"drive{ending}", tmp_path / "b", "--image", RAW)) == len(DRIVE)


@pytest.mark.parametrize(
    ("name", "kind", "use"),
    [
        ("/camera/color/image_raw", "sensor_msgs/Image", "image"),
        ("/depth_camera/rgb/image_raw/compressed", "sensor_msgs/CompressedImage", "image"),
        ("/camera/aligned_depth_to_color/image_raw", "sensor_msgs/Image", "depth"),
        ("/camera/depth/image_raw/compressedDepth", "sensor_msgs/CompressedImage", "depth"),
        ("/camera/depth/camera_info", "sensor_msgs/CameraInfo", ""),
        ("/move_base_simple/goal", "geometry_msgs/PoseStamped", ""),
        ("/initialpose", "geometry_msgs/PoseWithCovarianceStamped", ""),
        ("/amcl_pose", "geometry_msgs/PoseWithCovarianceStamped", "truth"),
        ("/scan", "sensor_msgs/LaserScan", ""),
    ],
)
def test_what_a_topic_could_serve_for(name: str, kind: str, use: str) -> None:
    assert use_of(Topic(name, kind, 1)) == use


@pytest.mark.parametrize(
    ("name", "straight"),
    [
        ("/camera/image_rect", True),
        ("/camera/image_rect_color/compressed", True),
        ("/camera/depth/image_rect_raw", True),
        ("/camera/image_rectified", True),
        ("/camera/image_raw", False),
        ("/camera/image_direct", False),
        ("/camera/image_uncorrected", False),
        ("/camera/image_unrectified", False),
        ("/camera/image_corrected/compressed", False),
    ],
)
def test_straightened_pictures_are_called_so(name: str, straight: bool) -> None:
    assert is_rectified(Topic(name, "sensor_msgs/Image", 1)) is straight


def test_true_poses_of_the_optical_frame_become_the_robots(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As in the bags of TUM RGB-D, whose ``/tf`` has the camera's optical frame in the world."""
    optical = Rotation.from_euler("ZYX", [-np.pi / 2, 0.0, -np.pi / 2])

    def sent(make: Messages) -> Iterator[Sent]:
        yield from drive(make)
        for time in np.arange(START - 0.2, START + len(DRIVE) - 0.8, 0.1):
            x, y, heading = compose(truth_at(time), MOUNTED)
            turn = Rotation.from_euler("z", heading) * optical
            yield Sent(time, "/tf", "tf2_msgs/TFMessage", make.transforms(time, "world", "eye", [x, y, 0.3], turn))

    bag = write_bag(tmp_path, "ros1", sent)
    recording = imported(bag, tmp_path / "drive", "--image", RAW, "--truth-tf", "world:eye")
    assert recording.truth is not None
    for time in np.arange(START, START + 5.0, 0.1):
        assert recording.truth.at(time) == pytest.approx(truth_at(time), abs=1e-3)
    shown = capsys.readouterr().out
    assert "note: the true poses are of a camera's optical frame" in shown
    assert "by the mount (x 0.1 m, y -0.05 m, yaw 90 degrees)" in shown and "does not point up" not in shown


def test_a_first_picture_of_another_size_does_not_cost_the_others(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def sent(make: Messages) -> Iterator[Sent]:
        small = make.image(START - 0.1, np.ascontiguousarray(looks()[0][0][:20, :30]))
        yield Sent(START - 0.1, RAW, "sensor_msgs/Image", small)
        yield from drive(make)

    recording = imported(write_bag(tmp_path, "mcap", sent), tmp_path / "out", "--image", RAW)
    assert [picture.time for picture in recording.pictures["rgb"]] == [START + i for i in range(len(DRIVE))]
    assert recording.camera is not None and recording.camera.width == 96
    assert "dropped: 1 x rgb picture: is not 96x72 as most are" in capsys.readouterr().out


def test_what_an_earlier_recording_left_does_not_count(bags: Callable[[str], Path], tmp_path: Path) -> None:
    (tmp_path / "drive").mkdir()
    for name in ("pan.txt", "omni.txt", "right.txt", "depth.txt", "rooms.csv", "origin.toml"):
        (tmp_path / "drive" / name).write_text("0 90\n")
    recording = imported(bags("mcap"), tmp_path / "drive", "--image", RAW, "--overwrite")
    assert recording.pan is None
    written = {path.name for path in (tmp_path / "drive").iterdir()}
    assert written == {"rgb", "rgb.txt", "odometry.txt", "groundtruth.txt", "camera.toml"}


class TestStrange:
    def test_pictures_that_cannot_serve_are_dropped_and_told(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        image = looks()[0][0]

        def sent(make: Messages) -> Iterator[Sent]:
            for time in np.arange(0.0, 6.05, 0.1):
                if not 2.0 < time < 2.95:
                    yield Sent(START + time, "/odom", "nav_msgs/Odometry", make.odometry(START + time, np.zeros(3)))
            for time, stamped in ((0.0, 0.0), (1.0, 1.0), (2.5, 2.5), (3.0, 1.0), (4.0, 4.0), (9.0, 9.0), (9.5, 9.5)):
                message = make.image(START + stamped, image)
                if time == 4.0:
                    message.data = message.data[:-5]
                yield Sent(START + time, "/image", "sensor_msgs/Image", message)
            odd = make.image(START + 5.0, image)
            odd.encoding = "infrared9"
            yield Sent(START + 5.0, "/image", "sensor_msgs/Image", odd)
            small = make.image(START + 5.5, np.ascontiguousarray(image[:36]))
            yield Sent(START + 5.5, "/image", "sensor_msgs/Image", small)

        recording = imported(write_bag(tmp_path, "sqlite", sent), tmp_path / "out")
        assert [picture.time - START for picture in recording.pictures["rgb"]] == [0.0, 1.0, 2.5]
        shown = capsys.readouterr().out
        assert "dropped: 2 x rgb picture: no odometry within 0.5 s" in shown
        assert "dropped: 1 x rgb picture: its data is cut off" in shown
        assert "dropped: 1 x rgb picture: the encoding 'infrared9' is not read" in shown
        assert "dropped: 1 x rgb picture: is not 96x72 as most are" in shown
        assert "dropped: 1 x rgb picture: another has the same time" in shown
        assert "note: /image goes back in time 1 times" in shown
        assert (
            "note: 1 pictures lie in holes of the odometry of more than 0.5 s, the longest 1.0 s, at 1002.500" in shown
        )
        assert "note: no camera info" in shown and "note: no transform tells" in shown

    def test_without_stamps_the_time_of_receipt_counts(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        def sent(make: Messages) -> Iterator[Sent]:
            for i in range(3):
                yield Sent(START + i, "/image", "sensor_msgs/Image", make.image(0.0, looks()[0][i]))
                yield Sent(START + i, "/odom", "nav_msgs/Odometry", make.odometry(START + i, np.zeros(3)))

        recording = imported(write_bag(tmp_path, "ros1", sent), tmp_path / "out")
        assert [picture.time for picture in recording.pictures["rgb"]] == pytest.approx(
            [START + i + 0.005 for i in range(3)]
        )
        assert recording.odometry is not None and list(recording.odometry.times) == [START, START + 1, START + 2]
        assert "note: /image has no stamps; the times it was received at are taken" in capsys.readouterr().out

    def test_clocks_that_never_meet(self, tmp_path: Path) -> None:
        def sent(make: Messages) -> Iterator[Sent]:
            for i in range(3):
                yield Sent(START + i, "/image", "sensor_msgs/Image", make.image(5.0 + i, looks()[0][i]))
                yield Sent(START + i, "/odom", "nav_msgs/Odometry", make.odometry(START + i, np.zeros(3)))

        bag = write_bag(tmp_path, "mcap", sent)
        told = complaint(bag, "-o", tmp_path / "out")
        assert "pictures are of 5.0 to 7.0 s, odometry of 1000.0 to 1002.0 s" in told and "--time received" in told
        assert len(imported(bag, tmp_path / "out", "--time", "received")) == 3

    @pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
    def test_messages_that_do_not_decode(self, kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        def sent(make: Messages) -> Iterator[Sent]:
            for i in range(8):
                time = START + 0.5 * i
                yield Sent(time, "/image", "sensor_msgs/Image", make.image(time, looks()[0][1]))
                yield Sent(time, "/odom", "nav_msgs/Odometry", make.odometry(time, np.zeros(3)))
                if i < 6:
                    yield Sent(time, "/pose", "geometry_msgs/PoseStamped", make.pose_stamped(time, np.zeros(3)))
            yield Sent(START + 1.0, "/image", "sensor_msgs/Image", bytes(30))
            yield Sent(START + 1.0, "/odom", "nav_msgs/Odometry", b"\x00\x01\x00\x00abc")
            yield Sent(
                START + 1.1, "/odom", "nav_msgs/Odometry", make.odometry(START + 1.1, np.array([np.nan, 0.0, 0.0]))
            )

        assert len(imported(write_bag(tmp_path, kind, sent), tmp_path / "out")) == 8
        shown = capsys.readouterr().out
        assert "dropped: 1 x rgb picture: its message does not decode" in shown
        assert "dropped: 1 x message: of /odom does not decode" in shown
        assert "dropped: 1 x odometer pose: is not finite, or its quaternion is zero" in shown
        assert "note: 1 pictures are before or after the true poses, which are of 1000.0 to 1002.5 s" in shown

    def test_depth_and_the_right_camera_go_with_their_picture(self, tmp_path: Path) -> None:
        depth = np.array([[1000, 0], [2500, 60000]], dtype=np.uint16)

        def sent(make: Messages) -> Iterator[Sent]:
            for time in (0.0, 1.0, 1.5):
                message = make.image(START + time, looks()[0][1])
                if time < 1.5:
                    yield Sent(START + time, "/left/image_rect", "sensor_msgs/Image", message)
                yield Sent(START + time, "/right/image_rect", "sensor_msgs/Image", message)
                far = make.image(START + time, depth.view(np.uint8))
                far.encoding, far.height, far.width, far.step, far.data = (
                    "16UC1",
                    2,
                    2,
                    4,
                    depth.view(np.uint8).reshape(-1),
                )
                yield Sent(START + time, "/depth/image", "sensor_msgs/Image", far)
                for side, shift in (("left", 0.0), ("right", -0.12 * FOCAL)):
                    info = camera_info(make, START + time)
                    (info.P if make.ros1 else info.p)[3] = shift
                    yield Sent(START + time, f"/{side}/camera_info", "sensor_msgs/CameraInfo", info)

        more = (
            "--image",
            "/left/image_rect",
            "--right",
            "/right/image_rect",
            "--depth",
            "/depth/image",
            "--odometry",
            "none",
        )
        recording = imported(write_bag(tmp_path, "ros1", sent), tmp_path / "out", *more)
        assert {kind: len(listed) for kind, listed in recording.pictures.items()} == {"rgb": 2, "right": 2, "depth": 2}
        assert recording.baseline_m == pytest.approx(0.12)
        assert recording.lens is None, "rectified pictures are straight"
        frame = next(iter(recording))
        assert frame.images["depth"].tolist() == [[5000, 0], [12500, 0]]
        assert (frame.images["right"] == looks()[0][1]).all()


class TestMistakes:
    def test_topics(self, bags: Callable[[str], Path], tmp_path: Path) -> None:
        bag, out = bags("sqlite"), ("-o", tmp_path / "out")
        told = complaint(bag, *out)
        assert f"{RAW} (sensor_msgs/Image, 6 messages), {PACKED}" in told and "choose one with --image TOPIC" in told
        assert "no topic is called '/odo'; choose from: /odom, /pose" in complaint(
            bag, *out, "--image", RAW, "--odometry", "/odo"
        )
        told = complaint(bag, *out, "--image", "/odom")
        assert "--image /odom: is /odom (nav_msgs/Odometry, 55 messages)" in told
        told = complaint(bag, *out, "--image", RAW, "--truth-tf", "mapp:base_link")
        assert "no transform leads from mapp to base_link; the bag has: base_link > camera, camera >" in told
        assert "as in map:base_link" in complaint(bag, *out, "--image", RAW, "--truth-tf", "map")
        assert "give one of them" in complaint(bag, *out, "--truth", "/pose", "--truth-tf", "map:base_link")
        assert "the end last" in complaint(bag, *out, "--start", "3", "--end", "2")
        assert "-o DIR" in complaint(bag)
        assert not list(tmp_path.iterdir())

    def test_no_pictures(self, tmp_path: Path) -> None:
        bag = write_bag(tmp_path, "mcap", lambda make: (one for one in drive(make) if "image" not in one.topic))
        assert "no topic has pictures" in complaint(bag, "-o", tmp_path / "out")

    @pytest.mark.parametrize("kind", ["ros1", "sqlite", "mcap"])
    def test_no_messages(self, kind: str, tmp_path: Path) -> None:
        bag = write_bag(tmp_path, kind, lambda make: iter(()))
        assert "holds no messages" in complaint(bag, "-o", tmp_path / "out")

    @pytest.mark.parametrize(
        ("kind", "name", "remedy"),
        [("ros1", "", "rosbag reindex"), ("mcap", "drive.mcap", "mcap recover"), ("sqlite", "drive.db3", ".recover")],
    )
    @pytest.mark.parametrize("share", [0.2, 0.5, 0.97])
    def test_cut_off(self, kind: str, name: str, remedy: str, share: float, tmp_path: Path) -> None:
        whole = write_bag(tmp_path, kind)
        file = whole / name if name else whole
        file.write_bytes(file.read_bytes()[: int(share * file.stat().st_size)])
        left = sorted(tmp_path.iterdir())
        assert remedy in complaint(file, "-o", tmp_path / "out", "--image", RAW)
        assert sorted(tmp_path.iterdir()) == left

    def test_damage_in_the_middle(self, tmp_path: Path) -> None:
        file = write_bag(tmp_path, "mcap-storage") / "drive.mcap"
        data = bytearray(file.read_bytes())
        data[len(data) // 2 : len(data) // 2 + 50] = bytes(50)
        file.write_bytes(data)
        assert "is damaged" in complaint(file, "-o", tmp_path / "out", "--image", RAW)
        assert not (tmp_path / "out").exists()

    def test_no_bags(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        out = ("-o", tmp_path / "out")
        assert "no such file or folder" in complaint(tmp_path / "a.bag", *out)
        (tmp_path / "empty.bag").touch()
        assert "is empty" in complaint(tmp_path / "empty.bag", *out)
        (tmp_path / "text.bag").write_text("this is a letter to my robot")
        assert "is no bag of ROS 1 or ROS 2" in complaint(tmp_path / "text.bag", *out)
        (tmp_path / "folder").mkdir()
        assert "holds no bag" in complaint(tmp_path / "folder", *out)
        (tmp_path / "folder" / "a.db3.zstd").touch()
        assert "holds compressed files, but no metadata.yaml" in complaint(tmp_path / "folder", *out)
        monkeypatch.setitem(sys.modules, "rosbags.rosbag1", None)
        assert 'pip install "topoloc[ros]"' in complaint(tmp_path / "text.bag", *out)
        assert not (tmp_path / "out").exists()

    def test_compression_that_is_not_read(self, tmp_path: Path) -> None:
        bag = write_bag(tmp_path, "sqlite-message")
        told = (bag / "metadata.yaml").read_text()
        (bag / "metadata.yaml").write_text(told.replace("zstd", "lz4"))
        assert "'lz4' is not supported" in complaint(bag, "-o", tmp_path / "out")
        (bag / "metadata.yaml").unlink()
        told = complaint(bag, "-o", tmp_path / "out", "--image", RAW)
        assert "metadata.yaml" in told
