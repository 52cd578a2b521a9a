"""The simulated laboratory: its plan, panoramas, the drive, the odometer, and what a seed fixes."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise

import cv2
import numpy as np
import pytest

from benchmarks.worlds import NODES, LabSettings, Simulation, lab_scene, panorama_of, render_frame, simulate
from benchmarks.worlds.drive import Drift, Route, drive, odometer
from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.lab import BOTTOM, LEFT, RIGHT, TOP, person
from benchmarks.worlds.simulate import people_present
from benchmarks.worlds.snapshots import first_column_heading, snapshot_turns
from topoloc.geometry import Floats, between, compose
from topoloc.odometry import MotionGate
from topoloc.topo_map import Camera

CAMERA = Camera()
LOOP = np.array([node[2:] for node in NODES])
SEEDS = range(30)
MOUNT = np.array([0.10, 0.0, 0.0])


@lru_cache(maxsize=4)
def short_run(seed: int = 3, **changes: float) -> Simulation:
    return simulate(LabSettings(updates=12, **changes), seed)  # type: ignore[arg-type]


def distance_to_segments(points: Floats, ends: Floats) -> Floats:
    along = ends[:, 2:] - ends[:, :2]
    offset = points[:, None, :] - ends[:, :2]
    share = np.clip((offset * along).sum(axis=2) / (along**2).sum(axis=1), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2))


def test_the_map_is_figure_5_22() -> None:
    topo_map = short_run().topo_map
    assert [node.id for node in topo_map.nodes] == list("12345678")
    expected = [(0, 0), (1, 0), (1, 1), (1, 2), (0, 2), (0, 1), (-1, 1), (-1, 0)]
    assert topo_map.positions == pytest.approx(np.array(expected, dtype=float))
    for node in topo_map.nodes:
        assert node.panorama is not None
        assert node.panorama.shape == (288, 3456, 3)
    to_walls = np.stack([LOOP[:, 0] - LEFT, RIGHT - LOOP[:, 0], LOOP[:, 1] - BOTTOM, TOP - LOOP[:, 1]])
    assert 2.0 <= to_walls.min() <= 2.7


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("age", [0.0, 1.0])
def test_no_furniture_stands_within_45_cm_of_the_path(seed: int, age: float) -> None:
    path = drive(LOOP, 600, np.random.default_rng(seed), Route(step_m=0.05, step_spread_m=0.0))
    assert distance_to_segments(path[:, :2], lab_scene(seed, age).faces.ends).min() > 0.45


def test_the_path_starts_on_node_1_and_then_keeps_25_to_35_cm_outside_the_nodes() -> None:
    for seed in SEEDS:
        path = drive(LOOP, 800, np.random.default_rng(seed), Route(step_m=0.04, step_spread_m=0.0))
        assert path[0, :2] == pytest.approx(LOOP[0])
        distance = np.linalg.norm(path[40:, None, :2] - LOOP, axis=2)
        passes = (distance[1:-1] < distance[:-2]) & (distance[1:-1] <= distance[2:]) & (distance[1:-1] < 0.6)
        nearest = distance[1:-1][passes]
        assert len(nearest) >= 3 * 8 - 4
        assert nearest.min() > 0.24
        assert nearest.max() < 0.36
        turned = np.unwrap(path[:, 2])
        assert turned[-1] > turned[0] + 4.0 * np.pi  # counter-clockwise, from 1 to 2
        ahead = np.diff(path[:, :2], axis=0)
        assert np.abs(np.cos(path[:-1, 2]) * ahead[:, 1] - np.sin(path[:-1, 2]) * ahead[:, 0]).max() < 0.01


def test_a_lap_has_about_24_frames_and_every_one_opens_the_motion_gate() -> None:
    gate, frames = MotionGate(), []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        truth = drive(LOOP, 80, rng)
        readings = odometer(between(truth[:-1], truth[1:]), truth[0], Drift(), rng)
        for before, after in pairwise(readings):
            assert gate.opens(before, MOUNT, after, MOUNT)
        frames.append(three_laps(truth) / 3.0)
    assert 24.0 <= np.mean(frames) <= 25.0


def three_laps(truth: Floats) -> int:
    """Index of the frame at which the robot has turned three times."""
    turned = np.unwrap(truth[:, 2]) - truth[0, 2]
    return int(np.argmax(turned >= 6.0 * np.pi))


def test_dead_reckoning_ends_1_to_3_metres_off_after_three_laps() -> None:
    off = []
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        truth = drive(LOOP, 80, rng)
        last = three_laps(truth)
        readings = odometer(between(truth[:-1], truth[1:]), truth[0], Drift(), rng)
        off.append(np.linalg.norm(readings[last, :2] - truth[last, :2]))
    assert 1.2 <= np.median(off) <= 2.5
    low, high = np.percentile(off, [10, 90])
    assert low >= 0.8
    assert high <= 2.8


def test_the_odometer_is_45_degrees_off_after_seven_turns_on_the_spot() -> None:
    turning = np.zeros((7 * 36, 3))
    turning[:, 2] = np.deg2rad(10.0)
    off = [
        np.rad2deg(abs(odometer(turning, np.zeros(3), Drift(), np.random.default_rng(seed))[-1, 2])) for seed in SEEDS
    ]
    assert np.mean(off) == pytest.approx(45.0, abs=6.0)
    assert np.std(off) < 8.0


def test_an_odometer_without_errors_repeats_the_drive_in_its_own_frame() -> None:
    truth = drive(LOOP, 40, np.random.default_rng(0))
    start = np.array([3.0, -2.0, 1.0])
    exact = Drift(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    readings = odometer(between(truth[:-1], truth[1:]), start, exact, np.random.default_rng(1))
    assert readings[0] == pytest.approx(start)
    assert between(readings[0], readings) == pytest.approx(between(truth[0], truth), abs=1e-9)


def test_snapshot_steps_close_the_circle_without_a_gap() -> None:
    for seed in SEEDS:
        turns = snapshot_turns(np.random.default_rng(seed))
        steps = np.rad2deg(np.diff(np.concatenate([turns, [2.0 * np.pi]])))
        assert len(turns) == 12
        assert steps.max() <= 38.0
        assert steps.min() > 0.0


@pytest.mark.parametrize("node", [0, 3, 6])
def test_a_frame_is_found_in_the_panorama_at_the_column_that_its_heading_gives(node: int) -> None:
    scene, columns = lab_scene(1), CAMERA.panorama_columns()
    clean = SensorEffects(0.0, 0.0, 0.0, 0.0, 0.0)
    panorama = panorama_of(scene, LOOP[node], CAMERA, np.random.default_rng(2), None, 0.0, clean)
    around = cv2.cvtColor(np.concatenate([panorama, panorama[:, : CAMERA.width]], axis=1), cv2.COLOR_RGB2GRAY)
    for heading in np.deg2rad([10.0, 130.0, -160.0]):
        frame = cv2.cvtColor(render_frame(scene, np.array([*LOOP[node], heading]), CAMERA), cv2.COLOR_RGB2GRAY)
        match = cv2.matchTemplate(around, frame, cv2.TM_CCOEFF_NORMED)[0]
        expected = (first_column_heading(CAMERA) - heading) / (2.0 * np.pi) * columns - CAMERA.width / 2.0
        error = (match.argmax() - expected + columns / 2.0) % columns - columns / 2.0
        assert match.max() > 0.8
        assert abs(error) < 12.0  # 1.25 degrees: frames are pasted unwarped


def test_panoramas_have_no_hole_and_placement_noise_moves_snapshots() -> None:
    scene = lab_scene(1)
    one = panorama_of(scene, LOOP[0], CAMERA, np.random.default_rng(2), placement_noise_columns=0.0)
    other = panorama_of(scene, LOOP[0], CAMERA, np.random.default_rng(2), placement_noise_columns=0.7)
    assert one.max(axis=(0, 2)).min() > 10
    assert (one != other).any(axis=(0, 2)).mean() > 0.5
    first = np.arange(150)  # the first snapshot is where it says
    assert np.abs(one[:, first].astype(int) - other[:, first]).mean() < 5.0


def test_a_seed_gives_the_same_bytes_in_any_order_of_access() -> None:
    settings = LabSettings(updates=6, people=0.5, age=0.5)
    one, other = simulate(settings, 7), simulate(settings, 7)
    backwards = {k: other.frames[k].images["rgb"] for k in (5, 2, 4, 0)}
    for k in (0, 2, 4, 5):
        assert one.frames[k].images["rgb"].tobytes() == backwards[k].tobytes()
        assert np.array_equal(np.asarray(one.frames[k].odometry), np.asarray(other.frames[k].odometry))
    assert (one.truth == other.truth).all()
    for a, b in zip(one.topo_map.nodes, other.topo_map.nodes, strict=True):
        assert a.panorama is not None
        assert b.panorama is not None
        assert a.panorama.tobytes() == b.panorama.tobytes()
    assert simulate(settings, 8).frames[0].images["rgb"].tobytes() != one.frames[0].images["rgb"].tobytes()


def test_frames_are_what_the_camera_ten_centimetres_ahead_of_the_axis_sees() -> None:
    still = LabSettings(updates=4, shake_px=0.0, effects=SensorEffects(0.0, 0.0, 0.0, 0.0, 0.0))
    run = simulate(still, 3)
    for frame, pose in zip(run.frames, run.truth, strict=True):
        assert frame.camera == pytest.approx(MOUNT)
        expected = render_frame(lab_scene(3), compose(pose, MOUNT), CAMERA)
        assert (frame.images["rgb"] == expected).all()
    assert set(run.frames[0].images) == {"rgb"}
    assert not run.frames[0].images["rgb"].flags.writeable
    with pytest.raises(KeyError):
        run.frames[0].images["depth"]


def test_covered_frames_are_flat_and_dark() -> None:
    run = simulate(LabSettings(updates=6, covered=(2, 4)), 3)
    for number, frame in enumerate(run.frames):
        image = frame.images["rgb"]
        if number in (2, 4):
            assert image.mean() < 12.0
            assert image.std() < 2.0
        else:
            assert image.std() > 15.0


def test_kidnapping_moves_the_robot_half_a_lap_and_the_odometer_not_at_all() -> None:
    run = simulate(LabSettings(updates=20, kidnap_at=8), 3)
    odometry = np.array([frame.odometry for frame in run.frames])
    assert np.linalg.norm(run.truth[8, :2] - run.truth[7, :2]) > 1.0
    assert odometry[8] == pytest.approx(odometry[7])
    assert run.truth[9] == pytest.approx(run.truth[8])
    assert [frame.images["rgb"].std() < 2.0 for frame in run.frames[7:11]] == [False, True, True, False]
    moved, said = between(run.truth[9:-1], run.truth[10:]), between(odometry[9:-1], odometry[10:])
    assert np.linalg.norm(moved[:, :2], axis=1).min() > 0.25
    assert said == pytest.approx(moved, abs=0.1)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.35, 0.9, 1.0])
def test_people_are_there_in_the_share_of_frames_asked_for_and_stay_a_while(share: float) -> None:
    there = people_present(share, 20000, np.random.default_rng(1))
    assert there.mean() == pytest.approx(share, abs=0.02 if 0.0 < share < 1.0 else 0.0)
    changes = (there[1:] != there[:-1]).mean()
    assert changes <= 0.75 * 2.0 * share * (1.0 - share)  # independent frames would change that often


def test_someone_stands_before_the_camera_in_every_frame_or_in_none() -> None:
    plain, crowded = short_run(), short_run(people=1.0)
    for a, b in zip(plain.frames, crowded.frames, strict=True):
        changed = (a.images["rgb"] != b.images["rgb"]).any(axis=(0, 2))
        assert changed.mean() > 0.08


def test_a_person_is_175_cm_tall_and_45_cm_wide() -> None:
    faces = person(1, np.array([2.0, 1.0]), 0.3, 0)
    assert faces.heights.max() == pytest.approx(1.75)
    across = np.linalg.norm(faces.ends[:, :2] - (2.0, 1.0), axis=1).max()
    assert 2.0 * across == pytest.approx(0.45)


def test_age_changes_the_frames_but_neither_the_map_nor_the_drive() -> None:
    fresh, old = short_run(), short_run(age=1.0)
    assert (fresh.truth == old.truth).all()
    assert fresh.topo_map.nodes[2].panorama is not None
    assert old.topo_map.nodes[2].panorama is not None
    assert (fresh.topo_map.nodes[2].panorama == old.topo_map.nodes[2].panorama).all()
    half = short_run(age=0.5)
    change = [
        np.mean(
            [
                np.abs(a.images["rgb"].astype(int) - b.images["rgb"]).mean()
                for a, b in zip(fresh.frames, run.frames, strict=True)
            ]
        )
        for run in (half, old)
    ]
    assert 0.0 < change[0] < change[1]


@pytest.mark.parametrize(
    ("wrong", "named"), [({"people": 1.5}, "people"), ({"age": -0.1}, "age"), ({"laps": 0.0}, "laps")]
)
def test_settings_out_of_range_are_refused_by_name(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        LabSettings(**wrong)  # type: ignore[arg-type]
