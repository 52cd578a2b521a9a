"""Names -> classes, by entry points, loaded only when asked for: ours and outsiders' in the same way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from topoloc.errors import UnknownName, UserError
from topoloc.interfaces import Estimator, Sensor
from topoloc.settings import Setting, build, explained, refuse_unknown

SENSORS, ESTIMATORS = "topoloc.sensors", "topoloc.estimators"
WORLDS, PANORAMAS, COMMANDS = "topoloc.worlds", "topoloc.panoramas", "topoloc.commands"
EXPERIMENTS, UNWRAPPERS, UPKEEPS = "topoloc.experiments", "topoloc.unwrappers", "topoloc.upkeeps"


def names(group: str) -> list[str]:
    """Names that are installed in a group, sorted."""
    return sorted({point.name for point in entry_points(group=group)})


def load(group: str, name: str) -> Any:
    """The object of that name.

    Raises:
        UnknownName: nothing in the group is called so; the message lists what is.
        UserError: it needs a library that is not installed.
    """
    what = group.rpartition(".")[2].removesuffix("s")
    found: dict[str, EntryPoint] = {point.name: point for point in entry_points(group=group)}
    if name not in found:
        raise UnknownName(what, name, sorted(found))
    try:
        return found[name].load()
    except ModuleNotFoundError as error:
        raise UserError(f"the {what} {name!r} needs the package {error.name!r}; install it with pip") from error


def make(group: str, name: str, settings: Mapping[str, Any] | None = None) -> Any:
    """An instance of the class of that name.

    Args:
        group: of entry points.
        name: of the class.
        settings: go into its ``Config`` dataclass, unknown ones refused; a class without one takes none.

    Raises:
        UserError: settings that are unknown, or that the dataclass or the class refuses.
    """
    cls = load(group, name)
    where = f"settings of {name}"
    if not hasattr(cls, "Config"):
        refuse_unknown(settings or {}, set(), where)
        return cls()
    config = build(cls.Config, settings or {}, where)
    try:
        return cls(config)
    except ValueError as error:
        raise UserError(f"{where}: {error}; correct the value") from None


def make_sensor(name: str, settings: Mapping[str, Any] | None = None) -> Sensor:
    """A sensor model by name; see ``topoloc list`` for the names."""
    sensor: Sensor = make(SENSORS, name, settings)
    return sensor


def make_estimator(name: str, settings: Mapping[str, Any] | None = None) -> Estimator:
    """An estimator by name; see ``topoloc list`` for the names."""
    estimator: Estimator = make(ESTIMATORS, name, settings)
    return estimator


def options(thing: Any) -> dict[str, Any]:
    """Name and default of each setting of a class that has a ``Config``."""
    config = getattr(thing, "Config", None)
    if config is None:
        return {}
    defaults = {}
    for item in fields(config):
        defaults[item.name] = item.default_factory() if item.default_factory is not MISSING else item.default
    return defaults


def settings_of(thing: Any) -> list[Setting]:
    """Each setting of a class as ``options`` finds them, with what it is; those of nested tables by dotted names."""
    return list(explained(thing.Config, options(thing))) if options(thing) else []
