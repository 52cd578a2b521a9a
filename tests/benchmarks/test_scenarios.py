"""The benchmark's own scenarios are what they say, and a folder's is what lies in it."""

from __future__ import annotations

import pickle
import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from benchmarks.cli.simulate import simulate
from benchmarks.scenarios import DEFAULT, Case, make_scenario, scenario_names
from benchmarks.scenarios.recorded import recorded
from benchmarks.scenarios.simulated import map_of
from benchmarks.worlds.image_grid import ImageGridWorld
from benchmarks.worlds.office import OfficeWorld
from benchmarks.worlds.world import World
from topoloc.errors import InputError, UnknownName, UserError
from topoloc.geometry import Floats
from topoloc.localizer import Localizer, Step
from topoloc.metrics import Run, evaluate
from topoloc.plugins import WORLDS, make, make_estimator, make_sensor
from topoloc.recording_folder import RecordingWriter
from topoloc.testing import toy_map
from topoloc.thesis_map import save_thesis_map
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Pixels

NAMES = (
    "lab-fresh",
    "lab-old",
    "lab-people",
    "lab-lights",
    "lab-kidnapped",
    "twins",
    "building",
    "office-stereo",
    "hall-omni",
)
KINDS = {"office-stereo": {"rgb", "right"}, "hall-omni": {"omni"}}
NODES = {"twins": 20, "building": 103, "office-stereo": 18, "hall-omni": 50}
JUMP_M = 1.0
"""No robot of ours drives as far from one frame to the next [m]."""
CAMERA = Camera(40.0, 8, 6)


