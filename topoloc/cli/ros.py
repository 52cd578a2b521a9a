"""``topoloc ros``: a node that localizes a running robot, on DDS with ROS 2's messages."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.live_setup import LiveChoice, live_localizer, stopped_by_signals
from topoloc.cli.localize import SETTINGS_HELP

if TYPE_CHECKING:
    from topoloc.dds.names import Topics
    from topoloc.dds.node import RosNode
    from topoloc.live.engine import LiveLocalizer, LiveReport

PATIENCE_S = 3.0
"""What does not come is told after so long, and looked at again so often [s]."""
LIVE_SETTINGS_HELP = f"{SETTINGS_HELP} Of the live run itself: live.KEY=VALUE, such as live.camera_silent_s=1."


def ros(
    topo_map: Annotated[Path, Parameter(name="map", help="Map folder, or a text map.")],
    *,
    image_topic: Annotated[str, Parameter(help="Of the camera, such as /camera/image/compressed.")],
    odometry_topic: Annotated[str, Parameter(help="Of the odometer: nav_msgs/Odometry.")] = "/odom",
    raw: Annotated[
        bool, Parameter(help="The images are sensor_msgs/Image, else sensor_msgs/CompressedImage.", negative="")
    ] = False,
    namespace: Annotated[str, Parameter(help="Goes before the names of what is published.")] = "topoloc",
    domain: Annotated[
        int | None, Parameter(help="DDS domain; without it ROS_DOMAIN_ID, else 0.", validator=Number(gte=0, lte=232))
    ] = None,
    camera_toml: Annotated[
        Path | None, Parameter(help="The camera's lens and its place on the robot, as in a recording.")
    ] = None,
    state: Annotated[Path | None, Parameter(help="File that keeps the belief for the next start.")] = None,
    sensor: Annotated[str, Parameter(help="See 'topoloc list sensors'; several as one: a+b, 'mix(a,b)'.")] = "ima",
    estimator: Annotated[str, Parameter(help="See 'topoloc list estimators'.")] = "activity",
    seed: Annotated[int, Parameter(help="Of the estimator's random numbers.", validator=Number(gte=0))] = 0,
    settings: Annotated[tuple[str, ...], Parameter(name="--set", help=LIVE_SETTINGS_HELP)] = (),
) -> None:
    """Localize a running robot that speaks ROS 2; no ROS is needed here, only the extra ``topoloc[dds]``.

    Listens to images and odometry, and publishes ``pose`` (geometry_msgs/PoseWithCovarianceStamped in the frame
    ``map``), ``node`` (std_msgs/String, the node's id, empty while unknown), ``particle_cloud``
    (nav2_msgs/ParticleCloud) and ``status`` (std_msgs/String) below the namespace. Ctrl-C ends it, with exit code 130.

    Example: ``topoloc ros lab/map --image-topic /camera/image/compressed --odometry-topic /odom --state belief.npz``
    """
    node_class = _installed()
    from topoloc.dds.names import Topics, domain_of
    from topoloc.live.sources import rig_on
    from topoloc.topo_map import TopoMap

    topics = Topics(image_topic, odometry_topic, raw, namespace)
    number = domain_of(domain)
    the_map = TopoMap.load(topo_map)
    choice = LiveChoice(sensor, estimator, seed, settings, state)
    live = live_localizer(the_map, choice, rig_on(camera_toml, the_map), frozenset({"rgb"}))
    node = node_class(topics, live, number)
    _introduce(topics, number)
    try:
        with stopped_by_signals():
            _serve(node, live, number)
    finally:
        _conclude(live, state)


def _installed() -> type[RosNode]:
    """The node, where the extra is installed."""
    from topoloc.errors import UserError

    try:
        from topoloc.dds.node import RosNode
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != "cyclonedds":
            raise
        raise UserError("topoloc ros needs cyclonedds; type: pip install 'topoloc[dds]'") from None
    return RosNode


def _introduce(topics: Topics, domain: int) -> None:
    """Which topics there are, in full."""
    from topoloc.dds.diagnosis import wanted
    from topoloc.dds.node import PUBLISHED

    inputs = " and ".join(f"{name} ({kind})" for name, kind in wanted(topics).values())
    outputs = ", ".join(topics.published(name) for name in PUBLISHED)
    print(f"domain {domain}: listening to {inputs}; publishing {outputs}; Ctrl-C ends", flush=True)


def _serve(node: RosNode, live: LiveLocalizer, domain: int) -> None:
    """Receive in one thread, look for what is amiss in another, localize and publish in this one until Ctrl-C."""
    import sys
    from threading import Event

    from topoloc.dds.board import Board
    from topoloc.live.feeds import run_fed

    board = Board(live.topo_map, sys.stdout)

    def watch(live: LiveLocalizer, stop: Event) -> None:
        while not stop.wait(PATIENCE_S):
            board.notice(_notices(node, domain))

    def tell(report: LiveReport) -> None:
        node.publish(report)
        board.tell(report)

    try:
        run_fed(live, lambda live, stop: node.receive(stop), [watch], tell, Event())
    finally:
        board.close()


def _conclude(live: LiveLocalizer, state: Path | None) -> None:
    """What came of it, and what is next."""
    from topoloc.live.lines import summary

    print(summary(live.counts))
    if state is None:
        print("the belief is not kept; with --state FILE the next start goes on from it")
    elif state.exists():
        print(f"{state}: the belief; the same command goes on from there")


def _notices(node: RosNode, domain: int) -> list[str]:
    """What is amiss with what comes in and goes out."""
    from topoloc.dds.diagnosis import Traffic, complaints

    traffic = Traffic(domain, node.publishers(), node.heard.counts, node.offered())
    told, counts = complaints(node.topics, traffic), node.heard.counts
    if counts["unreadable"] + counts["unstamped"]:
        told.append(f"messages could not be used, the last of them: {node.heard.problem}")
    if counts["unsent"]:
        told.append("messages could not be published: a subscriber does not keep up; look for it")
    return told
