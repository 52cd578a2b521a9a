"""``topoloc bench``: every sensor with every estimator on every scenario, in one table."""

from __future__ import annotations

import os
import platform
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, is_dataclass
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from topoloc.errors import InputError, UnknownName, UserError

if TYPE_CHECKING:
    from benchmarks.results import Row, Summary
    from benchmarks.runner import Suite
    from benchmarks.scenarios import Scenario

SEEDS, UPDATES = 2, 60
QUICK_SEEDS, QUICK_UPDATES = 1, 20
DRAWN_SENSOR = "ima"
"""By default this sensor comes first, and so it is the one whose drives the report draws: the thesis's."""
PACKAGES = ("topoloc", "numpy", "scipy", "opencv-python-headless", "joblib")

Names = Annotated[list[str] | None, Parameter(consume_multiple=True, negative_iterable=())]
Flag = Annotated[bool, Parameter(negative="")]


@dataclass(frozen=True)
class Choice:
    """What a benchmark runs, as ``config.toml`` has it and ``--resume`` reads it back.

    Attributes:
        scenarios, sensors, estimators: their names.
        seeds: how many, from 0 on.
        updates: frames of a drive.
    """

    scenarios: tuple[str, ...]
    sensors: tuple[str, ...]
    estimators: tuple[str, ...]
    seeds: int
    updates: int

    @property
    def command(self) -> str:
        """The command line that runs just this."""
        words = ["topoloc", "bench"]
        for name, value in asdict(self).items():
            words += [f"--{name}", *(value if isinstance(value, tuple) else [str(value)])]
        return shlex.join(words)


def bench(
    *,
    scenarios: Names = None,
    sensors: Names = None,
    estimators: Names = None,
    seeds: int = SEEDS,
    updates: int = UPDATES,
    jobs: int | None = None,
    out: Path | None = None,
    resume: Path | None = None,
    quick: Flag = False,
) -> None:
    """Compare sensors and estimators on simulated drives; ends in a table, results.csv and report.html.

    Example: ``topoloc bench --sensors ima --estimators activity grid --seeds 5``

    Args:
        scenarios: By default lab-fresh, lab-people and lab-kidnapped; others: office-stereo, hall-omni.
        sensors: Names of sensor models, or of several as one: a+b, 'mix(a,b)'; by default all that the scenarios suit.
        estimators: Names of estimators; all that are installed by default.
        seeds: Drives of each scenario.
        updates: Frames of each drive.
        jobs: Processes; as many as there are cores by default.
        out: New folder for the results; runs/TIME-bench by default.
        resume: Folder of a run that was interrupted: run what is missing there, with its settings.
        quick: A first look: one seed, 20 frames.
    """
    from joblib import cpu_count

    jobs = cpu_count() if jobs is None else jobs
    for name, value in (("seeds", seeds), ("updates", updates), ("jobs", jobs)):
        if value < 1:
            raise UserError(f"--{name} is {value}; give a whole number from 1 on")
    if resume is not None:
        if out or scenarios or sensors or estimators or quick or (seeds, updates) != (SEEDS, UPDATES):
            raise UserError("--resume takes its settings from the folder it continues; leave all others but --jobs out")
        folder, choice = resume, _read_choice(resume)
        suite = _suite(choice)
        _refuse_other_settings(folder, choice, suite)
    else:
        if quick:
            seeds, updates = min(seeds, QUICK_SEEDS), min(updates, QUICK_UPDATES)
        choice = _choose(scenarios, sensors, estimators, seeds, updates)
        suite = _suite(choice)
        folder = _new_folder(out)
        _write_config(folder, choice, suite)
    _run(folder, suite, jobs)


def _choose(
    scenarios: Sequence[str] | None,
    sensors: Sequence[str] | None,
    estimators: Sequence[str] | None,
    seeds: int,
    updates: int,
) -> Choice:
    """What to run, names checked. Raises ``UserError``."""
    from benchmarks.scenarios import default_scenarios, further_scenarios
    from topoloc.plugins import ESTIMATORS, known_sensor, names

    known = (*default_scenarios(), *further_scenarios())
    chosen = tuple(s for s in known if s.name in scenarios) if scenarios else default_scenarios()
    return Choice(
        scenarios=_known("scenario", scenarios or [s.name for s in chosen], [s.name for s in known]),
        sensors=tuple(dict.fromkeys(map(known_sensor, sensors))) if sensors else _sensors_for(chosen),
        estimators=_known("estimator", estimators, names(ESTIMATORS)),
        seeds=seeds,
        updates=updates,
    )


