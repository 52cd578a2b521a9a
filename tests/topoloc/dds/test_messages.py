"""The messages on the wire: byte for byte what rosbags' serializer, another implementation, makes of them."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from cyclonedds.idl import IdlStruct
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from topoloc.dds import messages as ros

STORE = get_typestore(Stores.ROS2_HUMBLE)
NAV2 = {
    "nav2_msgs/msg/Particle": "geometry_msgs/Pose pose\nfloat64 weight",
    "nav2_msgs/msg/ParticleCloud": "std_msgs/Header header\nParticle[] particles",
}
for name, definition in NAV2.items():
    STORE.register(get_types_from_msg(definition, name))

FLOATS = st.floats(allow_nan=False)  # which would equal nothing, itself included
COVARIANCES = st.lists(FLOATS, min_size=36, max_size=36)
TIMES = st.builds(ros.Time, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1))
HEADERS = st.builds(ros.Header, TIMES, st.text(max_size=9))
POINTS = st.builds(ros.Point, FLOATS, FLOATS, FLOATS)
VECTORS = st.builds(ros.Vector3, FLOATS, FLOATS, FLOATS)
POSES = st.builds(ros.Pose, POINTS, st.builds(ros.Quaternion, FLOATS, FLOATS, FLOATS, FLOATS))
POSES_WITH_COVARIANCE = st.builds(ros.PoseWithCovariance, POSES, COVARIANCES)
TWISTS = st.builds(ros.TwistWithCovariance, st.builds(ros.Twist, VECTORS, VECTORS), COVARIANCES)
UINT32 = st.integers(0, 2**32 - 1)
OCTETS = st.binary(max_size=20)
PARTICLES = st.lists(st.builds(ros.Particle, POSES, FLOATS), max_size=3)
MESSAGES = {
    "builtin_interfaces/msg/Time": TIMES,
    "std_msgs/msg/Header": HEADERS,
    "std_msgs/msg/String": st.builds(ros.String, st.text()),
    "sensor_msgs/msg/CompressedImage": st.builds(ros.CompressedImage, HEADERS, st.text(), OCTETS),
    "sensor_msgs/msg/Image": st.builds(
        ros.Image, HEADERS, UINT32, UINT32, st.text(max_size=9), st.integers(0, 255), UINT32, OCTETS
    ),
    "geometry_msgs/msg/PoseWithCovarianceStamped": st.builds(
        ros.PoseWithCovarianceStamped, HEADERS, POSES_WITH_COVARIANCE
    ),
    "nav_msgs/msg/Odometry": st.builds(ros.Odometry, HEADERS, st.text(max_size=9), POSES_WITH_COVARIANCE, TWISTS),
    "nav2_msgs/msg/ParticleCloud": st.builds(ros.ParticleCloud, HEADERS, PARTICLES),
}


def kind_of(message: IdlStruct) -> str:
    """``sensor_msgs/msg/Image`` for ``sensor_msgs.msg.dds_.Image_``."""
    return type(message).__idl_typename__.replace(".dds_.", ".").replace(".", "/").removesuffix("_")


def as_rosbags(value: Any) -> Any:
    """The same message made of rosbags' classes."""
    if isinstance(value, bytes):
        return np.frombuffer(value, dtype=np.uint8)
    if isinstance(value, list):
        return np.array(value) if value and isinstance(value[0], float) else [as_rosbags(item) for item in value]
    if not isinstance(value, IdlStruct):
        return value
    members = {name: as_rosbags(getattr(value, name)) for name in type(value).__annotations__}
    return STORE.types[kind_of(value)](**members)


@pytest.mark.parametrize("kind", MESSAGES)
def test_the_bytes_are_those_of_rosbags(kind: str) -> None:
    @settings(max_examples=40, deadline=None, derandomize=True, database=None)
    @given(MESSAGES[kind])
    def check(message: IdlStruct) -> None:
        assert kind_of(message) == kind
        theirs = bytes(STORE.serialize_cdr(as_rosbags(message), kind))
        assert message.serialize(use_version_2=False) == theirs
        assert type(message).deserialize(theirs) == message

    check()
