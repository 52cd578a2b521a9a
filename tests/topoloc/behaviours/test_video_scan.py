"""Taking a panorama on a stub of a robot: imprecise steps, turns that end short, and what cannot close."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

from topoloc.behaviours import Engine, ScannedCircle, ScanSettings, VideoScan, add_node, save_node
from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 96, 72)
BLOCKS = np.random.default_rng(7).integers(0, 256, (9, 108, 3)).astype(np.uint8)
CIRCLE: Image = BLOCKS.repeat(8, axis=0).repeat(8, axis=1)
"""What the stub sees: columns clockwise, the left edge of the first has heading 0."""
UNFILTERED = {"clahe": False}
MOST_ACTIONS = 60


@dataclass
class Stub:
    """A robot in the middle of ``CIRCLE``.

    Attributes:
        heading: true one [rad].
        gain: true turn for each told one.
        sd: standard deviation of a turn [rad].
        reading: what the odometer says for each true turn.
        pan: of the camera on the robot [rad].
        kind: of its pictures.
        seen: true headings of the optical axis at each look.
    """

    heading: float = 0.7
    gain: float = 1.0
    sd: float = 0.0
    reading: float = 1.0
    pan: float = 0.0
    kind: str = "rgb"
    seen: list[float] = field(default_factory=list)
    _said: float = 2.5
    _rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(3))

    def odometry(self) -> Floats:
        return np.array([4.0, -1.0, float(wrap(self._said))])

    def turn(self, angle: float) -> None:
        turned = self.gain * angle + self._rng.normal(0.0, self.sd)
        self.heading += turned
        self._said += self.reading * turned

    def look(self) -> Frame:
        axis = self.heading + self.pan
        self.seen.append(axis)
        columns = CIRCLE.shape[1]
        left = round(-axis / (2.0 * np.pi) * columns - CAMERA.width / 2.0)
        window = np.take(CIRCLE, range(left, left + CAMERA.width), axis=1, mode="wrap")
        return Frame(float(len(self.seen)), self.odometry(), np.array([0.1, 0.0, self.pan]), {self.kind: window})


class Slipping(Stub):
    """Its wheels turn, and the odometer with them; the robot does not."""

    def turn(self, angle: float) -> None:
        self._said += angle


def falling_short(degrees: float) -> Stub:
    """A robot whose odometer says what it was told, while its turn of 360 degrees falls so much short."""
    share = (360.0 - degrees) / 360.0
    return Stub(gain=share, reading=1.0 / share)


def scanned(robot: Stub, settings: ScanSettings | None = None, start: float = 0.7) -> ScannedCircle:
    scan = VideoScan(robot, start, settings, UNFILTERED)
    scan.init()
    for _ in range(MOST_ACTIONS):
        if not scan.action():
            return scan.circle
    raise AssertionError("the scan does not end")


def worst_deg(headings: Floats, truth: list[float]) -> float:
    return float(np.rad2deg(np.abs(wrap(headings - np.array(truth[: len(headings)]))).max()))


def off_truth_deg(circle: ScannedCircle) -> float:
    """How far the panorama must be rolled to lie on ``CIRCLE``, beside what its heading says [degrees]."""
    columns = CIRCLE.shape[1]
    roll = round(-circle.heading / (2.0 * np.pi) * columns)
    expected = np.roll(CIRCLE, -roll, axis=1).mean(axis=2)
    found = circle.panorama.mean(axis=2)
    spectrum = np.fft.rfft(expected, axis=1).conj() * np.fft.rfft(found, axis=1)
    shift = int(np.fft.irfft(spectrum, columns, axis=1).sum(axis=0).argmax())
    return float(abs((shift + columns / 2) % columns - columns / 2) * 360.0 / columns)


def test_an_exact_robot() -> None:
    """A 13th snapshot shows that the circle is closed, and is no part of the panorama."""
    robot = Stub()
    circle = scanned(robot)
    assert len(robot.seen) == 13 and len(circle.headings) == 12
    assert np.rad2deg(circle.turned) == pytest.approx(30.0 * np.arange(13))
    assert np.rad2deg(circle.turn) == pytest.approx(360.0, abs=0.5)
    assert worst_deg(circle.headings, robot.seen) < 1.0
    assert circle.panorama.shape == (72, 864, 3) and circle.panorama.any(axis=(0, 2)).all()
    assert (circle.camera, circle.filtered) == (CAMERA, False)
    assert circle.headings[0] == pytest.approx(0.7, abs=1e-9)
    assert circle.heading == pytest.approx(0.7 + np.deg2rad(20.0), abs=1e-9)
    assert off_truth_deg(circle) < 1.0


def test_the_first_snapshot_looks_where_the_camera_on_the_robot_does() -> None:
    circle = scanned(Stub(pan=-0.4))
    assert circle.headings[0] == pytest.approx(0.3, abs=1e-9)
    assert off_truth_deg(circle) < 1.0


@pytest.mark.parametrize("gain", [0.6, 0.85, 1.15, 1.4])
def test_steps_are_turned_until_the_odometer_says_so(gain: float) -> None:
    """Wheels that undershoot are told again, those that overshoot are turned back; there are chances besides."""
    robot = Stub(gain=gain, sd=np.deg2rad(1.0))
    circle = scanned(robot)
    steps = np.rad2deg(np.diff(circle.turned))
    assert np.abs(steps - 30.0).max() <= 4.0 and steps.std() > 0.1
    assert worst_deg(circle.headings, robot.seen) < 1.5 and off_truth_deg(circle) < 1.5


@pytest.mark.parametrize("short", [-10.0, 5.0, 10.0, 15.0, 20.0])
def test_the_pictures_tell_how_far_it_turned(short: float) -> None:
    """The thesis's robot, 5.1.2: when its odometer says 360 degrees it has turned 340 to 350; or more than a circle."""
    robot = falling_short(short)
    circle = scanned(robot)
    turned = np.rad2deg(np.array(robot.seen[0]) - np.array(robot.seen))
    assert np.rad2deg(circle.turn) == pytest.approx(turned[-1], abs=1.0)
    used = turned[: len(circle.headings)]
    assert 0.0 < 360.0 - used[-1] <= CAMERA.hfov_deg, "the last view that is used must reach the first"
    assert worst_deg(circle.headings, robot.seen) < 1.5 and off_truth_deg(circle) < 1.5


