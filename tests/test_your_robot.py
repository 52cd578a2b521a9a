"""README, "Your robot, your data": its commands, one after the other, on a bag of a robot (simulated)."""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from oracles.bags import Messages, Sent, jpeg, write_bag
from scipy.spatial.transform import Rotation

from benchmarks.own_data.driving import drive_of, scan_of
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from topoloc import plugins
from topoloc.cli.main import run
from topoloc.lens import pinhole_matrix
from topoloc.recording import Recording
from topoloc.rig_file import read_rig
from topoloc.topo_map import TopoMap

README = Path(__file__).parents[1] / "README.md"
SEED = 1000
ELSEWHERE = "topoloc ros"
"""Needs a running robot: tests/topoloc/dds."""


def commands() -> list[list[str]]:
    section = README.read_text().partition("## Your robot, your data")[2]
    (block, *_) = re.findall(r"```sh\n(.*?)```", section, re.DOTALL)
    lines = [line for line in block.splitlines() if not line.startswith(ELSEWHERE)]
    return [shlex.split(line, comments=True)[1:] for line in lines]


def sent(make: Messages, recording: Recording) -> Iterator[Sent]:
    """What a robot with a camera, wheels and motion capture sends while it drives."""
    assert recording.odometry is not None and recording.truth is not None and recording.camera is not None
    camera, focal = recording.camera, pinhole_matrix(recording.camera)[0, 0]
    ahead = Rotation.from_euler("ZYX", [-np.pi / 2, 0.0, -np.pi / 2])
    place = [recording.mount.x, recording.mount.y, 0.3]
    mounted = make.transforms(100.0, "base_link", "camera_optical", place, ahead)
    yield Sent(100.0, "/tf_static", "tf2_msgs/TFMessage", mounted)
    for frame in recording:
        time = 100.0 + frame.timestamp
        pose, truth = recording.odometry.at(frame.timestamp), recording.truth.at(frame.timestamp)
        info = make.camera_info(time, (camera.width, camera.height), focal, [0.0] * 5)
        yield Sent(time, "/odom", "nav_msgs/Odometry", make.odometry(time, pose))
        yield Sent(time, "/mocap", "geometry_msgs/PoseStamped", make.pose_stamped(time, truth))
        yield Sent(time, "/camera/camera_info", "sensor_msgs/CameraInfo", info)
        compressed = make.compressed(time, jpeg(np.asarray(frame.images["rgb"])))
        yield Sent(time, "/camera/image/compressed", "sensor_msgs/CompressedImage", compressed)


def filmed(recording: Recording, folder: Path) -> None:
    """ride.mp4 and ride.csv of the first frames, five a second."""
    assert recording.odometry is not None and recording.camera is not None
    size = (recording.camera.width, recording.camera.height)
    film = cv2.VideoWriter(str(folder / "ride.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 5.0, size)
    rows = ["time_s,x_mm,y_mm,heading_deg"]
    for number, frame in enumerate(list(recording)[:5]):
        film.write(np.ascontiguousarray(np.asarray(frame.images["rgb"])[:, :, ::-1]))
        x, y, heading = recording.odometry.at(frame.timestamp)
        rows.append(f"{0.2 * number},{1000 * x},{1000 * y},{np.rad2deg(heading)}")
    film.release()
    (folder / "ride.csv").write_text("\n".join(rows))


@pytest.mark.slow
def test_readme_takes_a_robot_from_its_bag_to_an_answer(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    world = plugins.make(plugins.WORLDS, "lab", {})
    assert isinstance(world, LabWorld) and isinstance(world.config, WorldSettings)
    scan = scan_of(world, SEED, tmp_path / "scan", turn_step=np.pi / 18.0)
    write_bag(tmp_path, "ros1", lambda make: sent(make, scan))
    ride = drive_of(world, SEED, tmp_path / "another_drive")
    filmed(ride, tmp_path)
    monkeypatch.chdir(tmp_path)
    for words in commands():
        code = run(words)
        said = capsys.readouterr()
        assert code == 0, f"{words}: {said.out} {said.err}"
    built, rig = TopoMap.load("map"), read_rig(Path("drive/camera.toml"))
    assert rig.camera is not None and rig.camera.hfov_deg == pytest.approx(40.0, abs=0.01)
    assert rig.mount.x == pytest.approx(0.1)
    assert len(built.nodes) == 8 and all(node.has_panorama for node in built.nodes)
    right = float(re.findall(r'"node_accuracy": ([\d.]+)', Path("run/metrics.json").read_text())[0])
    assert right > 0.8
    assert Path("tuned/settings.toml").exists()
