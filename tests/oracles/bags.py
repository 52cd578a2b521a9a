"""Bags as robots write them, by ``rosbags``: messages of ROS 1 and ROS 2, and files of every kind."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from rosbags import rosbag1, rosbag2
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from scipy.spatial.transform import Rotation

from topoloc.geometry import Floats
from topoloc.types import Image


@cache
class Messages:
    """Makes messages of ROS 1 or ROS 2."""

    def __init__(self, ros1: bool) -> None:
        self.ros1 = ros1
        self.store = get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE)
        self.store.register(get_types_from_msg("string text\nfloat32[] values", "my_robot/msg/Secret"))
        if ros1:
            definition = "geometry_msgs/TransformStamped[] transforms"
            self.store.register(get_types_from_msg(definition, "tf2_msgs/msg/TFMessage"))

    def make(self, kind: str, *values: Any) -> Any:
        return self.store.types[kind.replace("/", "/msg/")](*values)

    def header(self, time: float, frame: str) -> Any:
        stamp = self.make("builtin_interfaces/Time", int(time), round((time - int(time)) * 1e9))
        return self.make("std_msgs/Header", *([0] if self.ros1 else []), stamp, frame)

    def pose(self, pose: Floats) -> Any:
        x, y, z, w = Rotation.from_euler("z", pose[2]).as_quat()
        place = self.make("geometry_msgs/Point", pose[0], pose[1], 0.0)
        return self.make("geometry_msgs/Pose", place, self.make("geometry_msgs/Quaternion", x, y, z, w))

    def odometry(self, time: float, pose: Floats) -> Any:
        zero, unsure = self.make("geometry_msgs/Vector3", 0.0, 0.0, 0.0), np.zeros(36)
        told = self.make("geometry_msgs/PoseWithCovariance", self.pose(pose), unsure)
        twist = self.make("geometry_msgs/TwistWithCovariance", self.make("geometry_msgs/Twist", zero, zero), unsure)
        return self.make("nav_msgs/Odometry", self.header(time, "odom"), "base_link", told, twist)

    def pose_stamped(self, time: float, pose: Floats) -> Any:
        return self.make("geometry_msgs/PoseStamped", self.header(time, "map"), self.pose(pose))

    def transforms(self, time: float, parent: str, child: str, place: Sequence[float], turn: Rotation) -> Any:
        x, y, z, w = turn.as_quat()
        quaternion = self.make("geometry_msgs/Quaternion", x, y, z, w)
        transform = self.make("geometry_msgs/Transform", self.make("geometry_msgs/Vector3", *place), quaternion)
        stamped = self.make("geometry_msgs/TransformStamped", self.header(time, parent), child, transform)
        return self.make("tf2_msgs/TFMessage", [stamped])

    def image(self, time: float, image: Image) -> Any:
        rows, columns = image.shape[:2]
        values = (rows, columns, "rgb8", 0, 3 * columns, image.reshape(-1))
        return self.make("sensor_msgs/Image", self.header(time, "camera_optical"), *values)

    def compressed(self, time: float, data: bytes) -> Any:
        header = self.header(time, "camera_optical")
        return self.make("sensor_msgs/CompressedImage", header, "jpeg", np.frombuffer(data, dtype=np.uint8))

    def camera_info(self, time: float, size: tuple[int, int], focal: float, bent: Sequence[float]) -> Any:
        """Of a camera of (columns, rows), whose axis goes through the middle."""
        columns, rows = size
        matrix = np.array([focal, 0.0, (columns - 1) / 2, 0.0, focal, (rows - 1) / 2, 0.0, 0.0, 1.0])
        projection = np.insert(matrix.reshape(3, 3), 3, 0.0, axis=1).reshape(-1)
        region = self.make("sensor_msgs/RegionOfInterest", 0, 0, 0, 0, False)
        values = (rows, columns, "plumb_bob", np.array(bent), matrix, np.eye(3).reshape(-1), projection, 0, 0, region)
        return self.make("sensor_msgs/CameraInfo", self.header(time, "camera_optical"), *values)


def jpeg(image: Image) -> bytes:
    return bytes(cv2.imencode(".jpg", image[:, :, ::-1])[1])


@dataclass
class Sent:
    """A message on its way into a bag: when it is received, its topic and type; as bytes it goes in as it is."""

    time: float
    topic: str
    kind: str
    message: Any


def write_bag(folder: Path, kind: str, sent: Callable[[Messages], Iterable[Sent]]) -> Path:
    """Write a bag of a kind; returns its path."""
    form, _, packing = kind.partition("-")
    make = Messages(form == "ros1")
    path = folder / ("drive.bag" if form == "ros1" else "drive")
    writer: Any
    if form == "ros1":
        writer = rosbag1.Writer(path)
        if packing:
            writer.set_compression(rosbag1.Writer.CompressionFormat[packing.upper()])
    else:
        writer = rosbag2.Writer(
            path, version=9, storage_plugin=StoragePlugin[f"{form.upper()}3" if form == "sqlite" else "MCAP"]
        )
        if packing:
            writer.set_compression(CompressionMode[packing.upper()], CompressionFormat.ZSTD)
    connections: dict[str, Any] = {}
    with writer:
        for one in sorted(sent(make), key=lambda one: one.time):
            name = one.kind.replace("/", "/msg/")
            if one.topic not in connections:
                connections[one.topic] = writer.add_connection(one.topic, name, typestore=make.store)
            if isinstance(one.message, bytes):
                writer.write(connections[one.topic], round(one.time * 1e9), one.message)
                continue
            data = (make.store.serialize_ros1 if make.ros1 else make.store.serialize_cdr)(one.message, name)
            writer.write(connections[one.topic], round((one.time + 0.005) * 1e9), data)
    return path
