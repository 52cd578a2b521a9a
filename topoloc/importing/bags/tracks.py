"""All of a bag that is small, in one pass: odometry, true poses, transforms and camera infos."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from scipy.spatial.transform import Rotation

from topoloc.geometry import Floats
from topoloc.importing.bags.bag import TRANSFORMS, Bag, Message
from topoloc.importing.bags.job import Job
from topoloc.importing.bags.poses import POSE_OF, PoseLog, flattened, is_level, is_optical, of_transform
from topoloc.importing.bags.transforms import Transforms
from topoloc.recording import Track
from topoloc.rig_file import TruthOf

ODOMETER, TRUE = "odometer pose", "true pose"
"""What poses are called where they are told of."""


@dataclass
class Tracks:
    """What a bag tells besides pictures.

    Attributes:
        odometry: the odometer's poses, None where there are none.
        truth: the true poses, likewise.
        truth_of: whose these are, in the plane with the heading of what looks ahead: the robot's, or the camera's.
        transforms: of ``/tf`` and ``/tf_static``.
        infos: the first camera info of each topic of them.
        base: frame that the odometry is of; empty where nothing names it.
    """

    odometry: Track | None = None
    truth: Track | None = None
    truth_of: TruthOf = "robot"
    transforms: Transforms = field(default_factory=Transforms)
    infos: dict[str, Any] = field(default_factory=dict)
    base: str = ""


def read_tracks(job: Job) -> Tracks:
    """Read them.

    Raises:
        InputError: the bag is damaged.
        UserError: the transforms that are to be the poses are not there.
    """
    tracks, logs = Tracks(), {ODOMETER: PoseLog(), TRUE: PoseLog()}
    for message in _small_messages(job):
        if message.content is None:
            job.sink.drop("message", f"of {message.topic} does not decode")
        elif message.kind == TRANSFORMS:
            _keep_transforms(job, message, message.content, tracks.transforms)
        elif message.kind not in POSE_OF:
            tracks.infos.setdefault(message.topic, message.content)
        else:
            of_odometry = job.chosen.odometry is not None and message.topic == job.chosen.odometry.name
            _keep_pose(job, message, message.content, ODOMETER if of_odometry else TRUE, logs)
            if of_odometry:
                tracks.base = getattr(message.content, "child_frame_id", "")  # poses have none
    if job.settings.odometry_tf is not None:
        tracks.base = job.settings.odometry_tf[1]
    odometry = _in_space(job, ODOMETER, logs[ODOMETER], tracks.transforms, job.settings.odometry_tf)
    tracks.odometry = None if odometry is None else _of_robot(job, ODOMETER, *odometry)
    truth = _in_space(job, TRUE, logs[TRUE], tracks.transforms, job.settings.truth_tf)
    if truth is not None and is_optical(truth[2]):
        tracks.truth, tracks.truth_of = Track(truth[0], flattened(*truth[1:], ahead=2)), "optical"
    elif truth is not None:
        tracks.truth = _of_robot(job, TRUE, *truth)
    return tracks


def transforms_in(bag: Bag, seconds: float) -> Transforms:
    """The transforms that never change, and those sent in so many first seconds; their times are those of receipt."""
    transforms, names = Transforms(), [topic.name for topic in bag.topics if topic.kind == TRANSFORMS]
    fixed, changing = ([name for name in names if _is_fixed(name) == which] for which in (True, False))
    for message in (*bag.messages(fixed), *bag.messages(changing, seconds=seconds)):
        for part in () if message.content is None else message.content.transforms:
            transforms.add(part.header.frame_id, part.child_frame_id, message.received, of_transform(part.transform))
    return transforms


def _is_fixed(topic: str) -> bool:
    return topic.endswith("tf_static")


def _small_messages(job: Job) -> Iterator[Message]:
    """All but pictures, of the topics that serve for anything."""
    chosen = job.chosen
    stamped = [topic for topic in job.bag.topics if topic.kind == TRANSFORMS and topic.count]
    stamped += [topic for topic in (chosen.odometry, chosen.truth) if topic is not None]
    for topic in stamped:
        job.clock.look_at(job.bag, topic.name)
    infos = [topic for topic in (chosen.camera_info, chosen.right_info) if topic is not None]
    names = {topic.name for topic in (*stamped, *infos)}
    return job.follow(job.bag.messages(names), sum(topic.count for topic in (*stamped, *infos)), "poses")


def _keep_transforms(job: Job, message: Message, content: Any, transforms: Transforms) -> None:
    fixed = _is_fixed(message.topic)
    for part in content.transforms:
        child = part.child_frame_id
        time = None if fixed else job.clock.time(message, part.header, f"{part.header.frame_id} > {child}")
        if fixed or time is not None:
            transforms.add(part.header.frame_id, child, time, of_transform(part.transform))
        else:
            job.sink.drop("transform", f"to {child} has no stamp")


def _keep_pose(job: Job, message: Message, content: Any, what: str, logs: dict[str, PoseLog]) -> None:
    time = job.clock.time(message, content.header)
    if time is None:
        job.sink.drop(what, "has no stamp")
    else:
        logs[what].add(time, POSE_OF[message.kind](content))


def _in_space(
    job: Job, what: str, log: PoseLog, transforms: Transforms, frames: tuple[str, str] | None
) -> tuple[Floats, Floats, Rotation] | None:
    """Times, positions and turns of a topic, or of one frame in another at each reading; None: there are none."""
    job.sink.drop(what, "is not finite, or its quaternion is zero", log.unusable)
    if frames is not None:
        times = transforms.times(*frames)
        positions, turns = transforms.at(*frames, times)
    elif len(log):
        times, positions, turns = log.in_space()
        job.sink.drop(what, "another has the same time", len(log) - len(times))
    else:
        return None
    return times, positions, turns


def _of_robot(job: Job, what: str, times: Floats, positions: Floats, turns: Rotation) -> Track:
    """Poses with x ahead and z up, in the plane; it is noted where z does not point up."""
    if not is_level(turns):
        job.notes.append(f"the z axis of the {what}s does not point up: are they of the robot, x ahead and z up?")
    return Track(times, flattened(positions, turns))
