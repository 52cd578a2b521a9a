"""A bag -> a recording: poses first, then the pictures that there is odometry for, then what the camera is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import UserError
from topoloc.geometry import Floats, compose, inverse
from topoloc.importing.bags import notes
from topoloc.importing.bags.bag import Bag, Message
from topoloc.importing.bags.frames import FAR_S, write_beside, write_frames
from topoloc.importing.bags.intrinsics import baseline_m, intrinsics
from topoloc.importing.bags.job import BagSettings, Follow, Job
from topoloc.importing.bags.mounting import mounting
from topoloc.importing.bags.stamps import Clock
from topoloc.importing.bags.topics import Chosen, choose, is_rectified
from topoloc.importing.bags.tracks import Tracks, read_tracks
from topoloc.importing.recording_sink import Imported, RecordingSink
from topoloc.lens import Lens
from topoloc.recording import Track
from topoloc.rig_file import Mount, Rig
from topoloc.topo_map import Camera

BASES = ("base_link", "base_footprint")
"""Frames that stand for the robot where no message names it."""


@dataclass(frozen=True)
class BagImport:
    """What came of it.

    Attributes:
        imported: the recording.
        used: what served for what: ``image``, ``odometry``, ``truth``, ``camera``, ``mount``, ...
        notes: what a user should know of it.
    """

    imported: Imported
    used: Mapping[str, str]
    notes: tuple[str, ...]


def import_bag(
    bag: Bag, folder: Path, settings: BagSettings, follow: Follow = lambda messages, *_: iter(messages)
) -> BagImport:
    """Make a recording of a bag.

    Args:
        bag: an open one.
        folder: to write into.
        settings: what of it is read.
        follow: shows how far it is; by default nothing does.

    Raises:
        InputError: the bag is damaged.
        UserError: a topic is not there, several could serve, or nothing in it can be used.
    """
    found = choose(bag.topics, settings.told, settings.odometry_tf is None, settings.truth_tf is None)
    job = Job(bag, settings, found, RecordingSink(folder), Clock(settings.time), follow)
    first = job.clock.look_at(bag, found.image.name)
    tracks = read_tracks(job)
    times, size = write_frames(job, tracks.odometry)
    for kind, topic in (("right", found.right), ("depth", found.depth)):
        if topic is not None:
            write_beside(job, kind, topic, times)
    used = _used(found, settings)
    rig = Rig() if first is None or not len(times) else _rig(job, tracks, first, times, size, used)
    if tracks.truth is not None and tracks.truth_of == "optical":
        tracks.truth = _behind_camera(job, tracks.truth, rig.mount)
    if len(times):
        _write_poses(job, tracks, times)
    imported = job.sink.close(rig)
    strange = (
        *notes.of_odometry(tracks.odometry, times),
        *notes.of_truth(tracks.truth, times),
        *notes.of_clock(job.clock),
    )
    return BagImport(imported, used, (*job.notes, *strange))


def _write_poses(job: Job, tracks: Tracks, times: Floats) -> None:
    """Write the poses; where a part of the bag was asked for, those around its pictures, whose times are (N,) [s]."""
    whole = not job.settings.start and job.settings.end is None
    begin, end = (-np.inf, np.inf) if whole else (times[0] - FAR_S, times[-1] + FAR_S)
    for track, write in ((tracks.odometry, job.sink.odometry), (tracks.truth, job.sink.truth)):
        for time, pose in () if track is None else zip(track.times, track.poses, strict=True):
            if begin <= time <= end:
                write(float(time), pose)


def _behind_camera(job: Job, truth: Track, mount: Mount) -> Track:
    """True poses of the robot whose camera has these; it is noted."""
    place = f"x {mount.x:g} m, y {mount.y:g} m, yaw {mount.yaw_deg:g} degrees"
    what = "the true poses are of a camera's optical frame, its y axis points down"
    job.notes.append(f"{what}: z is taken for ahead, and the robot's pose is found by the mount ({place})")
    on_robot = np.array([mount.x, mount.y, np.deg2rad(mount.yaw_deg)])
    return Track(truth.times, compose(truth.poses, inverse(on_robot)))


def _used(found: Chosen, settings: BagSettings) -> dict[str, str]:
    """What served for what, in words."""
    topics = {"image": found.image, "right": found.right, "depth": found.depth}
    topics |= {"odometry": found.odometry, "truth": found.truth}
    frames = {"odometry": settings.odometry_tf, "truth": settings.truth_tf}
    used = {use: str(topic) for use, topic in topics.items() if topic is not None}
    return used | {use: f"transforms from {pair[0]} to {pair[1]}" for use, pair in frames.items() if pair}


def _rig(job: Job, tracks: Tracks, first: Message, times: Floats, size: tuple[int, int], used: dict[str, str]) -> Rig:
    """What the camera is and how it sits, as far as the bag tells; adds to ``used`` and to the notes."""
    camera, lens = _intrinsics(job, tracks, size)
    if camera is not None:
        bent = "straight pictures" if lens is None else f"a {lens.model} lens"
        used["camera"] = f"{camera.width}x{camera.height}, {camera.hfov_deg:.1f} degrees wide, {bent}"
    mount = _mount(job, tracks, first, (float(times[0]), float(times[-1])), used)
    right = job.chosen.right_info
    baseline = baseline_m(tracks.infos[right.name]) if right is not None and right.name in tracks.infos else None
    return Rig(camera=camera, mount=mount, lens=lens, baseline_m=baseline)


def _intrinsics(job: Job, tracks: Tracks, size: tuple[int, int]) -> tuple[Camera | None, Lens | None]:
    """Camera and lens of pictures of a size, columns and rows; None where they are not told, which is noted."""
    topic = job.chosen.camera_info
    unknown = "the field of view is not known: topoloc camera estimates it"
    if topic is None or topic.name not in tracks.infos:
        job.notes.append(f"no camera info; {unknown}")
        return None, None
    try:
        camera, lens = intrinsics(tracks.infos[topic.name], is_rectified(job.chosen.image))
        if (camera.width, camera.height) != size:
            raise ValueError(f"it is for {camera.width}x{camera.height}, the pictures are {size[0]}x{size[1]}")
    except ValueError as error:
        job.notes.append(f"{topic.name} is not used: {error}; {unknown}")
        return None, None
    return camera, lens


def _mount(job: Job, tracks: Tracks, first: Message, span: tuple[float, float], used: dict[str, str]) -> Mount:
    """Where the transforms put the camera; on the axis of the robot, looking ahead, where they do not tell."""
    known, frame = tracks.transforms, first.content.header.frame_id if first.content is not None else ""
    base = next((name for name in (tracks.base, *BASES) if name and name in known), "")
    if not base or not frame:
        job.notes.append("no transform tells how the camera sits on the robot: it is taken to look ahead from its axis")
        return Mount()
    try:
        mount, strange = mounting(known, base, frame, span)
    except UserError as error:
        job.notes.append(f"how the camera sits on the robot is not told: {error}")
        return Mount()
    job.notes.extend(strange)
    used["mount"] = f"{frame} on {base}: x {mount.x:g} m, y {mount.y:g} m, yaw {mount.yaw_deg:g} degrees"
    return mount
