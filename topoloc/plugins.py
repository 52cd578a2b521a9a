"""Names -> classes, by entry points, loaded only when asked for: ours and outsiders' in the same way."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import MISSING, fields
from importlib.metadata import EntryPoint, entry_points
from typing import Any

from topoloc.errors import UnknownName, UserError, one_line
from topoloc.interfaces import Estimator, Sensor
from topoloc.sensor_names import SensorName, parse
from topoloc.settings import Setting, build, explained, refuse_unknown

SENSORS, ESTIMATORS, FUSIONS = "topoloc.sensors", "topoloc.estimators", "topoloc.fusions"
WORLDS, PANORAMAS, COMMANDS = "topoloc.worlds", "topoloc.panoramas", "topoloc.commands"
EXPERIMENTS, UNWRAPPERS, UPKEEPS = "topoloc.experiments", "topoloc.unwrappers", "topoloc.upkeeps"
SCENARIOS = "topoloc.scenarios"


def names(group: str) -> list[str]:
    """Names that are installed in a group, sorted."""
    return sorted({point.name for point in entry_points(group=group)})


def load(group: str, name: str) -> Any:
    """The object of that name.

    Raises:
        UnknownName: nothing in the group is called so; the message lists what is.
        UserError: it needs a library that is not installed.
    """
    what = _kind(group)
    found: dict[str, EntryPoint] = {point.name: point for point in entry_points(group=group)}
    if name not in found:
        raise UnknownName(what, name, sorted(found))
    try:
        return found[name].load()
    except ModuleNotFoundError as error:
        raise UserError(f"the {what} {name!r} needs the package {error.name!r}; install it with pip") from error
    except Exception as error:
        raise UserError(f"the {what} {name!r} cannot be loaded ({one_line(error)}); mend its package") from error


def _kind(group: str) -> str:
    """What a thing of a group is called."""
    return group.rpartition(".")[2].removesuffix("s")


def make(group: str, name: str, settings: Mapping[str, Any] | None = None, *given: Any) -> Any:
    """An instance of the class of that name.

    Args:
        group: of entry points.
        name: of the class.
        settings: go into its ``Config`` dataclass, unknown ones refused; a class without one takes none.
        given: goes before the config, for a class that takes more than settings.

    Raises:
        UserError: settings that are unknown, or that the dataclass or the class refuses.
    """
    cls = load(group, name)
    where = f"settings of {name}"
    if not hasattr(cls, "Config"):
        refuse_unknown(settings or {}, set(), where)
        return cls(*given)
    config = build(cls.Config, settings or {}, where)
    try:
        return cls(*given, config)
    except ValueError as error:
        raise UserError(f"{where}: {error}; correct the value") from None


def make_sensor(name: str, settings: Mapping[str, Any] | None = None) -> Sensor:
    """A sensor model by name; see ``topoloc list`` for the names, and ``topoloc.sensor_names`` for several as one.

    Args:
        name: of a sensor, or of a fusion of several: ``ima+histogram``, ``mix(pca,disparity)``.
        settings: of the sensor; for a fusion its own, and tables by name of what is fused at any depth.

    Raises:
        UserError: a name or a setting that nothing has.
    """
    found, settings = parse(known_sensor(name)), settings or {}
    if not found.parts:
        sensor: Sensor = make(SENSORS, found.name, settings)
        return sensor
    refuse_unknown(settings, set(sensor_settings(name)), f"settings of {found}")
    inner = {part.name for part in found.inner()}
    return _fused(found, {key: value for key, value in settings.items() if key not in inner}, settings)


def _fused(name: SensorName, own: Mapping[str, Any], tables: Mapping[str, Any]) -> Sensor:
    """A fusion with settings of its own; what is fused finds its own in tables."""
    parts = []
    for part in name.parts:
        theirs = tables.get(part.name, {})
        parts.append(_fused(part, theirs, tables) if part.parts else make(SENSORS, part.name, theirs))
    fusion: Sensor = make(FUSIONS, name.name, own, parts)
    return fusion


def sensor_settings(name: str) -> dict[str, Any]:
    """Each setting that ``make_sensor`` takes for a name, with its default; those of what is fused in tables by name.

    Raises:
        UserError: a name that nothing has, or that needs a library that is not installed.
    """
    found = parse(known_sensor(name))
    return {**_options_of(found), **{part.name: _options_of(part) for part in found.inner()}}


def _options_of(name: SensorName) -> dict[str, Any]:
    return options(load(FUSIONS if name.parts else SENSORS, name.name))


def known_sensor(name: str) -> str:
    """The name of a sensor, or of a fusion, as it is spelled shortest; nothing is loaded.

    Raises:
        UserError: it is not well formed, or names what is not installed.
    """
    found = parse(name)
    for one in (found, *found.inner()):
        group = FUSIONS if one.parts else SENSORS
        if one.name in names(group):
            continue
        if not one.parts and one.name in names(FUSIONS):
            raise UserError(f"{one} fuses sensors, and none is named; write {one}(ima,histogram), say")
        raise UnknownName(_kind(group), one.name, names(group))
    return str(found)


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
