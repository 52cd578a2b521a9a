"""What a robot can do before its next look, what a sensor says of a map's views, and the loop."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from sensors import IMA, ColorHistogram
from sensors.images import cut_views
from topoloc.active import Action, ActiveLocalizer, ViewEvidence, orientations, pans, turns, view_evidence
from topoloc.errors import UserError
from topoloc.geometry import compose
from topoloc.localizer import Localizer
from topoloc.odometry import MotionGate
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Evidence, Frame, Image, Status, WeightedPoses

CAMERA = Camera(60.0, 40, 30)
MOUNT = np.array([0.1, 0.0, 0.2])


def some_image(seed: int, columns: int = 40) -> Image:
    return np.random.default_rng(seed).integers(0, 256, (30, columns, 3)).astype(np.uint8)


def map_of(nodes: int = 2, panoramas: bool = True, views: Sequence[View] = ()) -> TopoMap:
    places = [
        Node(str(k), f"place {k}", 3.0 * k, 1.0, 0.7 * k, some_image(k, 240) if panoramas else None)
        for k in range(nodes)
    ]
    return TopoMap("some places", CAMERA, tuple(places), views=tuple(views))


class Seer:
    """A sensor that remembers what it is shown and says of each frame where the camera could be."""

    def __init__(self, *needs: str, match: float = 0.9) -> None:
        self.needs, self.frames, self.match = frozenset(needs or ("rgb",)), list[Frame](), match

    def fit(self, topo_map: TopoMap) -> None:
        """Nothing to prepare."""

    def observe(self, frame: Frame) -> Evidence:
        self.frames.append(frame)
        if not frame.images["rgb"].any():
            return Evidence.blind()
        one = np.ones(1)
        pose = compose(np.array([[3.0, 1.0, 0.5]]), frame.camera)
        return Evidence(pose, np.array([1]), self.match * one, 0.1 * one, 2.0 * one, 0.3 * one, 20.0 * one)


class Believer:
    """An estimator whose belief is set from outside."""

    def __init__(self, belief: WeightedPoses) -> None:
        self.belief, self.updates = belief, 0

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Forgets nothing."""

    def predict(self, motion: object) -> None:
        """Moves nothing."""

    def update(self, evidence: Evidence) -> None:
        self.updates += 1


class First:
    """Takes the first action, and remembers among which."""

    def __init__(self) -> None:
        self.offered = list[list[Action]]()

    def choose(self, belief: WeightedPoses, actions: Sequence[Action]) -> int:
        self.offered.append(list(actions))
        return 0


DOUBT = WeightedPoses.uniform([(0.0, 1.0, 0.0), (3.0, 1.0, 0.0)], (0.01, 0.01, 0.01))
CERTAINTY = WeightedPoses.uniform([(3.0, 1.0, 0.0)], (0.01, 0.01, 0.01))


class Turntable:
    """A robot that does exactly what it is told; a picture of its own each time."""

    def __init__(self, odometry: bool = True) -> None:
        self.pose, self.camera, self.looks, self.has_odometry = np.zeros(3), MOUNT, 0, odometry

    def look(self, action: Action) -> Frame:
        self.pose, self.camera = compose(self.pose, action.motion), action.camera
        return self.frame()

    def frame(self) -> Frame:
        self.looks += 1
        odometry = self.pose if self.has_odometry else None
        return Frame(float(self.looks), odometry, self.camera, {"rgb": some_image(self.looks)})


def active(actions: Sequence[Action], belief: WeightedPoses = DOUBT) -> tuple[ActiveLocalizer, Believer, First]:
    estimator, selection = Believer(belief), First()
    return ActiveLocalizer(Localizer(map_of(), Seer(), estimator), selection, actions), estimator, selection


# --- actions --------------------------------------------------------------------------------------------------------


def test_orientations_go_round_the_circle_from_straight_ahead() -> None:
    angles = orientations()
    assert len(angles) == 22
    assert angles[0] == 0.0
    assert np.diff(np.unwrap(angles)) == pytest.approx(2.0 * np.pi / 22.0)
    assert ((angles >= -np.pi) & (angles < np.pi)).all()


def test_a_pan_turns_the_camera_and_not_the_robot() -> None:
    left, right = pans(np.deg2rad([90.0, -175.0]), MOUNT)
    assert left.motion == pytest.approx(0.0)
    assert left.camera == pytest.approx([0.1, 0.0, 0.2 + np.pi / 2.0])
    assert right.camera == pytest.approx([0.1, 0.0, 0.2 - np.deg2rad(175.0)])
    assert len(pans()) == 22


