"""Who does the tasks: the rows are the same whoever does them, also where a worker is killed in the middle of one."""

from __future__ import annotations

import builtins
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import TypeVar

import pytest
from oracles.run_contents import files_of, without_costs

from benchmarks.choice import choose, suite_of
from benchmarks.drives import KILLED
from benchmarks.results import ResultsFile, Row, read_results
from benchmarks.runner import Outcome, Suite, Task, run_suite, tasks
from benchmarks.scenarios import Case
from benchmarks.workers import in_processes, on_cluster
from topoloc.errors import UserError

GENEROUS_S = 120.0
"""So long a test waits for another process before it fails; it ends as soon as that has come so far."""
PATIENCE_S = 2.0
SEEDS, ESTIMATORS = 3, ["best-match", "dead-reckoning", "particle"]
T = TypeVar("T")
Work = Callable[[Suite, Sequence[Task]], Generator[Outcome, None, None]]


def suite(seeds: int, sensors: Sequence[str] = ("histogram",)) -> Suite:
    """Real sensors on short simulated drives."""
    return suite_of(choose(["lab-fresh"], sensors, ESTIMATORS, seeds, 3))


def results_of(what: Suite, folder: Path, work: Work) -> list[Row]:
    with ResultsFile(folder / "results.csv") as results:
        run_suite(what, results, work)
    return read_results(folder / "results.csv")


def waiting_suite(seeds: int, signs: Path) -> Suite:
    """The suite whose drives after the first, once begun, leave a file ``begun-SEED-PID`` and wait for one: ``go``."""

    def make_when_told(make: Callable[[int], Case], seed: int) -> Case:  # local, so that it travels by value
        if seed:
            (signs / f"begun-{seed}-{os.getpid()}").touch()
        while seed and not (signs / "go").exists():
            time.sleep(0.01)
        return make(seed)

    signs.mkdir()
    whole = suite(seeds)
    scenarios = tuple(replace(one, make=partial(make_when_told, one.make)) for one in whole.scenarios)
    return replace(whole, scenarios=scenarios)


def wait_for(found: Callable[[], T | None]) -> T:
    deadline = time.monotonic() + GENEROUS_S
    while (it := found()) is None:
        assert time.monotonic() < deadline, "another process does not come so far"
        time.sleep(0.02)
    return it


def begun(signs: Path, path: Path, among: Sequence[int] = ()) -> int | None:
    """A process that has begun a drive, one of these if any are named, once the rows of the first are there."""
    if not path.exists() or path.read_text().count("\n") <= len(ESTIMATORS):
        return None
    pids = [int(sign.name.split("-")[2]) for sign in signs.glob("begun-*")]
    return next((pid for pid in pids if not among or pid in among), None)


