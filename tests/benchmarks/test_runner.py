from __future__ import annotations

import json
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np
import pytest
from oracles.run_contents import files_of, without_costs

from benchmarks.drives import peak_mb, run_task
from benchmarks.looks import SharedLooks
from benchmarks.results import COLUMNS, ResultsFile, Row, read_results
from benchmarks.run_files import answers_path, drive_path, looks_path, steps_path
from benchmarks.runner import Drive, Suite, Task, run_suite, tasks
from benchmarks.scenarios import Case, Scenario
from benchmarks.workers import in_processes
from topoloc.errors import InputError, UnreadableImage, UserError
from topoloc.recording import LazyImages
from topoloc.steps import read_steps
from topoloc.testing import evidence_for, toy_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image, Motion, WeightedPoses

FRAMES = 12


def toy_case(seed: int, kidnapped_at: tuple[int, ...] = (6,)) -> Case:
    """A drive along the toy map's lower row; the picture of a frame holds its pose for the fake sensor."""
    rng = np.random.default_rng(seed)
    truth = np.column_stack([np.linspace(0.0, 2.0, FRAMES), rng.normal(0.0, 0.05, FRAMES), np.zeros(FRAMES)])
    picture = np.zeros((4, 4), dtype=np.uint8)
    odometry = np.column_stack([np.arange(FRAMES), np.zeros((FRAMES, 2))])
    odometry[3] = odometry[2]  # the robot stands: the gate stays closed
    frames = [Frame(float(i), odometry[i], np.zeros(3), {"rgb": picture}) for i in range(FRAMES)]
    return Case(toy_map(), frames, truth, kidnapped_at)


def broken_case(seed: int) -> Case:
    raise ZeroDivisionError(f"no world\nfor seed {seed}")


@dataclass
class FakeSensor:
    """Sees where the toy robot is, and counts how often it looked."""

    needs: frozenset[str] = frozenset({"rgb"})
    looks: int = 0
    fits: int = 0

    def fit(self, topo_map: TopoMap) -> None:
        self.topo_map, self.fits = topo_map, self.fits + 1

    def observe(self, frame: Frame) -> Evidence:
        self.looks += 1
        return evidence_for(self.topo_map, (2.0 * frame.timestamp / (FRAMES - 1), 0.0, 0.0))


class UnfitSensor(FakeSensor):
    def fit(self, topo_map: TopoMap) -> None:
        raise UserError("the map has no panoramas; add some")


class CrashingSensor(FakeSensor):
    def observe(self, frame: Frame) -> Evidence:
        self.looks += 1
        raise ValueError("a bug")


class FakeEstimator:
    """Believes a random node near the best hypothesis: the rows must not depend on the processes."""

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        self.rng, self.pose = rng, np.zeros(3)

    def predict(self, motion: Motion) -> None:
        self.pose = self.pose + motion.delta

    def update(self, evidence: Evidence) -> float | None:
        self.pose = evidence.poses[int(np.argmax(evidence.match))] + self.rng.normal(0.0, 0.3, 3)
        return 0.0

    @property
    def belief(self) -> WeightedPoses:
        return WeightedPoses.uniform(self.pose[None], np.full(3, 0.1))


class CrashingEstimator(FakeEstimator):
    def update(self, evidence: Evidence) -> float | None:
        raise RuntimeError("a bug\nover two lines")


def missing_package() -> FakeEstimator:
    raise UserError("needs the package 'filterpy'; install it with pip")


TOY = Scenario("toy", "A toy.", toy_case)


CALM = Scenario("toy-calm", "Nobody carries the toy.", partial(toy_case, kidnapped_at=()))
SUITE = Suite((TOY, CALM), {"fake": FakeSensor}, {"fake": FakeEstimator, "crashing": CrashingEstimator}, (0, 1))


def suite(**changes: Any) -> Suite:
    return replace(SUITE, token=uuid4().hex, **changes)


def results_of(what: Suite, folder: Path, jobs: int = 1) -> list[Row]:
    with ResultsFile(folder / "results.csv") as results:
        run_suite(what, results, partial(in_processes, jobs=jobs))
    return read_results(folder / "results.csv")


