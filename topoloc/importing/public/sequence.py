"""What an importer of a public set knows of one drive, and how drives become a recording."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from topoloc.errors import UnreadableImage
from topoloc.files import reason, write_csv
from topoloc.geometry import Floats
from topoloc.importing.recording_sink import SAME_TIME_S, RecordingSink
from topoloc.importing.thinning import Thinning
from topoloc.picture_header import size_of
from topoloc.recording import Track
from topoloc.rig_file import Rig
from topoloc.topo_map import Camera
from topoloc.types import Pixels

ROOMS_FILE, ROOM_COLUMNS = "rooms.csv", ("timestamp", "room")


@dataclass(frozen=True)
class Shot:
    """A picture with its place.

    Attributes:
        time: [s].
        path: of the picture.
        pose: (3,) true pose of the robot [m, m, rad], counter-clockwise.
        room: that it was taken in, as the set calls it; None where the set does not tell.
    """

    time: float
    path: Path
    pose: Floats
    room: str | None = None


@dataclass(frozen=True)
class Encoded:
    """A picture as it goes into a recording: bytes of a file, or pixels that are encoded by the suffix."""

    data: bytes | Pixels
    suffix: str


def as_it_is(path: Path) -> Encoded:
    """A picture file, to the byte. Raises ``UnreadableImage``."""
    try:
        return Encoded(path.read_bytes(), path.suffix.lower())
    except OSError as error:
        raise UnreadableImage(path, f"cannot be read ({reason(error)})", "unpack it again") from None


@dataclass(frozen=True)
class Drive:
    """One sequence of a public set.

    Attributes:
        name: of the sequence.
        kind: of its pictures, ``rgb`` or ``omni``.
        shots: in time.
        rig: what is documented of the camera.
        odometry: of the robot, or None.
        notes: what the user should know, a sentence each.
        dropped: how many pictures were left out, by reason.
        encode: what makes a picture of the recording of a file.
    """

    name: str
    kind: str
    shots: Sequence[Shot]
    rig: Rig = field(default_factory=Rig)
    odometry: Track | None = None
    notes: tuple[str, ...] = ()
    dropped: Mapping[str, int] = field(default_factory=dict)
    encode: Callable[[Path], Encoded] = as_it_is

    def with_field_of_view(self, hfov_deg: float | None) -> Drive:
        """The same drive by a camera of this horizontal field of view, where the set tells none [degrees]."""
        if hfov_deg is None or self.rig.camera is not None:
            return self
        return replace(self, rig=replace(self.rig, camera=camera_of(hfov_deg, self.shots)))


def camera_of(hfov_deg: float, shots: Sequence[Shot]) -> Camera | None:
    """The camera of pictures: its field of view [degrees] and their size; None where no picture tells its size."""
    for shot in shots:
        try:
            height, width = size_of(shot.path)
        except UnreadableImage:
            continue
        return Camera(hfov_deg, width, height)
    return None


def write_drives(
    drives: Sequence[Drive],
    sink: RecordingSink,
    folder: Path,
    thinning: Thinning,
    progress: Callable[[], object] = lambda: None,
) -> None:
    """Put drives into one recording: pictures, truth, odometry, and ``rooms.csv`` beside them.

    The odometry of several drives is left out: between them the robot was carried.

    Args:
        drives: of one set, in one frame.
        sink: notes what is left out.
        folder: of the recording.
        thinning: which pictures are taken of each drive.
        progress: called for each picture.
    """
    rooms: dict[int, tuple[float, str]] = {}
    for drive in drives:
        for why, count in drive.dropped.items():
            sink.drop("picture", why, count)
        for shot in _taken(drive, thinning, progress):
            try:
                encoded = drive.encode(shot.path)
            except UnreadableImage as error:
                sink.drop("picture", error.problem)
                continue
            sink.picture(drive.kind, shot.time, encoded.data, encoded.suffix)
            sink.truth(shot.time, shot.pose)
            if shot.room is not None:
                rooms.setdefault(round(shot.time / SAME_TIME_S), (shot.time, shot.room))
    if len(drives) == 1:
        _write_odometry(drives[0].odometry, sink)
    if rooms:
        rows = [(f"{time:.6f}", room) for time, room in sorted(rooms.values())]
        write_csv(folder / ROOMS_FILE, ROOM_COLUMNS, rows)


def _taken(drive: Drive, thinning: Thinning, progress: Callable[[], object]) -> Iterator[Shot]:
    """The shots that are taken of a drive."""
    before: float | None = None
    for shot in drive.shots:
        progress()
        time = shot.time - drive.shots[0].time
        if thinning.takes(time, before):
            before = time
            yield shot


def _write_odometry(odometry: Track | None, sink: RecordingSink) -> None:
    if odometry is not None:
        for time, pose in zip(odometry.times, odometry.poses, strict=True):
            sink.odometry(float(time), pose)
