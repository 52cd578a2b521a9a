"""Where the time of one update goes, for the main pairs of sensor and estimator: ``topoloc speed profile``.

A drive in the simulated laboratory. The parts of an update (look, predict, update, estimate) are timed plainly; how a
part divides among our functions is told by ``cProfile`` in another pass, since watching every call takes time. What
numpy, scipy or OpenCV need counts as the function's that called them.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator
from cProfile import Profile
from dataclasses import asdict, dataclass
from functools import lru_cache, partial
from itertools import pairwise
from time import process_time
from typing import Protocol, TypeVar

import numpy as np

from benchmarks.speed.case import one_thread
from benchmarks.speed.least_work import Work, look_work, step_work
from benchmarks.speed.own_functions import Shares, own_shares
from benchmarks.worlds import LabWorld, Simulation, WorldSettings
from sensors.ima import IMA
from sensors.images import views_of
from sensors.view_sensor import ViewSensor
from topoloc.estimate import EstimateRule, estimate_from
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import look
from topoloc.odometry import OdometryNoise
from topoloc.plugins import make_estimator, make_sensor
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Evidence, Frame, Motion

PAIRS = (
    ("ima", "activity"),
    ("ima", "grid"),
    ("ima", "particle"),
    ("pca", "particle"),
    ("histogram", "grid"),
    ("local", "activity"),
)
PARTS = ("look", "predict", "update", "estimate")
SEED, UPDATES, PASSES = 0, 24, 3
WARM_UP = 3
"""Updates at the start of a pass that are not counted: what is made at need and kept is no part of an update."""
T = TypeVar("T")


class Timer(Protocol):
    """Makes a call that belongs to a part, and measures it."""

    def __call__(self, part: str, call: Callable[[], T], /) -> T:
        """What the call returns."""


@dataclass(frozen=True)
class Part:
    """A part of an update.

    Attributes:
        name: one of ``PARTS``.
        ms: median over the updates of a drive, the best of the passes [ms].
        shares: of our functions in it, largest first; they sum to one.
        work: the least that it must do, or None where that is next to nothing.
    """

    name: str
    ms: float
    shares: Shares
    work: Work | None


@dataclass(frozen=True)
class Profiled:
    """One update of a pair, or a part of it.

    Attributes:
        name: of the sensor and the estimator, with what is special about the map.
        parts: in the order of an update.
    """

    name: str
    parts: tuple[Part, ...]

    @property
    def ms(self) -> float:
        """Of all parts [ms]."""
        return sum(part.ms for part in self.parts)

    def rows(self) -> list[dict[str, str | float]]:
        """As ``topoloc speed --json`` prints them.

        A row a part and function, its share of the part in ms; then one for each part with its least work, if told.
        """
        rows: list[dict[str, str | float]] = [
            {
                "what": "profile",
                "size": self.name,
                "part": part.name,
                "function": function.name,
                "ours_ms": round(share * part.ms, 5),
            }
            for part in self.parts
            for function, share in part.shares
        ]
        least: list[dict[str, str | float]] = [
            {"what": "profile-least", "size": self.name, "part": part.name, **asdict(part.work)}
            for part in self.parts
            if part.work is not None
        ]
        return rows + least


def profile_pair(sensor_name: str, estimator_name: str) -> Profiled:
    """Drive through the laboratory with a sensor and an estimator, on one thread."""
    drive = laboratory()
    with one_thread():
        sensor = _fitted(sensor_name, drive)
        estimator, kept = kept_by(partial(_started, estimator_name, drive.topo_map))
        passes = [_timed(sensor, estimator, drive) for _ in range(PASSES)]
        shares = _profiled(sensor, estimator, drive)
    work: dict[str, Work] = {}
    if (compared := _compared(sensor_name, sensor, drive)) is not None:
        work["look"] = look_work(sensor_name, drive.topo_map, compared)
    if estimator_name != "activity":  # a few numbers a node
        work |= {part: step_work(estimator_name, part, drive.topo_map, kept) for part in ("predict", "update")}
    parts = (Part(name, min(times[name] for times in passes), shares[name], work.get(name)) for name in PARTS)
    return Profiled(f"{sensor_name} with {estimator_name}", tuple(parts))


def _compared(name: str, sensor: Sensor, drive: Simulation) -> int | None:
    """Bytes that a picture is compared with: IMA's references, the descriptors of views; None for other sensors."""
    if isinstance(sensor, IMA):
        return kept_by(partial(_fitted, name, drive))[1]
    if isinstance(sensor, ViewSensor):
        return len(views_of(drive.topo_map).images) * int(sensor.describe(drive.frames[0].images).nbytes)
    return None


