"""Which settings are tried, and with which values: ours by name, and what the user names."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from topoloc import plugins
from topoloc.errors import UserError
from topoloc.sensor_names import parse
from topoloc.settings import Setting
from topoloc.tuning.choice import NOISES, ODOMETRY, Tunable

CANDIDATES: Mapping[str, Mapping[str, str]] = {
    "ima": {"slots": "5,6,10,12", "zoom": "1,1.05,1.2,1.3", "clahe": "true,false"},
    "ima-robust": {"slots": "5,6,10,12", "zoom": "1.1,1.2,1.4", "clahe": "true,false"},
    "activity": {"match_threshold": "0.35,0.4,0.45,0.55,0.6", "head_threshold": "0.5,0.55,0.65,0.7"},
    "activity-offset": {
        "match_threshold": "0.2,0.4,0.5",
        "head_threshold": "0.4,0.6",
        "sigma_m": "0.35,0.7",
        "outlier_floor": "0.01,0.1",
    },
    "particle": {"recovery": "0.005,0.01,0.05,0.1", "particles": "300,3000"},
    "grid": {"recovery": "0.005,0.01,0.05,0.1"},
}
"""Values that are tried beside the default, by sensor or estimator and its setting."""


def tunables_of(sensor: str, estimator: str, tries: Sequence[str] = (), with_odometry: bool = True) -> list[Tunable]:
    """The settings that are tried, the sensor's first.

    Args:
        sensor: its name, as ``topoloc.plugins`` takes it.
        estimator: alike.
        tries: ``sensor.slots=6,8,12`` words; where there are any, they take the place of ``CANDIDATES``.
        with_odometry: whether there is an odometer whose noise can be told; it is tried, too.

    Raises:
        UserError: a name that nothing has, a word that is no such list, or nothing to try.
    """
    known = {setting.name: setting for setting in _settings_of(sensor, estimator)}
    wanted = dict(_parsed(word) for word in tries) if tries else _ours(known, sensor, estimator)
    for key in wanted:
        if key not in known:
            names = ", ".join(known) or "none"
            raise UserError(f"--try: nothing is called {key!r} with {sensor} and {estimator}; use one of: {names}")
    found = [_tunable(known[key], words) for key, words in wanted.items()]
    found = sorted((one for one in found if one.others), key=lambda one: one.key.startswith("estimator."))
    if with_odometry:
        text = "noise of the odometer, from the truth of the other folds"
        found.append(Tunable(ODOMETRY, "default", tuple(NOISES)[1:], text))
    if not found:
        raise UserError(f"nothing to try for {sensor} and {estimator}: name settings, as in --try sensor.KEY=1,2,3")
    return found


def _settings_of(sensor: str, estimator: str) -> Iterator[Setting]:
    """The settings of both, by the names that ``topoloc localize --set`` has for them."""
    whole = parse(plugins.known_sensor(sensor))
    for name in (whole, *whole.inner()):
        thing = plugins.load(plugins.FUSIONS if name.parts else plugins.SENSORS, name.name)
        before = "sensor." if name is whole else f"sensor.{name.name}."
        yield from _prefixed(before, plugins.settings_of(thing))
    yield from _prefixed("estimator.", plugins.settings_of(plugins.load(plugins.ESTIMATORS, estimator)))


def _prefixed(before: str, settings: Sequence[Setting]) -> Iterator[Setting]:
    return (Setting(before + setting.name, setting.default, setting.text) for setting in settings)


def _ours(known: Mapping[str, Setting], sensor: str, estimator: str) -> dict[str, list[str]]:
    """What ``CANDIDATES`` has for a sensor, or for those in a fusion, and an estimator."""
    whole = parse(plugins.known_sensor(sensor))
    tables = [(f"sensor.{name.name}." if whole.parts else "sensor.", name.name) for name in (whole, *whole.inner())]
    tables.append(("estimator.", estimator))
    wanted = {
        f"{before}{key}": values.split(",")
        for before, name in tables
        for key, values in CANDIDATES.get(name, {}).items()
    }
    return {key: values for key, values in wanted.items() if key in known}


def _parsed(word: str) -> tuple[str, list[str]]:
    key, equals, values = word.partition("=")
    words = [value for value in values.split(",") if value]
    if not equals or not words:
        raise UserError(f"--try {word!r} names no values; write it as sensor.slots=6,8,12")
    return key, words


def _tunable(setting: Setting, words: Sequence[str]) -> Tunable:
    """The default among the words is left out, however it is written."""
    others = dict.fromkeys(word for word in words if _same(word) != _same(setting.default))
    return Tunable(setting.name, setting.default, tuple(others), setting.text)


def _same(word: str) -> str:
    """A word by which 1.10 is 1.1, and True true."""
    try:
        return f"{float(word):g}"
    except ValueError:
        return word.lower()
