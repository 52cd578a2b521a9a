"""The pictures of a bag, written one by one: those that are asked for, can be read and have odometry."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator

import numpy as np

from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.importing.bags.bag import Message, Topic
from topoloc.importing.bags.job import Job
from topoloc.importing.bags.pictures import Taken, taken
from topoloc.recording import MAX_OFFSET_S, Track

FAR_S = 0.5
"""A picture with no odometry so near in time has none [s]."""


def write_frames(job: Job, odometry: Track | None) -> tuple[Floats, tuple[int, int]]:
    """Write the main pictures; returns their times (N,) [s], increasing, and their size, columns and rows.

    A camera may send some pictures of another size, as when it starts; those of the size that most have are kept.

    Raises:
        InputError: the bag is damaged.
        UserError: none of them has odometry.
    """
    times: list[float] = []
    away: list[float] = []
    sizes: dict[str, tuple[int, int]] = {}
    for time, message in _messages(job, job.chosen.image, "rgb picture"):
        if odometry is not None and not odometry.times[0] - FAR_S <= time <= odometry.times[-1] + FAR_S:
            away.append(time)
        elif times and abs(time - times[-1]) < job.settings.every - 1e-6:
            job.sink.drop("rgb picture", f"within {job.settings.every:g} s of another (--every)")
        elif (picture := _read(job, message, "rgb picture")) is not None:
            name = job.sink.picture("rgb", time, picture.data, picture.suffix)
            if name is not None:
                times.append(time)
                sizes[name] = picture.width, picture.height
    job.sink.drop("rgb picture", f"no odometry within {FAR_S:g} s", len(away))
    if odometry is not None and away and not times:
        raise UserError(_never_together(np.array(away), odometry.times))
    usual = Counter(sizes.values()).most_common(1)[0][0] if sizes else (0, 0)
    odd = {name for name, size in sizes.items() if size != usual}
    job.sink.withdraw("rgb", odd, f"is not {usual[0]}x{usual[1]} as most are")
    return np.unique([time for time, name in zip(times, sizes, strict=True) if name not in odd]), usual


def write_beside(job: Job, kind: str, topic: Topic, main: Floats) -> None:
    """Write the ``right`` or ``depth`` pictures that belong to main ones, whose times (N,) [s] increase."""
    what = f"{kind} picture"
    for time, message in _messages(job, topic, what):
        if np.abs(main - time).min(initial=np.inf) > MAX_OFFSET_S:
            job.sink.drop(what, f"no rgb picture within {MAX_OFFSET_S:g} s")
        elif (picture := _read(job, message, what, depth=kind == "depth")) is not None:
            job.sink.picture(kind, time, picture.data, picture.suffix)


def _messages(job: Job, topic: Topic, what: str) -> Iterator[tuple[float, Message]]:
    """The messages of a topic that are asked for, with their times [s]."""
    start, end = job.settings.start, job.settings.end
    job.clock.look_at(job.bag, topic.name)
    messages = job.bag.messages([topic.name], start, None if end is None else end - start)
    for message in job.follow(messages, topic.count, f"{what}s"):
        if message.content is None:
            job.sink.drop(what, "its message does not decode")
        elif (time := job.clock.time(message, message.content.header)) is None:
            job.sink.drop(what, "has no stamp")
        else:
            yield time, message


def _read(job: Job, message: Message, what: str, depth: bool = False) -> Taken | None:
    try:
        return taken(message.kind, message.content, depth)
    except ValueError as error:
        job.sink.drop(what, str(error))
        return None


def _never_together(pictures: Floats, odometry: Floats) -> str:
    """What to do where pictures and odometry have nothing in common but the bag."""
    spans = [f"{times.min():.1f} to {times.max():.1f}" for times in (pictures, odometry)]
    remedy = "choose other topics, take --time received, or leave it out with --odometry none"
    return (
        f"no picture has odometry within {FAR_S:g} s: pictures are of {spans[0]} s, odometry of {spans[1]} s; {remedy}"
    )
