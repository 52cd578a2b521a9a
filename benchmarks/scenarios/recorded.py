"""A scenario from a folder with a map and a recording in it, such as ``topoloc simulate`` writes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import overload

import numpy as np

from benchmarks.scenarios.case import Case, Scenario
from topoloc.errors import InputError, UnreadableImage
from topoloc.geometry import Floats, between
from topoloc.map_folder import EDGES_FILE, MAP_FILE, NODES_FILE, VIEWS_FILE
from topoloc.recording import KINDS, Recording
from topoloc.topo_map import TopoMap
from topoloc.types import Frame

MAP, TEXT_MAP, RECORDING, TRUTH_FILE = "map", "map.txt", "recording", "groundtruth.txt"
MAP_FILES = (MAP_FILE, NODES_FILE, EDGES_FILE, VIEWS_FILE)
RECORDING_FILES = (*(f"{kind}.txt" for kind in KINDS), "odometry.txt", "pan.txt", "camera.toml", TRUTH_FILE)
"""What, with the map's, tells one drive from another: all but the pictures."""
CARRIED_M = 1.0
"""A robot that moved this much farther than its odometer, or elsewhere, from one frame to the next, was carried [m]."""
UNCOVERED_S = 1.0
"""A frame may be this much earlier or later than all readings of the truth [s]."""
DIGITS = 12
"""Of the digest in ``config.toml``."""


@dataclass(frozen=True)
class RecordedFrames(Sequence[Frame]):
    """The frames of a recording, made anew each time they are asked for: none keeps its pictures in memory.

    Attributes:
        drive: the recording.
    """

    drive: Recording

    def __len__(self) -> int:
        return len(self.drive)

    @overload
    def __getitem__(self, index: int) -> Frame: ...

    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...

    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        pictures = self.drive.pictures[self.drive.kind]
        if isinstance(index, slice):
            return [self.drive.frame(picture) for picture in pictures[index]]
        return self.drive.frame(pictures[index])


def recorded(folder: Path) -> Scenario:
    """The drive in a folder, under the folder's name; all of its frames are used.

    Args:
        folder: holds the map, ``map/`` or the thesis's text map ``map.txt``, and ``recording/`` with ground truth.

    Raises:
        InputError: naming file and remedy for whatever is missing or does not suit.
    """
    path = folder.resolve()
    digest = _digest(path)
    case = _case(path, digest)
    frames, nodes = len(case.frames), len(case.topo_map.nodes)
    settings = {"folder": str(path), "recorded": True, "frames": frames, "nodes": nodes, "digest": digest}
    description = f"Recorded drive of {frames} frames, {nodes} nodes."
    return Scenario(path.name, description, partial(_driven, path, digest), settings, case.kinds, recorded=True)


def _driven(folder: Path, digest: str, seed: int) -> Case:
    """The drive of every seed."""
    return _case(folder, digest)


@lru_cache(maxsize=1)  # the next seed needs the same map, which may take seconds to read
def _case(folder: Path, digest: str) -> Case:
    topo_map = TopoMap.load(_map_in(folder))
    drive = Recording.load(folder / RECORDING).on(topo_map.camera)
    truth = _truth_of(drive)
    _refuse_darkness(drive)
    frames = RecordedFrames(drive)
    return Case(topo_map, frames, truth, _kidnapped_at(drive, truth))


def _map_in(folder: Path) -> Path:
    """Where the map lies."""
    text = folder / TEXT_MAP
    return text if text.is_file() and not (folder / MAP).exists() else folder / MAP


def _truth_of(drive: Recording) -> Floats:
    """(N, 3) true poses at the frames. Raises ``InputError`` where they are not known."""
    path, times = drive.folder / TRUTH_FILE, _times(drive)
    if drive.truth is None:
        raise InputError(
            path, "no such file", "a benchmark needs the true poses: write 'timestamp tx ty tz qx qy qz qw' lines"
        )
    first, last = drive.truth.times[[0, -1]]
    outside = (times < first - UNCOVERED_S) | (times > last + UNCOVERED_S)
    if outside.any():
        raise InputError(
            path,
            f"tells of {first:.3f} to {last:.3f} s; the frame at {times[outside][0]:.3f} s lies outside",
            f"add true poses, or take the frame out of {drive.kind}.txt",
        )
    return np.array([drive.truth.at(time) for time in times])


def _times(drive: Recording) -> Floats:
    return np.array([picture.time for picture in drive.pictures[drive.kind]])


def _kidnapped_at(drive: Recording, truth: Floats) -> tuple[int, ...]:
    """Indices of frames at which the robot has been carried elsewhere: the odometer missed more than ``CARRIED_M``.

    Compared is where the robot went from one frame to the next, in its own frame before that step, by the truth
    (N, 3) and by the odometer. Of frames in a row the last counts: then it stands on the floor again. Nothing is found
    without an odometer, or where it was carried by less than that between any two frames.
    """
    if drive.odometry is None:
        return ()
    readings = np.array([drive.odometry.at(time) for time in _times(drive)])
    missed = between(truth[:-1], truth[1:])[:, :2] - between(readings[:-1], readings[1:])[:, :2]
    carried = np.linalg.norm(missed, axis=1) > CARRIED_M
    put_down = carried & ~np.append(carried[1:], False)
    return tuple(int(index) + 1 for index in np.flatnonzero(put_down))


def _refuse_darkness(drive: Recording) -> None:
    """Raise ``InputError`` where no picture can be read, or where the first that can is not of the map's camera."""
    problem: UnreadableImage | None = None
    for frame in RecordedFrames(drive):
        try:
            frame.images[drive.kind]
            return
        except UnreadableImage as error:
            problem = problem or error
    raise InputError(
        drive.folder / f"{drive.kind}.txt", f"none of its pictures can be used: {problem}", "correct the paths"
    )


def _digest(folder: Path) -> str:
    """What changes with the files of numbers and lists of a drive; the pictures are not read for it."""
    total = hashlib.sha256()
    for path in _listed(folder):
        with suppress(OSError):  # most are optional; what is needed and cannot be read is told of when it is loaded
            content = path.read_bytes()
            total.update(f"{path.name} {len(content)}\n".encode() + content)
    return total.hexdigest()[:DIGITS]


def _listed(folder: Path) -> Iterator[Path]:
    """All files that the digest is made of, whether they are there or not."""
    where = _map_in(folder)
    yield where
    yield from (where / name for name in MAP_FILES)
    yield from (folder / RECORDING / name for name in RECORDING_FILES)
