"""The simulated robot behind the interface of behaviours, and what behaviours make of the simulated laboratory."""

from __future__ import annotations

import re
import threading
from functools import cache
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from benchmarks.worlds import LabWorld, WorldSettings
from benchmarks.worlds.odometer import Drift
from benchmarks.worlds.robot import SimulatedRobot, Wheels
from sensors import IMA
from topoloc.behaviours import Engine, Localize, ScannedCircle, VideoScan, add_node, save_node
from topoloc.geometry import Floats, between, wrap
from topoloc.localizer import Localizer
from topoloc.plugins import make_estimator
from topoloc.testing import toy_map
from topoloc.thesis_map import load_thesis_map, save_thesis_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame

PAGE = Path(__file__).parents[2] / "docs" / "behaviours.md"
NORTH = np.pi / 2.0
"""The reference direction of the laboratory: each scan begins with a look up the map."""
PATIENCE_S = 120.0
SEEDS = range(3)
SHORT_DEG = 15.0
WORLD = LabWorld(WorldSettings())
EXACT = Wheels(0.0, 0.0, 0.0)


def at(place: int, heading: float = NORTH) -> Floats:
    return np.array([*WORLD.positions[place], heading])


class TestSimulatedRobot:
    def test_turns_and_drives_about_as_told(self) -> None:
        """Turns of 0.5 rad: standard deviation 1 degree and a tenth of 28.6; 200 of them, within 20 %."""
        robot = SimulatedRobot(WORLD, 0, (0.0, 0.0, 0.0))
        turned = []
        for _ in range(200):
            before = robot.pose
            robot.turn(0.5)
            turned.append(np.rad2deg(between(before, robot.pose)[2]))
        assert np.mean(turned) == pytest.approx(np.rad2deg(0.5), abs=0.7)
        assert np.std(turned) == pytest.approx(np.hypot(1.0, 0.1 * np.rad2deg(0.5)), rel=0.2)
        before = robot.pose
        robot.drive(1.0)
        x, y, heading = between(before, robot.pose)
        assert (x, y, heading) == (pytest.approx(1.0, abs=0.15), pytest.approx(0.0, abs=1e-12), pytest.approx(0.0))

    def test_exact_wheels_and_an_exact_odometer_tell_the_truth(self) -> None:
        robot = SimulatedRobot(LabWorld(WorldSettings(drift=Drift.none())), 0, (1.0, 2.0, 0.3), EXACT)
        start = robot.pose
        robot.turn(-1.2)
        robot.drive(0.7)
        robot.drive_to((0.5, 0.5, 3.0))
        assert robot.pose == pytest.approx([0.5, 0.5, 3.0])
        assert robot.odometry() == pytest.approx(between(start, robot.pose))

    def test_the_odometer_goes_on_and_errs_as_the_worlds_does(self) -> None:
        """A full turn: 1.8 % too little, see ``Drift``; what it said before it says again."""
        robot = SimulatedRobot(WORLD, 1, at(0), EXACT)
        said, total = [robot.odometry()], 0.0
        for _ in range(12):
            robot.turn(np.deg2rad(-30.0))
            said.append(robot.odometry())
            assert np.array_equal(said[-1], robot.odometry())
            total += float(wrap(said[-1][2] - said[-2][2]))
        assert np.rad2deg(total) == pytest.approx(-360.0 * (1.0 - 0.018), abs=4.0)

    def test_the_same_seed_is_the_same_robot_and_another_number_another(self) -> None:
        one, same, other = (SimulatedRobot(WORLD, 2, at(3), number=number) for number in (0, 0, 1))
        for robot in (one, same, other):
            robot.turn(0.5)
            robot.drive(0.3)
        assert np.array_equal(one.pose, same.pose) and np.array_equal(one.odometry(), same.odometry())
        assert np.array_equal(one.look().images["rgb"], same.look().images["rgb"])
        assert not np.array_equal(one.pose, other.pose)

    def test_a_frame_is_of_the_moment_of_the_look(self) -> None:
        robot = SimulatedRobot(WORLD, 0, at(0), EXACT)
        before = robot.look()
        again = robot.look()
        robot.turn(1.0)
        after = robot.look()
        assert (before.timestamp, again.timestamp, after.timestamp) == (0.0, 0.0, 1.0) and robot.time == 1.0
        assert np.array_equal(before.images["rgb"], again.images["rgb"])
        assert before.odometry is not None and after.odometry is not None
        assert after.odometry == pytest.approx(robot.odometry()) and before.odometry[2] == 0.0
        assert np.array_equal(before.camera, WORLD.mount)
        assert not np.array_equal(before.images["rgb"], after.images["rgb"])

    def test_who_carries_it_is_not_seen_by_the_odometer(self) -> None:
        robot = SimulatedRobot(WORLD, 0, at(0), EXACT)
        robot.drive(0.5)
        before = robot.odometry()
        robot.carry_to(at(4))
        assert np.array_equal(robot.odometry(), before) and np.array_equal(robot.pose, at(4))
        assert robot.look().timestamp == 2.0

    def test_looks_from_another_thread_show_places_where_it_stood(self) -> None:
        """Each frame's odometer is one of those that the driving thread read, at its time."""
        robot, frames, done = SimulatedRobot(WORLD, 0, at(0)), [], threading.Event()

        def watch() -> None:
            while not done.is_set():
                frames.append(robot.look())

        watcher = threading.Thread(target=watch)
        watcher.start()
        readings = {0.0: robot.odometry()}
        for _ in range(30):
            robot.turn(0.2)
            readings[robot.time] = robot.odometry()
        done.set()
        watcher.join(PATIENCE_S)
        frames.append(robot.look())
        assert [frame.timestamp for frame in frames] == sorted(frame.timestamp for frame in frames)
        for frame in frames:
            assert frame.odometry is not None and np.array_equal(frame.odometry, readings[frame.timestamp])

    @pytest.mark.parametrize("name", ["turn_sd_deg", "turn_sd", "drive_sd"])
    def test_wheels_say_what_must_hold(self, name: str) -> None:
        with pytest.raises(ValueError, match=f"{name} is -1"):
            Wheels(**{name: -1.0})


