"""What every world does with its settings: events, changes one at a time, the same bytes from the same seed."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest

from benchmarks.worlds import LabWorld, Moment, SensorEffects, Simulation, WorldSettings, lab_scene, render_frame
from benchmarks.worlds.drive import Route
from benchmarks.worlds.odometer import Drift
from topoloc import plugins
from topoloc.geometry import between, compose, wrap
from topoloc.types import DEPTH_UNITS_PER_M

MOUNT = np.array([0.10, 0.0, 0.0])
CLEAN = WorldSettings(
    updates=12,
    shake_px=0.0,
    turning_shake_px=0.0,
    grille_shake_px=0.0,
    effects=SensorEffects.none(),
    drift=Drift.none(),
)


@lru_cache(maxsize=8)
def run(seed: int = 3, **changes: Any) -> Simulation:
    return LabWorld(WorldSettings(**{"updates": 12, **changes})).simulate(seed)


def rgb(drive: Simulation, number: int) -> np.ndarray[Any, Any]:
    return np.asarray(drive.frames[number].images["rgb"])


def test_the_map_has_a_panorama_on_every_node() -> None:
    for node in run().topo_map.nodes:
        assert node.panorama is not None
        assert node.panorama.shape == (288, 3456, 3)


def test_a_seed_gives_the_same_bytes_in_any_order_of_access() -> None:
    settings = WorldSettings(updates=6, people=0.5, age=0.5, stereo_baseline_m=0.1, depth=True)
    one, other = LabWorld(settings).simulate(7), LabWorld(settings).simulate(7)
    backwards = {(k, kind): other.frames[k].images[kind] for k in (5, 2, 4, 0) for kind in ("depth", "right", "rgb")}
    for (k, kind), image in backwards.items():
        assert one.frames[k].images[kind].tobytes() == image.tobytes()
    for a, b in zip(one.frames, other.frames, strict=True):
        assert np.array_equal(np.asarray(a.odometry), np.asarray(b.odometry))
    assert (one.truth == other.truth).all()
    for node, twin in zip(one.topo_map.nodes, other.topo_map.nodes, strict=True):
        assert node.panorama is not None
        assert twin.panorama is not None
        assert node.panorama.tobytes() == twin.panorama.tobytes()
    assert rgb(LabWorld(settings).simulate(8), 0).tobytes() != rgb(one, 0).tobytes()


GREY = (
    (191, 165, 195, 199, 194, 176, 148, 127),
    (192, 167, 155, 111, 112, 185, 154, 130),
    (163, 161, 156, 103, 103, 199, 158, 128),
    (118, 153, 155, 60, 102, 128, 98, 76),
    (147, 137, 121, 59, 96, 63, 80, 59),
    (132, 123, 123, 97, 120, 57, 79, 42),
)
"""Means over blocks of 48 x 48 pixels of the fifth frame of seed 3, all effects on."""


def test_other_libraries_and_processors_draw_the_same_to_two_grey_levels() -> None:
    """The bytes may differ there (docs/worlds.md); whoever changes a world draws these anew."""
    drive = run(updates=5)
    blocks = rgb(drive, 4).astype(float).mean(axis=2).reshape(6, 48, 8, 48).mean(axis=(1, 3))
    assert blocks == pytest.approx(np.array(GREY, dtype=float), abs=2.0)
    assert drive.frames[4].odometry == pytest.approx([0.50741, 2.43232, 0.61050], abs=1e-4)


def test_frames_are_what_the_camera_ten_centimetres_ahead_of_the_axis_sees() -> None:
    drive = LabWorld(CLEAN).simulate(3)
    for frame, pose in zip(drive.frames, drive.truth, strict=True):
        assert frame.camera == pytest.approx(MOUNT)
        assert (frame.images["rgb"] == render_frame(lab_scene(3), compose(pose, MOUNT), LabWorld.camera)).all()
    assert set(drive.frames[0].images) == {"rgb"}
    assert not drive.frames[0].images["rgb"].flags.writeable
    with pytest.raises(KeyError):
        drive.frames[0].images["depth"]


def test_the_right_camera_looks_from_beside_and_depth_is_in_tum_units() -> None:
    drive = LabWorld(replace(CLEAN, stereo_baseline_m=0.12, depth=True)).simulate(3)
    frame, pose = drive.frames[4], drive.truth[4]
    beside = compose(compose(pose, MOUNT), (0.0, -0.12, 0.0))
    assert (frame.images["right"] == render_frame(lab_scene(3), beside, LabWorld.camera)).all()
    depth = frame.images["depth"]
    assert depth.dtype == np.uint16
    assert depth.shape == (288, 384)
    assert 0.5 < np.median(depth) / DEPTH_UNITS_PER_M < 6.0


@pytest.mark.parametrize(
    "change",
    [
        {"people": 1.0},
        {"age": 1.0},
        {"doors": 1.0},
        {"bulbs": 1.0},
        {"daylight": 1.0},
        {"covered_share": 1.0},
    ],
)
def test_each_change_alters_the_frames_but_neither_the_map_nor_the_drive(change: dict[str, float]) -> None:
    plain, changed = run(updates=24), run(updates=24, **change)
    assert (plain.truth == changed.truth).all()
    for frame, twin_frame in zip(plain.frames, changed.frames, strict=True):
        assert np.array_equal(np.asarray(frame.odometry), np.asarray(twin_frame.odometry))
    for node, twin in zip(plain.topo_map.nodes, changed.topo_map.nodes, strict=True):
        assert np.array_equal(np.asarray(node.panorama), np.asarray(twin.panorama))
    assert any((rgb(plain, k) != rgb(changed, k)).any() for k in range(24))


def test_changes_combine() -> None:
    everything = {"people": 0.5, "age": 0.7, "doors": 0.5, "bulbs": 0.3, "daylight": 0.2, "covered_share": 0.2}
    drive = run(**everything, kidnap_at=4, turned_at=8, stereo_baseline_m=0.1)
    assert all(frame.images[kind].shape == (288, 384, 3) for frame in drive.frames for kind in ("rgb", "right"))


def test_a_covered_camera_has_no_depth_and_both_eyes_of_one_body_see_alike() -> None:
    drive = run(covered=(1,), depth=True, stereo_baseline_m=1e-6, effects=SensorEffects(noise_grey=0.0, jpeg_quality=0))
    assert not drive.frames[1].images["depth"].any()
    for number in (0, 5):
        left, right = (drive.frames[number].images[kind].astype(int) for kind in ("rgb", "right"))
        assert np.abs(left - right).mean() < 0.2


def test_covered_frames_are_flat_and_dark() -> None:
    drive = run(covered=(2, 4))
    for number in range(6):
        image = rgb(drive, number)
        if number in (2, 4):
            assert image.mean() < 12.0
            assert image.std() < 2.0
        else:
            assert image.std() > 15.0


def test_a_share_of_the_frames_is_covered_in_stays() -> None:
    drive = run(updates=60, covered_share=0.3)
    dark = np.array([rgb(drive, number).mean() < 12.0 for number in range(60)])
    assert 0.1 < dark.mean() < 0.6
    assert (dark[1:] != dark[:-1]).mean() < dark.mean()


def test_kidnapping_moves_the_robot_half_a_lap_and_the_odometer_not_at_all() -> None:
    drive = run(updates=20, kidnap_at=8)
    odometry = np.array([frame.odometry for frame in drive.frames])
    assert np.linalg.norm(drive.truth[8, :2] - drive.truth[7, :2]) > 1.0
    assert odometry[8] == pytest.approx(odometry[7])
    assert drive.truth[9] == pytest.approx(drive.truth[8])
    assert [rgb(drive, number).std() < 2.0 for number in range(7, 11)] == [False, True, True, False]
    moved, said = between(drive.truth[9:-1], drive.truth[10:]), between(odometry[9:-1], odometry[10:])
    assert np.linalg.norm(moved[:, :2], axis=1).min() > 0.25
    assert said == pytest.approx(moved, abs=0.15)


def test_a_robot_turned_by_hand_drives_the_same_path_while_its_odometer_lies_turned() -> None:
    """Thesis 5.2.7, Figure 5.28: turned by -90 degrees, the odometer's path lies turned by 90."""
    drive = LabWorld(replace(CLEAN, updates=20, turned_at=6)).simulate(3)
    odometry = np.array([frame.odometry for frame in drive.frames])
    assert drive.truth[6, :2] == pytest.approx(drive.truth[5, :2])
    assert np.rad2deg(wrap(drive.truth[6, 2] - drive.truth[5, 2])) == pytest.approx(-90.0)
    assert odometry[6] == pytest.approx(odometry[5])
    apart = wrap((odometry[:, 2] - odometry[0, 2]) - (drive.truth[:, 2] - drive.truth[0, 2]))
    assert np.rad2deg(apart[:6]) == pytest.approx(0.0, abs=1e-6)
    assert np.rad2deg(apart[6:]) == pytest.approx(90.0)


