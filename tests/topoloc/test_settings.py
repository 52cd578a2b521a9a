from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Literal

import pytest

from topoloc.errors import InputError, UserError
from topoloc.settings import Setting, build, described, explained, optional_length, parse_words, read_toml


@dataclass(frozen=True)
class Inner:
    depth: float = 1.0
    deep: bool = False


@dataclass(frozen=True)
class Outer:
    count: int = 3
    ratio: float = 0.5
    on: bool = True
    name: str = "x"
    marks: tuple[int, ...] = ()
    inner: Inner = field(default_factory=Inner)
    spans: tuple[float, ...] = (0.5, 2.0)
    mode: Literal["fast", "fine"] = "fast"
    modes: tuple[Literal["a", "b"], ...] = ()

    def __post_init__(self) -> None:
        if self.count < 0:
            raise ValueError(f"count is {self.count}; it must not be negative")


class TestBuild:
    def test_an_empty_table_gives_the_defaults(self) -> None:
        assert build(Outer, {}, "here") == Outer()

    def test_values_of_their_own_type(self) -> None:
        table = {"count": 4, "ratio": 2, "on": False, "name": "y", "marks": [1, 2], "inner": {"depth": 3}}
        made = build(Outer, table, "here")
        assert made == Outer(4, 2.0, False, "y", (1, 2), Inner(3.0))
        assert isinstance(made.ratio, float)

    @pytest.mark.parametrize(
        ("word", "expected"),
        [
            ("count=7", {"count": 7}),
            ("count=7.0", {"count": 7}),
            ("ratio=1e-3", {"ratio": 0.001}),
            ("ratio=-2", {"ratio": -2.0}),
            ("on=false", {"on": False}),
            ("on=True", {"on": True}),
            ("name=a=b", {"name": "a=b"}),
            ("marks=3,1", {"marks": (3, 1)}),
            ("marks=5", {"marks": (5,)}),
            ("marks=", {"marks": ()}),
            ("spans=1,2.5", {"spans": (1.0, 2.5)}),
            ("mode=fine", {"mode": "fine"}),
            ("modes=b,a", {"modes": ("b", "a")}),
            ("inner.depth=2", {"inner": Inner(2.0)}),
            ("inner.deep=true", {"inner": Inner(deep=True)}),
        ],
    )
    def test_words_of_the_command_line(self, word: str, expected: dict[str, Any]) -> None:
        assert build(Outer, parse_words([word]), "here") == Outer(**expected)

    @pytest.mark.parametrize(
        ("table", "says"),
        [
            ({"cuont": 1}, ["here", "'cuont'", "count, inner, marks, mode, modes, name, on, ratio, spans"]),
            ({"inner": {"deph": 1}}, ["here: inner", "'deph'", "deep, depth"]),
        ],
    )
    def test_an_unknown_key_is_refused_by_name_with_the_known_ones(
        self, table: dict[str, Any], says: list[str]
    ) -> None:
        with pytest.raises(UserError) as caught:
            build(Outer, table, "here")
        assert all(words in str(caught.value) for words in says)

    @pytest.mark.parametrize(
        ("key", "value"),
        [
            ("count", "many"),
            ("count", 1.5),
            ("count", "1.5"),
            ("count", True),
            ("count", None),
            ("count", [1]),
            ("count", float("nan")),
            pytest.param("count", 10**400, id="count-beyond floats"),
            ("ratio", "half"),
            ("ratio", float("inf")),
            ("ratio", "nan"),
            ("ratio", False),
            ("ratio", {}),
            ("ratio", ""),
            ("on", "yes"),
            ("on", 1),
            ("name", 5),
            ("marks", "1,x"),
            ("marks", [1.5]),
            ("marks", 3),
            ("spans", "1,x"),
            ("mode", "faste"),
            ("mode", 3),
            ("mode", ["fast"]),
            ("modes", "a,c"),
            ("inner", 3),
            ("inner", "deep"),
        ],
    )
    def test_a_value_that_does_not_suit_its_field(self, key: str, value: Any) -> None:
        with pytest.raises(UserError, match=rf"^here: {key} is .*; \w+"):
            build(Outer, {key: value}, "here")

    def test_a_choice_that_is_none_lists_the_choices(self) -> None:
        with pytest.raises(UserError, match=r"^here: mode is 'Fast'; choose from: fast, fine$"):
            build(Outer, {"mode": "Fast"}, "here")

    def test_a_value_that_the_class_refuses(self) -> None:
        with pytest.raises(UserError, match="here: count is -1; it must not be negative; correct the value"):
            build(Outer, {"count": -1}, "here")


