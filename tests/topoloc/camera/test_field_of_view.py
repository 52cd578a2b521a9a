"""The field of view from turns on the spot in a drawn room (simulated), and on real photographs."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.shared_data import RING6_QUERIES, SHARED_DATA, yaws

from topoloc.camera.field_of_view import estimate_field_of_view
from topoloc.camera.turns import spot_pairs
from topoloc.errors import InputError, UserError
from topoloc.recording import Recording, Track, write_track
from topoloc.topo_map import Camera

COURTYARD = SHARED_DATA / "rotation_courtyard" / "snapshots"


def turn(step_deg: float, frames: int) -> np.ndarray:
    return np.column_stack([np.tile([0.3, 0.1], (frames, 1)), np.deg2rad(step_deg) * np.arange(frames)])


def test_full_circle_overrules_the_odometer(circle: Path) -> None:
    """Its odometer turns 3 % too little, which alone would make the field of view as much too narrow."""
    found = estimate_field_of_view(Recording.load(circle))
    assert found.hfov_deg == pytest.approx(62.0, rel=0.01)
    assert found.odometer_scale == pytest.approx(1.0 / 0.97, abs=0.003)
    assert found.turned_deg == pytest.approx(360.0)
    assert found.closed and found.circles == 1 and found.agreeing > 0.8
    # nobody tells where the camera sits: 0.2 m ahead of the axis would cost 4 to 6 %
    assert not found.place_told and 0.04 < found.sd_deg / found.hfov_deg < 0.06
    assert found.size == (256, 192)
    assert len(found.residuals) == len(found.points.before)


@pytest.mark.slow
def test_camera_told_to_sit_on_the_axis(circle: Path, tmp_path: Path) -> None:
    folder = tmp_path / "told"
    shutil.copytree(circle, folder)
    with (folder / "camera.toml").open("a") as file:
        file.write("\n[mount]\nx = 0.0\n")
    found = estimate_field_of_view(Recording.load(folder))
    assert found.place_told and found.sd_deg < 0.5


def test_each_of_several_circles_counts(film: Callable[..., Recording], monkeypatch: pytest.MonkeyPatch) -> None:
    """However few pairs of frames are compared, the turns stay whole; the second one ends with a turn back."""
    monkeypatch.setattr("topoloc.camera.turns.MOST_PAIRS", 20)
    back = np.concatenate([turn(-20.0, 19), turn(20.0, 3)[1:]]) + np.array([-0.8, 0.4, 0.0])
    recording = film(np.concatenate([turn(-20.0, 19), back]), Camera(62.0, 256, 192), scale=0.97)
    found = estimate_field_of_view(recording)
    assert found.circles == 2 and found.turned_deg == pytest.approx(720.0)
    assert found.hfov_deg == pytest.approx(62.0, rel=0.005)
    assert found.odometer_scale == pytest.approx(1.0 / 0.97, abs=0.003)


@pytest.mark.slow
def test_noise_of_the_odometer_is_no_harm_in_a_circle(film: Callable[..., Recording]) -> None:
    """What it errs in single steps, 2 degrees here, is not taken for turns of the camera."""
    recording = film(turn(12.0, 31), Camera(62.0, 256, 192))
    assert recording.odometry is not None
    poses = recording.odometry.poses.copy()
    poses[:, 2] += np.random.default_rng(301).normal(0.0, np.deg2rad(2.0), len(poses))
    found = estimate_field_of_view(replace(recording, odometry=Track(recording.odometry.times, poses)))
    assert found.circles == 1
    assert found.hfov_deg == pytest.approx(62.0, rel=0.003)


@pytest.mark.slow
@pytest.mark.parametrize(("hfov_deg", "step_deg"), [(40.0, 14.0), (90.0, -25.0)])
def test_full_circle_without_odometry(film: Callable[..., Recording], hfov_deg: float, step_deg: float) -> None:
    frames = int(380.0 / abs(step_deg)) + 1
    found = estimate_field_of_view(film(turn(step_deg, frames), Camera(hfov_deg, 256, 192), odometry=False))
    assert found.hfov_deg == pytest.approx(hfov_deg, rel=0.005)
    assert found.closed and found.odometer_scale is None
    assert found.turned_deg == pytest.approx(360.0)


def test_camera_ahead_of_the_axis(film: Callable[..., Recording]) -> None:
    """A part of a circle, the odometer right, the camera 0.15 m ahead and looking down: all told but the pitch."""
    recording = film(turn(10.0, 10), Camera(62.0, 256, 192), mount=(0.15, 0.0, 0.0), pitch=np.deg2rad(10.0))
    found = estimate_field_of_view(recording)
    assert found.hfov_deg == pytest.approx(62.0, rel=0.02)
    assert found.pitch_deg == pytest.approx(10.0, abs=2.0)
    assert not found.closed and found.place_told and found.sd_deg > 0.5


def first(recording: Recording, frames: int) -> Recording:
    return replace(recording, pictures={"rgb": recording.pictures["rgb"][:frames]})


class TestRefused:
    def test_straight_drive(self, straight: Path) -> None:
        with pytest.raises(UserError, match="turns on the spot by 0 degrees only; turn the robot on the spot"):
            estimate_field_of_view(Recording.load(straight))

    def test_odometer_of_the_other_sense(self, circle: Path) -> None:
        recording = first(Recording.load(circle), 8)
        assert recording.odometry is not None
        other = replace(recording, odometry=Track(recording.odometry.times, recording.odometry.poses * [1, 1, -1]))
        with pytest.raises(InputError, match="turns the other way than the pictures do"):
            estimate_field_of_view(other)

    def test_part_of_a_circle_without_odometry(self, circle: Path) -> None:
        part = replace(first(Recording.load(circle), 10), odometry=None)
        with pytest.raises(InputError, match="no circle closes in 10 pictures; turn the robot on the spot"):
            estimate_field_of_view(part)

    def test_odometry_of_another_drive(self, circle: Path) -> None:
        recording = first(Recording.load(circle), 10)
        assert recording.odometry is not None
        jumps = np.random.default_rng(0).uniform(5.0, 25.0, len(recording.odometry.times))
        poses = np.column_stack([np.zeros((len(jumps), 2)), np.deg2rad(np.cumsum(jumps))])
        with pytest.raises(InputError, match="% of what is seen twice moves as in a turn"):
            estimate_field_of_view(replace(recording, odometry=Track(recording.odometry.times, poses)))

    def test_frames_too_far_apart(self, film: Callable[..., Recording]) -> None:
        """It did turn a full circle: that it should do so is no help."""
        recording = film(turn(30.0, 13), Camera(40.0, 256, 192))
        assert recording.odometry is not None
        poses = recording.odometry.poses.copy()
        poses[:, 2] += np.random.default_rng(302).normal(0.0, np.deg2rad(8.0), len(poses))
        problem = r"frames in the turns are 26 degrees apart, and share less than half .* every (9|10) degrees or less"
        with pytest.raises(InputError, match=problem):
            estimate_field_of_view(replace(recording, odometry=Track(recording.odometry.times, poses)))

    def test_nothing_seen_twice(self, film: Callable[..., Recording]) -> None:
        with pytest.raises(
            InputError, match=r"0 of 11 pairs .* they are 36 degrees apart; .* every 10 degrees or less"
        ):
            estimate_field_of_view(film(turn(36.0, 12), Camera(40.0, 256, 192)))

    def test_panoramas(self, circle: Path) -> None:
        with pytest.raises(InputError, match=r"name a recording with rgb\.txt"):
            estimate_field_of_view(replace(Recording.load(circle), kind="omni"))

    def test_camera_that_is_covered_on_the_way(self, circle: Path) -> None:
        """One frame lost is no harm; after two the chain ends, whatever alike is seen later."""
        recording = replace(Recording.load(circle), odometry=None)
        pictures = list(recording.pictures["rgb"])
        for number in (3, 4):
            pictures[number] = replace(pictures[number], path=circle / "none.png")
        with pytest.raises(InputError, match=r"after 000002\.png too little is seen again"):
            estimate_field_of_view(replace(recording, pictures={"rgb": pictures}))

    def test_impossible_distance(self, circle: Path) -> None:
        with pytest.raises(UserError, match="scene_m is 0"):
            estimate_field_of_view(Recording.load(circle), scene_m=0.0)


def test_pairs_are_taken_where_the_robot_turns_only() -> None:
    drive = np.column_stack([0.1 * np.arange(10), np.zeros(10), np.deg2rad(3.0) * np.arange(10)])
    spot = drive[-1] + np.column_stack([np.zeros((8, 2)), np.deg2rad(6.0) * np.arange(1, 9)])
    robot = np.concatenate([drive, spot])
    pairs = spot_pairs(robot, robot[:, 2])
    assert pairs and all(first >= 9 for first, _ in pairs)
    assert {second - first for first, second in pairs} == {1, 2, 3, 6}


def recorded(photographs: Path, folder: Path, odometry: bool) -> Recording:
    """A recording of photographs of a turn, with their true headings for an odometer or without any."""
    truth = yaws(photographs)
    folder.mkdir()
    for name in truth:
        shutil.copy(photographs / name, folder / name)
    (folder / "rgb.txt").write_text("".join(f"{i}.0 {name}\n" for i, name in enumerate(truth)))
    if odometry:
        poses = np.column_stack([np.zeros((len(truth), 2)), np.deg2rad(list(truth.values()))])
        write_track(folder / "odometry.txt", list(range(len(truth))), poses)
    return Recording.load(folder)


@pytest.mark.skipif(not COURTYARD.is_dir(), reason="the real photographs are not on this machine")
@pytest.mark.parametrize("odometry", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_photographs_of_a_courtyard(tmp_path: Path, odometry: bool) -> None:
    """Hand-held, 30 degrees apart, pillars near by: about 65 degrees."""
    found = estimate_field_of_view(recorded(COURTYARD, tmp_path / "r", odometry))
    assert found.hfov_deg == pytest.approx(65.0, abs=1.0)
    assert found.closed


@pytest.mark.slow
@pytest.mark.skipif(not RING6_QUERIES.is_dir(), reason="the real photographs are not on this machine")
def test_photographs_of_a_laboratory(tmp_path: Path) -> None:
    found = estimate_field_of_view(recorded(RING6_QUERIES, tmp_path / "r", odometry=True))
    assert found.hfov_deg == pytest.approx(40.0, abs=0.2)
