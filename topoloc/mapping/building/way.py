"""The way that a robot took in a recording: its frames with their poses, from the source that is asked for."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Literal

import numpy as np

from topoloc.errors import InputError, UnreadableImage
from topoloc.geometry import Floats, between, compose
from topoloc.mapping.building.config import Poses
from topoloc.picture_header import size_of
from topoloc.recording import Picture, Recording, Track

NEAREST_READING_S = 0.5
"""A frame has a pose where there is a reading of one so near in time [s]."""
Source = Literal["truth", "odometry", "line"]


@dataclass(frozen=True)
class Way:
    """Frames of a recording that can be used, in time.

    Attributes:
        recording: that they are of.
        source: of the poses.
        size: rows and columns of the pictures as they were recorded.
        pictures: (N,) of the main kind.
        robot: (N, 3) poses of the robot, map frame.
        cameras: (N, 3) poses of the camera; heading = optical axis.
    """

    recording: Recording
    source: Source
    size: tuple[int, int]
    pictures: tuple[Picture, ...]
    robot: Floats
    cameras: Floats

    @property
    def length_m(self) -> float:
        """Of the path between the frames [m]."""
        return float(np.linalg.norm(np.diff(self.robot[:, :2], axis=0), axis=1).sum())


def way_of(recording: Recording, poses: Poses, speed_m_s: float | None, left_out: Counter[str]) -> Way:
    """The frames that can be read, have the usual size, and a pose.

    Args:
        recording: any.
        poses: source that is asked for. Odometry begins at the origin, looking along x.
        speed_m_s: of the line.
        left_out: counts, by reason, the frames that are not used.

    Raises:
        InputError: there are no such poses, or fewer than two frames remain.
    """
    size, pictures = _of_one_size(recording, left_out)
    source, track = _track(recording, poses)
    if track is not None:
        nearest = np.abs(np.array([picture.time for picture in pictures])[:, None] - _around(track, pictures))
        known = nearest.min(axis=1) <= NEAREST_READING_S
        if not known.all():
            left_out[f"no {source} within {NEAREST_READING_S:g} s"] += int((~known).sum())
        pictures = [picture for picture, has_pose in zip(pictures, known, strict=True) if has_pose]
    if len(pictures) < 2:
        why = "; ".join(f"{count} left out: {reason}" for reason, count in left_out.items()) or "there are no more"
        raise InputError(recording.folder, f"has {len(pictures)} frames for a map ({why})", "record a drive, whole")
    mounts = np.array([recording.frame(picture).camera for picture in pictures])
    robot = _poses(track, pictures, speed_m_s)
    if source == "odometry":
        robot = between(robot[0], robot)
    return Way(recording, source, size, tuple(pictures), robot, compose(robot, mounts))


def _of_one_size(recording: Recording, left_out: Counter[str]) -> tuple[tuple[int, int], list[Picture]]:
    """The pictures of the size that most have; the others are counted. Nothing is decoded."""
    found: list[tuple[tuple[int, int], Picture]] = []
    for picture in recording.pictures[recording.kind]:
        try:
            found.append((size_of(picture.path), picture))
        except UnreadableImage:
            left_out["the picture cannot be read"] += 1
    if not found:
        listed = recording.folder / f"{recording.kind}.txt"
        raise InputError(listed, "none of its pictures can be read", "correct the paths; 'topoloc check' names each")
    usual = Counter(size for size, _ in found).most_common(1)[0][0]
    left_out.update({"the picture has another size": sum(size != usual for size, _ in found)})
    return usual, [picture for size, picture in found if size == usual]


def _track(recording: Recording, poses: Poses) -> tuple[Source, Track | None]:
    """The source that is taken, and its readings; a line has none."""
    if poses == "line":
        return "line", None
    if poses in ("auto", "truth") and recording.truth is not None:
        return "truth", recording.truth
    if poses in ("auto", "odometry") and recording.odometry is not None:
        return "odometry", recording.odometry
    missing = {"truth": "groundtruth.txt", "odometry": "odometry.txt"}.get(poses, "groundtruth.txt or odometry.txt")
    remedy = "record the odometer; or, for a drive along one line, --poses line --speed-m-s 0.5 (your robot's speed)"
    raise InputError(recording.folder, f"holds no {missing}, and the nodes of a map have positions", remedy)


def _around(track: Track, pictures: list[Picture]) -> Floats:
    """Times (N, 2) of the readings before and after each picture [s]."""
    after = np.searchsorted(track.times, [picture.time for picture in pictures])
    last = len(track.times) - 1
    return np.column_stack([track.times[np.clip(after - 1, 0, last)], track.times[np.clip(after, 0, last)]])


def _poses(track: Track | None, pictures: list[Picture], speed_m_s: float | None) -> Floats:
    """Poses (N, 3) of the robot in the map frame."""
    if track is None:
        assert speed_m_s is not None  # the settings see to it
        along = speed_m_s * (np.array([picture.time for picture in pictures]) - pictures[0].time)
        return np.column_stack([along, np.zeros((len(pictures), 2))])
    return np.array([track.at(picture.time) for picture in pictures])