def test_the_columns_are_those_of_the_design() -> None:
    assert ",".join(COLUMNS) == (
        "scenario,sensor,estimator,seed,status,reason,steps,node_accuracy,strict_accuracy,adjacent_rate,wrong_rate,"
        "position_median_m,position_rmse_m,heading_median_deg,steps_to_localize,recall_at_p99,recovery_steps,lost_rate,"
        "calibration_error,nees,sensor_ms,estimator_ms,peak_mb"
    )


def test_a_row_for_every_combination_sorted(tmp_path: Path) -> None:
    rows = results_of(suite(), tmp_path)
    assert [row.key for row in rows] == sorted(suite().keys())
    good = [row for row in rows if row.status == "ok"]
    assert {row.estimator for row in good} == {"fake"}
    assert all(row.values["steps"] == FRAMES - 1 for row in good)  # one frame was gated
    assert all((row.values["recovery_steps"] is None) == (row.scenario == "toy-calm") for row in good)
    assert all(row.values["sensor_ms"] is not None and row.values["estimator_ms"] is not None for row in good)


def test_a_sensor_is_fitted_once_and_looks_at_a_frame_once(tmp_path: Path) -> None:
    made: list[FakeSensor] = []

    def make() -> FakeSensor:
        made.append(FakeSensor())
        return made[-1]

    estimators = dict.fromkeys(("first", "second", "third"), FakeEstimator)
    rows = results_of(suite(scenarios=(TOY,), sensors={"fake": make}, estimators=estimators), tmp_path)
    assert len(rows) == 6
    assert [(sensor.fits, sensor.looks) for sensor in made] == [(1, FRAMES - 1)] * 2  # a drive for each seed
    first, second = (without_costs([row])[0] for row in rows[:3:2])
    assert first.pop("estimator") != second.pop("estimator")
    assert first["node_accuracy"] == second["node_accuracy"]


def test_a_drive_is_made_once(tmp_path: Path) -> None:
    seeds: list[int] = []

    def make(seed: int) -> Case:
        seeds.append(seed)
        return toy_case(seed)

    results_of(suite(scenarios=(Scenario("toy", "", make),), sensors={"a": FakeSensor, "b": FakeSensor}), tmp_path)
    assert seeds == [0, 1]


def test_rows_do_not_depend_on_jobs(tmp_path: Path) -> None:
    one, two = (results_of(suite(), tmp_path / str(jobs), jobs) for jobs in (1, 2))
    assert without_costs(one) == without_costs(two)
    assert files_of(tmp_path / "1") == files_of(tmp_path / "2")


def test_what_crashes_is_a_row_and_the_rest_goes_on(tmp_path: Path) -> None:
    scenarios = (Scenario("broken", "", broken_case), TOY)
    rows = results_of(suite(scenarios=scenarios, sensors={"fake": FakeSensor, "crashing": CrashingSensor}), tmp_path)
    seen = {(row.scenario, row.sensor, row.estimator): (row.status, row.reason) for row in rows if row.seed == 0}
    assert seen["broken", "fake", "fake"] == ("failed", "ZeroDivisionError: no world for seed 0")
    assert seen["toy", "crashing", "fake"] == ("failed", "ValueError: a bug")
    assert seen["toy", "fake", "crashing"] == ("failed", "RuntimeError: a bug over two lines")
    assert seen["toy", "fake", "fake"] == ("ok", "")


@pytest.mark.parametrize(
    ("parts", "reason"),
    [
        (
            {"sensors": {"x": partial(FakeSensor, frozenset({"omni", "rgb"}))}},
            "needs omni images; the scenario has rgb",
        ),
        ({"sensors": {"x": UnfitSensor}}, "the map has no panoramas"),
        ({"estimators": {"x": missing_package}}, "needs the package 'filterpy'"),
    ],
)
def test_what_cannot_be_fed_is_unavailable(parts: dict[str, object], reason: str, tmp_path: Path) -> None:
    rows = results_of(suite(scenarios=(TOY,), **parts), tmp_path)
    assert rows and all(row.status == "unavailable" and row.reason.startswith(reason) for row in rows)
    assert all(value is None for row in rows for value in row.values.values())