def test_a_turn_turns_the_robot_and_not_the_camera_on_it() -> None:
    (turn,) = turns(np.deg2rad([30.0]), MOUNT)
    assert turn.motion == pytest.approx([0.0, 0.0, np.pi / 6.0])
    assert turn.camera == pytest.approx(MOUNT)
    assert len(turns()) == 22


@pytest.mark.parametrize("pose", [(1.0, 2.0), (0.0, 0.0, np.nan), ((0.0, 0.0, 0.0),)])
def test_an_action_is_two_poses(pose: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match="motion is"):
        Action(np.array(pose), MOUNT)
    with pytest.raises(ValueError, match="camera is"):
        Action(MOUNT, np.array(pose))


def test_an_action_does_not_change_later() -> None:
    motion = np.zeros(3)
    action = Action(motion, MOUNT)
    motion[0] = 1.0
    assert action.motion[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        action.motion[0] = 1.0


# --- what a sensor says of the views ----------------------------------------------------------------------------------


def test_views_are_shown_once_as_frames_of_the_robots_camera() -> None:
    views = [View(np.array([k, 0.5, 0.1 * k]), some_image(10 + k)) for k in range(3)]
    sensor = Seer()
    seen = view_evidence(map_of(views=views), sensor, MOUNT)
    assert len(sensor.frames) == 3
    for frame, view in zip(sensor.frames, views, strict=True):
        assert np.array_equal(frame.images["rgb"], view.image)
        assert frame.camera == pytest.approx(MOUNT)
    assert seen.view.tolist() == [0, 1, 2]
    assert seen.log_floors == pytest.approx(-4.0)


def test_stereo_views_show_both_pictures() -> None:
    views = [View(np.zeros(3), some_image(1), right=some_image(2))]
    sensor = Seer("rgb", "right")
    view_evidence(map_of(views=views), sensor)
    assert np.array_equal(sensor.frames[0].images["right"], some_image(2))


def test_a_map_of_panoramas_shows_the_windows_that_view_sensors_train_on() -> None:
    topo_map, sensor = map_of(), Seer()
    view_evidence(topo_map, sensor)
    expected = [
        image
        for node in topo_map.nodes
        if node.panorama is not None
        for image, _ in cut_views(node.panorama, node.heading, CAMERA)
    ]
    assert len(sensor.frames) == len(expected) == 48
    for frame, image in zip(sensor.frames, expected, strict=True):
        assert np.array_equal(frame.images["rgb"], image)


@pytest.mark.parametrize("make", [IMA, ColorHistogram])
@pytest.mark.parametrize("mount", [np.zeros(3), MOUNT])
def test_a_window_is_known_again_where_it_was_cut(make: type[IMA | ColorHistogram], mount: np.ndarray) -> None:
    """The best hypothesis of each window is its node, its heading, and the camera ahead of the robot's axis there."""
    topo_map, sensor = map_of(), make()
    sensor.fit(topo_map)
    seen = view_evidence(topo_map, sensor, mount)
    headings = np.concatenate(
        [[axis for _, axis in cut_views(node.panorama, node.heading, CAMERA)] for node in topo_map.nodes]  # type: ignore[arg-type]
    )
    robots = np.column_stack([np.repeat(topo_map.positions, 24, axis=0), headings - mount[2]])
    best = [np.flatnonzero(seen.view == k)[seen.log_likelihoods[seen.view == k].argmax()] for k in range(48)]
    expected = compose(robots, mount)
    assert np.abs(seen.poses[best, :2] - expected[:, :2]).max() < 1e-2
    # a column of 72 is 0.8 degrees wide here, and the view is shifted by up to one when it is scaled
    assert np.cos(seen.poses[best, 2] - expected[:, 2]).min() > np.cos(np.deg2rad(2.0))


def test_a_view_that_stands_among_many_counts_less() -> None:
    one = Seer().observe(Turntable().frame())
    poses = np.array([(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (0.0, 0.0, np.pi)])
    assert ViewEvidence.of([one] * 4, poses).weights == pytest.approx([0.5, 0.5, 1.0, 1.0])


def test_a_blind_view_has_no_hypothesis_and_is_likely_everywhere() -> None:
    one, dark = Seer().observe(Turntable().frame()), Evidence.blind()
    seen = ViewEvidence.of([dark, one, dark], np.zeros((3, 3)))
    assert seen.view.tolist() == [1]
    assert seen.log_floors == pytest.approx([0.0, -4.0, 0.0])
    assert ViewEvidence.of([dark], np.zeros((1, 3))).weights == pytest.approx([1.0])
    with pytest.raises(ValueError, match="one view at least"):
        ViewEvidence.of([], np.zeros((0, 3)))


def test_a_map_without_what_is_needed_is_refused() -> None:
    with pytest.raises(UserError, match="neither training views nor panoramas"):
        view_evidence(map_of(panoramas=False), Seer())
    with pytest.raises(UserError, match="no omni images"):
        view_evidence(map_of(), Seer("omni"))


# --- the loop -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("actions", "odometry"),
    [(pans(camera=MOUNT), True), (turns(camera=MOUNT), True), (pans(camera=MOUNT), False)],
    ids=["pans", "turns", "pans without an odometer"],
)
def test_no_direction_is_looked_at_twice(actions: list[Action], odometry: bool) -> None:
    robot, directions = Turntable(odometry), []
    localizer, estimator, selection = active(actions)
    localizer.step(robot.frame())
    while (action := localizer.next_action()) is not None:
        localizer.step(robot.look(action))
        directions.append(float(compose(robot.pose, robot.camera)[2]))
    assert len(directions) == 21  # and the first look makes 22
    assert [len(actions) for actions in selection.offered] == list(range(21, 0, -1))
    assert estimator.updates == 22  # every look counted
    turned = np.sort(np.rad2deg(np.array(directions) - MOUNT[2]) % 360.0)
    assert turned == pytest.approx(np.arange(1, 22) * 360.0 / 22.0)


def test_it_ends_when_localized() -> None:
    robot = Turntable()
    localizer, estimator, _ = active(pans(camera=MOUNT), CERTAINTY)
    estimate = localizer.run(robot, robot.frame())
    assert estimate.status is Status.LOCALIZED
    assert robot.looks == 1
    assert localizer.next_action() is None
    estimator.belief = DOUBT  # and goes on when it is in doubt again
    localizer.step(robot.look(pans(np.array([1.0]), MOUNT)[0]))
    assert localizer.next_action() is not None


def test_it_ends_after_so_many_looks_or_when_all_was_seen() -> None:
    for most, taken in ((1, 1), (5, 5), (100, 22)):
        robot = Turntable()
        localizer, _, _ = active(turns(camera=MOUNT))
        assert localizer.run(robot, robot.frame(), most).status is not Status.LOCALIZED
        assert robot.looks == taken


def test_what_was_seen_elsewhere_is_new_here() -> None:
    robot = Turntable()
    localizer, _, selection = active(pans(camera=MOUNT))
    localizer.run(robot, robot.frame())
    assert localizer.next_action() is None
    localizer.step(robot.look(Action(np.array([0.5, 0.0, 0.0]), MOUNT)))
    assert localizer.next_action() is not None
    assert len(selection.offered[-1]) == 21


def test_before_the_first_look_everything_is_new() -> None:
    localizer, _, selection = active(pans(camera=MOUNT))
    assert localizer.next_action() is not None
    assert len(selection.offered[-1]) == 22


def test_the_motion_gate_tells_which_looks_are_the_same() -> None:
    estimator, selection = Believer(DOUBT), First()
    inner = Localizer(map_of(), Seer(), estimator, gate=MotionGate(min_rotation_deg=40.0))
    localizer = ActiveLocalizer(inner, selection, pans(camera=MOUNT))
    robot = Turntable()
    localizer.step(robot.frame())
    localizer.next_action()
    assert len(selection.offered[-1]) == 17  # 16.4 and 32.7 degrees to either side are the same, and the look itself


def test_a_dark_look_is_not_taken_again() -> None:
    localizer, _, selection = active(pans(camera=MOUNT))
    dark = {"rgb": np.zeros((30, 40, 3), dtype=np.uint8)}
    localizer.step(Frame(0.0, np.zeros(3), MOUNT, dark))
    localizer.next_action()
    assert len(selection.offered[-1]) == 21


def test_the_page_on_active_localization_runs(capsys: pytest.CaptureFixture[str]) -> None:
    page = (Path(__file__).parents[2] / "docs" / "active.md").read_text()
    (code,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    exec(compile(code, "active.md", "exec"), {})
    (promised,) = re.findall(r"It prints `([^`]+)`", page)
    assert capsys.readouterr().out.strip() == promised
