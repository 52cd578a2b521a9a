"""Where the time of a look of IMA goes on a large map, beside the laboratory's eight nodes, where much else counts."""

from __future__ import annotations

from cProfile import Profile
from functools import partial
from itertools import cycle, islice
from time import process_time

import numpy as np

from benchmarks.speed.case import one_thread
from benchmarks.speed.growers import frames_of, panoramas
from benchmarks.speed.least_work import look_work
from benchmarks.speed.own_functions import own_shares
from benchmarks.speed.profile import Part, Profiled, kept_by
from sensors.ima import IMA
from topoloc.localizer import look
from topoloc.topo_map import TopoMap
from topoloc.types import Frame

NODES = 1_000
"""Of a map of noise, made as ``topoloc speed growth`` makes it; IMA as it is set keeps everything of so many."""
LOOKS = 11


def profile_look() -> Profiled:
    """Looks of IMA alone, timed plainly, then watched in another pass; on one thread."""
    pictures = panoramas(NODES)
    frames = frames_of(pictures)
    with one_thread():
        sensor, compared = kept_by(partial(_fitted, pictures.topo_map, frames[0]))
        times = [_seconds(sensor, frame) for frame in islice(cycle(frames), LOOKS)]
        profile = Profile(process_time)  # what else runs does not count
        for frame in frames:
            profile.runcall(look, sensor, frame)
    work = look_work("ima", pictures.topo_map, compared)
    part = Part("look", 1e3 * float(np.median(times)), own_shares(profile), work)
    return Profiled(f"ima, a look on a map of {NODES:,} made panoramas", (part,))


def _fitted(topo_map: TopoMap, frame: Frame) -> IMA:
    sensor = IMA()
    sensor.fit(topo_map)
    sensor.observe(frame)  # what is made at the first look and kept
    return sensor


def _seconds(sensor: IMA, frame: Frame) -> float:
    begun = process_time()
    look(sensor, frame)
    return process_time() - begun
