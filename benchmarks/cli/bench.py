"""``topoloc bench``: every sensor with every estimator on every scenario, in one table."""

from __future__ import annotations

import shlex
import sys
from contextlib import contextmanager, suppress
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

from cyclopts import Parameter

from topoloc.cli.numbers import Whole
from topoloc.errors import InputError, UserError

if TYPE_CHECKING:
    from collections.abc import Callable, Generator, Iterator, Sequence

    from benchmarks.runner import Outcome, Suite, Task

    Work = Callable[[Suite, Sequence[Task]], Generator[Outcome]]

SEEDS, UPDATES = 2, 60
QUICK_SEEDS, QUICK_UPDATES = 1, 20
QUICK_SCENARIOS = ("lab-fresh", "lab-kidnapped")
FULL_SEEDS = 10
NOT_TAKEN = "all others but --jobs, --cluster and --json"

Names = Annotated[list[str] | None, Parameter(consume_multiple=True, negative_iterable=())]
Words = Annotated[list[str] | None, Parameter(name="--set", consume_multiple=True, negative_iterable=())]
Flag = Annotated[bool, Parameter(negative="")]


def bench(
    *,
    scenarios: Names = None,
    sensors: Names = None,
    estimators: Names = None,
    seeds: Whole | None = None,
    first_seed: Whole = 0,
    updates: Whole | None = None,
    settings: Words = None,
    jobs: Whole | None = None,
    cluster: str | None = None,
    out: Path | None = None,
    resume: Path | None = None,
    quick: Flag = False,
    full: Flag = False,
    as_json: Annotated[bool, Parameter(name="--json", negative="")] = False,
) -> None:
    """Compare sensors and estimators on simulated drives, or on your own; ends in a table and report.html.

    Example: ``topoloc bench --sensors ima pca --estimators activity particle --seeds 10``

    Args:
        scenarios: By default lab-fresh, lab-people and lab-kidnapped; 'topoloc list scenarios' shows all. A folder with
            map/ and recording/ in it is one, too.
        sensors: Names of sensor models, or of several as one: a+b, 'mix(a,b)'; by default all that the scenarios suit.
        estimators: Names of estimators; all that are installed by default.
        seeds: Drives of each simulated scenario; 2 by default.
        first_seed: Seed of the first of them.
        updates: Frames of each simulated drive; 60 by default.
        settings: sensors.NAME.KEY=VALUE, estimators.NAME.KEY=VALUE or scenarios.NAME.KEY=VALUE.
        jobs: Processes; as many as there are cores by default.
        cluster: Address of a dask scheduler whose workers do the work, or 'local' for a cluster of this machine.
        out: New folder for the results; runs/TIME-bench by default.
        resume: Folder of a run that was interrupted: run what is missing there, with its settings.
        quick: A first look: two scenarios, one seed, 20 frames.
        full: Everything: all scenarios, 10 seeds; takes half an hour or more, and can be interrupted and resumed.
        as_json: Print the rows as JSON in place of the tables.
    """
    import tomli_w
    from joblib import cpu_count

    from benchmarks.choice import choose, left_out, read_choice, suite_of
    from benchmarks.config import config_of, refuse_other_settings
    from benchmarks.run_folder import only_writer
    from benchmarks.workers import in_processes, on_cluster, refuse_unreachable
    from topoloc.files import write_text

    _refuse_numbers(seeds, first_seed, updates, jobs)
    _refuse_empty(scenarios=scenarios, sensors=sensors, estimators=estimators, set=settings)
    if jobs is not None and cluster is not None:
        raise UserError("--jobs is for this machine alone, --cluster for the workers of a cluster; give one of them")
    if resume is not None:
        if any((out, scenarios, sensors, estimators, seeds, first_seed, updates, settings, quick, full)):
            raise UserError(f"--resume takes its settings from the folder it continues; leave out {NOT_TAKEN}")
        folder, choice = resume, read_choice(resume)
        refuse_other_settings(folder, choice)
    else:
        folder = out or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-bench"
        _refuse_taken(folder)
        usual = _usual(quick, full)
        choice = choose(
            scenarios or usual.scenarios,
            sensors,
            estimators,
            seeds or usual.seeds,
            updates or usual.updates,
            first_seed,
            settings or (),
        )
    suite = suite_of(choice)
    if cluster is not None:
        refuse_unreachable(cluster)
    if sensors is None and resume is None and left_out(choice):
        print(f"left out, since no scenario here has what they need: {left_out(choice)}", file=sys.stderr)
    work = partial(in_processes, jobs=jobs or cpu_count()) if cluster is None else partial(on_cluster, address=cluster)
    config = tomli_w.dumps(config_of(choice, suite))
    with only_writer(folder):
        if resume is None:
            _refuse_taken(folder)  # another may have begun and ended there since
            write_text(folder / "config.toml", config)
        _run(folder, suite, work, as_json)


