"""Names of sensors that look together, and the sensors that are made of them."""

from __future__ import annotations

from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc import plugins
from topoloc.errors import UnknownName, UserError
from topoloc.sensor_names import SensorName, parse

LEAF = st.sampled_from(["ima", "ima-robust", "histogram", "my_sensor.2"]).map(SensorName)


def named(name: str, *parts: str | SensorName) -> SensorName:
    return SensorName(name, tuple(SensorName(part) if isinstance(part, str) else part for part in parts))


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("ima", named("ima")),
        ("a+b", named("product", "a", "b")),
        (" a + b+ c ", named("product", "a", "b", "c")),
        ("product(a,b)", named("product", "a", "b")),
        ("a+(b+c)", named("product", "a", "b", "c")),
        ("((a))", named("a")),
        ("mix(a,b)", named("mix", "a", "b")),
        ("mix( a , b+c )", named("mix", "a", named("product", "b", "c"))),
        ("mix(a,b)+c", named("product", named("mix", "a", "b"), "c")),
        ("mix(a,mix(b,c))", named("mix", "a", named("mix", "b", "c"))),
        ("mix+a", named("product", "mix", "a")),
    ],
)
def test_names_are_read(text: str, expected: SensorName) -> None:
    assert parse(text) == expected
    assert parse(str(expected)) == expected


@settings(max_examples=100, deadline=None)
@given(
    st.recursive(
        LEAF,
        lambda inner: st.tuples(st.sampled_from(["{}+{}", "mix({},{})", "({}+{})", "vote({},{})"]), inner, inner).map(
            lambda drawn: parse(drawn[0].format(drawn[1], drawn[2]))
        ),
        max_leaves=8,
    )
)
def test_what_is_spelled_is_read_back(name: SensorName) -> None:
    assert parse(str(name)) == name
    assert str(parse(str(name))) == str(name)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("", "a name is missing at its end"),
        ("ima+", "a name is missing at its end"),
        ("ima++pca", "a name is missing at character 5"),
        ("+ima", "a name is missing at character 1"),
        ("mix(ima,)", "a name is missing at character 9"),
        ("mix(ima,pca", "',' or ')' is missing at its end"),
        ("mix(ima pca)", "',' or ')' is missing at character 9"),
        ("ima)", "')' does not belong at character 4"),
        ("ima pca", "'pca' does not belong at character 5"),
        ("ima,pca", "',' does not belong at character 4"),
        ("mix(ima)", "mix is given one sensor, and takes two or more, at character 4"),
        ("(ima,pca)", "the name of a fusion is missing at character 1"),
        ("(" * 3000 + "ima", "brackets are open at character 21"),
    ],
)
def test_a_mistake_is_told_in_one_line_with_its_place(text: str, problem: str) -> None:
    with pytest.raises(UserError) as caught:
        parse(text)
    message = str(caught.value)
    assert problem in message
    assert "write ima, ima+histogram or mix(ima,histogram)" in message
    assert "\n" not in message


class TestMaking:
    def test_a_single_name_is_made_as_before(self) -> None:
        assert type(plugins.make_sensor("ima")) is plugins.load(plugins.SENSORS, "ima")
        with pytest.raises(UnknownName, match=r"no sensor is called 'imma'; choose from: .*ima"):
            plugins.make_sensor("imma")

    def test_settings_find_their_sensor(self) -> None:
        chosen: dict[str, Any] = {
            "weights": "0.7,0.3",
            "ima": {"slots": "5"},
            "histogram": {"bins": "12"},
            "product": {"most": "7"},
        }
        sensor: Any = plugins.make_sensor("mix(ima, histogram+ima)", chosen)
        assert type(sensor) is plugins.load(plugins.FUSIONS, "mix")
        assert sensor.config.weights == (0.7, 0.3)
        first, inner = sensor.parts
        assert type(inner) is plugins.load(plugins.FUSIONS, "product")
        assert inner.config.most == 7
        assert inner.parts[0].config.bins == 12
        assert (first.config.slots, inner.parts[1].config.slots) == (5, 5)
        assert plugins.make_sensor("ima+histogram", {"most": 9}).config.most == 9  # type: ignore[attr-defined]

    @pytest.mark.parametrize(
        ("name", "chosen", "problem"),
        [
            ("ima+histogram", {"slots": 3}, r"settings of ima\+histogram: .*'slots'.*histogram, ima, most, tolerance"),
            ("mix(ima,histogram)", {"pca": {}}, r"settings of mix\(ima,histogram\): .*'pca'"),
            ("ima+histogram", {"ima": {"slot": 3}}, "settings of ima: .*'slot'"),
            ("ima+histogram", {"ima": 3}, "settings of ima is 3; it is a table"),
            ("mix(ima,ima+histogram)", {"product": 3}, "settings of product is 3; it is a table"),
            ("mix(ima,histogram)", {"weights": "1,2,3"}, "settings of mix: weights has 3 values for 2 sensors"),
            ("mix(ima,histogram)", {"weights": "1,-2"}, "settings of mix: weights are 1.0, -2.0"),
            ("mix(ima,histogram)", {"weights": "a"}, "settings of mix: weights is 'a'; write a number"),
        ],
    )
    def test_settings_that_nothing_has_are_refused(self, name: str, chosen: dict[str, Any], problem: str) -> None:
        with pytest.raises(UserError, match=problem):
            plugins.make_sensor(name, chosen)

    @pytest.mark.parametrize(
        ("name", "problem"),
        [
            ("mix(ima,imma)", "no sensor is called 'imma'; choose from: .*histogram, ima"),
            ("blend(ima,histogram)", "no fusion is called 'blend'; choose from: mix, product"),
            ("ima(histogram,pca)", "no fusion is called 'ima'"),
            ("mix", "mix fuses sensors, and none is named"),
            ("ima+mix", "mix fuses sensors, and none is named"),
        ],
    )
    def test_unknown_names_are_refused(self, name: str, problem: str) -> None:
        for use in (plugins.make_sensor, plugins.known_sensor, plugins.sensor_settings):
            with pytest.raises(UserError, match=problem):
                use(name)

    def test_the_settings_of_a_name_are_those_that_it_takes(self) -> None:
        found = plugins.sensor_settings("mix(ima,histogram+ima-robust)")
        assert set(found) == {"weights", "ima", "histogram", "ima-robust", "product"}
        assert found["histogram"] == plugins.options(plugins.load(plugins.SENSORS, "histogram"))
        plugins.make_sensor("mix(ima,histogram+ima-robust)", found)
        assert plugins.sensor_settings("ima") == plugins.options(plugins.load(plugins.SENSORS, "ima"))
        assert plugins.known_sensor("mix( ima, histogram + pca)") == "mix(ima,histogram+pca)"
