"""A task of the benchmark done: one sensor looks at drives, and every estimator runs on what it saw."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from time import perf_counter

import numpy as np
from threadpoolctl import threadpool_limits

from benchmarks import replay
from benchmarks.looks import CRASHES, SharedLooks
from benchmarks.results import FAILED, UNAVAILABLE, Row
from benchmarks.run_files import Kept, answers_path, drive_path, looks_path, steps_path
from benchmarks.runner import Drive, Outcome, Suite, Task
from benchmarks.scenarios import Case
from estimators import BestMatch
from topoloc.errors import UserError, one_line
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import Localizer, Step
from topoloc.metrics import Costs, Run, evaluate
from topoloc.steps import steps_text
from topoloc.topo_map import TopoMap

ESTIMATOR_STREAM = 1
"""Beside the seed, so that an estimator does not draw the very numbers that the world's noise was made of."""
LONGEST_REASON = 300
KILLED = "its process was killed, perhaps for want of memory, or by the sensor or an estimator itself"
KEPT_PICTURES = 1000
"""Frames whose pictures a process keeps for the next sensor, some 330 MB in the laboratory; of longer drives they are
made, or read, again."""


@dataclass
class Remembered:
    """The drives that a process made for its last task: the next sensor's are often the same.

    Attributes:
        where: suite, site and seed that they are of.
        cases: by scenario.
    """

    where: tuple[str, str, int] = ("", "", 0)
    cases: dict[str, Case] = field(default_factory=dict)

    def case(self, suite: Suite, drive: Drive) -> Case:
        """The drive, made where it is not remembered; those of another site or seed are forgotten."""
        where = (suite.token, drive.scenario.site or drive.scenario.name, drive.seed)
        if where != self.where:
            self.where, self.cases = where, {}
        name = drive.scenario.name
        if name not in self.cases:
            with one_thread():
                self.cases[name] = drive.scenario.make(drive.seed)
        return self.cases[name]

    @property
    def keeps_pictures(self) -> bool:
        """Whether there is room for the pictures of all drives of this site."""
        return sum(len(case.frames) for case in self.cases.values()) <= KEPT_PICTURES


_remembered = Remembered()


@dataclass(frozen=True)
class Fitted:
    """A sensor that was fitted to a map."""

    sensor: Sensor
    topo_map: TopoMap


@dataclass(frozen=True)
class _Localized:
    """A run that came to its end, and what its estimator held at each step where that is shown."""

    steps: list[Step]
    run: Run
    answers: list[replay.Answer]


def run_task(suite: Suite, task: Task) -> Iterator[Outcome]:
    """The rows of a task, each after the files that belong to it; whatever crashes is a row that says so."""
    fitted: Fitted | None = None
    for drive in task.drives:
        try:
            case = _remembered.case(suite, drive)
        except CRASHES as error:
            yield from (_row(task.sensor, drive, pair, FAILED, error) for pair in drive.pairs)
            continue
        if drive.pictured:
            yield from _if_it_can_be_shown(partial(_kept_drive, drive, case))
        try:
            fitted = _fit(suite.sensors[task.sensor], case, fitted)
        except CRASHES as error:
            status = UNAVAILABLE if isinstance(error, UserError) else FAILED
            yield from (_row(task.sensor, drive, pair, status, error) for pair in drive.pairs)
            continue
        looks = SharedLooks(fitted.sensor, None, keep_pictures=_remembered.keeps_pictures)
        yield from _run_drive(suite, task.sensor, drive, case, looks)


def _kept_drive(drive: Drive, case: Case) -> Kept:
    shown = replay.drive_of(drive.scenario.name, drive.seed, case, _remembered.keeps_pictures)
    return Kept(drive_path(drive.scenario.name), replay.as_json(shown))


def _fit(make_sensor: Callable[[], Sensor], case: Case, before: Fitted | None) -> Fitted:
    """A sensor fitted to the drive's map, or the one before if that map is the same.

    Raises:
        UserError: the drive cannot feed it.
    """
    known = before if before is not None and before.topo_map is case.topo_map else None
    sensor = make_sensor() if known is None else known.sensor
    missing = sensor.needs - case.kinds
    if missing:
        have = ", ".join(sorted(case.kinds)) or "no"
        raise UserError(f"needs {', '.join(sorted(missing))} images; the scenario has {have} images")
    if known is not None:
        return known
    with one_thread():
        sensor.fit(case.topo_map)
    return Fitted(sensor, case.topo_map)


