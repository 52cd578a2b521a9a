"""Every sensor with every estimator on every drive of every scenario.

A drive is made once, a sensor is fitted to its map once and looks at each of its frames once; what it saw is shared
by all estimators. Processes work on a drive each and hand their rows to the parent, which alone writes. With one job
rows arrive one by one, with several jobs the rows of a drive arrive together.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter

import numpy as np
from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky.process_executor import TerminatedWorkerError
from threadpoolctl import threadpool_limits

from benchmarks.results import FAILED, UNAVAILABLE, Key, Point, ResultsFile, Row, Track, track_path, write_track
from benchmarks.scenarios import Case, Scenario
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import Localizer, Step
from topoloc.metrics import Run, evaluate
from topoloc.plan import dead_reckoning
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame

ESTIMATOR_STREAM = 1
"""Beside the seed, so that an estimator does not draw the very numbers that the world's noise was made of."""
LONGEST_REASON = 300


@dataclass(frozen=True)
class Suite:
    """What is compared: every sensor with every estimator on every scenario with every seed.

    Attributes:
        scenarios: the scenarios.
        sensors, estimators: by name, how to build a fresh one.
        seeds: of the drives.
    """

    scenarios: tuple[Scenario, ...]
    sensors: Mapping[str, Callable[[], Sensor]]
    estimators: Mapping[str, Callable[[], Estimator]]
    seeds: tuple[int, ...]

    def keys(self) -> list[Key]:
        """All of its runs."""
        return [
            (scenario.name, sensor, estimator, seed)
            for scenario in self.scenarios
            for seed in self.seeds
            for sensor in self.sensors
            for estimator in self.estimators
        ]


class SharedLooks:
    """A fitted sensor that looks at each frame once and remembers what it saw, or what went wrong.

    Args:
        sensor: any sensor; fitted here.
        topo_map: to fit it to.

    Attributes:
        looks: how often the sensor really looked.
        seconds: that these looks took.
        waited: the same, with the time until the pictures were there [s].
    """

    def __init__(self, sensor: Sensor, topo_map: TopoMap) -> None:
        self._sensor, self._seen = sensor, dict[float, Evidence | Exception]()
        self.looks, self.seconds, self.waited = 0, 0.0, 0.0
        sensor.fit(topo_map)

    @property
    def needs(self) -> frozenset[str]:
        """Kinds of image that the sensor reads."""
        return self._sensor.needs

    def fit(self, topo_map: TopoMap) -> None:
        """Nothing to do: the sensor is fitted already."""

    def observe(self, frame: Frame) -> Evidence:
        """What the sensor sees in the frame, the first time by looking."""
        if frame.timestamp not in self._seen:
            self._seen[frame.timestamp] = self._look(frame)
        seen = self._seen[frame.timestamp]
        if isinstance(seen, Exception):
            raise seen
        return seen

    def _look(self, frame: Frame) -> Evidence | Exception:
        """What the sensor sees, or what the next estimator must meet as well without another look."""
        asked = started = perf_counter()
        try:
            for kind in self.needs & frozenset(frame.images):
                frame.images[kind]  # rendered or read from disk now: that is no work of the sensor's
            started = perf_counter()
            return self._sensor.observe(frame)
        except Exception as error:
            return error
        finally:
            ended = perf_counter()
            self.looks += 1
            self.seconds += ended - started
            self.waited += ended - asked


@dataclass(frozen=True)
class _Drive:
    """The work of one process at a time: one drive, and which pairs of sensor and estimator still have to run."""

    scenario: Scenario
    seed: int
    pairs: tuple[tuple[str, str], ...]

    def row(self, sensor: str, estimator: str, status: str, error: Exception) -> Row:
        """A row that says why there is no result."""
        return Row(self.scenario.name, sensor, estimator, self.seed, status, _one_line(error))


def run_suite(
    suite: Suite, results: ResultsFile, jobs: int = 1, on_row: Callable[[Row], None] = lambda row: None
) -> None:
    """Run what is not in ``results`` yet, and append it there.

    Args:
        suite: what to compare.
        results: where rows go; the drive that the report draws is kept beside it.
        jobs: processes.
        on_row: told of each row once it is written.
    """
    for result in _work(suite, _drives(suite, {row.key for row in results.rows}), jobs):
        if isinstance(result, Row):
            results.append(result)
            on_row(result)
        else:
            _keep(results.path.parent, result)


def _keep(folder: Path, track: Track) -> None:
    """The first drive of a scenario stays: the report must not depend on where a run was interrupted."""
    if not track_path(folder, track.scenario).exists():
        write_track(folder, track)


def _drives(suite: Suite, done: set[Key]) -> list[_Drive]:
    """The drives that still have something to run."""
    drives = []
    for scenario in suite.scenarios:
        for seed in suite.seeds:
            pairs = tuple(
                (sensor, estimator)
                for sensor in suite.sensors
                for estimator in suite.estimators
                if (scenario.name, sensor, estimator, seed) not in done
            )
            if pairs:
                drives.append(_Drive(scenario, seed, pairs))
    return drives


