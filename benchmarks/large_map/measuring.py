"""IMA with a coarse stage beside exact IMA on a large map: how often they agree, and what each costs."""

from __future__ import annotations

import gc
import tracemalloc
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from time import process_time

import numpy as np

from benchmarks.large_map.agreement import Agreement, Answers, agreements, answers_of
from benchmarks.large_map.making import LargeMap
from topoloc.geometry import Floats
from topoloc.interfaces import Sensor
from topoloc.plugins import make_sensor
from topoloc.types import Frame

SENSOR = "ima"
EXACT: Mapping[str, float] = {"memory_mb": 6000.0}
"""Settings of exact IMA: all transforms of 10,000 panoramas find room, which is the fastest that it can be."""
TIMED = 16
"""Queries that looks are timed on, by turns: an exact look at 10,000 nodes takes a second."""


@dataclass(frozen=True)
class Costs:
    """What a sensor takes to know a map.

    Attributes:
        fit_s: processor time of its fit [s].
        held_mb: memory that it holds after its first look, without the map's pictures [MB].
        most_mb: the most memory that fit and first look took at a time [MB].
    """

    fit_s: float
    held_mb: float
    most_mb: float


@dataclass(frozen=True)
class Fitted:
    """A sensor that knows the map, and what that took."""

    sensor: Sensor
    costs: Costs


@dataclass(frozen=True)
class Result:
    """Coarse beside exact IMA on a map of one size.

    Attributes:
        nodes: of the map.
        candidates: that the coarse stage leaves to IMA.
        agreements: for each of ``PLACES``.
        exact_ms, coarse_ms: processor time of a look, medians [ms].
        ratio: exact by coarse time of the same look, median and quartiles.
        exact, coarse: what fitting took; the sensors themselves would fill memory.
    """

    nodes: int
    candidates: int
    agreements: Mapping[str, Agreement]
    exact_ms: float
    coarse_ms: float
    ratio: tuple[float, float, float]
    exact: Costs
    coarse: Costs

    def row(self) -> dict[str, object]:
        """The result for JSON."""
        costs = {
            f"{name}_{key}": round(value, 3)
            for name, taken in (("exact", self.exact), ("coarse", self.coarse))
            for key, value in asdict(taken).items()
        }
        return {
            "nodes": self.nodes,
            "candidates": self.candidates,
            **{place: agreement.row() for place, agreement in self.agreements.items()},
            "exact_ms": round(self.exact_ms, 4),
            "coarse_ms": round(self.coarse_ms, 4),
            "ratio": [round(value, 3) for value in self.ratio],
            **costs,
        }


def fitted(large: LargeMap, settings: Mapping[str, object]) -> Fitted:
    """IMA on a map, after a first look, which may make what was left for it.

    Memory is what Python and numpy allocate; what OpenCV takes for itself is not seen. The time is taken while that is
    watched, which costs little beside work on arrays.
    """
    sensor = make_sensor(SENSOR, settings)
    gc.collect()
    tracemalloc.start()
    begun = process_time()
    sensor.fit(large.topo_map)
    seconds = process_time() - begun
    sensor.observe(large.frames[0])
    gc.collect()
    held, most = (size / 1e6 for size in tracemalloc.get_traced_memory())
    tracemalloc.stop()
    return Fitted(sensor, Costs(seconds, held, most))


def seconds_by_turns(sensors: Sequence[Sensor], frames: Sequence[Frame]) -> Floats:
    """Processor time (S, N) of each sensor's look at each frame [s]; who looks first changes, lest it matter."""
    seconds = np.zeros((len(sensors), len(frames)))
    for number, frame in enumerate(frames):
        for which in np.roll(np.arange(len(sensors)), number).tolist():
            begun = process_time()
            sensors[which].observe(frame)
            seconds[which, number] = process_time() - begun
    return seconds


def results(large: LargeMap, candidates: Sequence[int]) -> Iterator[Result]:
    """IMA with each number of candidates beside exact IMA; 0 is exact IMA beside itself.

    Exact IMA looks at every query once; two fitted sensors are in memory at a time.
    """
    exact = fitted(large, EXACT)
    answers = answers_of(exact.sensor, large.frames)
    for count in candidates:
        yield compared(large, count, exact, answers, fitted(large, {"candidates": count} if count else EXACT))


def compared(large: LargeMap, candidates: int, exact: Fitted, theirs: Answers, coarse: Fitted) -> Result:
    """A coarse sensor on all queries of a map beside the exact one and its answers; both are timed on the first few."""
    ours = answers_of(coarse.sensor, large.frames)
    our_s, their_s = np.maximum(seconds_by_turns([coarse.sensor, exact.sensor], large.frames[:TIMED]), 1e-9)
    low, middle, high = np.percentile(their_s / our_s, [25.0, 50.0, 75.0])
    return Result(
        nodes=len(large.topo_map.nodes),
        candidates=candidates,
        agreements=agreements(large, theirs, ours),
        exact_ms=1e3 * float(np.median(their_s)),
        coarse_ms=1e3 * float(np.median(our_s)),
        ratio=(float(middle), float(low), float(high)),
        exact=exact.costs,
        coarse=coarse.costs,
    )


def growth(nodes: Sequence[int], times: Sequence[float]) -> float:
    """Exponent p of time ~ nodes^p, least squares over two sizes or more; NaN for fewer."""
    if len(set(nodes)) < 2:
        return float("nan")
    return float(np.polyfit(np.log(nodes), np.log(times), 1)[0])
