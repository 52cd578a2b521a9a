"""What a benchmark runs: chosen by name, written to ``config.toml``, read back to resume, to explain, to compare."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from benchmarks.runner import Suite
from benchmarks.scenarios import DEFAULT, Scenario, make_scenario, scenario_names
from topoloc.errors import InputError, UnknownName, UserError
from topoloc.plugins import ESTIMATORS, SENSORS, known_sensor, load, make_estimator, make_sensor, names
from topoloc.settings import build, parse_words, read_toml, refuse_unknown

DRAWN_SENSOR = "ima"
"""By default this sensor comes first, and so it is the one whose drives the report draws: the thesis's."""
SLOWEST_SENSORS = ("ima-robust", "local")
"""They come next, so that no process is left alone with one of them at the end."""
REMEDY = "name the folder of a benchmark run"
TABLES = ("scenarios", "sensors", "estimators")


@dataclass(frozen=True)
class Choice:
    """What a benchmark runs, as ``config.toml`` has it and ``--resume`` reads it back.

    Attributes:
        scenarios, sensors, estimators: their names; a scenario may be a folder.
        seeds: how many, 1 at least.
        updates: frames of a simulated drive, 1 at least.
        first_seed: the first of the seeds.
        settings: ``sensors.NAME.KEY=VALUE`` words, and the same for estimators and scenarios.
    """

    scenarios: tuple[str, ...]
    sensors: tuple[str, ...]
    estimators: tuple[str, ...]
    seeds: int
    updates: int
    first_seed: int = 0
    settings: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("seeds", "updates"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be a whole number from 1 on")
        if self.first_seed < 0:
            raise ValueError(f"first_seed is {self.first_seed}; it must be a whole number from 0 on")

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
        known = {"scenarios": {Path(name).name for name in self.scenarios}, "sensors": set(self.sensors)}
        for what in TABLES:
            refuse_unknown(tables.get(what, {}), known.get(what, set(self.estimators)), f"--set {what}")
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
    known_estimators = _known("estimator", estimators, names(ESTIMATORS))
    chosen = tuple(dict.fromkeys(map(_findable, scenarios or DEFAULT)))
    made = [make_scenario(name, updates) for name in chosen]
    _refuse_namesakes(made)
    choice = Choice(
        scenarios=chosen,
        sensors=tuple(dict.fromkeys(map(known_sensor, sensors))) if sensors else sensors_for(made),
        estimators=known_estimators,
        seeds=seeds,
        updates=updates,
        first_seed=first_seed,
        settings=tuple(settings),
    )
    suite_of(choice)
    return choice


def sensors_for(scenarios: Sequence[Scenario]) -> tuple[str, ...]:
    """All sensors that one of the scenarios has the images for, the drawn one first, then the slowest."""
    known = sorted(names(SENSORS), key=lambda name: (name != DRAWN_SENSOR, name not in SLOWEST_SENSORS, name))
    return tuple(name for name in known if any(_needs(name) <= scenario.kinds for scenario in scenarios))


def left_out(choice: Choice) -> str:
    """Which sensors are not run, and the images that they need; empty where all are."""
    left = [name for name in names(SENSORS) if name not in choice.sensors]
    return ", ".join(f"{name} ({', '.join(sorted(_needs(name)))} images)" for name in left)


def _needs(sensor: str) -> frozenset[str]:
    try:
        return frozenset(load(SENSORS, sensor).needs)
    except (UserError, AttributeError, TypeError):  # it cannot be loaded, or what it needs depends on its settings
        return frozenset()


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
            make_scenario(name, choice.updates, tables["scenarios"].get(Path(name).name)) for name in choice.scenarios
        ),
        sensors={name: partial(make_sensor, name, tables["sensors"].get(name)) for name in choice.sensors},
        estimators={name: partial(make_estimator, name, tables["estimators"].get(name)) for name in choice.estimators},
        seeds=tuple(range(choice.first_seed, choice.first_seed + choice.seeds)),
    )


def read_choice(folder: Path) -> Choice:
    """What the run in a folder was started with. Raises ``InputError`` where it is no run's folder."""
    path = folder / "config.toml"
    run = read_toml(path, REMEDY).get("run", {})
    lacking = [name for name in ("scenarios", "sensors", "estimators", "seeds", "updates") if name not in run]
    if lacking:
        raise InputError(path, f"[run] has no {lacking[0]}", REMEDY)
    return build(Choice, {name: run[name] for name in Choice.__dataclass_fields__ if name in run}, path)
