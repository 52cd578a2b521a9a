"""A benchmark that is killed, stopped, started twice or out of room loses nothing and says so in one line."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from oracles.run_contents import files_of, without_costs

from benchmarks.results import ResultsFile, Row, read_results
from benchmarks.run_folder import LOCK_FILE, is_free, only_writer
from topoloc.cli.main import EXIT_INTERRUPTED, EXIT_USER_ERROR, run
from topoloc.errors import UserError

GENEROUS_S = 120.0
"""So long a test waits for another process before it fails; it ends as soon as that has come so far."""
SMALL = ["bench", "--scenarios", "lab-fresh", "--sensors", "histogram", "--estimators", "best-match", "dead-reckoning"]
SEEDS = 2
JOBS_1, JOBS_2, CLUSTER = ("--jobs", "1"), ("--jobs", "2"), ("--cluster", "local")


def words(folder: Path, seeds: int = SEEDS, how: tuple[str, str] = JOBS_1) -> list[str]:
    """The command that begins a run in the folder, or continues the one that is there."""
    if (folder / "config.toml").exists():
        return ["bench", "--resume", str(folder), *how]
    return [*SMALL, "--updates", "6", "--seeds", str(seeds), *how, "--out", str(folder)]


@contextmanager
def started(arguments: list[str]) -> Iterator[subprocess.Popen[str]]:
    """The real command in a process group of its own, as a terminal has it; none of the group survives the block."""
    command = [sys.executable, "-m", "topoloc", *arguments]
    pipe = subprocess.PIPE
    with subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as process:
        try:
            yield process
        finally:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
            process.communicate(timeout=GENEROUS_S)  # to the end of both pipes: the workers hold them, too


def rows_written(folder: Path) -> int:
    """Whole lines after the first."""
    path = folder / "results.csv"
    return max(path.read_text().count("\n") - 1, 0) if path.exists() else 0


def wait_for_rows(process: subprocess.Popen[str], folder: Path, rows: int) -> None:
    """Until so many are there, or the process has ended."""
    deadline = time.monotonic() + GENEROUS_S
    while process.poll() is None and rows_written(folder) < rows:
        assert time.monotonic() < deadline, "the benchmark does not come so far"
        time.sleep(0.005)


def run_killed_after(folder: Path, seeds: int, rows: int, how: tuple[str, str] = JOBS_1) -> bool:
    """Go on until there are so many rows, then kill all processes; whether it was not at its end before."""
    with started(words(folder, seeds, how)) as process:
        wait_for_rows(process, folder, rows)
        return process.poll() is None


def assert_same(folder: Path, whole: Path) -> None:
    assert without_costs(read_results(folder / "results.csv")) == without_costs(read_results(whole / "results.csv"))
    assert files_of(folder) == files_of(whole) != {}
    assert (folder / "report.html").stat().st_size > 0


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a run that nothing disturbed."""
    folder = tmp_path_factory.mktemp("whole")
    assert run(words(folder)) == 0
    return folder


@pytest.fixture
def copy(whole: Path, tmp_path: Path) -> Path:
    """A copy of that folder, to be spoilt."""
    import shutil

    return Path(shutil.copytree(whole, tmp_path / "copy"))


def lines_of(folder: Path) -> list[str]:
    return (folder / "results.csv").read_text().splitlines(keepends=True)


def test_killed_and_resumed_until_it_ends(whole: Path, tmp_path: Path) -> None:
    folder = tmp_path / "run"
    for rows in (0, 2):
        assert run_killed_after(folder, SEEDS, rows)
    assert run(words(folder)) == 0
    assert_same(folder, whole)


@pytest.mark.slow
@pytest.mark.parametrize("how", [JOBS_1, JOBS_2])
def test_killed_again_and_again_at_any_moment(how: tuple[str, str], tmp_path: Path) -> None:
    """After each row, and at moments from a seeded generator, which fall into imports, drives, writes or the report."""
    seeds = 6
    assert run(words(tmp_path / "whole", seeds)) == 0
    folder, rng = tmp_path / "rows", np.random.default_rng(7)
    kills = sum(run_killed_after(folder, seeds, rows, how) for rows in range(2 * seeds))
    assert kills > seeds  # rows of a task come together: some counts are passed over
    assert run(words(folder, seeds, how)) == 0
    assert_same(folder, tmp_path / "whole")
    folder = tmp_path / "moments"
    for _ in range(8):
        with started(words(folder, seeds, how)):
            time.sleep(rng.uniform(0.5, 3.0))
    assert run(words(folder, seeds, how)) == 0
    assert_same(folder, tmp_path / "whole")


