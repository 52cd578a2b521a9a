"""Where live pictures come from: a camera, a video or a recording, and what is known of the camera that took them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from threading import Event

import numpy as np

from topoloc.errors import InputError
from topoloc.geometry import Floats, wrap
from topoloc.importing.odometry_csv import read_poses_csv
from topoloc.importing.video import Video
from topoloc.live.camera import CameraFeed, Capture, open_camera
from topoloc.live.engine import LiveLocalizer
from topoloc.live.feeds import Feed
from topoloc.live.messages import Message, Picture, beside, play, recorded
from topoloc.recording import Recording, Track
from topoloc.rig_file import Rig, read_rig
from topoloc.topo_map import TopoMap

REACH_S = 0.5
"""Pictures of a video farther than this beyond its odometry have none [s]."""


@dataclass(frozen=True)
class Source:
    """Pictures, and the odometry that comes with them.

    Attributes:
        feed: hands them on in real time.
        rig: of the camera, as far as it is told.
        kinds: of the pictures.
        messages: the same, where they can also be had as fast as they are worked on; None for a camera.
        close: lets go of a video file, however far it was played; a camera's feed does so itself.
        note: what is strange about it; empty where nothing is.
    """

    feed: Feed
    rig: Rig = field(default_factory=Rig)
    kinds: frozenset[str] = frozenset({"rgb"})
    messages: Iterator[Message] | None = None
    close: Callable[[], None] = lambda: None
    note: str = ""


@dataclass(frozen=True)
class _Played:
    """Messages at the pace of their stamps."""

    messages: Iterator[Message]

    def __call__(self, live: LiveLocalizer, stop: Event) -> None:
        play(self.messages, live, stop)


def of_camera(device: str, rig: Rig, opener: Callable[..., Capture] = open_camera) -> Source:
    """A camera at this computer, its pictures stamped with Unix time. Raises ``UserError`` where it cannot be opened.

    Args:
        device: its number, or a path such as ``/dev/video0``.
        rig: what is known of it; a size that is told there is asked for.
        opener: opens a device; ``open_camera`` by default.
    """
    reopen = partial(opener, device, rig.camera)
    return Source(CameraFeed(reopen(), reopen), rig)


def of_video(path: Path, rig: Rig, odometry: Path | None = None, offset_s: float = 0.0) -> Source:
    """A video file, its pictures stamped with the seconds since its first one.

    Args:
        path: of the file.
        rig: what is known of its camera.
        odometry: CSV file of poses; see ``read_poses_csv``.
        offset_s: time of the video's first picture on the clock of that file [s].

    Raises:
        InputError: no such file, no video, no such columns, or no moment in common.
    """
    read = None if odometry is None else read_poses_csv(odometry)
    track = None if read is None else Track(read.times - offset_s, read.poses)
    video = Video(path)
    note = ""
    if odometry is not None and track is not None:
        end = "the end" if np.isnan(video.seconds) else f"{video.seconds:.1f} s"  # not every file tells it
        told = f"tells {track.times[0]:g} to {track.times[-1]:g} s, the video 0 to {end}"
        if track.times[0] > video.seconds or track.times[-1] < 0.0:
            video.close()
            raise InputError(odometry, told, "tell when the video begins on its clock, --offset-s")
        if track.times[0] > REACH_S or track.times[-1] < video.seconds - REACH_S:
            note = f"{odometry} {told}; pictures beyond have no odometry; if the clocks differ, add --offset-s"
    messages = beside(_pictures(video), track, REACH_S)
    return Source(_Played(messages), rig, messages=messages, close=video.close, note=note)


def _pictures(video: Video) -> Iterator[Picture]:
    for time in video.times():
        frame = video.frame()
        yield Picture(time, b"" if frame is None else frame)


def of_recording(folder: Path, topo_map: TopoMap, with_odometry: bool = True) -> Source:
    """A recording as if it were made now; its pictures are those that ``topoloc localize`` would see.

    Raises:
        InputError: it cannot be read, or its camera is not the map's.
    """
    drive = Recording.load(folder).on(topo_map.camera)
    if not with_odometry:
        drive = replace(drive, odometry=None)
    messages = recorded(drive)
    return Source(_Played(messages), Rig(drive.camera, drive.mount), frozenset(drive.pictures), messages)


def rig_on(path: Path | None, topo_map: TopoMap) -> Rig:
    """What a ``camera.toml`` tells, held against the camera of a map; nothing where none is named.

    Raises:
        InputError: it does not exist, or tells another field of view than the map's.
    """
    if path is None:
        return Rig()
    if not path.is_file():
        raise InputError(path, "no such file", "name a camera.toml; 'topoloc camera' finds what to write into it")
    rig, camera = read_rig(path), topo_map.camera
    if rig.camera is not None and abs(rig.camera.hfov_deg - camera.hfov_deg) > 0.02 * camera.hfov_deg:
        told = f"hfov_deg is {rig.camera.hfov_deg:g}, but the map was made with {camera.hfov_deg:g}"
        raise InputError(path, told, "correct it, or use a map made with this camera")
    return rig


def mounted(rig: Rig) -> Floats:
    """(3,) pose of the camera on the robot."""
    return np.array([rig.mount.x, rig.mount.y, float(wrap(np.deg2rad(rig.mount.yaw_deg)))])
