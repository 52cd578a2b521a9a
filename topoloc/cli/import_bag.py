"""``topoloc import bag``: a recording of ROS 1 or ROS 2 bags, without ROS."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from math import inf, isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from topoloc.importing.bags import Bag, BagImport, Message

LISTED_S = 10.0
"""So much of ``/tf`` is looked at to list the frames: it may be long [s]."""


def import_bag(
    files: Annotated[
        tuple[Path, ...],
        Parameter(
            help="Bags: .bag, .db3 or .mcap files, or folders of ROS 2 bags; several are read as one.", negative=""
        ),
    ],
    *,
    output: Annotated[Path | None, Parameter(name=["--output", "-o"], help="Recording folder to make.")] = None,
    list_topics: Annotated[bool, Parameter(name="--list", help="List the topics; write nothing.", negative="")] = False,
    image: Annotated[str | None, Parameter(help="Topic of the pictures; by default the only one there is.")] = None,
    odometry: Annotated[str | None, Parameter(help="Topic of the odometer's poses, or none.")] = None,
    odometry_tf: Annotated[str | None, Parameter(help="Odometry from transforms, as odom:base_link.")] = None,
    truth: Annotated[str | None, Parameter(help="Topic of the true poses, or none.")] = None,
    truth_tf: Annotated[str | None, Parameter(help="True poses from transforms, as map:base_link.")] = None,
    camera_info: Annotated[str | None, Parameter(help="Topic of the camera info, or none.")] = None,
    right: Annotated[str | None, Parameter(help="Topic of the right camera's pictures.")] = None,
    depth: Annotated[str | None, Parameter(help="Topic of depth pictures, aligned with the others.")] = None,
    time: Annotated[Literal["header", "received"], Parameter(help="The time of a message.")] = "header",
    every: Annotated[float, Parameter(help="Take a picture every so many seconds; 0: all.")] = 0.0,
    start: Annotated[float, Parameter(help="Begin so many seconds after the beginning of the bag.")] = 0.0,
    end: Annotated[float, Parameter(help="Stop so many seconds after the beginning of the bag.")] = inf,
    overwrite: Annotated[bool, Parameter(help="Replace the output if it exists.", negative="")] = False,
) -> None:
    """Make a recording of ROS 1 or ROS 2 bags; no ROS is needed.

    Pictures are Image or CompressedImage, odometry is Odometry, true poses are PoseStamped,
    PoseWithCovarianceStamped, Odometry or TransformStamped; each may be told by its topic. Odometry and true poses
    may also come from /tf. CameraInfo and the transform to the camera become camera.toml.

    Example: ``topoloc import bag drive.bag -o drive --odometry /odom --truth-tf map:base_link``
    """
    from topoloc.errors import UserError
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.importing.bags import Bag, BagSettings, Told
    from topoloc.importing.bags import import_bag as read_into
    from topoloc.importing.recording_sink import OWNED

    told = Told(image, odometry, truth, camera_info, right, depth)
    frames = (_frames("odometry", odometry, odometry_tf), _frames("truth", truth, truth_tf))
    if not (0.0 <= start < end and isfinite(start) and every >= 0.0 and isfinite(every)):
        raise UserError(f"--start is {start:g}, --end {end:g}, --every {every:g}; give seconds from 0 on, the end last")
    if list_topics:
        with Bag(files) as bag:
            _list(bag)
        return
    if output is None:
        raise UserError("say where to write, -o DIR, or look at the topics, --list")
    refuse_to_overwrite(output, overwrite)
    settings = BagSettings(told, *frames, time, every, start, end if isfinite(end) else None)
    with Bag(files) as bag, new_folder(output, overwrite, owned=OWNED) as folder:
        done = read_into(bag, folder, settings, _follow)
    _tell(output, done)


def _frames(what: str, topic: str | None, told: str | None) -> tuple[str, str] | None:
    """The two frames of ``--odometry-tf`` or ``--truth-tf``."""
    from topoloc.errors import UserError

    if told is None:
        return None
    if topic is not None:
        raise UserError(f"--{what} and --{what}-tf tell the same; give one of them")
    parent, _, child = told.partition(":")
    if not parent or not child or ":" in child:
        raise UserError(f"--{what}-tf is {told!r}; name two frames, as in map:base_link")
    return parent, child


def _follow(messages: Iterable[Message], count: int, what: str) -> Iterator[Message]:
    from topoloc.cli.progress import bar

    with bar() as progress:
        yield from progress.track(messages, total=count, description=what)


def _list(bag: Bag) -> None:
    """Print the topics, how many messages each has, and what it could serve for."""
    from rich.console import Console
    from rich.table import Column, Table

    from topoloc.importing.bags import transforms_in, use_of

    print(f"{bag.path}: {bag.seconds:.1f} s from {bag.start:.3f}")
    name = Column("topic", no_wrap=True)  # whole, as it is typed after --image
    table = Table(name, Column("type", overflow="fold"), "count", "Hz", "serves for")
    for topic in bag.topics:
        rate = f"{topic.count / bag.seconds:.1f}" if bag.seconds > 0.0 else ""
        table.add_row(topic.name, topic.kind.rpartition("/")[2], str(topic.count), rate, use_of(topic))
    Console().print(table)
    print(f"frames: {transforms_in(bag, LISTED_S).told()}")


def _tell(output: Path, done: BagImport) -> None:
    """Print what served for what, what is strange, what was written."""
    from topoloc.cli.imported import tell

    for use, what in done.used.items():
        print(f"{use}: {what}")
    for note in done.notes:
        print(f"note: {note}")
    tell(output, done.imported)