KILLED_AT_A_WRITE = """
import os, pathlib, signal, sys
from topoloc.cli.main import run
import benchmarks.choice, benchmarks.drives, benchmarks.report, benchmarks.workers

def counted(really):
    def called(*arguments):
        global left
        left -= 1
        if left == 0:
            os.kill(os.getpid(), signal.SIGKILL)
        return really(*arguments)
    return called

folder, begin = pathlib.Path(sys.argv[1]), sys.argv[2:-1]
for point in range(1, 1000):
    child = os.fork()
    if child == 0:
        left = point
        os.fsync, pathlib.Path.replace = counted(os.fsync), counted(pathlib.Path.replace)
        sys.exit(run([*begin, str(folder / str(point))]))
    if os.waitpid(child, 0)[1] == 0:
        break
print(point)
"""
"""Begins one run after the other, and kills each a write later: before a file is flushed, then before it is renamed."""


@pytest.mark.slow
def test_killed_at_every_write(tmp_path: Path) -> None:
    command = [sys.executable, "-c", KILLED_AT_A_WRITE, str(tmp_path), *words(tmp_path / "none", seeds=1)]
    points = int(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-1])
    folders = [tmp_path / str(point) for point in range(1, points + 1)]
    *killed, undisturbed = folders
    assert len(killed) > 15
    for folder in killed:
        assert run(words(folder, 1)) == 0, folder
        assert_same(folder, undisturbed)
        assert not [path.name for path in folder.rglob(".*") if path.name != LOCK_FILE]


@pytest.mark.parametrize("half", [-30, -200])
def test_what_a_kill_leaves_half_written_does_not_disturb(half: int, whole: Path, copy: Path) -> None:
    """A half row; rows that were not sorted yet; temporary files of writes that did not end."""
    head, *rows = lines_of(copy)
    (copy / "results.csv").write_text("".join([head, *reversed(rows)])[:half])
    leftovers = [
        copy / ".results.csv.abcd1234",
        copy / "steps" / ".best-match-0.csv.abcd_234",
        copy / ".x.html.00000000",
    ]
    for path in leftovers:
        path.write_text("scenario,sen")
    mine = copy / ".notes"
    mine.write_text("mine")
    assert run(words(copy)) == 0
    assert_same(copy, whole)
    assert mine.exists() and not any(path.exists() for path in leftovers)


def test_killed_before_it_really_began(tmp_path: Path) -> None:
    """Then there is no config.toml, and nothing to resume: the same command begins anew in the same place."""
    (tmp_path / LOCK_FILE).touch()
    (tmp_path / ".config.toml.x1234567").write_text("[run]\ncomm")
    assert is_free(tmp_path)
    assert run(words(tmp_path, seeds=1)) == 0
    assert rows_written(tmp_path) == 2
    assert {LOCK_FILE} == {path.name for path in tmp_path.rglob(".*")}


@pytest.mark.parametrize("name", ["config.toml", ".config.toml", ".config.toml.bak", "notes"])
def test_a_folder_that_holds_something_is_not_free(name: str, tmp_path: Path) -> None:
    assert is_free(tmp_path) and is_free(tmp_path / "none")
    (tmp_path / name).touch()
    assert not is_free(tmp_path) and not is_free(tmp_path / name)


