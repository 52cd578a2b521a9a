"""How time and memory grow with the size of the map, the number of particles, the number of cells.

Memory is what ``tracemalloc`` saw allocated: by Python and by numpy, which also holds OpenCV's results. It belongs to
the sensor or estimator alone, without interpreter and map, and is the same in each run; a process's resident memory is
neither. Work space inside of BLAS and OpenCV is not in it, nor is what is mapped from a file.
"""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from time import process_time

import numpy as np

from benchmarks.speed.case import enough, one_thread, seconds_of
from benchmarks.speed.large_maps import machines_memory_gb
from topoloc.errors import UserError

SAMPLES, SAMPLED_S = 11, 3.0
"""Most samples of a point, and how long they take at most together, if there are no fewer than three [s]."""
BUDGET_S = 12.0
"""Most rows of points take about so much processor time by default [s]; sizes beyond that are left out and told."""
MOST_MB, MOST_OF_MEMORY = 6000.0, 0.5
"""A size is left out if it is expected to need more memory than this [MB], or a larger share of the machine's."""

Step = Callable[[], object]
SetUp = Callable[[], Step]
"""Fits a sensor or resets an estimator; what it returns makes one look or one update at each call."""


@dataclass(frozen=True)
class Grower:
    """Something whose cost is measured over sizes.

    Attributes:
        name: of the sensor or estimator, with what is special about it.
        by: what grows: nodes, particles, cells.
        sizes: from small to large.
        prepare: makes maps and pictures of a size, which costs neither time nor memory of what is measured.
        budget_s: for all sizes, by default [s].
    """

    name: str
    by: str
    sizes: tuple[int, ...]
    prepare: Callable[[int], SetUp]
    budget_s: float = BUDGET_S


@dataclass(frozen=True)
class Point:
    """What one size cost.

    Attributes:
        size: how many of ``Grower.by``.
        ms: a look, or an update with its motion, median over the samples [ms].
        ms_low, ms_high: quartiles of the same.
        samples: how many.
        fit_s: setting up, with memory watched, which makes it some per cent slower [s].
        fit_mb: most memory meanwhile [MB].
        kept_mb: memory that stays after setting up and the first looks [MB].
        peak_mb: most memory of a look or update above that [MB].
        took_s: the whole measurement [s]; these, too, are processor time.
    """

    size: int
    ms: float
    ms_low: float
    ms_high: float
    samples: int
    fit_s: float
    fit_mb: float
    kept_mb: float
    peak_mb: float
    took_s: float


@dataclass(frozen=True)
class Growth:
    """A row of points.

    Attributes:
        grower: what was measured.
        points: by size.
        left_out: (size, reason) of those that were not measured.
    """

    grower: Grower
    points: tuple[Point, ...]
    left_out: tuple[tuple[int, str], ...] = ()

    @property
    def exponent(self) -> tuple[float, float]:
        """See ``exponent``, over all sizes."""
        return exponent([point.size for point in self.points], [point.ms for point in self.points])

    @property
    def last_tenfold(self) -> tuple[float, float]:
        """The same over the last factor of ten, where what does not grow matters less."""
        last = [point for point in self.points if 10 * point.size >= self.points[-1].size]
        return exponent([point.size for point in last], [point.ms for point in last])

    def rows(self) -> list[dict[str, str | float | int | None]]:
        """As ``topoloc speed --json`` prints them: a row a point, then the exponents; null where there is none."""
        of = {"of": self.grower.name, "by": self.grower.by}
        rows: list[dict[str, str | float | int | None]] = [
            {
                "what": "growth",
                "size": f"{point.size:,} {self.grower.by}",
                **of,
                "number": point.size,
                "ours_ms": round(point.ms, 4),
                "fit_s": round(point.fit_s, 4),
                "kept_mb": round(point.kept_mb, 3),
                "peak_mb": round(point.peak_mb, 3),
            }
            for point in self.points
        ]
        figures = (*self.exponent, *self.last_tenfold)
        names = ("exponent", "exponent_error", "last_tenfold", "last_tenfold_error")
        told = {name: _number(figure) for name, figure in zip(names, figures, strict=True)}
        return [*rows, {"what": "growth-exponent", "size": f"by {self.grower.by}", **of, **told}]


