from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from topoloc.errors import InputError, UserError
from topoloc.settings import build, parse_words, read_toml


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
            ("inner.depth=2", {"inner": Inner(2.0)}),
            ("inner.deep=true", {"inner": Inner(deep=True)}),
        ],
    )
    def test_words_of_the_command_line(self, word: str, expected: dict[str, Any]) -> None:
        assert build(Outer, parse_words([word]), "here") == Outer(**expected)

    @pytest.mark.parametrize(
        ("table", "says"),
        [
            ({"cuont": 1}, ["here", "'cuont'", "count, inner, marks, name, on, ratio"]),
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
            ("inner", 3),
            ("inner", "deep"),
        ],
    )
    def test_a_value_that_does_not_suit_its_field(self, key: str, value: Any) -> None:
        with pytest.raises(UserError, match=rf"^here: {key} is .*; \w+"):
            build(Outer, {key: value}, "here")

    def test_a_value_that_the_class_refuses(self) -> None:
        with pytest.raises(UserError, match="here: count is -1; it must not be negative; correct the value"):
            build(Outer, {"count": -1}, "here")


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