def test_two_benchmarks_never_write_into_one_folder(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    def state() -> dict[str, tuple[int, bytes]]:
        return {str(path): (path.stat().st_mtime_ns, path.read_bytes()) for path in copy.rglob("*") if path.is_file()}

    before = state()
    with only_writer(copy):
        assert run(words(copy)) == EXIT_USER_ERROR
        assert capsys.readouterr().err == (
            f"topoloc: {copy}: another benchmark is writing here; wait until it ends, or stop it\n"
        )
        assert state() == before
    assert run(words(copy)) == 0


@pytest.mark.slow
def test_a_killed_parent_lets_go_of_its_folder_though_its_workers_live_on(whole: Path, tmp_path: Path) -> None:
    with started(words(tmp_path / "run", how=JOBS_2)) as process:
        wait_for_rows(process, tmp_path / "run", 1)
        process.kill()
        process.wait()
        assert run(words(tmp_path / "run")) == 0
        os.killpg(process.pid, signal.SIGKILL)
    assert_same(tmp_path / "run", whole)


@pytest.mark.parametrize("how", [JOBS_2, *(pytest.param(how, marks=pytest.mark.slow) for how in (JOBS_1, CLUSTER))])
def test_ctrl_c_leaves_a_report_of_what_is_done(how: tuple[str, str], tmp_path: Path) -> None:
    if how == CLUSTER:
        pytest.importorskip("distributed")
    folder, seeds = tmp_path / "run", 40
    with started(words(folder, seeds, how)) as process:
        wait_for_rows(process, folder, 3)
        os.killpg(process.pid, signal.SIGINT)
        out, err = process.communicate(timeout=GENEROUS_S)  # ends only when no worker holds the pipes any more
    assert process.returncode == EXIT_INTERRUPTED
    assert err.splitlines() == [f"stopped early; continue with: topoloc bench --resume {folder}", "topoloc: stopped"]
    keys = [row.key for row in read_results(folder / "results.csv")]
    assert 3 <= len(keys) < 2 * seeds and keys == sorted(set(keys))
    assert (folder / "report.html").stat().st_size > 0
    assert str(folder / "report.html") in out
    assert {LOCK_FILE} == {path.name for path in folder.rglob(".*")}


def test_ctrl_c_while_a_row_is_written_does_not_lose_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    really, path = os.fsync, tmp_path / "results.csv"

    def stopped(handle: int) -> None:
        monkeypatch.setattr(os, "fsync", really)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt), ResultsFile(path) as results:
        monkeypatch.setattr(os, "fsync", stopped)
        results.append(Row("a", "b", "c", 0))
    assert [row.key for row in read_results(path)] == [("a", "b", "c", 0)]


@contextmanager
def files_no_longer_than(size: int) -> Iterator[None]:
    """What a full disk does: writes stop in the middle, with an error."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize(
    ("what", "rows", "room"), [("replay", 0, 40), ("steps", 2, 40), ("results.csv", 3, 40), ("report.html", 4, 9000)]
)
def test_no_room_is_one_line_and_resumed_when_there_is(
    what: str, rows: int, room: int, whole: Path, copy: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """As many rows are there already as make results.csv just so much shorter, or longer, than the other files."""
    lines = sorted(lines_of(copy), key=lambda line: line.split(",")[3])  # by seed; "seed" comes last
    (copy / "results.csv").write_text(before := "".join([lines[-1], *lines[:rows]]))
    with files_no_longer_than(len(before) + room):
        assert run(words(copy)) == EXIT_USER_ERROR
    said = capsys.readouterr().err.splitlines()
    assert said[-1].startswith(f"topoloc: {copy / what}") and "cannot be written (" in said[-1]
    assert said[:-1] == [f"stopped early; continue with: topoloc bench --resume {copy}"] * (what != "report.html")
    assert len(read_results(copy / "results.csv")) >= rows
    assert run(words(copy)) == 0
    assert_same(copy, whole)


def test_no_room_for_the_settings(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "run"
    with files_no_longer_than(500):
        assert run(words(folder)) == EXIT_USER_ERROR
    error = capsys.readouterr().err
    assert error.startswith(f"topoloc: {folder / 'config.toml'}: cannot be written (") and error.count("\n") == 1
    assert is_free(folder)


def test_a_folder_that_cannot_be_written_to(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o555)
    if os.access(folder, os.W_OK):  # root may write anywhere but here
        folder = Path("/proc")
    if not folder.is_dir():
        pytest.skip("this user may write everywhere")
    assert run(words(folder / "run", 1)) == EXIT_USER_ERROR
    error = capsys.readouterr().err
    assert error.startswith(f"topoloc: {folder / 'run'}: cannot be written (") and error.count("\n") == 1
    with pytest.raises(UserError, match="yours to write to"), only_writer(folder / "run"):
        pass