@pytest.fixture
def maps_without_pictures(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Making their pictures takes most of a drive's time, and tells nothing of the drive."""
    for world in (World, OfficeWorld, ImageGridWorld):
        monkeypatch.setattr(world, "topo_map", lambda self, seed: self.layout())
    map_of.cache_clear()
    yield
    map_of.cache_clear()


def jumps(truth: Floats) -> list[int]:
    """The frames at which the robot is farther from where it was than it drives."""
    return [int(i) + 1 for i in np.flatnonzero(np.linalg.norm(np.diff(truth[:, :2], axis=0), axis=1) > JUMP_M)]


def pictures(case: Case, index: int) -> list[bytes]:
    return [case.frames[index].images[kind].tobytes() for kind in sorted(case.kinds)]


def test_they_come_in_one_order_and_the_default_ones_are_three_of_them() -> None:
    assert scenario_names() == NAMES
    assert DEFAULT == ("lab-fresh", "lab-people", "lab-kidnapped")


@pytest.mark.usefixtures("maps_without_pictures")
@pytest.mark.parametrize("updates", [4, 20])
@pytest.mark.parametrize("name", NAMES)
def test_a_drive_is_what_its_scenario_says(name: str, updates: int) -> None:
    scenario = make_scenario(name, updates)
    case = scenario.make(2)
    assert scenario.name == name and not scenario.recorded
    frames = 2 * updates if name == "twins" else updates
    assert scenario.settings["updates"] == frames
    assert len(case.frames) == len(case.truth) == frames
    assert len(case.topo_map.nodes) == NODES.get(name, 8)
    assert case.kinds == scenario.kinds == KINDS.get(name, {"rgb"})
    assert jumps(case.truth) == list(case.kidnapped_at)
    assert case.kidnapped_at == ((updates // 2,) if name == "lab-kidnapped" else ())


@pytest.mark.usefixtures("maps_without_pictures")
@pytest.mark.parametrize("name", NAMES)
def test_a_seed_makes_the_same_frames_twice_and_another_seed_others(name: str) -> None:
    scenario = make_scenario(name, 4)
    one, other = scenario.make(2), pickle.loads(pickle.dumps(scenario.make))(2)
    assert np.array_equal(one.truth, other.truth)
    assert pictures(one, 1) == pictures(other, 1)
    assert pictures(one, 1) != pictures(scenario.make(3), 1)


@pytest.mark.usefixtures("maps_without_pictures")
def test_the_laboratory_looks_different_in_each_of_its_scenarios() -> None:
    cases = {name: make_scenario(name, 20).make(2) for name in NAMES if name.startswith("lab-")}
    before = cases.pop("lab-fresh")
    assert set(cases) == {"lab-old", "lab-people", "lab-lights", "lab-kidnapped"}
    for name, case in cases.items():
        unlike = np.array([difference(*pair) > 1.0 for pair in zip(case.frames, before.frames, strict=True)])
        if name == "lab-kidnapped":
            assert unlike.tolist() == [False] * 10 + [True] * 10
            continue
        assert np.array_equal(case.truth, before.truth)
        assert unlike.all() or (name == "lab-people" and unlike.sum() >= 4), name


def difference(one: Frame, other: Frame) -> float:
    """Mean of the absolute difference of two frames' pictures, in grey levels."""
    return float(np.abs(one.images["rgb"].astype(int) - other.images["rgb"]).mean())


def maps_of(name: str, seed: int) -> TopoMap:
    """As the world itself makes it, whatever happens on the drive."""
    scenario = make_scenario(name, 4)
    world: World = make(WORLDS, scenario.site, scenario.settings)
    return world.topo_map(seed)


def same_maps(one: TopoMap, other: TopoMap) -> bool:
    """Whether all arrays of two maps are equal."""
    arrays, others = arrays_of(one), arrays_of(other)
    return one.nodes == other.nodes and all(np.array_equal(a, b) for a, b in zip(arrays, others, strict=True))


def arrays_of(topo_map: TopoMap) -> list[Pixels]:
    pictures: list[Pixels | None] = [node.panorama for node in topo_map.nodes]
    pictures += [array for view in topo_map.views for array in (view.pose, view.image, view.right)]
    return [np.asarray(topo_map.edges), *(np.zeros(0) if picture is None else picture for picture in pictures)]


def test_scenarios_of_one_site_have_one_map() -> None:
    assert make_scenario("lab-old").site == make_scenario("lab-fresh").site == "lab"
    laboratory = [name for name in NAMES if name.startswith("lab-")]
    fresh, *others = (make_scenario(name, 4).make(2).topo_map for name in laboratory)
    assert len(others) == 4 and all(other is fresh for other in others)  # so that a sensor is fitted to it once
    assert same_maps(maps_of("lab-old", 2), fresh)
    assert not same_maps(maps_of("lab-old", 2), maps_of("lab-old", 3))
    twice = make_scenario("lab-fresh", 4, {"scan": {"shake_px": "0"}})
    assert twice.make(2).topo_map is not fresh


@pytest.mark.slow
@pytest.mark.parametrize("site", sorted({make_scenario(name).site for name in NAMES}))
def test_all_scenarios_of_a_site_have_one_map(site: str) -> None:
    for name in [name for name in NAMES if make_scenario(name).site == site]:
        assert same_maps(maps_of(name, 2), make_scenario(name, 4).make(2).topo_map), name


def test_settings_take_the_place_of_a_scenarios_own() -> None:
    scenario = make_scenario("lab-people", 20, {"people": "0.1", "kidnap_at": "5"})
    assert (scenario.settings["people"], scenario.settings["kidnap_at"]) == (0.1, 5)
    for settings in ({"updates": "5"}, {"nonsense": "1"}):
        with pytest.raises(UserError, match=next(iter(settings))):
            make_scenario("lab-people", 20, settings)
    with pytest.raises(UserError, match="doors"):
        make_scenario("building", 20, {"doors": "0.5"})


@pytest.fixture(scope="module")
def simulated_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("recorded") / "carried"
    simulate("lab", output=folder, seed=2, settings=("updates=8", "kidnap_at=4"))
    return folder


def steps_of(case: Case) -> list[Step]:
    localizer = Localizer(case.topo_map, make_sensor("histogram"), make_estimator("grid"), rng=1)
    steps = []
    for frame in case.frames:
        localizer.step(frame)
        assert localizer.last is not None
        steps.append(localizer.last)
    return steps


def test_a_recorded_drive_is_the_simulated_one(simulated_folder: Path) -> None:
    scenario, live = make_scenario(str(simulated_folder)), make_scenario("lab-kidnapped", 8).make(2)
    case = pickle.loads(pickle.dumps(scenario.make))(7)
    assert (scenario.name, scenario.recorded, scenario.site) == ("carried", True, "")
    assert scenario.description == "Recorded drive of 8 frames, 8 nodes."
    assert scenario.kinds == case.kinds == {"rgb"}
    assert case.kidnapped_at == live.kidnapped_at == (4,)
    assert case.truth == pytest.approx(live.truth, abs=2e-6)
    assert same_maps(case.topo_map, live.topo_map)
    for frame, other in zip(case.frames, live.frames, strict=True):
        assert (frame.timestamp, frame.camera) == (other.timestamp, pytest.approx(other.camera))
        assert frame.odometry == pytest.approx(other.odometry, abs=2e-6)
        assert np.array_equal(frame.images["rgb"], other.images["rgb"])
    values, wanted = (
        evaluate(Run.of(one.topo_map, steps_of(one), one.truth, one.kidnapped_at)) for one in (case, live)
    )
    assert values["steps"] == 6, "two frames are gated: put down, the robot stands by its odometer"
    for name, value in wanted.items():
        assert values[name] is None if value is None else values[name] == pytest.approx(value, rel=1e-3, abs=1e-4), name


def test_frames_keep_none_of_their_pictures(simulated_folder: Path) -> None:
    frames = make_scenario(str(simulated_folder)).make(0).frames
    assert frames[2] is not frames[2]
    assert [frame.timestamp for frame in frames[1:3]] == [frames[1].timestamp, frames[2].timestamp]
    assert frames[-1].timestamp == frames[7].timestamp
    with pytest.raises(IndexError):
        frames[8]


def toy_drive(
    folder: Path, times: tuple[float, ...] = (0.0, 1.0, 2.0, 3.0), truth_x: Floats | None = None, odometer: bool = True
) -> Path:
    """A drive along the x axis at 0.4 m a frame, by the odometer; flat pictures."""
    nodes = tuple(Node(node.id, node.name, node.x, node.y) for node in toy_map().nodes)
    TopoMap("toy", CAMERA, nodes).save(folder / "map")
    writer = RecordingWriter(folder / "recording", CAMERA)
    poses = np.column_stack([0.4 * np.arange(len(times)), np.zeros((len(times), 2))])
    truth = poses.copy()
    truth[:, 0] = truth[:, 0] if truth_x is None else truth_x
    picture = np.full((CAMERA.height, CAMERA.width, 3), 90, dtype=np.uint8)
    for time, pose, true_pose in zip(times, poses, truth, strict=True):
        writer.add(Frame(time, pose if odometer else None, np.zeros(3), {"rgb": picture}), true_pose)
    writer.close()
    return folder


@pytest.mark.parametrize(
    ("truth_x", "kidnapped_at"),
    [
        ((0.0, 0.4, 0.8, 1.2), ()),
        ((0.0, 0.4, 1.7, 2.1), ()),  # 0.9 m farther than the odometer: it slipped
        ((0.0, 0.4, 2.0, 2.4), (2,)),
        ((0.0, 0.4, 0.8, -2.0), (3,)),
        ((0.0, 3.0, 3.4, 6.0), (1, 3)),
        ((0.0, 3.0, 6.0, 6.4), (2,)),  # carried past one frame: it stands again at the second
    ],
)
def test_who_moves_farther_than_the_odometer_was_carried(
    truth_x: tuple[float, ...], kidnapped_at: tuple[int, ...], tmp_path: Path
) -> None:
    assert recorded(toy_drive(tmp_path, truth_x=np.array(truth_x))).make(0).kidnapped_at == kidnapped_at


def test_without_an_odometer_nobody_is_known_to_be_carried(tmp_path: Path) -> None:
    case = recorded(toy_drive(tmp_path, truth_x=np.array([0.0, 3.0, 3.4, 3.8]), odometer=False)).make(0)
    assert case.frames[0].odometry is None
    assert case.kidnapped_at == ()


def test_a_circle_camera_and_a_stereo_camera(tmp_path: Path) -> None:
    simulate("image_grid", output=tmp_path / "circles", seed=2, settings=("updates=2", "grid=6x8"))
    assert make_scenario(str(tmp_path / "circles")).kinds == {"omni"}
    folder = toy_drive(tmp_path / "pairs")
    shutil.copy(folder / "recording" / "rgb.txt", folder / "recording" / "right.txt")
    assert make_scenario(str(folder)).kinds == {"rgb", "right"}


def test_a_text_map_will_do(simulated_folder: Path, tmp_path: Path) -> None:
    shutil.copytree(simulated_folder / "recording", tmp_path / "recording")
    save_thesis_map(TopoMap.load(simulated_folder / "map"), tmp_path / "map.txt")
    case = recorded(tmp_path).make(0)
    assert case.topo_map.positions == pytest.approx(TopoMap.load(simulated_folder / "map").positions)
    assert case.topo_map.nodes[0].panorama is not None


def test_the_settings_tell_when_the_data_are_others(tmp_path: Path) -> None:
    folder = toy_drive(tmp_path / "one")
    before = recorded(folder)
    copy = recorded(shutil.copytree(folder, tmp_path / "two"))
    assert before.settings["folder"] == str(folder.resolve())
    assert copy.settings["folder"] == str((tmp_path / "two").resolve())
    assert {key: before.settings[key] for key in ("recorded", "frames", "nodes")} == {
        "recorded": True,
        "frames": 4,
        "nodes": 6,
    }
    assert before.settings["digest"] == copy.settings["digest"] == recorded(folder).settings["digest"]
    for name in ("recording/groundtruth.txt", "recording/camera.toml", "map/nodes.csv"):
        path = folder / name
        path.write_text(path.read_text() + "\n")
        now = recorded(folder)
        assert now.settings["digest"] != before.settings["digest"], name
        before = now


@pytest.fixture
def drives(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    monkeypatch.chdir(tmp_path)
    yield tmp_path


def test_a_folder_may_be_named_as_it_lies(drives: Path) -> None:
    toy_drive(drives / "mine")
    scenario = make_scenario("mine")
    assert scenario.settings["folder"] == str(drives.resolve() / "mine")
    toy_drive(drives / "twins")
    assert not make_scenario("twins").recorded
    assert make_scenario("./twins").recorded


def test_a_name_that_is_neither(drives: Path) -> None:
    with pytest.raises(UnknownName, match=r"'nonsense'; choose from: building, .*or a folder with map/ and recording/"):
        make_scenario("nonsense")


def test_settings_of_a_recorded_drive_are_refused(drives: Path) -> None:
    toy_drive(drives / "mine")
    with pytest.raises(UserError, match="mine, which is recorded: nothing is called 'people'"):
        make_scenario("mine", settings={"people": "0.3"})


def replace_text(path: Path, old: str, new: str) -> None:
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def only_truth_until(path: Path, lines: int) -> None:
    path.write_text("".join(path.read_text().splitlines(keepends=True)[: lines + 1]))


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda at: shutil.rmtree(at / "map"), "map: no such folder; name the folder that holds map.toml"),
        (lambda at: shutil.rmtree(at / "recording"), "recording: no such folder; .*rgb.txt"),
        (lambda at: (at / "recording/groundtruth.txt").unlink(), "groundtruth.txt: no such file; .*write 'timestamp"),
        (
            lambda at: only_truth_until(at / "recording/groundtruth.txt", 2),
            r"groundtruth.txt: tells of 0.000 to 1.000 s; the frame at 3.000 s lies outside; .*rgb.txt",
        ),
        (
            lambda at: replace_text(at / "recording/rgb.txt", "0.000000 rgb", "-1.100000 rgb"),
            r"groundtruth.txt: tells of 0.000 to 3.000 s; the frame at -1.100 s lies outside",
        ),
        (
            lambda at: replace_text(at / "recording/camera.toml", "hfov_deg = 40.0", "hfov_deg = 60.0"),
            "camera.toml: hfov_deg is 60, but the map was made with 40; correct it",
        ),
        (
            lambda at: replace_text(at / "map/map.toml", "height = 6", "height = 60"),
            "rgb.txt, line 2: 000000.png is 8x6, but the map's camera has 8x60",
        ),
        (lambda at: shutil.rmtree(at / "recording/rgb"), "rgb.txt: none of its pictures can be used: .*000000.png"),
    ],
)
def test_what_is_missing_or_does_not_suit_is_one_line(spoil: object, message: str, drives: Path) -> None:
    folder = toy_drive(drives / "mine")
    assert callable(spoil)
    spoil(folder)
    with pytest.raises(InputError, match=message) as caught:
        make_scenario("mine")
    assert "\n" not in str(caught.value)


def test_one_picture_that_cannot_be_read_is_no_mistake(drives: Path) -> None:
    folder = toy_drive(drives / "mine")
    (folder / "recording" / "rgb" / "000000.png").unlink()
    assert len(make_scenario("mine").make(0).frames) == 4


def test_frames_a_little_outside_of_the_truth_are_let_pass(drives: Path) -> None:
    folder = toy_drive(drives / "mine")
    only_truth_until(folder / "recording" / "groundtruth.txt", 3)
    case = make_scenario("mine").make(0)
    assert np.array_equal(case.truth[3], case.truth[2])
