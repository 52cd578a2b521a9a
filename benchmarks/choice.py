"""What a benchmark runs: chosen by name, written to ``config.toml``, read back to resume, to explain, to compare."""

from __future__ import annotations

import os
import platform
import re
import shlex
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, is_dataclass
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.runner import Suite
from benchmarks.scenarios import DEFAULT, Scenario, make_scenario, scenario_names
from topoloc.errors import InputError, UnknownName, UserError
from topoloc.plugins import (
    ESTIMATORS,
    SENSORS,
    known_sensor,
    load,
    make_estimator,
    make_sensor,
    names,
    options,
    sensor_settings,
)
from topoloc.settings import build, parse_words, read_toml, refuse_unknown

DRAWN_SENSOR = "ima"
"""By default this sensor comes first, and so it is the one whose drives the report draws: the thesis's."""
PACKAGES = ("topoloc", "numpy", "scipy", "opencv-python-headless", "scikit-learn", "joblib")
REMEDY = "name the folder of a benchmark run"
TABLES = ("scenarios", "sensors", "estimators")


@dataclass(frozen=True)
class Choice:
    """What a benchmark runs, as ``config.toml`` has it and ``--resume`` reads it back.

    Attributes:
        scenarios, sensors, estimators: their names; a scenario may be a folder.
        seeds: how many.
        first_seed: the first of them.
        updates: frames of a simulated drive.
        settings: ``sensors.NAME.KEY=VALUE`` words, and the same for estimators and scenarios.
    """

    scenarios: tuple[str, ...]
    sensors: tuple[str, ...]
    estimators: tuple[str, ...]
    seeds: int
    updates: int
    first_seed: int = 0
    settings: tuple[str, ...] = ()

    @property
    def command(self) -> str:
        """The command line that runs just this."""
        words = ["topoloc", "bench"]
        for name in ("scenarios", "sensors", "estimators"):
            words += [f"--{name}", *getattr(self, name)]
        words += ["--seeds", str(self.seeds), "--updates", str(self.updates)]
        words += ["--first-seed", str(self.first_seed)] * (self.first_seed > 0)
        words += ["--set", *self.settings] * bool(self.settings)
        return shlex.join(words)

    def tables(self) -> Mapping[str, Mapping[str, Any]]:
        """The settings as a table each for scenarios, sensors and estimators, by name.

        Raises:
            UserError: a word that is none, or names what is not run.
        """
        tables = parse_words(self.settings)
        refuse_unknown(tables, set(TABLES), "--set")
        for what in TABLES:
            refuse_unknown(tables.get(what, {}), set(getattr(self, what)), f"--set {what}")
        return {what: tables.get(what, {}) for what in TABLES}


def choose(
    scenarios: Sequence[str] | None,
    sensors: Sequence[str] | None,
    estimators: Sequence[str] | None,
    seeds: int,
    updates: int,
    first_seed: int = 0,
    settings: Sequence[str] = (),
) -> Choice:
    """What to run, names checked; None for all that can be: scenarios the default ones, sensors those they can feed.

    Raises:
        UserError: a name or a setting that nothing has.
    """
    chosen = tuple(dict.fromkeys(map(_findable, scenarios or DEFAULT)))
    made = [make_scenario(name, updates) for name in chosen]
    _refuse_namesakes(made)
    choice = Choice(
        scenarios=chosen,
        sensors=tuple(dict.fromkeys(map(known_sensor, sensors))) if sensors else sensors_for(made),
        estimators=_known("estimator", estimators, names(ESTIMATORS)),
        seeds=seeds,
        updates=updates,
        first_seed=first_seed,
        settings=tuple(settings),
    )
    suite_of(choice)
    return choice


def sensors_for(scenarios: Sequence[Scenario]) -> tuple[str, ...]:
    """All sensors that one of the scenarios has the images for, the drawn one first; says which are left out."""
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
        print(f"left out, since no scenario here has what they need: {', '.join(left)}", file=sys.stderr)
    return tuple(chosen)


def _findable(scenario: str) -> str:
    """A name as it is; a folder so that it is found from wherever the run is resumed."""
    return scenario if scenario in scenario_names() or not Path(scenario).is_dir() else str(Path(scenario).resolve())


def _refuse_namesakes(scenarios: Sequence[Scenario]) -> None:
    """Raise ``UserError`` for two of one name, whose rows could not be told apart."""
    for scenario in scenarios:
        own = scenario_names() if scenario.recorded else ()
        if scenario.name in own or sum(other.name == scenario.name for other in scenarios) > 1:
            raise UserError(f"two scenarios are called {scenario.name!r}; give the folder another name")


