"""Why nothing comes in: what a user got wrong, as far as the node can see it."""

from __future__ import annotations

from collections.abc import Mapping, Set
from dataclasses import dataclass

from topoloc.dds.names import Topics

COMPRESSED, RAW, ODOMETRY = "sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image", "nav_msgs/msg/Odometry"


@dataclass(frozen=True)
class Traffic:
    """What a node can see of its domain.

    Attributes:
        domain: its number.
        publishers: of ``image`` and ``odometry``, how many there are.
        counts: how many messages of each came.
        offered: topics that others publish, and their types, in ROS 2's words.
    """

    domain: int
    publishers: Mapping[str, int]
    counts: Mapping[str, int]
    offered: Mapping[str, Set[str]]


def wanted(topics: Topics) -> dict[str, tuple[str, str]]:
    """Name and type of what the node listens to, by kind."""
    return {"image": (topics.image, RAW if topics.raw else COMPRESSED), "odometry": (topics.odometry, ODOMETRY)}


def complaints(topics: Topics, traffic: Traffic) -> list[str]:
    """What has not come yet, why as far as it can be told, and what to do; a line each."""
    silent = [kind for kind in wanted(topics) if not traffic.counts.get(kind)]
    return [f"no {kind} on {wanted(topics)[kind][0]} yet: {_reason(kind, topics, traffic)}" for kind in silent]


def _reason(kind: str, topics: Topics, traffic: Traffic) -> str:
    topic, its_type = wanted(topics)[kind]
    here = traffic.offered.get(topic, set())
    count = traffic.publishers[kind]
    if count:
        whose = "1 publisher is" if count == 1 else f"{count} publishers are"
        return f"{whose} there, but nothing arrives; is the driver running, and the network fast enough?"
    if here and its_type not in here:
        return f"it is published as {', '.join(sorted(here))}, not {its_type}; {_remedy(here, topics)}"
    if not traffic.offered:
        return f"no topic at all in domain {traffic.domain}; is the domain id right, and the network in CYCLONEDDS_URI?"
    same = sorted(name for name, types in traffic.offered.items() if its_type in types)
    if same:
        return f"nobody publishes it; {its_type} is on {', '.join(same)}"
    others = ", ".join(f"{name} ({', '.join(sorted(types))})" for name, types in sorted(traffic.offered.items()))
    return f"nobody publishes it, nor any {its_type}; there is {others}"


def _remedy(here: Set[str], topics: Topics) -> str:
    """What to do about a topic of another type."""
    if RAW in here and not topics.raw:
        return "add --raw"
    return "leave --raw out" if COMPRESSED in here and topics.raw else "name another topic"