@contextmanager
def meanwhile(do: Callable[[], None]) -> Iterator[None]:
    """Do something in another thread; what goes wrong there fails the test."""
    problems = list[BaseException]()

    def watched() -> None:
        try:
            do()
        except BaseException as problem:
            problems.append(problem)

    thread = threading.Thread(target=watched, daemon=True)
    thread.start()
    yield
    thread.join()
    assert not problems, problems


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run in this process."""
    folder = tmp_path_factory.mktemp("undisturbed")
    results_of(suite(SEEDS), folder, partial(in_processes, jobs=1))
    return folder


@pytest.mark.slow
def test_what_a_killed_process_was_doing_is_done_again(undisturbed: Path, tmp_path: Path) -> None:
    signs, results = tmp_path / "signs", tmp_path / "killed" / "results.csv"
    what = waiting_suite(SEEDS, signs)

    def kill_one() -> None:
        os.kill(wait_for(partial(begun, signs, results)), signal.SIGKILL)
        (signs / "go").touch()

    with meanwhile(kill_one):
        rows = results_of(what, tmp_path / "killed", partial(in_processes, jobs=2))
    assert len(rows) == len(what.keys())
    assert without_costs(rows) == without_costs(read_results(undisturbed / "results.csv"))
    assert files_of(tmp_path / "killed") == files_of(undisturbed)


@pytest.mark.slow
def test_a_task_that_always_kills_its_process_has_failed_and_the_rest_goes_on(tmp_path: Path) -> None:
    whole = suite(4)

    def deadly(make: Callable[[int], Case], seed: int) -> Case:
        if seed != 1:
            return make(seed)
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError

    what = replace(whole, scenarios=tuple(replace(one, make=partial(deadly, one.make)) for one in whole.scenarios))
    rows = results_of(what, tmp_path / "deadly", partial(in_processes, jobs=2))
    once = results_of(whole, tmp_path / "whole", partial(in_processes, jobs=1))
    assert {(row.status, row.reason) for row in rows if row.seed == 1} == {("failed", KILLED)}
    alike = [[row for row in some if row.seed != 1] for some in (rows, once)]
    assert without_costs(alike[0]) == without_costs(alike[1]) and len(rows) == len(once)


@contextmanager
def cluster(folder: Path, workers: int) -> Iterator[tuple[str, list[subprocess.Popen[bytes]]]]:
    """A scheduler and workers, each a process of its own: address, processes, the scheduler's first."""
    pytest.importorskip("distributed")
    sheet = folder / "scheduler.json"
    here = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(sheet)]
    alone = ["--no-nanny", "--nthreads", "1", "--local-directory", str(folder)]
    dask = [sys.executable, "-m", "dask"]
    processes = list[subprocess.Popen[bytes]]()
    try:
        for words in [
            ["scheduler", "--port", "0", "--dashboard-address", "127.0.0.1:0", *here],
            *[["worker", *here, *alone]] * workers,
        ]:
            started = subprocess.Popen([*dask, *words], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.STDOUT)
            processes.append(started)
        yield wait_for(partial(address_in, sheet)), processes
    finally:
        for process in processes:
            process.kill()
        for process in processes:
            process.wait()


def address_in(sheet: Path) -> str | None:
    import json

    try:
        return str(json.loads(sheet.read_text())["address"])
    except (OSError, ValueError):  # not there yet, or half written
        return None


def test_a_killed_workers_task_is_done_by_another(undisturbed: Path, tmp_path: Path) -> None:
    signs, results = tmp_path / "signs", tmp_path / "killed" / "results.csv"
    what = waiting_suite(SEEDS, signs)
    with cluster(tmp_path, 2) as (address, (_, *workers)):
        pids = [worker.pid for worker in workers]

        def kill_one() -> None:
            os.kill(wait_for(partial(begun, signs, results, pids)), signal.SIGKILL)
            (signs / "go").touch()

        with meanwhile(kill_one):
            rows = results_of(what, tmp_path / "killed", partial(on_cluster, address=address))
        assert sorted(worker.poll() is None for worker in workers) == [False, True]
    assert without_costs(rows) == without_costs(read_results(undisturbed / "results.csv"))
    assert files_of(tmp_path / "killed") == files_of(undisturbed)


@pytest.mark.slow
@pytest.mark.parametrize("who", ["scheduler", "worker"])
def test_a_cluster_that_goes_is_told_of_and_what_is_done_stays(who: str, tmp_path: Path) -> None:
    signs = tmp_path / "signs"
    what, path = waiting_suite(2, signs), tmp_path / "run" / "results.csv"
    (signs / "go").touch()
    threads = set(threading.enumerate())
    with cluster(tmp_path, 1) as (address, processes):

        def kill(row: Row) -> None:
            processes[("scheduler", "worker").index(who)].kill()

        work = partial(on_cluster, address=address, patience_s=PATIENCE_S)
        with pytest.raises(UserError, match=f"{address}.*--resume") as problem, ResultsFile(path) as results:
            run_suite(what, results, work, on_row=kill)
    assert "\n" not in str(problem.value)
    assert {row.seed for row in read_results(path)} == {0}
    assert set(threading.enumerate()) <= threads