def _known(what: str, wanted: Sequence[str] | None, known: Sequence[str]) -> tuple[str, ...]:
    """The wanted names, each once; all known ones where none are named."""
    for name in wanted or ():
        if name not in known:
            raise UnknownName(what, name, sorted(known))
    return tuple(dict.fromkeys(wanted or known))


def suite_of(choice: Choice) -> Suite:
    """A choice made ready to run; its settings are checked here, whatever needs a missing package later.

    Raises:
        UserError: a setting that nothing has, or a value that it refuses.
    """
    tables = choice.tables()
    for name, table in tables["sensors"].items():
        make_sensor(name, table)
    for name, table in tables["estimators"].items():
        make_estimator(name, table)
    return Suite(
        scenarios=tuple(
            make_scenario(name, choice.updates, tables["scenarios"].get(name)) for name in choice.scenarios
        ),
        sensors={name: partial(make_sensor, name, tables["sensors"].get(name)) for name in choice.sensors},
        estimators={name: partial(make_estimator, name, tables["estimators"].get(name)) for name in choice.estimators},
        seeds=tuple(range(choice.first_seed, choice.first_seed + choice.seeds)),
    )


def read_choice(folder: Path) -> Choice:
    """What the run in a folder was started with. Raises ``InputError`` where it is no run's folder."""
    path = folder / "config.toml"
    run = read_toml(path, REMEDY).get("run", {})
    return build(Choice, {name: run[name] for name in Choice.__dataclass_fields__ if name in run}, path)


def config_of(choice: Choice, suite: Suite) -> dict[str, Any]:
    """The resolved settings, the versions and the machine: what somebody needs who repeats the run."""
    config = {
        "run": {
            "command": choice.command,
            "started": f"{datetime.now():%Y-%m-%d %H:%M:%S}",
            "rows": len(suite.keys()),
            **asdict(choice),
        },
        "versions": {"python": platform.python_version(), **dict(_versions())},
        "machine": _machine(),
        "scenarios": {s.name: {"description": s.description, **s.settings} for s in suite.scenarios},
        "sensors": {name: _resolved(sensor_settings, name, choice) for name in suite.sensors},
        "estimators": {name: _resolved(_estimator_settings, name, choice) for name in suite.estimators},
    }
    return dict(_plain(config))


def refuse_other_settings(folder: Path, choice: Choice) -> None:
    """Rows of two versions or settings in one table could not be told apart. Raises ``InputError``."""
    path = folder / "config.toml"
    then, now = read_toml(path, REMEDY), config_of(choice, suite_of(choice))
    if then.get("versions", {}).get("topoloc") != now["versions"]["topoloc"]:
        raise InputError(path, "the run was begun with another version of topoloc", "start a new run")
    for section in TABLES:
        if then.get(section) != now[section]:
            raise InputError(path, f"[{section}] has other settings than today's defaults", "start a new run")


def _machine() -> dict[str, Any]:
    """What times and memory are told of."""
    processor = platform.processor() or platform.machine()
    with suppress(OSError, IndexError):  # Linux does not tell otherwise
        found = re.findall(r"^model name\s*: (.*)$", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
        processor = found[0]
    machine: dict[str, Any] = {"system": platform.system(), "processor": processor, "cores": os.cpu_count()}
    with suppress(AttributeError, ValueError, OSError):  # elsewhere than on Linux and macOS
        machine["memory_gb"] = round(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9, 1)
    return machine


def _versions() -> Iterator[tuple[str, str]]:
    from importlib.metadata import PackageNotFoundError, version

    for package in PACKAGES:
        with suppress(PackageNotFoundError):  # another build of OpenCV, say
            yield package, version(package)


def _estimator_settings(name: str) -> Mapping[str, Any]:
    return options(load(ESTIMATORS, name))


def _resolved(defaults_of: Callable[[str], Mapping[str, Any]], name: str, choice: Choice) -> dict[str, Any]:
    """Default settings and, in their place, those of the choice."""
    what = "estimators" if defaults_of is _estimator_settings else "sensors"
    try:
        return _merged(_plain(defaults_of(name)), choice.tables()[what].get(name, {}))
    except UserError:  # a package is missing: its rows will say so
        return {}


def _merged(table: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """A table with changes in it, tables in tables likewise; words become what they replace: numbers, truth values."""
    merged = dict(table)
    for key, value in changes.items():
        old = merged.get(key)
        if isinstance(old, Mapping):
            merged[key] = _merged(old, value)
        elif isinstance(old, bool):
            merged[key] = str(value).lower() == "true"
        else:
            merged[key] = type(old)(value) if isinstance(old, int | float) else value
    return merged


def _plain(value: Any) -> Any:
    """A value as TOML can hold it: what is None is left out."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value if isinstance(value, bool | int | float | str) else str(value)
