"""What a user is told when nothing comes in, and the names he may write."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from topoloc.dds.diagnosis import COMPRESSED, ODOMETRY, RAW, Traffic, complaints
from topoloc.dds.names import Topics, domain_of, of_dds, on_dds, type_of_dds
from topoloc.errors import UserError

TOPICS = Topics("camera/image", "/odom")
NOBODY = {"image": 0, "odometry": 0}


@pytest.mark.parametrize(
    ("offered", "publishers", "says"),
    [
        ({}, 0, "no topic at all in domain 7; is the domain id right"),
        ({"/camera/image": {RAW}}, 0, f"it is published as {RAW}, not {COMPRESSED}; add --raw"),
        ({"/camera/image": {"std_msgs/msg/String"}}, 0, "name another topic"),
        ({"/b": {COMPRESSED}, "/a": {COMPRESSED}}, 0, f"nobody publishes it; {COMPRESSED} is on /a, /b"),
        ({"/tf": {"tf2_msgs/msg/TFMessage"}}, 0, "there is /tf (tf2_msgs/msg/TFMessage)"),
        ({"/camera/image": {COMPRESSED}}, 1, "1 publisher is there, but nothing arrives"),
        ({"/camera/image": {COMPRESSED}}, 2, "2 publishers are there, but nothing arrives"),
    ],
)
def test_why_no_image_comes(offered: Mapping[str, set[str]], publishers: int, says: str) -> None:
    traffic = Traffic(7, {"image": publishers, "odometry": 1}, {"odometry": 3}, offered)
    (told,) = complaints(TOPICS, traffic)
    assert told.startswith("no image on /camera/image yet: ") and says in told


def test_raw_where_the_images_are_compressed() -> None:
    offered = {"/camera/image": {COMPRESSED}, "/odom": {ODOMETRY}}
    told = complaints(Topics("/camera/image", "/odom", raw=True), Traffic(0, NOBODY, {}, offered))
    assert len(told) == 2 and told[0].endswith("leave --raw out") and told[1].startswith("no odometry on /odom yet")


def test_nothing_is_amiss() -> None:
    assert complaints(TOPICS, Traffic(0, NOBODY, {"image": 1, "odometry": 1}, {})) == []


@pytest.mark.parametrize("name", ["", "/", "camera image", "/camera/", "//camera", "/2d", "~/image", "/caméra", "/a/1"])
def test_no_name_of_a_topic(name: str) -> None:
    for names in ((name, "/odom"), ("/image", name), ("/image", "/odom", False, name)):
        with pytest.raises(UserError, match="is no ROS 2 topic name; "):
            Topics(*names)


def test_names() -> None:
    assert (TOPICS.image, TOPICS.published("pose")) == ("/camera/image", "/topoloc/pose")
    assert on_dds("/camera/image") == "rt/camera/image"
    assert [of_dds(name) for name in ("rt/odom", "rq/serviceRequest", "DCPSTopic")] == ["/odom", None, None]
    assert type_of_dds("sensor_msgs::msg::dds_::Image_") == RAW
    assert type_of_dds("HelloWorldData::Msg") == "HelloWorldData::Msg"


def test_the_domain() -> None:
    assert domain_of(5, {"ROS_DOMAIN_ID": "7"}) == 5
    assert [domain_of(None, {"ROS_DOMAIN_ID": told}) for told in ("7", "", " 42 ")] == [7, 0, 42]
    assert domain_of(None, {}) == 0
    for told in ("-1", "233", "one"):
        with pytest.raises(UserError, match="ROS_DOMAIN_ID is"):
            domain_of(None, {"ROS_DOMAIN_ID": told})