class TestLength:
    def test_a_length_or_none(self) -> None:
        assert optional_length({"a": 1}, "a", "here") == 1.0
        assert optional_length({}, "a", "here") is None

    @pytest.mark.parametrize("value", [0, -1.0, "x", True, float("nan"), float("inf")])
    def test_what_is_none(self, value: object) -> None:
        with pytest.raises(UserError, match=r"^here: a is .*; write a "):
            optional_length({"a": value}, "a", "here")


@dataclass(frozen=True)
class Base:
    """Of every one.

    Attributes:
        size: of a side [m]; a text that
            goes on: here.
        low, high: ends of the range.
        mode: how.

    Raises:
        silent: not an attribute.
    """

    size: float = 1.0
    low: float = 0.0
    high: float = float("inf")
    mode: str = "x"
    silent: bool = False


@dataclass(frozen=True)
class Derived(Base):
    """Of one only.

    Attributes:
        mode: another how.
        inner: a table.
        marks: a list.
    """

    inner: Base = field(default_factory=Base)
    marks: tuple[float, ...] = (1.0, 0.25)
    none: tuple[int, ...] = ()


@dataclass(frozen=True)
class Untold(Derived):
    more: int = 3


class TestDescribed:
    def test_entries_of_the_docstring(self) -> None:
        assert described(Base) == {
            "size": "of a side [m]; a text that goes on: here.",
            "low": "ends of the range.",
            "high": "ends of the range.",
            "mode": "how.",
        }

    @pytest.mark.parametrize("cls", [Derived, Untold])
    def test_what_is_inherited_is_told_by_the_nearest_base_that_tells_it(self, cls: type) -> None:
        texts = described(cls)
        assert list(texts) == ["size", "low", "high", "mode", "inner", "marks"]
        assert (texts["size"], texts["mode"]) == (described(Base)["size"], "another how.")

    def test_explained_with_defaults_and_the_tables_within(self) -> None:
        defaults = {item: getattr(Derived(), item) for item in Derived.__dataclass_fields__}
        settings = {setting.name: setting for setting in explained(Derived, defaults)}
        assert settings["low"] == Setting("low", "0", "ends of the range.")
        assert settings["inner.mode"] == Setting("inner.mode", "x", "how.")
        assert "inner" not in settings and settings["none"].text == ""
        shown = {name: settings[name].default for name in ("high", "silent", "marks", "none", "inner.size")}
        assert shown == {"high": "infinite", "silent": "false", "marks": "1,0.25", "none": "none", "inner.size": "1"}


class TestWords:
    def test_several_words_fill_one_table(self) -> None:
        assert parse_words(["a=1", "b.c=2", "b.d=x"]) == {"a": "1", "b": {"c": "2", "d": "x"}}
        assert parse_words([]) == {}

    @pytest.mark.parametrize("words", [["a"], ["=1"], [""], ["a=1", "a.b=2"]])
    def test_words_that_are_no_settings(self, words: list[str]) -> None:
        with pytest.raises(UserError, match=r"key=value|give it once"):
            parse_words(words)

    def test_a_table_is_not_replaced_by_a_value(self) -> None:
        with pytest.raises(UserError, match=r"inner is '2'"):
            build(Outer, parse_words(["inner.depth=1", "inner=2"]), "here")


class TestToml:
    def test_reads(self, tmp_path: Path) -> None:
        (tmp_path / "a.toml").write_text('name = "ä"\n[inner]\ndepth = 1\n', encoding="utf-8")
        assert read_toml(tmp_path / "a.toml", "restore it") == {"name": "ä", "inner": {"depth": 1}}

    @pytest.mark.parametrize("text", ["a = 1\nb = = 2\n", "a = 1\na = 2\n"])
    def test_names_the_line_that_does_not_parse(self, text: str, tmp_path: Path) -> None:
        (tmp_path / "a.toml").write_text(text)
        with pytest.raises(InputError, match=r"a\.toml.*line 2.*; "):
            read_toml(tmp_path / "a.toml", "restore it")

    @pytest.mark.parametrize("data", [b"\xff\xfe\x00", b"a = 1" + b"0" * 5000], ids=["binary", "5001 digits"])
    def test_garbage(self, data: bytes, tmp_path: Path) -> None:
        (tmp_path / "a.toml").write_bytes(data)
        with pytest.raises(InputError, match=r"a\.toml"):
            read_toml(tmp_path / "a.toml", "restore it")

    def test_missing(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match=r"a\.toml: no such file; make one"):
            read_toml(tmp_path / "a.toml", "make one")