@cache
def lab_scan(seed: int, place: int, short_deg: float = 0.0) -> tuple[ScannedCircle, Floats]:
    """The panorama of a place of the laboratory, and the true headings of the snapshots in it (S,): simulated.

    Args:
        seed: of the laboratory.
        place: index of it.
        short_deg: by so much the turn ends short when the odometer says that it is a full one.
    """
    drift = Drift(rotation_scale=short_deg / (360.0 - short_deg)) if short_deg else WORLD.config.drift
    robot = SimulatedRobot(LabWorld(WorldSettings(drift=drift)), seed, at(place), number=place)
    scan = VideoScan(robot, NORTH, method_settings={"clahe": False})
    scan.init()
    truth, more = [], True
    while more:
        more = scan.action()
        truth.append(robot.pose[2])
    return scan.circle, np.array(truth)[: len(scan.circle.headings)]


@cache
def lab_map(seed: int) -> TopoMap:
    """The laboratory as a robot maps it by scans: simulated."""
    made: TopoMap | None = None
    for number, place in enumerate(WORLD.places):
        circle, _ = lab_scan(seed, number)
        made = add_node(made, circle.node(place.id, place.x, place.y, place.name), circle, "laboratory")
    assert made is not None
    return made


def placement_deg(circle: ScannedCircle, truth: Floats) -> Floats:
    """(S,) how far snapshots lie from their true headings [degrees]."""
    return np.asarray(np.abs(np.rad2deg(wrap(circle.headings - truth))))


@pytest.mark.slow
@pytest.mark.parametrize("short", [0.0, SHORT_DEG])
def test_scans_of_the_laboratory_close_with_every_snapshot_in_its_place(short: float) -> None:
    """8 nodes, 3 seeds; with a turn that ends 15 degrees short the last view must reach the first all the same."""
    errors, counts = [], []
    for seed in SEEDS:
        for place in range(len(WORLD.places)):
            circle, truth = lab_scan(seed, place, short)
            assert circle.panorama.any(axis=(0, 2)).all(), "no column may stay empty"
            assert 360.0 - np.rad2deg(np.unwrap(truth)[0] - np.unwrap(truth)[-1]) <= WORLD.camera.hfov_deg
            errors.append(placement_deg(circle, truth).max())
            counts.append(len(truth))
    print(f"\n{short:g} degrees short: {np.mean(counts):.1f} snapshots used; worst place of each scan: median", end=" ")
    print(f"{np.median(errors):.1f}, largest {max(errors):.1f} degrees")
    assert np.median(errors) < 4.0 and max(errors) < 10.0