def test_a_turn_that_ends_short_is_closed_by_a_snapshot_more() -> None:
    """Twelve of them end 44 degrees before the first, more than a view."""
    assert [len(scanned(falling_short(degrees)).headings) for degrees in (0.0, 15.0)] == [12, 13]


@pytest.mark.parametrize(
    ("robot", "says"),
    [
        (Stub(gain=0.0), r"does not turn as told: after 5 commands its odometer says 0\.0 of 30 degrees; look at"),
        (Stub(gain=0.05), r"does not turn as told: .* of 30 degrees"),
        (Stub(reading=-1.0), r"does not turn as told: .* of 30 degrees; .*counter-clockwise is positive"),
        (Slipping(), r"stands still: its odometer says 30 degrees, and snapshot 2 shows what the one before it does"),
        (Stub(gain=0.5, reading=2.0), r"the pictures do not close: \d+ snapshots over \d+ degrees .*; take them"),
        (Stub(kind="omni"), r"a scan needs rgb pictures, the robot's frames have omni; name"),
    ],
    ids=["no turn", "hardly a turn", "odometer reversed", "slipping", "odometer twice as fast", "no pictures"],
)
def test_what_cannot_close_is_one_clear_line(robot: Stub, says: str) -> None:
    with pytest.raises(UserError, match=says) as caught:
        scanned(robot)
    assert "\n" not in str(caught.value) and len(robot.seen) <= ScanSettings.most_snapshots


def test_a_wrong_field_of_view_is_told() -> None:
    says = r"the pictures do not close: .*places snapshot \d+ \d\d degrees from the odometer's .*correct hfov_deg"
    with pytest.raises(UserError, match=says):
        scanned(Stub(), ScanSettings(hfov_deg=50.0))


def test_an_engine_runs_it_to_its_end() -> None:
    scan = VideoScan(Stub(), 0.7, method_settings=UNFILTERED)
    with pytest.raises(ValueError, match="the scan is not done"):
        _ = scan.circle
    with Engine() as engine:
        engine.run(scan, 60.0)
    assert len(scan.circle.headings) == 12
    with Engine() as engine, pytest.raises(UserError, match="does not turn"):
        engine.run(VideoScan(Stub(gain=0.0), 0.7), 60.0)


def test_a_scan_may_be_run_again() -> None:
    """After its end, and after a failure that somebody has mended, it begins with the first snapshot."""
    robot = Stub()
    scan = VideoScan(robot, 0.7, method_settings=UNFILTERED)
    with Engine() as engine:
        engine.run(scan, 60.0)
        first, looks = scan.circle, len(robot.seen)
        robot.gain = 0.0
        with pytest.raises(UserError, match="does not turn"):
            engine.run(scan, 60.0)
        robot.gain = 1.0
        robot.seen.clear()
        engine.run(scan, 60.0)
    assert scan.circle is not first
    assert (len(robot.seen), len(scan.circle.headings)) == (looks, 12)