def test_looks_are_remembered_even_where_they_fail() -> None:
    class Unreadable(FakeSensor):
        def observe(self, frame: Frame) -> Evidence:
            self.looks += 1
            raise UnreadableImage("a.png", "does not decode", "save it again")

    sensor = Unreadable()
    looks = SharedLooks(sensor, toy_map())
    for _ in range(2):
        with pytest.raises(UnreadableImage):
            looks.observe(toy_case(0).frames[0])
    assert sensor.looks == looks.looks == 1


@pytest.mark.parametrize("keep", [0.0, 0.02, 0.4, 0.7, 0.999, 1.0])
def test_resuming_a_killed_run_gives_the_same_rows(keep: float, tmp_path: Path) -> None:
    whole = results_of(suite(), tmp_path)
    path = tmp_path / "results.csv"
    text = path.read_bytes()
    path.write_bytes(text[: int(keep * len(text))])
    with ResultsFile(path, read_results(path)) as results:
        ran: list[Row] = []
        run_suite(suite(), results, partial(in_processes, jobs=1), on_row=ran.append)
    again = read_results(path)
    assert without_costs(again) == without_costs(whole)
    assert (len(ran) == 0) == (keep == 1.0)


def test_rows_are_on_the_disk_when_the_benchmark_is_interrupted(tmp_path: Path) -> None:
    def stop_at(row: Row) -> None:
        assert read_results(tmp_path / "results.csv")[-1].key == row.key
        if row.seed == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), ResultsFile(tmp_path / "results.csv") as results:
        run_suite(suite(), results, partial(in_processes, jobs=1), on_row=stop_at)
    rows = read_results(tmp_path / "results.csv")
    assert [row.key for row in rows] == sorted(row.key for row in rows)
    assert len(rows) == 5  # two scenarios of the first seed, and one row of the second


@pytest.mark.parametrize(
    ("text", "problem"),
    [("a,b\n", "does not have the columns"), (",".join(COLUMNS) + "\nx,y\n", "line 2"), (None, "no such file")],
)
def test_a_file_that_is_no_results(text: str | None, problem: str, tmp_path: Path) -> None:
    if text is not None:
        (tmp_path / "results.csv").write_text(text)
    with pytest.raises(InputError, match=problem):
        read_results(tmp_path / "results.csv")


def test_reasons_with_commas_and_quotes_come_back(tmp_path: Path) -> None:
    row = Row("a", "b", "c", 0, "failed", 'commas, "quotes"', {"nees": 1.5})
    with ResultsFile(tmp_path / "results.csv") as results:
        results.append(row)
    back = read_results(tmp_path / "results.csv")[0]
    assert (back.reason, back.values["nees"], back.values["steps"]) == (row.reason, 1.5, None)


def test_every_answer_of_a_run_is_kept_with_the_truth(tmp_path: Path) -> None:
    for row in results_of(suite(), tmp_path):
        path = tmp_path / steps_path(row.scenario, row.sensor, row.estimator, row.seed)
        assert path.exists() == (row.status == "ok")
        if row.status == "ok":
            steps, case = read_steps(path), toy_case(row.seed)
            assert steps.truth == pytest.approx(case.truth, abs=1e-4)
            assert list(steps.kind).count("gated") == 1
            assert steps.right[steps.updated].mean() == pytest.approx(row.values["node_accuracy"])
            assert not steps.right[~steps.updated].any()


def test_the_first_drive_of_a_scenario_is_kept_for_the_report(tmp_path: Path) -> None:
    rows = results_of(suite(), tmp_path)
    for scenario in ("toy", "toy-calm"):
        drive = json.loads((tmp_path / drive_path(scenario)).read_text())
        assert (drive["scenario"], drive["seed"], len(drive["frames"])) == (scenario, 0, FRAMES)
        assert drive["reckoned"][0] == pytest.approx(drive["truth"][0][:2])
        looks = json.loads((tmp_path / looks_path(scenario, "fake")).read_text())
        answers = json.loads((tmp_path / answers_path(scenario, "fake", "fake")).read_text())
        assert [look["frame"] for look in looks] == [n for n in range(FRAMES) if answers[n]["kind"] != "gated"]
        right = [answer["right"] for answer in answers if answer["kind"] != "gated"]
        (row,) = (row for row in rows if row.key == (scenario, "fake", "fake", 0))
        assert np.mean(right) == pytest.approx(row.values["node_accuracy"])
        assert not (tmp_path / answers_path(scenario, "fake", "crashing")).exists()


