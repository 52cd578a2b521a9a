"""The node as a user starts it, in a process of its own, and a robot in this one; all on the loopback interface."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
import threading
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cyclonedds.core import Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from oracles.loopback import DEADLINE_S, DOMAIN, LOOPBACK, NAME, until
from PIL import Image as Pictures

from sensors.images import cut_views
from topoloc.dds import messages as ros
from topoloc.dds.convert import seconds, stamp
from topoloc.dds.node import DEFAULT, PUBLISHED
from topoloc.geometry import Floats, compose, wrap
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Image

CAMERA = Camera(40.0, 96, 72)
EPOCH_S = 1_700_000_000.0


def noise_circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


NODES = tuple(Node(f"N{k}", f"place {k}", float(k), 0.5, 1.0, noise_circle(k)) for k in range(3))


def png(image: Image) -> bytes:
    buffer = io.BytesIO()
    Pictures.fromarray(image).save(buffer, "png")
    return buffer.getvalue()


def view(node: int, which: int) -> tuple[bytes, Floats]:
    """A picture taken at a node, and the robot's pose (3,) then."""
    panorama = NODES[node].panorama
    assert panorama is not None
    image, heading = cut_views(panorama, NODES[node].heading, CAMERA)[which]
    return png(image), np.array([NODES[node].x, NODES[node].y, heading])


class NodeProcess:
    """``topoloc ros`` in a process of its own; what it prints is kept."""

    def __init__(self, *options: str) -> None:
        words = ["--image-topic", f"/{NAME}/image/compressed", "--odometry-topic", f"{NAME}/odom", "--namespace", NAME]
        command = [sys.executable, "-m", "topoloc", "ros", *words, "--domain", str(DOMAIN), *options]
        self.process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, env=os.environ
        )
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(iter(self.process.stdout.readline, ""))

    def said(self) -> str:
        return "".join(self.lines)

    def end(self, how: int = signal.SIGKILL) -> int:
        if self.process.poll() is None:
            self.process.send_signal(how)
        code = self.process.wait(DEADLINE_S)
        self._reader.join()
        assert self.process.stdout is not None
        self.process.stdout.close()
        return code


class Robot:
    """Publishes pictures and odometry, and keeps what the node publishes."""

    def __init__(self) -> None:
        self.participant = DomainParticipant(DOMAIN)
        self.images = self.writer("image/compressed", ros.CompressedImage)
        self.odometry = self.writer("odom", ros.Odometry)
        patient = Qos(Policy.Reliability.Reliable(10**8), Policy.History.KeepAll)
        self.readers = {
            name: DataReader(self.participant, self.topic(name, kind), patient) for name, kind in PUBLISHED.items()
        }
        self.got: dict[str, list[Any]] = {name: [] for name in PUBLISHED}
        self.now = EPOCH_S
        self.met: set[int] = set()

    def topic(self, name: str, kind: type[Any]) -> Topic[Any]:
        return Topic(self.participant, f"rt/{NAME}/{name}", kind)

    def writer(self, name: str, kind: type[Any]) -> DataWriter[Any]:
        return DataWriter(self.participant, self.topic(name, kind), DEFAULT)

    def meet(self, node: NodeProcess) -> None:
        """Wait until all ends have found those of a node that has just been started.

        One that was killed is still thought to be there until its lease of 10 s runs out.
        """
        ends: dict[Any, Callable[[], list[int]]] = {
            writer: writer.get_matched_subscriptions for writer in (self.images, self.odometry)
        }
        ends |= {reader: reader.get_matched_publications for reader in self.readers.values()}
        until(lambda: all(set(found()) - self.met for found in ends.values()), node.said)
        self.met.update(*(found() for found in ends.values()))

    def listen(self) -> bool:
        """Take what came; true, so that a condition may go on."""
        for name, reader in self.readers.items():
            self.got[name] += [sample for sample in reader.take(100) if isinstance(sample, PUBLISHED[name])]
        return True

    def drive(self, at: float, pose: Floats) -> None:
        """An odometer with a frame of its own."""
        x, y, heading = compose((3.0, -2.0, 2.0), pose)
        turned = ros.Quaternion(0.0, 0.0, float(np.sin(heading / 2)), float(np.cos(heading / 2)))
        pose_message = ros.PoseWithCovariance(ros.Pose(ros.Point(float(x), float(y)), turned))
        self.odometry.write(ros.Odometry(ros.Header(stamp(at), "odom"), "base_link", pose_message))

    def show(self, at: float, picture: bytes) -> None:
        self.images.write(ros.CompressedImage(ros.Header(stamp(at), "camera"), "png", picture))

    def look(self, picture: bytes, pose: Floats, node: NodeProcess) -> ros.PoseWithCovarianceStamped:
        """Stand somewhere for a second, take a picture, and wait for its answer."""
        self.now += 1.0
        for shift in (-0.1, 0.1):
            self.drive(self.now + shift, pose)
        self.show(self.now, picture)
        return self.answer(self.now, node)

    def answer(self, at: float, node: NodeProcess) -> ros.PoseWithCovarianceStamped:
        wanted = stamp(at)
        before = len(self.got["status"])
        until(lambda: self.listen() and any(pose.header.stamp == wanted for pose in self.got["pose"]), node.said)
        until(lambda: self.listen() and len(self.got["status"]) > before, node.said)  # the last that is published
        message: ros.PoseWithCovarianceStamped
        message = next(pose for pose in self.got["pose"] if pose.header.stamp == wanted)
        return message