@lru_cache(maxsize=1)
def laboratory() -> Simulation:
    """The drive, its pictures rendered."""
    drive = LabWorld(WorldSettings(updates=UPDATES)).simulate(SEED)
    for frame in drive.frames:
        frame.images["rgb"]
    return drive


def _fitted(name: str, drive: Simulation) -> Sensor:
    sensor = make_sensor(name)
    sensor.fit(drive.topo_map)
    sensor.observe(drive.frames[0])  # what is made at the first look and kept
    return sensor


def _started(name: str, topo_map: TopoMap) -> Estimator:
    estimator = make_estimator(name)
    estimator.reset(topo_map, np.random.default_rng(SEED))
    return estimator


def kept_by(make: Callable[[], T]) -> tuple[T, int]:
    """What is made, and the bytes that it keeps."""
    make()  # imports at need
    tracemalloc.start()
    try:
        made = make()
        return made, tracemalloc.get_traced_memory()[0]
    finally:
        tracemalloc.stop()


def _steps(drive: Simulation) -> Iterator[tuple[Frame, Motion]]:
    """Frames and the motions that led to them, the first left out."""
    noise = OdometryNoise()
    for before, frame in pairwise(drive.frames):
        assert before.odometry is not None and frame.odometry is not None  # a simulated robot has an odometer
        yield frame, noise.motion(before.odometry, frame.odometry)


def _drive(sensor: Sensor, estimator: Estimator, drive: Simulation, counted: Timer) -> None:
    """What ``Localizer.step`` does at each update, part by part."""
    estimator.reset(drive.topo_map, np.random.default_rng(SEED))
    rule = getattr(type(estimator), "estimate_rule", EstimateRule())
    for number, (frame, motion) in enumerate(_steps(drive)):
        timer = uncounted if number < WARM_UP else counted
        timer("predict", partial(estimator.predict, motion))
        seen, _ = timer("look", partial(look, sensor, frame))
        timer("update", partial(estimator.update, seen))
        timer("estimate", partial(_estimate, estimator, drive.topo_map, rule, seen))


def _estimate(estimator: Estimator, topo_map: TopoMap, rule: EstimateRule, seen: Evidence) -> Estimate:
    return estimate_from(estimator.belief, topo_map, 0.0, rule, seen)


def _timed(sensor: Sensor, estimator: Estimator, drive: Simulation) -> dict[str, float]:
    """Median of each part [ms]."""
    times: dict[str, list[float]] = {name: [] for name in PARTS}

    def timer(name: str, call: Callable[[], T]) -> T:
        begun = process_time()
        result = call()
        times[name].append(1e3 * (process_time() - begun))
        return result

    _drive(sensor, estimator, drive, timer)
    return {name: float(np.median(taken)) for name, taken in times.items()}


def _profiled(sensor: Sensor, estimator: Estimator, drive: Simulation) -> dict[str, Shares]:
    """How each part divides among our functions."""
    profiles = {name: Profile(process_time) for name in PARTS}  # what else runs does not count

    def timer(name: str, call: Callable[[], T]) -> T:
        return profiles[name].runcall(call)

    _drive(sensor, estimator, drive, timer)
    return {name: own_shares(profile) for name, profile in profiles.items()}


def uncounted(part: str, call: Callable[[], T]) -> T:
    """A timer that measures nothing."""
    return call()