def test_a_recorded_drive_is_made_once_for_all_seeds(tmp_path: Path) -> None:
    seeds: list[int] = []

    def make(seed: int) -> Case:
        seeds.append(seed)
        return toy_case(seed)

    rows = results_of(suite(scenarios=(Scenario("mine", "", make, recorded=True),), seeds=(3, 4, 5)), tmp_path)
    assert seeds == [3]
    assert [row.seed for row in rows if row.status == "ok"] == [3, 4, 5]
    poses = [read_steps(tmp_path / steps_path("mine", "fake", "fake", seed)) for seed in (3, 4)]
    assert (poses[0].truth == poses[1].truth).all()
    assert (poses[0].poses != poses[1].poses).any()  # the estimator's own chance


def test_a_sensor_is_fitted_once_to_drives_of_one_map() -> None:
    the_map, made = toy_map(), list[FakeSensor]()

    def make_case(seed: int) -> Case:
        return replace(toy_case(seed), topo_map=the_map)

    def make_sensor() -> FakeSensor:
        made.append(FakeSensor())
        return made[-1]

    scenarios = tuple(Scenario(name, "", make_case, site="toys") for name in ("a", "b"))
    chosen = suite(scenarios=scenarios, sensors={"fake": make_sensor}, seeds=(0,))
    (task,) = tasks(chosen, set())
    assert len(list(run_task(chosen, task))) > 4
    assert [sensor.fits for sensor in made] == [1]
    assert [sensor.looks for sensor in made] == [2 * (FRAMES - 1)]
    other = suite(scenarios=(*scenarios, replace(TOY, site="toys")), sensors={"fake": make_sensor}, seeds=(0,))
    list(run_task(other, tasks(other, set())[0]))
    assert [sensor.fits for sensor in made] == [1, 1, 1]  # the third drive has another map: a fresh sensor


def test_tasks_hold_only_what_is_missing() -> None:
    chosen = suite()
    done = {key for key in chosen.keys() if key[3] == 0 or key[2] == "fake"}  # noqa: SIM118
    assert tasks(chosen, set(chosen.keys())) == []
    assert tasks(chosen, done) == [
        Task("fake", (Drive(scenario, 1, (("crashing", 1),), False, False),)) for scenario in (TOY, CALM)
    ]


class Clock:
    """Time that passes only where somebody says so."""

    def __init__(self) -> None:
        self.now = 0.0

    def __call__(self) -> float:
        return self.now