@pytest.mark.slow
def test_ima_reads_headings_off_scanned_panoramas() -> None:
    """8 fresh frames near each of 8 nodes, 3 seeds: within 10 degrees in 95 % of them."""
    errors = []
    for seed in SEEDS:
        sensor, rng = IMA(), np.random.default_rng([seed, 5])
        sensor.fit(lab_map(seed))
        for place in range(len(WORLD.places)):
            robot = SimulatedRobot(WORLD, seed, at(place), number=100 + place)
            for heading in rng.uniform(-np.pi, np.pi, 8):
                robot.drive_to(at(place, heading))
                evidence = sensor.observe(robot.look()).of_robot(WORLD.mount)
                best = int(evidence.match.argmax())
                errors.append(abs(float(wrap(evidence.poses[best, 2] - heading))))
    right = float(np.mean(np.rad2deg(errors) < 10.0))
    print(f"\nheadings within 10 degrees: {right:.1%} of {len(errors)}; median {np.rad2deg(np.median(errors)):.1f}")
    assert right >= 0.95


@pytest.mark.slow
def test_a_robot_maps_the_laboratory_and_finds_itself_on_it(tmp_path: Path) -> None:
    """Scans of eight nodes, a map folder and a text map, then a lap with ``Localize``: right in 80 % or more."""
    with Engine() as engine:
        for number, place in enumerate(WORLD.places):
            robot = SimulatedRobot(WORLD, 5, at(number), number=number)
            scan = VideoScan(robot, NORTH, method_settings={"clahe": False})
            engine.run(scan, PATIENCE_S)
            save_node(tmp_path / "map", scan.circle.node(place.id, place.x, place.y, place.name), scan.circle)
    the_map = TopoMap.load(tmp_path / "map")
    known = save_thesis_map(the_map, tmp_path / "lab.txt")
    by_text = load_thesis_map(tmp_path / "lab.txt", known)
    assert [node.name for node in by_text.nodes] == [node.name for node in the_map.nodes]
    assert np.allclose(by_text.positions, the_map.positions, atol=5e-4)

    _, truth = LabWorld(WorldSettings(laps=1.0)).drive(5)
    robot = SimulatedRobot(WORLD, 5, truth[0], number=50)
    behaviour = Localize(robot, tmp_path / "map", "ima", "particle")
    plain = {name: Localizer(the_map, IMA(), make_estimator(name)) for name in ("particle", "activity")}
    right: dict[str, list[bool]] = {name: [] for name in plain}
    with Engine() as engine:
        engine.start(behaviour)
        for number, pose in enumerate(truth):
            if number > 0:
                robot.drive_to(pose)
            position = behaviour.wait(PATIENCE_S, after=robot.time - 0.5)
            found = {name: localizer.step(robot.look()).node for name, localizer in plain.items()}
            assert position.estimate.node == found["particle"]
            for name, node in found.items():
                right[name].append(is_right(the_map, node, pose))
    print("\nright:", ", ".join(f"{name} {np.mean(of):.1%} of {len(of)} frames" for name, of in right.items()))
    assert np.mean(right["particle"]) >= 0.8


def is_right(topo_map: TopoMap, node: int | None, pose: Floats) -> bool:
    """DESIGN.md, "Truth of a node": at most 0.25 m farther away than the nearest."""
    if node is None:
        return False
    away = float(np.linalg.norm(topo_map.positions[node] - pose[:2]))
    return away <= float(topo_map.distance_to_nearest(pose[None, :2])[0]) + 0.25


@pytest.mark.parametrize("number", [0, 1])
def test_examples_of_the_page_print_what_they_say(number: int, capsys: pytest.CaptureFixture[str]) -> None:
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)[number]
    exec(compile(code, PAGE.name, "exec"), {})
    assert capsys.readouterr().out.strip() == re.findall(r"It prints `([^`]+)`", PAGE.read_text())[number]


def test_the_robot_of_the_page_stands_behind_the_interface() -> None:
    """Its drivers are the simulated robot's; one step of a scan and one of localization run on it."""
    code = re.findall(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL)[2]
    namespace: dict[str, Any] = {}
    exec(compile(code, PAGE.name, "exec"), namespace)
    behind = SimulatedRobot(WORLD, 0, at(0), EXACT)
    base = SimpleNamespace(pose=lambda: behind.odometry().tolist(), rotate=behind.turn)
    camera = SimpleNamespace(read=lambda: behind.look().images["rgb"])
    robot = namespace["MyRobot"](base, camera)
    scan = VideoScan(robot, NORTH)
    scan.init()
    assert scan.action() and scan.action()
    assert np.rad2deg(wrap(behind.pose[2] - NORTH)) == pytest.approx(-30.0, abs=4.0)
    behaviour = Localize(robot, toy_map(), SeesNothing(), "particle")
    behaviour.init()
    assert behaviour.action() and behaviour.position() is not None


class SeesNothing:
    needs = frozenset({"rgb"})

    def fit(self, topo_map: TopoMap) -> None:
        pass

    def observe(self, frame: Frame) -> Evidence:
        return Evidence.blind()