@pytest.mark.parametrize("random", [False, True])
def test_events_and_longer_drives_leave_what_comes_before_them_as_it_was(random: bool) -> None:
    """To a millimetre: the path is one smooth curve, and what comes far behind still moves it a little."""
    route = Route(random=random)
    plain = LabWorld(WorldSettings(updates=20, route=route)).drive(3)
    for change in ({"updates": 60}, {"kidnap_at": 12}, {"turned_at": 12}, {"kidnap_at": 12, "turned_at": 16}):
        changed = LabWorld(WorldSettings(**{"updates": 20, "route": route, **change})).drive(3)  # type: ignore[arg-type]
        for one, other in zip(plain, changed, strict=True):
            assert one[:12] == pytest.approx(other[:12], abs=2e-3)


@pytest.mark.parametrize("world", ["lab", "lab_corridor", "office", "image_grid", "twins", "building"])
@pytest.mark.parametrize("events", [(4, 6), (6, 4), (0, 2), (2, 0), (10, 8), (7, 10)])
def test_events_move_the_robot_by_hand_and_otherwise_it_rolls(world: str, events: tuple[int, int]) -> None:
    """Between events no step is longer than usual; who is turned stands still; who is carried off ends elsewhere."""
    cls = plugins.load(plugins.WORLDS, world)
    more = {"rooms": 4} if world == "building" else {}
    kidnapped, turned = events
    made = cls(cls.Config(updates=12, kidnap_at=kidnapped, turned_at=turned, **more))
    truth = made.drive(1)[1]
    step = between(truth[:-1], truth[1:])
    by_hand = {kidnapped - 1, turned - 1}
    usual = (made.route.step_m + made.route.step_spread_m) * made.pace(truth[:-1, :2]).max()
    assert all(np.hypot(*move[:2]) <= 1.01 * usual for number, move in enumerate(step) if number not in by_hand)
    assert truth[turned + 1, :2] == pytest.approx(truth[turned, :2])
    if kidnapped > 0:
        assert np.linalg.norm(truth[kidnapped, :2] - truth[kidnapped - 1, :2]) > 0.25