def _sensors_for(scenarios: Sequence[Scenario]) -> tuple[str, ...]:
    """All sensors that one of the scenarios has the images for, the drawn one first; says which are left out."""
    from topoloc.plugins import SENSORS, load, names

    kinds, chosen, left = [scenario.kinds for scenario in scenarios], [], []
    for name in sorted(names(SENSORS), key=lambda name: (name != DRAWN_SENSOR, name)):
        try:
            needs = frozenset(load(SENSORS, name).needs)
        except (UserError, AttributeError):  # a package is missing, or needs depend on settings: its rows will say so
            needs = frozenset()
        if any(needs <= images for images in kinds):
            chosen.append(name)
        else:
            left.append(f"{name} ({', '.join(sorted(needs))} images)")
    if left:
        print(f"left out, since no scenario here has what they need: {', '.join(left)}")
    return tuple(chosen)


def _known(what: str, wanted: Sequence[str] | None, known: Sequence[str]) -> tuple[str, ...]:
    """The wanted names, each once; all known ones where none are named."""
    for name in wanted or ():
        if name not in known:
            raise UnknownName(what, name, sorted(known))
    return tuple(dict.fromkeys(wanted or known))


def _suite(choice: Choice) -> Suite:
    from functools import partial

    from benchmarks.runner import Suite
    from benchmarks.scenarios import default_scenarios, further_scenarios
    from topoloc.plugins import make_estimator, make_sensor

    known = (*default_scenarios(choice.updates), *further_scenarios(choice.updates))
    return Suite(
        scenarios=tuple(s for s in known if s.name in choice.scenarios),
        sensors={name: partial(make_sensor, name) for name in choice.sensors},
        estimators={name: partial(make_estimator, name) for name in choice.estimators},
        seeds=tuple(range(choice.seeds)),
    )


def _new_folder(out: Path | None) -> Path:
    folder = out or Path("runs") / f"{datetime.now():%Y%m%d-%H%M%S}-bench"
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise InputError(folder, "exists already", f"name another folder, or continue it with --resume {folder}")
    return folder


def _read_choice(folder: Path) -> Choice:
    """What the run in a folder was started with."""
    from topoloc.settings import build, read_toml

    path = folder / "config.toml"
    run = read_toml(path, "name the folder of a benchmark run").get("run", {})
    choice = build(Choice, {name: run[name] for name in Choice.__dataclass_fields__ if name in run}, path)
    return _choose(**asdict(choice))


def _write_config(folder: Path, choice: Choice, suite: Suite) -> None:
    import tomli_w

    from topoloc.files import write_text

    write_text(folder / "config.toml", tomli_w.dumps(_config(choice, suite)))


def _config(choice: Choice, suite: Suite) -> dict[str, Any]:
    """The resolved settings, the versions and the machine: what somebody needs who repeats the run."""
    from topoloc.plugins import ESTIMATORS, load, options, sensor_settings

    config = {
        "run": {
            "command": choice.command,
            "started": f"{datetime.now():%Y-%m-%d %H:%M:%S}",
            "rows": len(suite.keys()),
            **asdict(choice),
        },
        "versions": {"python": platform.python_version(), **dict(_versions())},
        "machine": {"system": platform.platform(), "cores": os.cpu_count()},
        "scenarios": {s.name: {"description": s.description, **s.settings} for s in suite.scenarios},
        "sensors": {name: _defaults(sensor_settings, name) for name in suite.sensors},
        "estimators": {name: _defaults(lambda one: options(load(ESTIMATORS, one)), name) for name in suite.estimators},
    }
    return dict(_plain(config))


