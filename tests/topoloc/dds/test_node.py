"""The node beside a robot in the same process: what it hands over, what it counts, and what it sees of the domain."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from typing import Any

import cv2
import numpy as np
import pytest
from cyclonedds.core import DDSException
from cyclonedds.domain import DomainParticipant
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from oracles.loopback import DOMAIN, LOOPBACK, NAME, until

from topoloc.dds import convert
from topoloc.dds import messages as ros
from topoloc.dds.names import Topics
from topoloc.dds.node import DEFAULT, PUBLISHED, RosNode
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.live import LiveCounts, LiveReport
from topoloc.types import Estimate, Image, Status, WeightedPoses


class Sink:
    def __init__(self) -> None:
        self.images: list[tuple[float, bytes | Image]] = []
        self.odometry: list[tuple[float, Floats]] = []

    def on_image(self, time: float, data: bytes | Image) -> None:
        self.images.append((time, data))

    def on_odometry(self, time: float, pose: Floats) -> None:
        self.odometry.append((time, pose))


class Beside:
    """A node that receives, and writers to its topics."""

    def __init__(self, raw: bool = False) -> None:
        self.sink = Sink()
        name = f"{NAME}_{'raw' if raw else 'compressed'}"
        self.topics = Topics(f"{name}/image", f"{name}/odom", raw, name)
        self.node = RosNode(self.topics, self.sink, DOMAIN)
        self.participant = DomainParticipant(DOMAIN)
        self.images = self.writer("image", ros.Image if raw else ros.CompressedImage)
        self.odometry = self.writer("odom", ros.Odometry)
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.node.receive, args=(self.stop,))
        self.thread.start()
        until(lambda: self.node.publishers() == {"image": 1, "odometry": 1})

    def topic(self, name: str, kind: type[Any]) -> Topic[Any]:
        return Topic(self.participant, f"rt{self.topics.published(name)}", kind)

    def writer(self, name: str, kind: type[Any]) -> DataWriter[Any]:
        return DataWriter(self.participant, self.topic(name, kind), DEFAULT)

    def end(self) -> None:
        self.stop.set()
        self.thread.join()


@pytest.fixture
def beside(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[Beside]:
    monkeypatch.setenv("CYCLONEDDS_URI", LOOPBACK)
    both = Beside(raw=getattr(request, "param", False))
    yield both
    both.end()


class Latin(str):
    """A text that is sent as ROS 2 allows it, not as UTF-8."""

    def encode(self, encoding: str = "utf-8", errors: str = "strict") -> bytes:
        return super().encode("latin-1")


def test_what_comes_in_is_handed_over(beside: Beside) -> None:
    beside.odometry.write(ros.Odometry(ros.Header(ros.Time(5, 250_000_000))))
    beside.images.write(ros.CompressedImage(ros.Header(ros.Time(7, 500_000_000)), "jpeg", b"a picture"))
    until(lambda: beside.sink.images and beside.sink.odometry)
    assert beside.sink.images == [(7.5, b"a picture")]
    assert [(time, pose.tolist()) for time, pose in beside.sink.odometry] == [(5.25, [0.0, 0.0, 0.0])]


def test_what_cannot_be_used_is_counted_and_costs_nothing_else(beside: Beside) -> None:
    beside.images.write(ros.CompressedImage(ros.Header(ros.Time(1), Latin("Kamera für alles")), "jpeg", b"1"))
    beside.images.write(ros.CompressedImage(ros.Header(ros.Time(0, 0)), "jpeg", b"0"))
    beside.images.write(ros.CompressedImage(ros.Header(ros.Time(2)), "jpeg", b"2"))
    until(lambda: beside.sink.images)
    assert beside.sink.images == [(2.0, b"2")]
    assert beside.node.heard.counts == {"image": 2, "unreadable": 1, "unstamped": 1}
    assert "header.stamp" in beside.node.heard.problem


@pytest.mark.parametrize("beside", [True], indirect=True)
def test_raw_pictures(beside: Beside) -> None:
    header = ros.Header(ros.Time(1))
    beside.images.write(ros.Image(header, 1, 2, "bgr8", 0, 8, bytes([1, 2, 3, 4, 5, 6, 0, 0])))
    beside.images.write(ros.Image(header, 1, 2, "32FC1", 0, 8, bytes(8)))
    until(lambda: beside.sink.images and beside.node.heard.counts["unreadable"])
    assert np.array_equal(beside.sink.images[0][1], [[[3, 2, 1], [6, 5, 4]]])
    assert "'32FC1'" in beside.node.heard.problem


@pytest.mark.parametrize("beside", [True], indirect=True)
def test_whatever_decoding_raises_is_counted(beside: Beside, monkeypatch: pytest.MonkeyPatch) -> None:
    def pixels(message: ros.Image) -> Image:
        if message.width == 1:
            raise cv2.error("no such picture")
        return convert.pixels(message)

    monkeypatch.setattr("topoloc.dds.node.pixels", pixels)
    header = ros.Header(ros.Time(1))
    for width in (1, 2):
        beside.images.write(ros.Image(header, 1, width, "rgb8", 0, 3 * width, bytes(3 * width)))
    until(lambda: beside.sink.images or not beside.thread.is_alive())
    assert beside.thread.is_alive() and beside.node.heard.counts["unreadable"] == 1
    assert beside.node.heard.problem == "no such picture"


def test_who_else_is_there(beside: Beside) -> None:
    """What others publish is seen while they do so; what the node publishes is not."""
    camera = beside.writer("other", ros.Image)
    there = {beside.topics.published(name): {kind} for name, kind in (
        ("image", "sensor_msgs/msg/CompressedImage"),
        ("odom", "nav_msgs/msg/Odometry"),
        ("other", "sensor_msgs/msg/Image"),
    )}  # fmt: skip
    until(lambda: beside.node.offered() == there)
    del camera
    del there[beside.topics.published("other")]
    until(lambda: beside.node.offered() == there)


def report(time: float, used: int, why: str = "") -> LiveReport:
    estimate = Estimate(np.array([1.0, 2.0, 3.0]), np.diag([1.0, 2.0, 3.0]), 0, 0.9, Status.LOST)
    belief = WeightedPoses.uniform([[1.0, 2.0, 3.0], [1.5, 2.0, -3.0]])
    return LiveReport(time, estimate, Status.LOST, why, belief, np.zeros(3), "N0", LiveCounts(used=used), 0.0)


def test_what_comes_of_it_is_published_under_the_stamp_of_its_picture(beside: Beside) -> None:
    readers = {
        name: DataReader(beside.participant, beside.topic(name, kind), DEFAULT) for name, kind in PUBLISHED.items()
    }
    until(lambda: all(reader.get_matched_publications() for reader in readers.values()))
    exact = ros.Time(1_700_000_000, 123_456_789)  # which a float cannot hold
    beside.images.write(ros.CompressedImage(ros.Header(exact), "jpeg", b"a picture"))
    until(lambda: beside.sink.images)
    beside.node.publish(report(0.0, used=0))
    beside.node.publish(report(beside.sink.images[0][0], used=1, why="the camera is silent for 3.1 s"))
    got: dict[str, list[Any]] = {name: [] for name in readers}
    wanted = {"node": 2, "pose": 1, "particle_cloud": 1, "status": 2}

    def all_came() -> bool:
        for name in wanted:
            got[name] += readers[name].take(9)
        return all(len(got[name]) >= count for name, count in wanted.items())

    until(all_came)
    assert [message.data for message in got["node"]] == ["N0", "N0"]
    assert [message.data for message in got["status"]] == ["LOST", "LOST: the camera is silent for 3.1 s"]
    (pose,), (cloud,) = got["pose"], got["particle_cloud"]
    assert (pose.header, cloud.header) == (ros.Header(exact, "map"), ros.Header(exact, "map"))
    assert [particle.weight for particle in cloud.particles] == [0.5, 0.5]
    assert (pose.pose.pose.position.x, pose.pose.pose.position.y) == (1.0, 2.0)
    assert np.array_equal(np.diag(np.reshape(pose.pose.covariance, (6, 6))), [1.0, 2.0, 0.0, 0.0, 0.0, 3.0])


def test_a_subscriber_that_does_not_keep_up_does_not_stop_the_node(
    beside: Beside, monkeypatch: pytest.MonkeyPatch
) -> None:
    def late(*_: object) -> None:
        raise DDSException(DDSException.DDS_RETCODE_TIMEOUT, "while writing")

    monkeypatch.setattr(DataWriter, "write", late)
    beside.node.publish(report(1.0, used=1))
    assert beside.node.heard.counts["unsent"] == len(PUBLISHED)


def test_a_domain_that_cannot_be_joined(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Domain><NoSuchThing/></Domain></CycloneDDS>")
    with pytest.raises(UserError, match=r"DDS domain 101 cannot be joined .*CYCLONEDDS_URI"):
        RosNode(Topics("/image", "/odom"), Sink(), 101)
    assert "NoSuchThing" in capfd.readouterr().err
