"""Which topic of a bag serves for what: the one that was told, or the only one that could."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from topoloc.errors import UnknownName, UserError
from topoloc.importing.bags.bag import TRANSFORMS, Topic
from topoloc.importing.bags.pictures import COMPRESSED, RAW
from topoloc.importing.bags.poses import POSE_OF

NONE = "none"
"""What is told for a topic that is not to be taken."""
PICTURES, ODOMETRY, INFO = (RAW, COMPRESSED), "nav_msgs/Odometry", "sensor_msgs/CameraInfo"
NO_TRUTH = ("goal", "initialpose", "initial_pose", "clicked", "waypoint")
"""Names of poses that are wishes, not measurements."""
TRANSPORTS = ("compressed", "compresseddepth", "image_transport")
RECTIFIED = re.compile(r"(?<![a-z])rect(ified)?(?![a-z])")
"""A word of its own: ``direct``, ``uncorrected`` and ``unrectified`` are others."""
USES = {"image": "--image", "odometry": "--odometry", "truth": "--truth", "camera info": "--camera-info"}


@dataclass(frozen=True)
class Told:
    """Topics by name as a user tells them; None: to be found."""

    image: str | None = None
    odometry: str | None = None
    truth: str | None = None
    camera_info: str | None = None
    right: str | None = None
    depth: str | None = None


@dataclass(frozen=True)
class Chosen:
    """The topics that serve; None: none does."""

    image: Topic
    odometry: Topic | None
    truth: Topic | None
    camera_info: Topic | None
    right: Topic | None
    depth: Topic | None
    right_info: Topic | None


def use_of(topic: Topic) -> str:
    """What a topic could serve for; empty for nothing."""
    name = topic.name.lower()
    of_depth = "depth" in "/".join(stem(topic).lower().split("/")[-2:])  # /camera/depth/image_raw, /camera/depth_image
    if topic.kind in PICTURES:
        return "depth" if of_depth else "image"
    if topic.kind == INFO:
        return "" if of_depth else "camera info"
    if topic.kind == ODOMETRY:
        return "odometry"
    if topic.kind in POSE_OF:
        return "" if any(word in name for word in NO_TRUTH) else "truth"
    return "transforms" if topic.kind == TRANSFORMS else ""


def choose(topics: Sequence[Topic], told: Told, odometry: bool = True, truth: bool = True) -> Chosen:
    """The topics that serve for what.

    Args:
        topics: of the bag.
        told: by the user.
        odometry: look for it where it is not told.
        truth: the same.

    Raises:
        UserError: a topic that is told is not there or of another type; there is none with pictures; several could
            serve, and none is told.
    """
    image = _named(topics, told.image, PICTURES, "--image") or _only(topics, "image", {told.right, told.depth})
    if image is None:
        raise UserError("no topic has pictures (sensor_msgs/Image or CompressedImage); see what there is with --list")
    found_odometry = _named(topics, told.odometry, tuple(POSE_OF), "--odometry")
    if odometry and told.odometry is None:
        found_odometry = _only(topics, "odometry", {told.truth})
    found_truth = _named(topics, told.truth, tuple(POSE_OF), "--truth")
    if truth and told.truth is None:
        found_truth = _only(topics, "truth", {told.odometry})
    return Chosen(
        image,
        found_odometry,
        found_truth,
        _named(topics, told.camera_info, (INFO,), "--camera-info") if told.camera_info else _info(topics, image),
        right := _named(topics, told.right, PICTURES, "--right"),
        _named(topics, told.depth, PICTURES, "--depth"),
        None if right is None else _beside(topics, right),
    )


def _named(topics: Iterable[Topic], name: str | None, kinds: Collection[str], option: str) -> Topic | None:
    """The topic that is told; None where none is, or ``none``."""
    if name is None or name == NONE:
        return None
    found = [topic for topic in topics if topic.name.strip("/") == name.strip("/")]
    fitting = [topic for topic in found if topic.kind in kinds and topic.count]
    if fitting:
        return fitting[0]
    if not found:
        raise UnknownName("topic", name, [topic.name for topic in topics if topic.kind in kinds])
    wanted = " or ".join(kinds)
    raise UserError(f"{option} {name}: is {found[0]}; name a topic of {wanted} that has messages")


def _only(topics: Iterable[Topic], use: str, others: Collection[str | None]) -> Topic | None:
    """The only topic of a use that does not serve for another; None where there is none."""
    taken = {name.strip("/") for name in others if name}
    could = [one for one in topics if one.count and use_of(one) == use and one.name.strip("/") not in taken]
    if len(could) > 1:
        option, escape = USES[use], "" if use == "image" else f", or {USES[use]} none"
        listed = ", ".join(map(str, could))
        raise UserError(f"several topics could be the {use}: {listed}; choose one with {option} TOPIC{escape}")
    return could[0] if could else None


def stem(image: Topic) -> str:
    """The name of a topic of pictures without how they are sent: ``/image_raw`` for ``/image_raw/compressed``."""
    parent, _, last = image.name.rpartition("/")
    return parent if last.lower() in TRANSPORTS else image.name


def is_rectified(image: Topic) -> bool:
    """Whether pictures are straightened already, as their name tells: ``image_rect``, ``image_rect_color``."""
    return RECTIFIED.search(stem(image).rpartition("/")[2].lower()) is not None


def _beside(topics: Iterable[Topic], image: Topic) -> Topic | None:
    """The camera info that by ROS's rule is sent beside a topic of pictures."""
    name = f"{stem(image).rpartition('/')[0]}/camera_info"
    return next((topic for topic in topics if topic.kind == INFO and topic.count and topic.name == name), None)


def _info(topics: Sequence[Topic], image: Topic) -> Topic | None:
    """The camera info beside the pictures, or the only one there is."""
    return _beside(topics, image) or _only(topics, "camera info", ())