def _work(suite: Suite, drives: Sequence[_Drive], jobs: int) -> Iterator[Row | Track]:
    processes = min(jobs, len(drives))
    if processes <= 1:
        for drive in drives:
            yield from _run_drive(suite, drive)
        return
    try:
        with parallel_config(backend="loky", inner_max_num_threads=1):
            parallel = Parallel(n_jobs=processes, return_as="generator_unordered")
            for batch in parallel(delayed(_batch)(suite, drive) for drive in drives):
                yield from batch
    except TerminatedWorkerError:
        raise UserError("a process was killed, perhaps for want of memory; continue with --resume, --jobs 1") from None


def _batch(suite: Suite, drive: _Drive) -> list[Row | Track]:
    return list(_run_drive(suite, drive))


@contextmanager
def _one_thread() -> Iterator[None]:
    """Libraries that would use every core hinder the other processes, and their sums depend on how many they get."""
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)


def _run_drive(suite: Suite, drive: _Drive) -> Iterator[Row | Track]:
    try:
        with _one_thread():
            case = drive.scenario.make(drive.seed)
    except Exception as error:
        yield from (drive.row(sensor, estimator, FAILED, error) for sensor, estimator in drive.pairs)
        return
    drawn = drive.seed != suite.seeds[0]
    for name, make_sensor in suite.sensors.items():
        estimators = [estimator for sensor, estimator in drive.pairs if sensor == name]
        if not estimators:
            continue
        try:
            looks = _prepare(make_sensor, case)
        except Exception as error:
            status = UNAVAILABLE if isinstance(error, UserError) else FAILED
            yield from (drive.row(name, estimator, status, error) for estimator in estimators)
            continue
        for estimator in estimators:
            row, run = _run_pair(drive, case, looks, (name, estimator), suite.estimators[estimator])
            if run is not None and not drawn:
                drawn = True
                yield _track(row, run, case)
            yield row


def _prepare(make_sensor: Callable[[], Sensor], case: Case) -> SharedLooks:
    """A sensor fitted to the drive's map. Raises ``UserError`` where the drive cannot feed it."""
    sensor = make_sensor()
    missing = sensor.needs - case.kinds
    if missing:
        have = ", ".join(sorted(case.kinds)) or "no"
        raise UserError(f"needs {', '.join(sorted(missing))} images; the scenario has {have} images")
    with _one_thread():
        return SharedLooks(sensor, case.topo_map)


def _run_pair(
    drive: _Drive, case: Case, looks: SharedLooks, pair: tuple[str, str], make_estimator: Callable[[], Estimator]
) -> tuple[Row, Run | None]:
    """One run: its row, and its record where it came to an end."""
    try:
        estimator = make_estimator()
    except Exception as error:
        return drive.row(*pair, UNAVAILABLE if isinstance(error, UserError) else FAILED, error), None
    try:
        with _one_thread():
            steps, seconds = _localize(case, looks, estimator, drive.seed)
            run = Run.of(case.topo_map, steps, case.truth, case.kidnapped_at)
            values = evaluate(run)
    except Exception as error:
        return drive.row(*pair, FAILED, error), None
    updates = len(run.updates)
    values["sensor_ms"] = 1e3 * looks.seconds / looks.looks if looks.looks else None
    values["estimator_ms"] = 1e3 * seconds / updates if updates else None
    values["peak_mb"] = _peak_mb()
    return Row(drive.scenario.name, *pair, drive.seed, values=values), run


def _localize(case: Case, looks: SharedLooks, estimator: Estimator, seed: int) -> tuple[list[Step], float]:
    """The steps of a run, and the seconds they took beside waiting for what the sensor saw."""
    rng = np.random.default_rng([seed, ESTIMATOR_STREAM])
    localizer = Localizer(case.topo_map, looks, estimator, rng=rng)
    steps = []
    start, waited = perf_counter(), looks.waited
    for frame in case.frames:
        localizer.step(frame)
        assert localizer.last is not None  # a step was just made
        steps.append(localizer.last)
    return steps, (perf_counter() - start) - (looks.waited - waited)


def _track(row: Row, run: Run, case: Case) -> Track:
    return Track(
        scenario=row.scenario,
        sensor=row.sensor,
        estimator=row.estimator,
        seed=row.seed,
        nodes=_points(case.topo_map.positions),
        edges=[(int(a), int(b)) for a, b in np.asarray(case.topo_map.edges)],
        ids=[node.id for node in case.topo_map.nodes],
        truth=_points(case.truth),
        dead_reckoning=_points(_dead_reckoning(case)),
        updates=[int(index) for index in run.updates],
        estimates=_points(np.array([run.estimates[index].pose for index in run.updates])),
        right=[bool(value) for value in run.right],
        kidnapped_at=list(case.kidnapped_at),
    )


def _dead_reckoning(case: Case) -> Floats:
    """(N, 3) where the odometer alone puts the robot, from its true start on; (0, 3) where it has none."""
    readings = [frame.odometry for frame in case.frames]
    known = np.array([reading for reading in readings if reading is not None])
    if len(known) < len(readings) or not readings:
        return np.zeros((0, 3))
    return dead_reckoning(known, case.truth[0])


def _points(poses: Floats) -> list[Point]:
    return [(round(float(x), 4), round(float(y), 4)) for x, y in poses[:, :2]]


def _one_line(error: Exception) -> str:
    text = " ".join(str(error).split())
    if not isinstance(error, UserError):
        text = f"{type(error).__name__}: {text}".removesuffix(": ")
    return text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 3] + "..."


def _peak_mb() -> float | None:
    """The most memory that this process ever held [MB]; None where the system does not tell."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6)
