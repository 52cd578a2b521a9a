"""Bags, one or several read as one: their topics, and their messages in the order in which they were received."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cache
from heapq import merge
from pathlib import Path
from typing import TYPE_CHECKING, Any

from topoloc.errors import InputError, one_line
from topoloc.importing.bags.bag_files import METADATA, BagFile, Format, bag_files

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.typesys.store import Typestore

NS = 1e-9
"""A nanosecond [s]: bags count in them."""
TRANSFORMS = "tf2_msgs/TFMessage"
COMPRESSED = (b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18")
"""First bytes of what zstd and lz4 write; no message begins so."""
KINDS_OF_OLD = {"tf/tfMessage": TRANSFORMS}
"""Types that ROS 1 renamed and left as they were."""


@dataclass(frozen=True)
class Topic:
    """What a bag holds under one name.

    Attributes:
        name: such as ``/odom``.
        kind: type of its messages, such as ``nav_msgs/Odometry``, in ROS 1 and ROS 2 alike.
        count: of its messages.
    """

    name: str
    kind: str
    count: int

    def __str__(self) -> str:
        return f"{self.name} ({self.kind}, {self.count} messages)"


@dataclass(frozen=True)
class Message:
    """One message of a bag.

    Attributes:
        topic: its name.
        kind: its type.
        received: when it was recorded [s].
        content: its fields, named as in ROS; None where its bytes do not decode.
    """

    topic: str
    kind: str
    received: float
    content: Any | None


class Bag:
    """Opens bags, for ``with``.

    Messages are decoded by the definitions of standard messages that ``rosbags`` carries, never by those in the bag:
    ROS has left them as they are since its first years, and so nothing in a file is run as a program.

    Args:
        paths: files or folders, of ROS 1 or ROS 2; a bag in several files may be given file by file, in any order.

    Raises:
        InputError: a path is no bag, or cannot be read.
        UserError: ``rosbags`` is not installed.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._files = [file for path in paths for file in bag_files(path)]
        self._stack = ExitStack()
        self._readers: list[tuple[BagFile, Any, Typestore]] = []

    def __enter__(self) -> Bag:
        try:
            for file in self._files:
                reader = self._stack.enter_context(_opened(file))
                self._readers.append((file, reader, _definitions(file.format)))
            if not sum(reader.message_count for _, reader, _ in self._readers):
                raise InputError(self._files[0].path, "holds no messages", "record it again")
        except BaseException:
            self._stack.close()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    @property
    def path(self) -> Path:
        """The first file or folder."""
        return self._files[0].path

    @property
    def topics(self) -> list[Topic]:
        """What the bag holds, by name; a name of two types stands there twice."""
        counts: Counter[tuple[str, str]] = Counter()
        for _, reader, _ in self._readers:
            for connection in reader.connections:
                counts[connection.topic, _kind(connection)] += connection.msgcount
        return [Topic(name, kind, count) for (name, kind), count in sorted(counts.items())]

    @property
    def start(self) -> float:
        """When the first message was received [s]."""
        return float(min(reader.start_time for _, reader, _ in self._readers) * NS)

    @property
    def seconds(self) -> float:
        """From the first message to the last [s]."""
        starts, ends = zip(*((reader.start_time, reader.end_time) for _, reader, _ in self._readers), strict=True)
        return float((max(ends) - min(starts)) * NS)

    def messages(self, names: Collection[str], start: float = 0.0, seconds: float | None = None) -> Iterator[Message]:
        """Messages of some topics.

        Args:
            names: of the topics.
            start: where to begin, after the first message of the bag [s].
            seconds: how long to go on [s]; None: to the end.

        Raises:
            InputError: the file is damaged there.
        """
        first = min(reader.start_time for _, reader, _ in self._readers)
        begin = first + round(start / NS)
        end = None if seconds is None else begin + round(seconds / NS)
        streams = (_messages(*opened, names, begin, end) for opened in self._readers)
        yield from merge(*streams, key=lambda message: message.received)


def _kind(connection: Connection) -> str:
    kind = connection.msgtype.replace("/msg/", "/")
    return KINDS_OF_OLD.get(kind, kind)


def _opened(file: BagFile) -> Any:
    """A reader of ``rosbags``, not to be closed by anyone but ``with``."""
    from rosbags import rosbag1, rosbag2

    opener = rosbag1.Reader if file.format is Format.ROS1 else rosbag2.Reader
    try:
        reader = opener(file.path)
        reader.open()
    except OSError:
        raise  # the system's refusal says more than the file's format
    except Exception as error:  # damaged bytes bring out anything
        raise InputError(file.path, f"cannot be opened ({one_line(str(error))})", file.format.remedy) from error
    return _Closing(reader)


class _Closing:
    """An open reader, closed by ``with``: opening it is the part that is to be explained when it fails."""

    def __init__(self, reader: Any) -> None:
        self._reader = reader

    def __enter__(self) -> Any:
        return self._reader

    def __exit__(self, *_: object) -> None:
        self._reader.close()


@cache
def _definitions(form: Format) -> Typestore:
    """The standard messages as ``rosbags`` has them; for ROS 1 they lack the transforms."""
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    if form is not Format.ROS1:
        return get_typestore(Stores.ROS2_HUMBLE)
    store = get_typestore(Stores.ROS1_NOETIC)
    store.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms", "tf2_msgs/msg/TFMessage"))
    return store


def _messages(
    file: BagFile, reader: Any, store: Typestore, names: Collection[str], begin: int, end: int | None
) -> Iterator[Message]:
    """Messages of one file; ``begin`` and ``end`` are nanoseconds as the bag counts them."""
    connections = [connection for connection in reader.connections if connection.topic in names]
    if not connections:  # which would mean all of them
        return
    decode = store.deserialize_ros1 if file.format is Format.ROS1 else store.deserialize_cdr
    try:
        for connection, received, data in reader.messages(connections, begin, end):
            if file.format is not Format.ROS1 and data[:4] in COMPRESSED:
                raise InputError(file.path, "its messages are compressed", f"name its folder, with {METADATA} in it")
            kind = _kind(connection)
            yield Message(connection.topic, kind, received * NS, _decoded(decode, data, kind))
    except (OSError, InputError):
        raise
    except Exception as error:  # as above
        raise InputError(file.path, f"is damaged ({one_line(error)})", file.format.remedy) from error


def _decoded(decode: Callable[[bytes, str], object], data: bytes, kind: str) -> Any | None:
    package, name = kind.split("/")
    try:
        return decode(data, f"{package}/msg/{name}")
    except Exception:  # whatever a generated decoder meets in bytes that are not what they should be
        return None
