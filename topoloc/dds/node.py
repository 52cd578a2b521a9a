"""The node: hands over what comes in on DDS, and publishes what comes of it."""

from __future__ import annotations

import threading
from collections import Counter, OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication
from cyclonedds.core import DDSException, InstanceState, Policy, Qos, ReadCondition, SampleState, ViewState, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.internal import InvalidSample
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

from topoloc.dds import messages as ros
from topoloc.dds.convert import cloud, pixels, planar_pose, seconds, stamp, stamped_pose
from topoloc.dds.names import Topics, of_dds, on_dds, type_of_dds
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.types import Image

if TYPE_CHECKING:
    from topoloc.live.engine import LiveReport

PLAIN_CDR = Policy.DataRepresentation(use_cdrv0_representation=True)
SENSOR_DATA = Qos(Policy.Reliability.BestEffort, Policy.Durability.Volatile, PLAIN_CDR)
"""ROS 2's quality of service for sensors, apart from how many messages may wait.

A best-effort reader takes from reliable writers and from best-effort ones.
"""
IMAGES, READINGS = (Qos(Policy.History.KeepLast(depth), base=SENSOR_DATA) for depth in (30, 100))
"""About a second's worth may wait, not five messages as in ROS 2: those that are overwritten nobody counts."""
DEFAULT = Qos(
    Policy.Reliability.Reliable(duration(milliseconds=100)),
    Policy.Durability.Volatile,
    Policy.History.KeepLast(10),
    PLAIN_CDR,
)
"""ROS 2's default quality of service."""
PUBLISHED = {
    "pose": ros.PoseWithCovarianceStamped,
    "node": ros.String,
    "particle_cloud": ros.ParticleCloud,
    "status": ros.String,
}
"""What is published below the namespace."""
WAIT_MS = 50
"""How long the receiving thread sleeps before it looks whether it should stop."""
MAX_MESSAGES = 1000
"""So many at most are taken at a time."""
KEPT_STAMPS = 64
"""Stamps of so many pictures are remembered to the nanosecond, which seconds in a float are not."""


class Sink(Protocol):
    """Where what comes in goes; ``topoloc.live.engine.LiveLocalizer`` is one."""

    def on_image(self, time: float, data: bytes | Image) -> None:
        """Take a picture of a time [s]."""

    def on_odometry(self, time: float, pose: Floats) -> None:
        """Take the odometer's pose (3,) at a time [s]."""


@dataclass
class Heard:
    """What came of the messages so far.

    Attributes:
        counts: messages by kind (``image``, ``odometry``), those that could not be used (``unreadable``, ``unstamped``)
            and those that could not be published in time (``unsent``).
        problem: what was wrong with the last one that could not be used.
    """

    counts: Counter[str] = field(default_factory=Counter)
    problem: str = ""