def _refuse_other_settings(folder: Path, choice: Choice, suite: Suite) -> None:
    """Rows of two versions or settings in one table could not be told apart."""
    from topoloc.settings import read_toml

    path = folder / "config.toml"
    then, now = read_toml(path, "name the folder of a benchmark run"), _config(choice, suite)
    if then.get("versions", {}).get("topoloc") != now["versions"]["topoloc"]:
        raise InputError(path, "the run was begun with another version of topoloc", "start a new run")
    for section in ("scenarios", "sensors", "estimators"):
        if then.get(section) != now[section]:
            raise InputError(path, f"[{section}] has other settings than today's defaults", "start a new run")


def _versions() -> Iterator[tuple[str, str]]:
    from importlib.metadata import PackageNotFoundError, version

    for package in PACKAGES:
        with suppress(PackageNotFoundError):  # another build of OpenCV, say
            yield package, version(package)


def _defaults(settings_of: Callable[[str], Mapping[str, Any]], name: str) -> Mapping[str, Any]:
    try:
        return settings_of(name)
    except UserError:  # a package is missing: its rows will say so
        return {}


def _plain(value: Any) -> Any:
    """A value as TOML can hold it: what is None is left out."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value if isinstance(value, bool | int | float | str) else str(value)


def _run(folder: Path, suite: Suite, jobs: int) -> None:
    """Run what is missing in the folder; whatever happens, report what is there."""
    from benchmarks.results import ResultsFile, read_results
    from benchmarks.runner import run_suite

    path = folder / "results.csv"
    done = read_results(path) if path.exists() else []
    try:
        with ResultsFile(path, done) as results, _progress(len(suite.keys()), len(done)) as advance:
            run_suite(suite, results, jobs, on_row=lambda row: advance())
    except (KeyboardInterrupt, UserError):
        with suppress(UserError):  # the first mistake is the one to tell of
            _finish(folder)
            print(f"stopped early; continue with: topoloc bench --resume {shlex.quote(str(folder))}")
        raise
    _finish(folder)


@contextmanager
def _progress(total: int, done: int) -> Iterator[Callable[[], None]]:
    """A bar with the time left, on a terminal only."""
    from topoloc.cli.progress import bar

    with bar() as progress:
        task = progress.add_task("runs", total=total, completed=done)
        yield lambda: progress.advance(task)


def _finish(folder: Path) -> None:
    """The report, the table on the screen, and where the files are."""
    from benchmarks.report import write_report
    from benchmarks.results import read_results

    report = write_report(folder)
    rows = read_results(folder / "results.csv")
    _print_tables(rows)
    bad = [row for row in rows if row.status != "ok"]
    if bad:
        print(f"{len(bad)} of {len(rows)} runs gave no result, e.g. {bad[0].status}: {bad[0].reason}")
    for path in (folder / "results.csv", folder / "config.toml", report):
        print(path)
    if bad and len(bad) == len(rows):
        raise UserError(f"no run gave a result ({bad[0].reason}); choose other sensors, estimators or scenarios")


def _print_tables(rows: Sequence[Row]) -> None:
    """For each scenario sensors by estimators: node accuracy; sensors that gave nothing there are left out."""
    from rich import box
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    from benchmarks.results import summarize

    console, accuracy = Console(), summarize(rows, "node_accuracy")
    for scenario in dict.fromkeys(row.scenario for row in rows):
        own = [row for row in rows if row.scenario == scenario]
        sensors = list(dict.fromkeys(row.sensor for row in own if row.status == "ok"))
        if not sensors:
            continue
        console.print(f"{escape(scenario)} (simulated): node accuracy, %, mean ± standard deviation", style="italic")
        heads = (escape(name).replace("-", "-\n") for name in sensors)
        table = Table("", *heads, box=box.SIMPLE, padding=(0, 1, 0, 0))
        for estimator in dict.fromkeys(row.estimator for row in own):
            cells = (_screen_cell(accuracy.get((scenario, sensor, estimator))) for sensor in sensors)
            table.add_row(escape(estimator), *cells)
        console.print(table)


def _screen_cell(accuracy: Summary | None) -> str:
    if accuracy is None:
        return ""
    if accuracy.mean is None:
        return accuracy.text()
    spread = "" if accuracy.deviation is None else f" ± {100 * accuracy.deviation:.0f}"
    return f"{100 * accuracy.mean:.0f}{spread}"
