"""The ROS 2 messages that the node reads and writes, as ROS 2 puts them on the wire.

Names, fields and their order are those of ROS 2's packages ``builtin_interfaces``, ``std_msgs``, ``sensor_msgs``,
``geometry_msgs``, ``nav_msgs`` and ``nav2_msgs`` (Humble and later); each module ``package/msg/Type`` is called
``package::msg::dds_::Type_`` on DDS. Members are final, the encoding is XCDR version 1 (plain CDR), as ROS 2 uses.
Lengths are in metres, angles in radians.
"""

# No "from __future__ import annotations" here: cyclonedds reads the annotations as types, not as text.

from collections.abc import Sequence
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

from cyclonedds.idl import IdlStruct, make_idl_struct
from cyclonedds.idl.types import array, float64, int32, sequence, uint8, uint32

Message = TypeVar("Message", bound=IdlStruct)

if TYPE_CHECKING:
    Covariance: TypeAlias = Sequence[float]
    Octets: TypeAlias = bytes
else:
    Covariance: TypeAlias = array[float64, 36]
    Octets: TypeAlias = sequence[uint8]


def _no_covariance() -> Covariance:
    return [0.0] * 36


def _octets_at_once(cls: type[Message]) -> type[Message]:
    """A message whose ``data`` are bytes to Python, and a sequence of octets to others.

    cyclonedds encodes ``bytes`` members, too, but can make no topic of a message that has one; and its sequences are
    lists of Python integers: 17 ms for a VGA picture instead of 0.1 ms. Hence a twin with ``bytes`` for the encoding.
    """
    members = {item.name: bytes if item.name == "data" else item.type for item in fields(cls)}  # type: ignore[arg-type]
    twin = make_idl_struct(cls.__name__, cls.__idl_typename__, members)

    def serialize(self: Message, *options: Any, **named: Any) -> bytes:
        return twin(**{name: getattr(self, name) for name in members}).serialize(*options, **named)

    def deserialize(data: bytes, *options: Any, **named: Any) -> Message:
        return cls(**vars(twin.deserialize(data, *options, **named)))

    cls.serialize, cls.deserialize = serialize, staticmethod(deserialize)  # type: ignore[method-assign,assignment]
    return cls


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    """A moment: seconds and nanoseconds (below one second) since the clock's beginning."""

    sec: int32 = 0
    nanosec: uint32 = 0


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    """When, and in which frame."""

    stamp: Time = field(default_factory=Time)
    frame_id: str = ""


@dataclass
class String(IdlStruct, typename="std_msgs.msg.dds_.String_"):
    """A text."""

    data: str = ""


@_octets_at_once
@dataclass
class CompressedImage(IdlStruct, typename="sensor_msgs.msg.dds_.CompressedImage_"):
    """An encoded picture: ``format`` says how (``jpeg``, ``bgr8; jpeg compressed bgr8``), ``data`` is the file."""

    header: Header = field(default_factory=Header)
    format: str = ""
    data: Octets = b""


@_octets_at_once
@dataclass
class Image(IdlStruct, typename="sensor_msgs.msg.dds_.Image_"):
    """A picture as pixels: ``height`` rows of ``step`` bytes, ``width`` pixels in each, by ``encoding``."""

    header: Header = field(default_factory=Header)
    height: uint32 = 0
    width: uint32 = 0
    encoding: str = ""
    is_bigendian: uint8 = 0
    step: uint32 = 0
    data: Octets = b""


@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    """A position [m]."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    """A rotation."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    """Where, and how turned."""

    position: Point = field(default_factory=Point)
    orientation: Quaternion = field(default_factory=Quaternion)


@dataclass
class PoseWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.PoseWithCovariance_"):
    """A pose, and its covariance (6, 6) row by row: x, y, z, then the turns about these axes [m, rad]."""

    pose: Pose = field(default_factory=Pose)
    covariance: Covariance = field(default_factory=_no_covariance)


@dataclass
class PoseWithCovarianceStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PoseWithCovarianceStamped_"):
    """The same with its time and frame."""

    header: Header = field(default_factory=Header)
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    """A vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    """A velocity [m/s, rad/s]."""

    linear: Vector3 = field(default_factory=Vector3)
    angular: Vector3 = field(default_factory=Vector3)


@dataclass
class TwistWithCovariance(IdlStruct, typename="geometry_msgs.msg.dds_.TwistWithCovariance_"):
    """A velocity, and its covariance (6, 6) row by row."""

    twist: Twist = field(default_factory=Twist)
    covariance: Covariance = field(default_factory=_no_covariance)


@dataclass
class Odometry(IdlStruct, typename="nav_msgs.msg.dds_.Odometry_"):
    """The odometer's pose in ``header.frame_id``, and the velocity in ``child_frame_id``."""

    header: Header = field(default_factory=Header)
    child_frame_id: str = ""
    pose: PoseWithCovariance = field(default_factory=PoseWithCovariance)
    twist: TwistWithCovariance = field(default_factory=TwistWithCovariance)


@dataclass
class Particle(IdlStruct, typename="nav2_msgs.msg.dds_.Particle_"):
    """One pose of a belief, and its weight."""

    pose: Pose = field(default_factory=Pose)
    weight: float64 = 0.0


if TYPE_CHECKING:
    Particles: TypeAlias = Sequence[Particle]
else:
    Particles: TypeAlias = sequence[Particle]


@dataclass
class ParticleCloud(IdlStruct, typename="nav2_msgs.msg.dds_.ParticleCloud_"):
    """A belief as weighted poses."""

    header: Header = field(default_factory=Header)
    particles: Particles = field(default_factory=list)
