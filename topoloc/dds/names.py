"""ROS 2's names, and what they are called on DDS."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass

from topoloc.errors import UserError

TOPIC_PREFIX = "rt"
"""ROS 2 puts this before the name of each topic."""
MAX_DOMAIN = 232
"""Above this the ports of DDS end."""
_NAME = re.compile(r"/?[A-Za-z_][A-Za-z0-9_]*(/[A-Za-z_][A-Za-z0-9_]*)*")
_DDS_TYPE = re.compile(r"(\w+)::(\w+)::dds_::(\w+)_")


@dataclass(frozen=True)
class Topics:
    """Names of the topics that the node reads and writes, as ROS 2 writes them; a slash in front may be left out.

    Attributes:
        image: of the pictures.
        odometry: of the odometer.
        raw: the pictures are sensor_msgs/Image, else sensor_msgs/CompressedImage.
        namespace: goes before the names of what is published.
    """

    image: str
    odometry: str
    raw: bool = False
    namespace: str = "topoloc"

    def __post_init__(self) -> None:
        for name in (self.image, self.odometry, self.namespace):
            if not _NAME.fullmatch(name):
                remedy = "a name is letters, digits and _ between slashes, such as /camera/image/compressed"
                raise UserError(f"{name!r} is no ROS 2 topic name; {remedy}")
        for item in ("image", "odometry", "namespace"):
            object.__setattr__(self, item, f"/{getattr(self, item).lstrip('/')}")

    def published(self, name: str) -> str:
        """The full name of something that the node publishes."""
        return f"{self.namespace}/{name}"


def on_dds(topic: str) -> str:
    """``rt/odom`` for ``/odom``."""
    return f"{TOPIC_PREFIX}{topic}"


def of_dds(topic: str) -> str | None:
    """``/odom`` for ``rt/odom``; None for what is no topic of ROS 2."""
    prefix, slash, rest = topic.partition("/")
    return f"/{rest}" if prefix == TOPIC_PREFIX and slash else None


def type_of_dds(name: str) -> str:
    """``sensor_msgs/msg/Image`` for ``sensor_msgs::msg::dds_::Image_``; any other name as it is."""
    found = _DDS_TYPE.fullmatch(name)
    return "/".join(found.groups()) if found else name


def domain_of(option: int | None, environment: Mapping[str, str] = os.environ) -> int:
    """The domain to join: the option's, else that of ROS_DOMAIN_ID, else 0.

    Raises:
        UserError: ROS_DOMAIN_ID is no number from 0 to 232.
    """
    if option is not None:
        return option
    told = environment.get("ROS_DOMAIN_ID", "").strip() or "0"
    if not told.isdecimal() or int(told) > MAX_DOMAIN:
        raise UserError(f"ROS_DOMAIN_ID is {told!r}, not a number from 0 to {MAX_DOMAIN}; correct it, or give --domain")
    return int(told)
