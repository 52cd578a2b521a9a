"""What papers on these sets report: the share of pictures whose room is right, and the errors of position."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.files import write_csv
from topoloc.geometry import Floats, wrap
from topoloc.importing.public.sequence import ROOM_COLUMNS, ROOMS_FILE
from topoloc.map_folder import number, rows_of
from topoloc.recording import Recording, Track
from topoloc.topo_map import TopoMap

NODE_ROOMS_FILE, NODE_ROOM_COLUMNS = "node_rooms.csv", ("node", "room")
SAME_S = 1e-3
"""A step and a label are of one picture within this [s]."""
RESTORE = "import the set again"


@dataclass(frozen=True)
class RoomRate:
    """How often the room of the named node was the true one.

    Attributes:
        pictures: that have a true room; every frame counts, whether the gate was open or not.
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
    """Errors of each frame (N,): distance [m] and turn [degrees]."""

    metres: Floats
    degrees: Floats

    def within(self, metres: float) -> float:
        """Share of frames whose position is at most so far off."""
        return float(np.mean(self.metres <= metres))


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


def room_rate(steps: Path, recording: Path, rooms_of_nodes: Path) -> RoomRate | None:
    """The rate of a run.

    Args:
        steps: ``steps.csv`` of ``topoloc localize`` or of a benchmark.
        recording: that was localized, with ``rooms.csv``.
        rooms_of_nodes: ``node_rooms.csv`` of its map.

    Returns:
        None where rooms are not told.

    Raises:
        InputError: a file cannot be read, or no step is at the time of a label.
    """
    labels = read_rooms(recording)
    if labels is None or not rooms_of_nodes.exists():
        return None
    of_node = {row["node"]: row["room"] for _, row in rows_of(rooms_of_nodes, NODE_ROOM_COLUMNS, RESTORE)}
    times, rooms = labels
    count: dict[str, tuple[int, int]] = {}
    named = 0
    for line, row in rows_of(steps, ("timestamp", "node"), "run 'topoloc localize' again"):
        time = number(row["timestamp"], "timestamp", steps, line)
        nearest = int(np.abs(times - time).argmin())
        if abs(times[nearest] - time) > SAME_S:
            continue
        true = rooms[nearest]
        pictures, right = count.get(true, (0, 0))
        named += bool(row["node"])
        count[true] = (pictures + 1, right + (of_node.get(row["node"]) == true))
    if not count:
        raise InputError(steps, f"no step is at a time of {recording / ROOMS_FILE}", "name the run of this recording")
    return RoomRate(
        sum(pictures for pictures, _ in count.values()), named, sum(right for _, right in count.values()), count
    )


def pose_errors(steps: Path, recording: Path) -> PoseErrors | None:
    """Errors at every frame of a run; None where the recording has no truth. Raises ``InputError``."""
    truth: Track | None = Recording.load(recording).truth
    if truth is None:
        return None
    rows = list(rows_of(steps, ("timestamp", "x", "y", "heading_deg"), "run 'topoloc localize' again"))
    names = ("timestamp", "x", "y", "heading_deg")
    table = np.array([[number(row[name], name, steps, line) for name in names] for line, row in rows]).reshape(-1, 4)
    if not len(table):
        raise InputError(steps, "holds no steps", "run 'topoloc localize' again")
    true = np.array([truth.at(float(time)) for time in table[:, 0]])
    turns = np.abs(np.rad2deg(wrap(np.deg2rad(table[:, 3]) - true[:, 2])))
    return PoseErrors(np.hypot(*(table[:, 1:3] - true[:, :2]).T), turns)
