from __future__ import annotations

import pickle
from dataclasses import is_dataclass
from importlib.metadata import EntryPoint, entry_points
from pathlib import Path

import pytest

from topoloc import plugins
from topoloc.cli.main import run
from topoloc.errors import InputError, OutputExists, UnknownName, UserError

GROUPS = (plugins.SENSORS, plugins.ESTIMATORS, plugins.WORLDS, plugins.PANORAMAS, plugins.COMMANDS)
REGISTERED = [(group, name) for group in GROUPS for name in plugins.names(group)]


def test_ours_are_registered() -> None:
    assert {"ima", "histogram"} <= set(plugins.names(plugins.SENSORS))
    assert {"activity", "grid", "particle", "best-match", "dead-reckoning"} <= set(plugins.names(plugins.ESTIMATORS))
    assert {"bench", "check", "list", "localize", "panorama", "simulate"} <= set(plugins.names(plugins.COMMANDS))
    assert "lab" in plugins.names(plugins.WORLDS) and "thesis" in plugins.names(plugins.PANORAMAS)


@pytest.mark.parametrize(("group", "name"), REGISTERED)
def test_every_registered_name_loads_and_says_what_it_is(group: str, name: str) -> None:
    thing = plugins.load(group, name)
    assert (thing.__doc__ or "").strip()
    if group != plugins.COMMANDS:
        assert is_dataclass(thing.Config)
        assert type(plugins.make(group, name)) is thing
        assert set(plugins.options(thing)) == set(thing.Config.__dataclass_fields__)


@pytest.mark.parametrize(("group", "name"), [(group, name) for group, name in REGISTERED if group != plugins.COMMANDS])
def test_every_setting_says_what_it_is(group: str, name: str) -> None:
    thing = plugins.load(group, name)
    settings = plugins.settings_of(thing)
    assert {setting.name.partition(".")[0] for setting in settings} == set(plugins.options(thing))
    assert [setting.name for setting in settings if not setting.text] == []


@pytest.mark.parametrize("group", GROUPS)
def test_an_unknown_name_lists_the_known_ones(group: str) -> None:
    with pytest.raises(UnknownName) as caught:
        plugins.load(group, "imma")
    message = str(caught.value)
    assert group.removeprefix("topoloc.").removesuffix("s") in message and "'imma'" in message
    assert all(name in message for name in plugins.names(group))


def test_settings_go_into_the_config() -> None:
    assert plugins.make_sensor("ima", {"slots": "4"}).config.slots == 4  # type: ignore[attr-defined]
    with pytest.raises(UserError, match=r"settings of ima: .*'slot'.*slots"):
        plugins.make_sensor("ima", {"slot": 4})
    with pytest.raises(UserError, match=r"settings of ima: slots is 0"):
        plugins.make_sensor("ima", {"slots": 0})
    assert hasattr(type(plugins.make_estimator("grid")), "belief")


def test_options_of_a_class_without_settings() -> None:
    assert plugins.options(object) == {}
    assert plugins.settings_of(object) == []


class TestOutsiders:
    @staticmethod
    def install(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
        point = EntryPoint("mine", value, plugins.SENSORS)
        monkeypatch.setattr(plugins, "entry_points", lambda group: [point])

    def test_a_class_of_somebody_elses(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.install(monkeypatch, "fractions:Fraction")
        assert plugins.names(plugins.SENSORS) == ["mine"]
        assert plugins.load(plugins.SENSORS, "mine").__name__ == "Fraction"

    def test_a_module_that_fails_when_it_is_loaded_is_the_users_mistake(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        (tmp_path / "spoilt_sensor.py").write_text("raise ValueError('at import')\n")
        monkeypatch.syspath_prepend(tmp_path)
        self.install(monkeypatch, "spoilt_sensor:Sensor")
        with pytest.raises(UserError, match=r"sensor 'mine' cannot be loaded \(ValueError: at import\)"):
            plugins.load(plugins.SENSORS, "mine")

    def test_a_missing_library_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.install(monkeypatch, "a_package_that_nobody_has:Thing")
        with pytest.raises(UserError, match=r"sensor 'mine' needs the package 'a_package_that_nobody_has'; install"):
            plugins.load(plugins.SENSORS, "mine")

    def test_nothing_installed(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(plugins, "entry_points", lambda group: [])
        with pytest.raises(UnknownName, match="none is installed"):
            plugins.load(plugins.SENSORS, "ima")

    def test_a_class_without_settings_takes_none(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(plugins, "load", lambda group, name: dict)
        assert plugins.make(plugins.SENSORS, "mine") == {}
        with pytest.raises(UserError, match=r"settings of mine: nothing is called 'slots' here"):
            plugins.make(plugins.SENSORS, "mine", {"slots": 3})

    def test_a_broken_command_does_not_take_the_others_with_it(
        self, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        known = entry_points(group=plugins.COMMANDS)
        broken = EntryPoint("broken", "a_package_that_nobody_has:thing", plugins.COMMANDS)
        monkeypatch.setattr(plugins, "entry_points", lambda group: [*known, broken])
        assert run(["--version"]) == 0
        captured = capsys.readouterr()
        assert "'broken' is left out" in captured.err
        assert captured.out.strip()


@pytest.mark.parametrize(
    "error",
    [
        UnknownName("sensor", "nosuch", ["ima"]),
        InputError("map.toml", "has no name", "give it one", 3),
        OutputExists("run"),
        UserError("a slip"),
    ],
)
def test_a_mistake_comes_back_whole_from_another_process(error: UserError) -> None:
    back = pickle.loads(pickle.dumps(error))
    assert type(back) is type(error)
    assert (str(back), vars(back)) == (str(error), vars(error))