@pytest.mark.slow
def test_a_task_that_kills_every_worker_is_told_of(tmp_path: Path) -> None:
    whole = suite(1)

    def deadly(seed: int) -> Case:
        os.kill(os.getpid(), signal.SIGKILL)
        raise AssertionError

    what = replace(whole, scenarios=tuple(replace(one, make=deadly) for one in whole.scenarios))
    with cluster(tmp_path, 5) as (address, _):
        work = partial(on_cluster, address=address, patience_s=GENEROUS_S)
        with pytest.raises(UserError, match=r"gave up a task \(KilledWorker.*--resume"):
            results_of(what, tmp_path / "run", work)


def test_a_scheduler_without_workers_is_told_of(tmp_path: Path) -> None:
    with cluster(tmp_path, 0) as (address, _), pytest.raises(UserError, match="has no workers; start some with"):
        list(on_cluster(suite(1), tasks(suite(1), set()), address, patience_s=0.1))


@pytest.mark.slow
def test_workers_with_another_version_are_told_of(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with cluster(tmp_path, 1) as (address, _):
        monkeypatch.setattr("benchmarks.cluster.__version__", "9.9")
        with pytest.raises(UserError, match=r"the worker tcp://\S+ has topoloc \S+; install topoloc 9\.9 there"):
            list(on_cluster(suite(1), tasks(suite(1), set()), address))


@pytest.mark.parametrize("address", ["nonsense", "tcp://127.0.0.1:1"])
def test_an_address_where_nobody_answers(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("benchmarks.cluster.ANSWER_S", 0.2)
    with pytest.raises(UserError, match=f"--cluster {address}: no dask scheduler answers there.*'dask scheduler'"):
        list(on_cluster(suite(1), tasks(suite(1), set()), address))


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    really = builtins.__import__

    def without(name: str, *arguments: object, **others: object) -> ModuleType:
        if name == "distributed":
            raise ModuleNotFoundError("no module", name=name)
        return really(name, *arguments, **others)  # type: ignore[arg-type]

    monkeypatch.delitem(sys.modules, "benchmarks.cluster", raising=False)
    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(UserError, match=r"distributed is missing.*pip install 'topoloc\[cluster\]'"):
        list(on_cluster(suite(1), tasks(suite(1), set()), "local"))


@pytest.mark.slow
def test_rows_and_files_depend_neither_on_jobs_nor_on_a_cluster(tmp_path: Path) -> None:
    pytest.importorskip("distributed")
    what = suite(3, ["ima", "histogram", "pca"])
    works: dict[str, Work] = {f"{jobs} jobs": partial(in_processes, jobs=jobs) for jobs in (1, 2, 3)}
    works["cluster"] = partial(on_cluster, address="local")
    rows = {name: without_costs(results_of(what, tmp_path / name, work)) for name, work in works.items()}
    files = {name: files_of(tmp_path / name) for name in works}
    assert len(rows["1 jobs"]) == len(what.keys())
    for name in works:
        assert rows[name] == rows["1 jobs"], name
        assert files[name] == files["1 jobs"], name


@pytest.mark.slow
def test_workers_of_this_machine_are_as_fast_as_other_processes(monkeypatch: pytest.MonkeyPatch) -> None:
    """By default dask's workers give memory back at every turn, by which some sensors take twice as long."""
    monkeypatch.delenv("MALLOC_TRIM_THRESHOLD_", raising=False)
    pytest.importorskip("distributed")
    from benchmarks.cluster import joined

    with joined("local", GENEROUS_S) as backend:
        trims, threads = (backend.client.run(os.getenv, name) for name in ("MALLOC_TRIM_THRESHOLD_", "OMP_NUM_THREADS"))
    assert set(trims.values()) == {None}
    assert set(threads.values()) == {"1"}