@pytest.fixture
def robot(monkeypatch: pytest.MonkeyPatch) -> Iterator[Robot]:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    yield Robot()


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., NodeProcess]]:
    """Starts the node on a map of three nodes; whatever still runs at the end is ended."""
    started: list[NodeProcess] = []
    TopoMap("tiny", CAMERA, NODES).save(tmp_path / "map")

    def begin(*options: str) -> NodeProcess:
        started.append(NodeProcess(str(tmp_path / "map"), *options))
        return started[-1]

    yield begin
    for process in started:
        process.end()


def assert_near(message: ros.PoseWithCovarianceStamped, pose: Floats) -> None:
    at, turned = message.pose.pose.position, message.pose.pose.orientation
    assert np.hypot(at.x - pose[0], at.y - pose[1]) < 0.3
    assert abs(float(wrap(2.0 * np.arctan2(turned.z, turned.w) - pose[2]))) < np.deg2rad(10.0)


def test_a_drive(robot: Robot, start: Callable[..., NodeProcess], tmp_path: Path) -> None:
    state = tmp_path / "belief.npz"
    options = ("--state", str(state), "--set", "live.camera_silent_s=1.5")
    node = start(*options)
    robot.meet(node)

    for k, which in ((0, 0), (0, 2), (1, 2), (1, 4), (2, 4)):
        picture, pose = view(k, which)
        answer = robot.look(picture, pose, node)
    assert_near(answer, pose)
    assert answer.header.frame_id == "map"
    covariance = np.reshape(answer.pose.covariance, (6, 6))
    assert np.allclose(covariance, covariance.T) and (np.diag(covariance)[[0, 1, 5]] > 0.0).all()
    assert not covariance[2:5].any()
    assert robot.got["node"][-1].data == "N2"
    assert "LOCALIZED" in [message.data for message in robot.got["status"]]
    cloud = robot.got["particle_cloud"][-1]
    assert sum(particle.weight for particle in cloud.particles) == pytest.approx(1.0)
    assert (cloud.header.frame_id, cloud.header.stamp) == ("map", answer.header.stamp)

    check_late_and_reordered(robot, node)
    check_a_burst(robot, node)
    until(lambda: robot.listen() and robot.got["status"][-1].data.startswith("LOST: the camera is silent"), node.said)
    node.end(signal.SIGKILL)
    check_a_restart(robot, start(*options), state)


def check_late_and_reordered(robot: Robot, node: NodeProcess) -> None:
    """A picture of the past is no news; readings of the odometer may come in any order."""
    picture, pose = view(1, 2)
    robot.show(robot.now - 3.5, picture)
    robot.now += 1.0
    picture, pose = view(2, 6)
    for shift in (0.1, -0.3, -0.1, 0.1):
        robot.drive(robot.now + shift, pose)
    robot.show(robot.now, picture)
    assert_near(robot.answer(robot.now, node), pose)
    assert robot.got["node"][-1].data == "N2"
    times = [seconds(message.header.stamp) for message in robot.got["pose"]]
    assert times == sorted(times), "the late picture must not be answered"


def check_a_burst(robot: Robot, node: NodeProcess) -> None:
    """More pictures than it can work on: the last one counts, and it says how many were dropped."""
    picture, pose = view(2, 6)
    before = len(robot.got["pose"])
    robot.drive(robot.now + 2.0, pose)
    for i in range(30):
        robot.show(robot.now + 0.02 * (i + 1), picture)
    robot.now += 1.0
    robot.look(picture, pose, node)
    assert len(robot.got["pose"]) - before < 30
    until(lambda: re.search(r"dropped [1-9]", node.said()), node.said)


def check_a_restart(robot: Robot, node: NodeProcess, state: Path) -> None:
    """After a kill, the first frame, though it shows nothing, has the node's name from the saved belief."""
    robot.meet(node)
    _, pose = view(2, 6)
    robot.got["node"].clear()
    answer = robot.look(png(np.full((72, 96, 3), 128, dtype=np.uint8)), pose, node)
    assert_near(answer, pose)
    assert robot.got["node"][-1].data == "N2"
    assert node.end(signal.SIGINT) == 130
    assert "1 pictures: 1 used\n" in node.said() and f"{state}: the belief; " in node.said()
    assert "Traceback" not in node.said()
