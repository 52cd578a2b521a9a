"""What papers on these sets report: the share of pictures whose room is right, and the errors of position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.files import write_csv
from topoloc.geometry import Floats, wrap
from topoloc.importing.public.answers import SAME_S, Answers
from topoloc.importing.public.sequence import ROOM_COLUMNS, ROOMS_FILE
from topoloc.map_folder import number, rows_of
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap

NODE_ROOMS_FILE, NODE_ROOM_COLUMNS = "node_rooms.csv", ("node", "room")
RESTORE = "import the set again"


@dataclass(frozen=True)
class RoomRate:
    """How often the room of the named node was the true one.

    Attributes:
        pictures: that have a true room; every frame counts, whether the gate was open or not, with a step or without.
        named: of these, for how many a node was named.
        right: of these, for how many it lay in the true room.
        by_room: pictures and right ones of each room.
    """

    pictures: int
    named: int
    right: int
    by_room: Mapping[str, tuple[int, int]]

    @property
    def rate(self) -> float:
        """Share of right ones of all pictures; one for which no node was named is wrong."""
        return self.right / self.pictures


@dataclass(frozen=True)
class PoseErrors:
    """Errors of a run.

    Attributes:
        metres, degrees: (N,) distance and turn of each frame that has a step.
        missing: frames without a step.
    """

    metres: Floats
    degrees: Floats
    missing: int = 0

    def within(self, metres: float) -> float:
        """Share of all frames whose position is at most so far off; one without a step is not."""
        return float((self.metres <= metres).sum() / (len(self.metres) + self.missing))


def read_rooms(recording: Path) -> tuple[Floats, list[str]] | None:
    """Times (N,) [s], increasing, and rooms of a recording; None where it has none. Raises ``InputError``."""
    path = recording / ROOMS_FILE
    if not path.exists():
        return None
    rows = [
        (number(row["timestamp"], "timestamp", path, line), row["room"])
        for line, row in rows_of(path, ROOM_COLUMNS, RESTORE)
    ]
    if not rows:
        return None
    rows.sort()
    return np.array([time for time, _ in rows]), [room for _, room in rows]


def node_rooms(topo_map: TopoMap, train: Path) -> dict[str, str]:
    """The room of each node by its id: that of the nearest picture of the recording that the map was made of."""
    labels = read_rooms(train)
    truth = Recording.load(train).truth
    if labels is None or truth is None:
        return {}
    times, rooms = labels
    places = np.array([truth.at(float(time))[:2] for time in times])
    return {node.id: rooms[int(np.square(places - [node.x, node.y]).sum(axis=1).argmin())] for node in topo_map.nodes}


def write_node_rooms(folder: Path, topo_map: TopoMap, train: Path) -> None:
    """Write ``node_rooms.csv`` into a folder, where the recording that the map was made of has rooms."""
    rooms = node_rooms(topo_map, train)
    if rooms:
        write_csv(folder / NODE_ROOMS_FILE, NODE_ROOM_COLUMNS, sorted(rooms.items()))


def room_rate(answers: Answers, rooms_of_nodes: Path) -> RoomRate | None:
    """The rate of a run; a picture without a step counts as one for which no node was named.

    Args:
        answers: to a recording with ``rooms.csv``.
        rooms_of_nodes: ``node_rooms.csv`` of its map.

    Returns:
        None where rooms are not told.

    Raises:
        InputError: a file cannot be read, or no picture is at the time of a label.
    """
    recording = answers.recording
    labels = read_rooms(recording.folder)
    if labels is None or not rooms_of_nodes.exists():
        return None
    of_node = {row["node"]: row["room"] for _, row in rows_of(rooms_of_nodes, NODE_ROOM_COLUMNS, RESTORE)}
    times, rooms = labels
    count: dict[str, tuple[int, int]] = {}
    named = 0
    for picture, step in zip(recording.pictures[recording.kind], answers.steps, strict=True):
        nearest = int(np.abs(times - picture.time).argmin())
        if abs(times[nearest] - picture.time) > SAME_S:
            continue
        true, node = rooms[nearest], "" if step is None else step[1]["node"]
        pictures, right = count.get(true, (0, 0))
        named += bool(node)
        count[true] = (pictures + 1, right + (of_node.get(node) == true))
    if not count:
        raise InputError(recording.folder / ROOMS_FILE, "no label is at a picture's time", RESTORE)
    return RoomRate(
        sum(pictures for pictures, _ in count.values()), named, sum(right for _, right in count.values()), count
    )


def pose_errors(answers: Answers) -> PoseErrors | None:
    """Errors at every step of a run; None where the recording has no truth. Raises ``InputError``."""
    recording = answers.recording
    if recording.truth is None:
        return None
    names = ("x", "y", "heading_deg")
    having = [
        (picture.time, *step)
        for picture, step in zip(recording.pictures[recording.kind], answers.steps, strict=True)
        if step is not None
    ]
    table = np.array([[number(row[name], name, answers.path, line) for name in names] for _, line, row in having])
    true = np.array([recording.truth.at(time) for time, _, _ in having])
    turns = np.abs(np.rad2deg(wrap(np.deg2rad(table[:, 2]) - true[:, 2])))
    return PoseErrors(np.hypot(*(table[:, :2] - true[:, :2]).T), turns, answers.missing)