def _number(figure: float) -> float | None:
    return round(figure, 3) if np.isfinite(figure) else None


def exponent(sizes: Sequence[float], costs: Sequence[float]) -> tuple[float, float]:
    """The k of cost ~ size^k, by least squares over the logarithms, and its standard error; NaN where there is none."""
    if len(sizes) < 2:
        return float("nan"), float("nan")
    x, y = (np.log(values) - np.log(values).mean() for values in (sizes, costs))
    slope = float(x @ y / (x @ x))
    missed, freedom = y - slope * x, len(sizes) - 2
    return slope, float(np.sqrt(missed @ missed / freedom / (x @ x))) if freedom else float("nan")


def grow(grower: Grower, budget_s: float, done: Callable[[], object]) -> Growth:
    """Measure one size after the other, as long as the next is expected to fit into time and memory.

    Args:
        grower: to be measured.
        budget_s: for all sizes [s]; infinite measures all that memory allows.
        done: is called after each size, also after one that is left out.
    """
    grower.prepare(grower.sizes[0])()()  # what is imported at need is neither time nor memory of the first point
    points: list[Point] = []
    left_out: list[tuple[int, str]] = []
    for size in grower.sizes:
        reason = _too_large(points, size, budget_s)
        if reason is None:
            try:
                points.append(measure_point(grower, size))
            except UserError as error:  # a map that is too large for it
                reason = str(error)
        if reason is not None:
            left_out.append((size, reason))
        done()
    return Growth(grower, tuple(points), tuple(left_out))


def _too_large(points: Sequence[Point], size: int, budget_s: float) -> str | None:
    """Why a size is not tried, from how the last two grew."""
    if not points:
        return None
    spent = sum(point.took_s for point in points)
    seconds = _expected(points, size, [point.took_s for point in points])
    megabytes = _expected(points, size, [max(point.fit_mb, point.kept_mb + point.peak_mb) for point in points])
    if megabytes > min(MOST_MB, 1e3 * MOST_OF_MEMORY * machines_memory_gb()):
        return f"would need about {megabytes / 1000.0:.0f} GB"
    return f"would take about {seconds:.0f} s" if spent + seconds > budget_s else None


def _expected(points: Sequence[Point], size: int, costs: Sequence[float]) -> float:
    """Cost of a size if it goes on as it went last, but between as the size's root and as its square."""
    sizes = [point.size for point in points]
    slope = exponent(sizes[-2:], np.maximum(costs[-2:], 1e-9).tolist())[0] if len(points) > 1 else 1.0
    return float(costs[-1] * (size / sizes[-1]) ** np.clip(slope, 0.5, 2.0))


def measure_point(grower: Grower, size: int) -> Point:
    """Set up, look, and look again and again, on one thread."""
    begun = process_time()
    set_up = grower.prepare(size)
    with one_thread():
        step, fit_s, fit_mb, kept_mb, peak_mb = _watched(set_up)
        times = 1e3 * np.array(list(_times(step)))
    low, median, high = np.percentile(times, [25.0, 50.0, 75.0]).tolist()
    took_s = process_time() - begun
    return Point(size, median, low, high, len(times), fit_s, fit_mb, kept_mb, peak_mb, took_s)


def _watched(set_up: SetUp) -> tuple[Step, float, float, float, float]:
    """What is set up, seconds, most MB meanwhile, MB that stay, and most MB of a look above them."""
    tracemalloc.start()
    try:
        begun = process_time()
        step = set_up()
        fit_s, fit_bytes = process_time() - begun, tracemalloc.get_traced_memory()[1]
        for _ in range(2):  # what is made at the first looks and kept
            step()
        kept_bytes = tracemalloc.get_traced_memory()[0]
        tracemalloc.reset_peak()
        step()
        peak_bytes = tracemalloc.get_traced_memory()[1] - kept_bytes
    finally:
        tracemalloc.stop()
    return step, fit_s, fit_bytes / 1e6, kept_bytes / 1e6, peak_bytes / 1e6


def _times(step: Step) -> Iterator[float]:
    """Seconds a call, sample by sample."""
    number, length = enough(step)
    for _ in range(max(3, min(SAMPLES, int(SAMPLED_S / length)))):
        yield seconds_of(step, number) / number
