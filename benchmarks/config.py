"""``config.toml``: what a benchmark ran with, as resolved, and on which machine."""

from __future__ import annotations

import os
import platform
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, is_dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from benchmarks.choice import REMEDY, TABLES, Choice, suite_of
from benchmarks.runner import Suite
from topoloc.errors import InputError, UserError
from topoloc.plugins import ESTIMATORS, load, options, sensor_settings
from topoloc.settings import read_toml

PACKAGES = ("topoloc", "numpy", "scipy", "opencv-python-headless", "scikit-learn", "joblib")


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
        else:
            merged[key] = _like(old, value)
    return merged


def _like(old: Any, value: Any) -> Any:
    """A value as what it replaces is written down: a word may stand for a number, a truth value or a list."""
    if isinstance(old, bool):
        return str(value).lower() == "true"
    if isinstance(old, int | float):
        return type(old)(float(value))
    if isinstance(old, list) and isinstance(value, str):
        return [_number(word) for word in value.split(",") if word not in ("", "none")]
    return value


def _number(word: str) -> Any:
    with suppress(ValueError):
        return float(word)
    return word


def _plain(value: Any) -> Any:
    """A value as TOML can hold it: what is None is left out."""
    if is_dataclass(value) and not isinstance(value, type):
        value = asdict(value)
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    return value if isinstance(value, bool | int | float | str) else str(value)