class RosNode:
    """A participant of a domain that reads two topics and writes four: pose, node, particle_cloud and status.

    Args:
        topics: their names.
        sink: is given what comes in, by the thread that runs ``receive``.
        domain: number of the DDS domain.

    Raises:
        UserError: the domain cannot be joined.
    """

    def __init__(self, topics: Topics, sink: Sink, domain: int = 0) -> None:
        self.topics, self.heard = topics, Heard()
        self._sink = sink
        self._stamps: OrderedDict[float, ros.Time] = OrderedDict()
        try:
            self._participant = DomainParticipant(domain)
        except DDSException as error:
            remedy = "look at CYCLONEDDS_URI, at the network, and at the lines above"
            raise UserError(f"DDS domain {domain} cannot be joined ({error.msg}); {remedy}") from None
        self._images = self._reader(topics.image, ros.Image if topics.raw else ros.CompressedImage, IMAGES)
        self._odometry = self._reader(topics.odometry, ros.Odometry, READINGS)
        self._writers = {name: self._writer(name, kind) for name, kind in PUBLISHED.items()}
        self._endpoints = BuiltinDataReader(self._participant, BuiltinTopicDcpsPublication)
        self._present = ReadCondition(self._endpoints, SampleState.Any | ViewState.Any | InstanceState.Alive)

    def _reader(self, name: str, kind: type[Any], qos: Qos) -> DataReader[Any]:
        return DataReader(self._participant, Topic(self._participant, on_dds(name), kind), qos)

    def _writer(self, name: str, kind: type[Any]) -> DataWriter[Any]:
        topic = Topic(self._participant, on_dds(self.topics.published(name)), kind)
        return DataWriter(self._participant, topic, DEFAULT)

    def receive(self, stop: threading.Event) -> None:
        """Hand over what comes in until ``stop`` is set.

        A thread of ours that waits, not listeners: those would make the receiving threads of DDS wait for Python.
        """
        waitset = WaitSet(self._participant)
        conditions = {}
        for reader, take in ((self._odometry, self._take_odometry), (self._images, self._take_image)):
            conditions[reader] = ReadCondition(reader, SampleState.Any | ViewState.Any | InstanceState.Any), take
            waitset.attach(conditions[reader][0])
        while not stop.is_set():
            waitset.wait(duration(milliseconds=WAIT_MS))
            for reader, (condition, take) in conditions.items():  # odometry first: a frame asks for it
                self._drain(reader, condition, take)

    def _drain(self, reader: DataReader[Any], condition: ReadCondition, take: Callable[[Any], None]) -> None:
        """Take all that waits, one by one, so that one that is no message costs no other."""
        for _ in range(MAX_MESSAGES):
            try:
                samples = reader.take(condition=condition)
                if not samples:
                    return
                if not isinstance(samples[0], InvalidSample):  # which is the news that a publisher has gone
                    take(samples[0])
            except DDSException:
                raise
            except Exception as error:  # whatever a stranger's bytes raise: the robot runs on
                self.heard.counts["unreadable"] += 1
                self.heard.problem = str(error)

    def _take_image(self, message: ros.Image | ros.CompressedImage) -> None:
        time = self._time_of("image", message.header)
        if time is None:
            return
        self._stamps[time] = message.header.stamp
        while len(self._stamps) > KEPT_STAMPS:
            self._stamps.popitem(last=False)
        self._sink.on_image(time, pixels(message) if isinstance(message, ros.Image) else message.data)

    def _take_odometry(self, message: ros.Odometry) -> None:
        time = self._time_of("odometry", message.header)
        if time is not None:
            self._sink.on_odometry(time, planar_pose(message))

    def _time_of(self, kind: str, header: ros.Header) -> float | None:
        """Count a message; its time, or None where nobody filled it in."""
        time = seconds(header.stamp)
        self.heard.counts[kind] += 1
        if time == 0.0:
            self.heard.counts["unstamped"] += 1
            self.heard.problem = f"{kind} messages carry no time; fill in header.stamp"
            return None
        return time

    def publish(self, report: LiveReport) -> None:
        """Tell what came of a picture, under its own stamp; before the first one there is no pose to tell."""
        self._write("node", ros.String(report.node_id or ""))
        if report.counts.used:
            time = self._stamps.get(report.timestamp) or stamp(report.timestamp)
            self._write("pose", stamped_pose(report.estimate, time))
            self._write("particle_cloud", cloud(report.belief, time))
        self._write("status", ros.String(f"{report.status.value}: {report.why}".removesuffix(": ")))

    def _write(self, name: str, message: Any) -> None:
        """A subscriber that does not keep up may cost us a message, but must not stop the robot's localizer."""
        try:
            self._writers[name].write(message)
        except DDSException:
            self.heard.counts["unsent"] += 1

    def publishers(self) -> dict[str, int]:
        """How many publishers there are of images and of odometry."""
        readers = {"image": self._images, "odometry": self._odometry}
        return {kind: len(reader.get_matched_publications()) for kind, reader in readers.items()}

    def offered(self) -> dict[str, set[str]]:
        """Topics of ROS 2 that somebody else publishes in the domain, and their types."""
        found: dict[str, set[str]] = {}
        ours = self._participant.get_guid()
        for endpoint in self._endpoints.read(N=MAX_MESSAGES, condition=self._present):
            name = of_dds(endpoint.topic_name)
            if name is not None and endpoint.participant_key != ours:
                found.setdefault(name, set()).add(type_of_dds(endpoint.type_name))
        return found