class _Usual(NamedTuple):
    """What is run where nothing is said; scenarios None for the default ones."""

    scenarios: Sequence[str] | None
    seeds: int
    updates: int


def _usual(quick: bool, full: bool) -> _Usual:
    """For a first look, for everything, or neither. Raises ``UserError`` for both."""
    from benchmarks.scenarios import scenario_names

    if quick and full:
        raise UserError("--quick and --full contradict each other; give one of them")
    if quick:
        return _Usual(QUICK_SCENARIOS, QUICK_SEEDS, QUICK_UPDATES)
    return _Usual(scenario_names(), FULL_SEEDS, UPDATES) if full else _Usual(None, SEEDS, UPDATES)


def _refuse_numbers(seeds: int | None, first_seed: int, updates: int | None, jobs: int | None) -> None:
    """Raise ``UserError`` for a number that is too small."""
    for name, value in (("seeds", seeds), ("updates", updates), ("jobs", jobs)):
        if value is not None and value < 1:
            raise UserError(f"--{name} is {value}; give a whole number from 1 on")
    if first_seed < 0:
        raise UserError(f"--first-seed is {first_seed}; give a whole number from 0 on")


def _refuse_empty(**lists: list[str] | None) -> None:
    """Raise ``UserError`` for an option that was named with nothing after it: it would silently mean all."""
    for name, words in lists.items():
        if words == []:
            raise UserError(f"--{name} has nothing after it; name at least one, or leave it out")


def _refuse_taken(folder: Path) -> None:
    from benchmarks.run_folder import is_free

    if not is_free(folder):
        raise InputError(folder, "exists already", f"name another folder, or continue it with --resume {folder}")


def _run(folder: Path, suite: Suite, work: Work, as_json: bool) -> None:
    """Run what is missing in the folder; whatever happens, report what is there."""
    from benchmarks.results import ResultsFile, read_results
    from benchmarks.runner import run_suite

    path = folder / "results.csv"
    done = read_results(path) if path.exists() else []
    try:
        with ResultsFile(path, done) as results, _progress(len(suite.keys()), len(done)) as advance:
            run_suite(suite, results, work, on_row=lambda row: advance())
    except BaseException:
        with suppress(UserError):  # the first mistake is the one to tell of
            _finish(folder, suite, as_json)
        print(f"stopped early; continue with: topoloc bench --resume {shlex.quote(str(folder))}", file=sys.stderr)
        raise
    _finish(folder, suite, as_json)


@contextmanager
def _progress(total: int, done: int) -> Iterator[Callable[[], None]]:
    """A bar with the time left, on a terminal only."""
    from topoloc.cli.progress import bar

    with bar() as progress:
        task = progress.add_task("runs", total=total, completed=done)
        yield lambda: progress.advance(task)


def _finish(folder: Path, suite: Suite, as_json: bool) -> None:
    """The report, the table on the screen, and where the files are."""
    from benchmarks.report import write_report
    from benchmarks.results import OK, read_results
    from benchmarks.screen import print_json, print_problems, print_tables

    rows = read_results(folder / "results.csv")
    if not rows:  # stopped before anything was done: there is nothing to report
        return
    report = write_report(folder)
    bad = [row for row in rows if row.status != OK]
    if as_json:
        print_json(folder, rows, len(suite.keys()))
    else:
        print_tables(rows, {scenario.name for scenario in suite.scenarios if scenario.recorded})
        print_problems(rows)
        for path in (folder / "results.csv", folder / "config.toml", report):
            print(path)
    if bad and len(bad) == len(rows):
        raise UserError(f"no run gave a result ({bad[0].reason}); choose other sensors, estimators or scenarios")
