"""``topoloc ros``: a node that localizes a running robot, on DDS with ROS 2's messages."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.localize import SETTINGS_HELP

if TYPE_CHECKING:
    from topoloc.dds.names import Topics
    from topoloc.dds.node import RosNode
    from topoloc.live.engine import LiveLocalizer, LiveReport
    from topoloc.topo_map import TopoMap

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
    from topoloc.topo_map import TopoMap

    topics = Topics(image_topic, odometry_topic, raw, namespace)
    number = domain_of(domain)
    the_map = TopoMap.load(topo_map)
    live = _localizer(the_map, camera_toml, (sensor, estimator, seed), settings, state)
    node = node_class(topics, live, number)
    _introduce(topics, number)
    try:
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


def _localizer(
    the_map: TopoMap,
    camera_toml: Path | None,
    names: tuple[str, str, int],
    settings: tuple[str, ...],
    state: Path | None,
) -> LiveLocalizer:
    """What the node feeds; names are those of sensor and estimator, and the seed."""
    from topoloc import plugins
    from topoloc.errors import UserError
    from topoloc.live import LiveConfig, LiveLocalizer
    from topoloc.live.saved_belief import load
    from topoloc.live.sources import mounted, rig_on
    from topoloc.localizer import Localizer
    from topoloc.odometry import OdometryNoise
    from topoloc.settings import build, parse_words, refuse_unknown

    sensor, estimator, seed = names
    tables = parse_words(settings)
    refuse_unknown(tables, {"sensor", "estimator", "odometry", "live"}, "--set")
    config = build(LiveConfig, tables.get("live", {}), "settings of live")
    noise = build(OdometryNoise, tables.get("odometry", {}), "settings of odometry")
    rig = rig_on(camera_toml, the_map)
    eye = plugins.make_sensor(sensor, tables.get("sensor"))
    mind = plugins.make_estimator(estimator, tables.get("estimator"))
    if eye.needs - {"rgb"}:
        missing = ", ".join(sorted(eye.needs - {"rgb"}))
        raise UserError(f"{sensor} needs {missing} pictures, and the topic gives rgb; choose another sensor")
    saved = None if state is None else load(state, the_map)
    localizer = Localizer(the_map, eye, mind, rng=seed, noise=noise)
    camera = rig.camera or the_map.camera
    return LiveLocalizer(localizer, mounted(rig), rig.lens, camera, config, saved, state_file=state, rng=seed)


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