@pytest.mark.parametrize("grey", [False, True])
def test_a_filtered_panorama_says_so(grey: bool) -> None:
    """Of a camera that gives grey pictures, too."""

    class Eye(Stub):
        def look(self) -> Frame:
            frame = super().look()
            return replace(frame, images={"rgb": frame.images["rgb"].mean(axis=2).astype(np.uint8)}) if grey else frame

    for clahe in (True, False):
        scan = VideoScan(Eye(), 0.7, method_settings={"clahe": clahe})
        Engine().run(scan, 60.0)
        assert scan.circle.filtered is clahe
        assert scan.circle.panorama.ndim == (2 if grey or clahe else 3)


def test_pictures_of_two_sizes_are_refused() -> None:
    class Zooming(Stub):
        def look(self) -> Frame:
            frame = super().look()
            rows = slice(None, None, len(self.seen))
            return replace(frame, images={"rgb": frame.images["rgb"][rows]})

    with pytest.raises(UserError, match=r"pictures of \(72, 96, 3\) and \(36, 96, 3\); keep one size"):
        scanned(Zooming())


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: ScanSettings(hfov_deg=0.0), "hfov_deg is 0.0"),
        (lambda: ScanSettings(step_deg=36.0), r"step_deg is 36\.0.*comes to 42\.4 degrees"),
        (lambda: ScanSettings(tolerance_deg=0.0), "tolerance_deg is 0.0"),
        (lambda: ScanSettings(odometer_error=0.6), "odometer_error"),
        (lambda: ScanSettings(astray_deg=0.0), "astray_deg is 0.0"),
        (lambda: ScanSettings(overlap_deg=40.0), r"overlap_deg is 40\.0"),
        (lambda: ScanSettings(most_snapshots=8), "most_snapshots"),
        (lambda: ScanSettings(most_commands=0), "most_commands"),
    ],
)
def test_settings_say_what_must_hold(make: Callable[[], ScanSettings], says: str) -> None:
    with pytest.raises(ValueError, match=says):
        make()


class TestOnAMap:
    circle = ScannedCircle(CIRCLE, 0.5, CAMERA, False, np.zeros(12), np.zeros(13), 0.0)

    def test_nodes_are_added_and_replaced(self) -> None:
        one = add_node(None, self.circle.node("A", 0.0, 1.0), self.circle, "room")
        assert (one.name, one.camera, one.filtered) == ("room", CAMERA, False)
        assert (one.nodes[0].id, one.nodes[0].name, one.nodes[0].heading) == ("A", "A", 0.5)
        two = add_node(one, self.circle.node("B", 1.0, 1.0, "desk"), self.circle)
        assert [node.id for node in two.nodes] == ["A", "B"] and np.asarray(two.edges).tolist() == [[0, 1]]
        newer = replace(self.circle, heading=-0.5)
        again = add_node(two, newer.node("A", 0.0, 1.0), newer)
        assert [(node.id, node.heading) for node in again.nodes] == [("A", -0.5), ("B", 0.5)]

    def test_edges_that_were_given_stay(self) -> None:
        nodes = tuple(Node(name, name, float(x), 0.0) for x, name in enumerate("ABC"))
        ring = TopoMap("m", CAMERA, nodes, np.array([[0, 2]]))
        grown = add_node(ring, self.circle.node("D", 3.0, 0.0), self.circle)
        assert np.asarray(grown.edges).tolist() == [[0, 2]]

    @pytest.mark.parametrize("other", [{"camera": Camera(50.0, 96, 72)}, {"filtered": True}])
    def test_panoramas_of_another_kind_do_not_mix(self, other: dict[str, object]) -> None:
        one = add_node(None, self.circle.node("A", 0.0, 1.0), self.circle)
        strange = replace(self.circle, **other)  # type: ignore[arg-type]
        with pytest.raises(UserError, match="scan with the same camera"):
            add_node(one, strange.node("B", 1.0, 1.0), strange)

    def test_saved_one_by_one(self, tmp_path: Path) -> None:
        for x, name in enumerate("ABA"):
            saved = save_node(tmp_path / "map", self.circle.node(name, float(x), 0.0), self.circle)
        read = TopoMap.load(tmp_path / "map")
        assert [(node.id, node.x) for node in read.nodes] == [("A", 2.0), ("B", 1.0)]
        assert read.name == saved.name == "map" and np.asarray(read.edges).tolist() == [[0, 1]]
        for node in read.nodes:
            assert node.panorama is not None and np.array_equal(node.panorama, CIRCLE)

    def test_a_folder_of_something_else_is_left_alone(self, tmp_path: Path) -> None:
        (tmp_path / "mine.txt").write_text("mine")
        with pytest.raises(InputError, match=r"map\.toml"):
            save_node(tmp_path, self.circle.node("A", 0.0, 0.0), self.circle)
        assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]