def _run_drive(suite: Suite, sensor: str, drive: Drive, case: Case, looks: SharedLooks) -> Iterator[Outcome]:
    name, seen = drive.scenario.name, _look_ahead(case, looks)
    if drive.shown and seen:
        yield from _if_it_can_be_shown(partial(_kept_looks, sensor, drive, case, seen, looks))
    for estimator, seed in drive.pairs:
        pair, shown = (estimator, seed), drive.shown and seed == drive.seed
        try:
            made = suite.estimators[estimator]()
        except CRASHES as error:
            yield _row(sensor, drive, pair, UNAVAILABLE if isinstance(error, UserError) else FAILED, error)
            continue
        try:
            with one_thread():
                done = _localize(case, looks, made, seed, shown)
                row = Row(name, sensor, estimator, seed, values=evaluate(done.run))
        except CRASHES as error:
            yield _row(sensor, drive, pair, FAILED, error)
            continue
        if shown:
            yield Kept(answers_path(name, sensor, estimator), replay.as_json(done.answers))
        right = np.zeros(len(done.steps), dtype=bool)
        right[done.run.updates] = done.run.right
        yield Kept(steps_path(name, sensor, estimator, seed), steps_text(case.topo_map, done.steps, case.truth, right))
        yield row


def _look_ahead(case: Case, looks: SharedLooks) -> list[Step]:
    """Let the sensor look at all that will be asked of it, so that no estimator's time has its cold caches in it.

    Which frames are looked at depends on the odometer alone. Returns the steps, none where the sensor crashed: every
    estimator will meet that.
    """
    localizer, steps = Localizer(case.topo_map, looks, BestMatch()), []
    with one_thread(), suppress(*CRASHES):
        for frame in case.frames:
            localizer.step(frame)
            assert localizer.last is not None  # a step was just made
            steps.append(localizer.last)
    return steps if len(steps) == len(case.frames) else []


def _if_it_can_be_shown(keep: Callable[[], Kept]) -> Iterator[Kept]:
    """What the replay needs; a run is none the worse where that cannot be made: the report says what is missing."""
    with suppress(*CRASHES):
        yield keep()


def _kept_looks(sensor: str, drive: Drive, case: Case, steps: Sequence[Step], looks: SharedLooks) -> Kept:
    kept = []
    for number, (frame, step) in enumerate(zip(case.frames, steps, strict=True)):
        if step.kind != "gated":
            kept.append(replay.look_of(number, frame, step, looks.sensor))
            looks.let_go(frame)
    return Kept(looks_path(drive.scenario.name, sensor), replay.as_json(kept))


def _localize(case: Case, looks: SharedLooks, estimator: Estimator, seed: int, shown: bool) -> _Localized:
    """One run: its steps, what they cost beside waiting for what the sensor saw, and, if shown, the beliefs."""
    rng = np.random.default_rng([seed, ESTIMATOR_STREAM])
    localizer = Localizer(case.topo_map, looks, estimator, rng=rng)
    steps, held, seconds = [], [], 0.0
    for frame in case.frames:
        started, waited = perf_counter(), looks.waited
        localizer.step(frame)
        seconds += (perf_counter() - started) - (looks.waited - waited)
        assert localizer.last is not None  # a step was just made
        steps.append(localizer.last)
        if shown:
            gated = localizer.last.kind == "gated"
            held.append(([] if gated else replay.cells_of(estimator.belief), replay.account_of(estimator)))
    updates = sum(step.kind != "gated" for step in steps)
    costs = Costs(
        1e3 * looks.seconds / looks.looks if looks.looks else None,
        1e3 * seconds / updates if updates else None,
        peak_mb(),
    )
    run = Run.of(case.topo_map, steps, case.truth, case.kidnapped_at, costs)
    right = dict(zip(run.updates.tolist(), run.right.tolist(), strict=True))
    answers = [
        replay.answer_of(steps[number], right.get(number, False), cells, account)
        for number, (cells, account) in enumerate(held)
    ]
    return _Localized(steps, run, answers)


def killed_rows(task: Task) -> Iterator[Outcome]:
    """The rows of a task that killed the process it was done in."""
    for drive in task.drives:
        for estimator, seed in drive.pairs:
            yield Row(drive.scenario.name, task.sensor, estimator, seed, FAILED, KILLED)


@contextmanager
def one_thread() -> Iterator[None]:
    """Libraries that would use every core hinder the other processes, and their sums depend on how many they get."""
    import cv2

    threads = cv2.getNumThreads()
    cv2.setNumThreads(1)
    try:
        with threadpool_limits(1):
            yield
    finally:
        cv2.setNumThreads(threads)


def _row(sensor: str, drive: Drive, pair: tuple[str, int], status: str, error: BaseException) -> Row:
    """A row that says why there is no result."""
    estimator, seed = pair
    return Row(drive.scenario.name, sensor, estimator, seed, status, _reason(error))


def _reason(error: BaseException) -> str:
    text = one_line(error)
    return text if len(text) <= LONGEST_REASON else text[: LONGEST_REASON - 3] + "..."


def peak_mb() -> float | None:
    """The most memory that this process ever held [MB]; None where the system does not tell."""
    if sys.platform == "win32":
        return None
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return float(peak / 1e6 if sys.platform == "darwin" else peak * 1024 / 1e6)
