"""Which values are tried: ours for ours, the user's for all, each mistake with its remedy."""

from __future__ import annotations

import pytest

from topoloc import plugins
from topoloc.errors import UserError
from topoloc.tuning.candidates import CANDIDATES, tunables_of
from topoloc.tuning.choice import Choice


@pytest.mark.parametrize("name", CANDIDATES)
def test_ours_are_settings_that_exist_and_can_be_had(name: str) -> None:
    """One by one; a value that goes with no default of another setting could never be tried first."""
    group = plugins.SENSORS if name in plugins.names(plugins.SENSORS) else plugins.ESTIMATORS
    known = {setting.name for setting in plugins.settings_of(plugins.load(group, name))}
    assert set(CANDIDATES[name]) <= known
    for key, values in CANDIDATES[name].items():
        had = 0
        for value in values.split(","):
            try:
                plugins.make(group, name, {key: value})
                had += 1
            except UserError:
                pass
        assert had >= 2, key


def test_of_ima_and_activity() -> None:
    tunables = tunables_of("ima", "activity")
    assert [one.key for one in tunables] == [
        *("sensor.slots", "sensor.zoom", "sensor.clahe"),
        *("estimator.match_threshold", "estimator.head_threshold", "odometry"),
    ]
    slots = tunables[0]
    assert slots.default == "8" and "8" not in slots.others and "CLAHE" in tunables[2].text


def test_the_users_take_the_place_of_ours() -> None:
    tunables = tunables_of("ima", "activity", ["estimator.match_power=1,2.0,3", "sensor.zoom=1.10,1.3"], False)
    assert [(one.key, one.default, one.others) for one in tunables] == [
        ("sensor.zoom", "1.1", ("1.3",)),
        ("estimator.match_power", "1", ("2.0", "3")),
    ]


def test_of_a_fusion_each_part_by_its_name() -> None:
    keys = [one.key for one in tunables_of("ima+histogram", "grid", with_odometry=False)]
    assert keys == ["sensor.ima.slots", "sensor.ima.zoom", "sensor.ima.clahe", "estimator.recovery"]
    words = Choice().changed(tunables_of("ima+histogram", "grid")[0], "6", {"default": Choice().noise})
    assert words.table("sensor") == {"ima": {"slots": "6"}}


@pytest.mark.parametrize(
    ("tries", "says"),
    [
        (["sensor.slot=1,2"], r"nothing is called 'sensor.slot' .* sensor.slots"),
        (["slots=1,2"], r"nothing is called 'slots'"),
        (["sensor.slots"], r"names no values; write it as sensor.slots=6,8,12"),
        (["sensor.slots="], r"names no values"),
    ],
)
def test_mistakes(tries: list[str], says: str) -> None:
    with pytest.raises(UserError, match=says):
        tunables_of("ima", "activity", tries)


def test_nothing_to_try() -> None:
    with pytest.raises(UserError, match=r"nothing to try for histogram and best-match: name settings"):
        tunables_of("histogram", "best-match", with_odometry=False)