def test_a_random_route_is_another_route() -> None:
    usual, random = run(updates=40), run(updates=40, route=Route(random=True))
    assert np.abs(usual.truth - random.truth).max() > 0.5
    nodes = usual.topo_map.positions
    off = np.linalg.norm(random.truth[:, None, :2] - nodes, axis=2).min(axis=1)
    assert off.max() < 0.9


def test_the_map_is_made_in_its_own_light_whatever_the_drive_sees() -> None:
    assert WorldSettings(age=0.4, doors=0.2).now() == Moment(age=0.4, doors=0.2)
    assert LabWorld(WorldSettings(age=1.0)).mapped_at(3) == Moment()


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"people": 1.5}, "people"),
        ({"age": -0.1}, "age"),
        ({"bulbs": 0.7, "daylight": 0.7}, "daylight"),
        ({"shake_px": -1.0}, "shake_px"),
        ({"laps": float("nan")}, "laps"),
        ({"kidnap_laps": 99999.0}, "kidnap_laps"),
        ({"camera_ahead_m": 30.0}, "camera_ahead_m"),
        ({"stereo_baseline_m": 2.0}, "stereo_baseline_m"),
        ({"updates": -1}, "updates"),
    ],
)
def test_settings_out_of_range_are_refused_by_name(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        WorldSettings(**wrong)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"laps": 0.0}, "laps"),
        ({"updates": 5, "kidnap_at": 5}, "kidnap_at"),
        ({"updates": 5, "turned_at": 9}, "turned_at"),
        ({"updates": 5, "turned_at": 2, "kidnap_at": 2}, "apart"),
        ({"updates": 9, "turned_at": 5, "kidnap_at": 4}, "apart"),
        ({"updates": 9, "kidnap_at": 5, "turned_at": 4}, "apart"),
        ({"updates": 5, "covered": (7,)}, "covered"),
        ({"updates": 10**7}, "100000"),
    ],
)
def test_events_that_never_come_are_refused_by_name(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        LabWorld(WorldSettings(**wrong))