def test_times_of_sensor_and_estimator_are_told_apart(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A look of 10 ms once a frame, 5 ms until its picture is there, 2 ms for each estimator's update."""
    clock = Clock()
    monkeypatch.setattr("benchmarks.drives.perf_counter", clock)
    monkeypatch.setattr("benchmarks.looks.perf_counter", clock)

    def picture() -> Image:
        clock.now += 0.005
        return np.zeros((4, 4), dtype=np.uint8)

    def make(seed: int) -> Case:
        case = toy_case(seed)
        frames = [replace(frame, images=LazyImages({"rgb": picture})) for frame in case.frames]
        return replace(case, frames=frames)

    class SlowSensor(FakeSensor):
        def observe(self, frame: Frame) -> Evidence:
            clock.now += 0.010
            return super().observe(frame)

    class SlowEstimator(FakeEstimator):
        def update(self, evidence: Evidence) -> float | None:
            clock.now += 0.002
            return super().update(evidence)

    scenarios, estimators = (Scenario("slow", "", make),), dict.fromkeys(("a", "b"), SlowEstimator)
    rows = results_of(suite(scenarios=scenarios, sensors={"slow": SlowSensor}, estimators=estimators), tmp_path)
    assert [row.values["sensor_ms"] for row in rows] == pytest.approx([10.0] * 4)
    assert [row.values["estimator_ms"] for row in rows] == pytest.approx([2.0] * 4)


def test_memory_is_the_most_that_the_process_held() -> None:
    before = peak_mb()
    if before is None:
        pytest.skip("this system does not tell")
    held = np.ones(round((before + 60.0) * 1e6 / 8.0))
    after = peak_mb()
    assert after is not None and after >= before + 50.0
    del held
    assert peak_mb() == pytest.approx(after, rel=0.1)


@pytest.mark.parametrize(("room", "read"), [(1000, 1), (2 * FRAMES - 1, 2)])
def test_pictures_are_kept_for_the_next_sensor_while_there_is_room(
    room: int, read: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("benchmarks.drives.KEPT_PICTURES", room)
    reads: list[str] = []

    def make(name: str, seed: int) -> Case:
        def reader() -> Image:
            reads.append(name)
            return np.zeros((4, 4), dtype=np.uint8)

        case = toy_case(seed)
        return replace(case, frames=[replace(frame, images=LazyImages({"rgb": reader})) for frame in case.frames])

    scenarios = tuple(Scenario(name, "", partial(make, name), site="toys") for name in ("a", "b"))
    chosen = suite(scenarios=scenarios, sensors={"one": FakeSensor, "other": FakeSensor}, seeds=(1, 2))
    chosen = replace(chosen, estimators={"fake": FakeEstimator})
    one, other = tasks(chosen, set())[2:]  # of the second seed, which is not replayed
    assert len(list(run_task(chosen, one))) == len(list(run_task(chosen, other))) == 4
    assert reads.count("b") == read * (FRAMES - 1)


class ExitingSensor(FakeSensor):
    def observe(self, frame: Frame) -> Evidence:
        raise SystemExit("bye")


class ExitingEstimator(FakeEstimator):
    def update(self, evidence: Evidence) -> float | None:
        raise SystemExit(5)


def test_who_exits_does_not_take_the_others_with_it(tmp_path: Path) -> None:
    chosen = suite(
        scenarios=(TOY,),
        sensors={"exiting": ExitingSensor, "fake": FakeSensor},
        estimators={"exiting": ExitingEstimator, "fake": FakeEstimator},
        seeds=(0,),
    )
    rows = {(row.sensor, row.estimator): (row.status, row.reason) for row in results_of(chosen, tmp_path)}
    assert rows == {
        ("exiting", "exiting"): ("failed", "SystemExit: bye"),
        ("exiting", "fake"): ("failed", "SystemExit: bye"),
        ("fake", "exiting"): ("failed", "SystemExit: 5"),
        ("fake", "fake"): ("ok", ""),
    }


def test_the_replay_of_a_recorded_drive_is_that_of_the_first_seed(tmp_path: Path) -> None:
    scenario = Scenario("mine", "", toy_case, recorded=True)
    results_of(suite(scenarios=(scenario,), seeds=(3, 4, 5)), tmp_path)
    answers = json.loads((tmp_path / answers_path("mine", "fake", "fake")).read_text())
    shown = [(answer["x"], answer["y"]) for answer in answers]
    first, other = (read_steps(tmp_path / steps_path("mine", "fake", "fake", seed)).poses[:, :2] for seed in (3, 4))
    assert np.array(shown) == pytest.approx(first, abs=1e-3)
    assert np.abs(first - other).max() > 0.01


def test_what_cannot_be_shown_does_no_harm_to_its_rows(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*given: object) -> None:
        raise MemoryError

    monkeypatch.setattr("benchmarks.replay.drive_of", refuse)
    monkeypatch.setattr("benchmarks.replay.look_of", refuse)
    rows = results_of(suite(estimators={"fake": FakeEstimator}), tmp_path)
    assert {row.status for row in rows} == {"ok"}
    assert not (tmp_path / drive_path("toy")).exists() and not (tmp_path / looks_path("toy", "fake")).exists()
