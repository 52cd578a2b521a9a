"""Settings are frozen dataclasses: built from TOML tables and ``key=value`` words, explained from their docstrings."""

from __future__ import annotations

import inspect
import math
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from textwrap import dedent
from typing import Any, Literal, TypeVar, get_args, get_origin, get_type_hints

from topoloc.errors import InputError, UserError
from topoloc.files import read_text

T = TypeVar("T")


def read_toml(path: Path, remedy: str) -> dict[str, Any]:
    """The table of a TOML file. Raises ``InputError`` naming the line that does not parse."""
    text = read_text(path, remedy)
    try:
        return tomllib.loads(text)
    except ValueError as error:  # TOMLDecodeError is one, and so is what a number of 5000 digits raises
        raise InputError(path, f"is not valid TOML ({error})", "mend that line") from None


def refuse_unknown(table: Mapping[str, Any], known: set[str], where: Path | str) -> None:
    """Raise ``UserError`` for the first key that nobody reads, naming the keys that are read."""
    for key in table:
        if key not in known:
            names = ", ".join(sorted(known)) or "none"
            raise UserError(f"{where}: nothing is called {key!r} here; take it out, or use one of: {names}")


def build(cls: type[T], table: Mapping[str, Any], where: Path | str) -> T:
    """An instance of the frozen dataclass ``cls`` from a table; words are converted to the field's type.

    Raises:
        UserError: an unknown key, or a value that does not suit its field.
    """
    assert is_dataclass(cls)
    if not isinstance(table, Mapping):
        raise UserError(f"{where} is {table!r}; it is a table of settings: write its keys below it")
    hints = get_type_hints(cls)
    refuse_unknown(table, {item.name for item in fields(cls)}, where)
    values = {key: convert(value, hints[key], f"{where}: {key}") for key, value in table.items()}
    try:
        return cls(**values)
    except (TypeError, ValueError) as error:
        raise UserError(f"{where}: {error}; correct the value") from None


def convert(value: Any, kind: Any, where: str) -> Any:
    """A TOML value, or a word from the command line, as the type of its field."""
    if kind is bool:
        if isinstance(value, bool):
            return value
        if str(value).lower() in ("true", "false"):
            return str(value).lower() == "true"
        raise UserError(f"{where} is {value!r}; write true or false")
    if is_dataclass(kind) and isinstance(kind, type):
        return build(kind, value, where)
    if kind in (int, float):
        try:
            number = float(value)
        except (TypeError, ValueError, OverflowError):
            raise UserError(f"{where} is {value!r}; write a number") from None
        if isinstance(value, bool) or not math.isfinite(number) or (kind is int and number != int(number)):
            raise UserError(f"{where} is {value!r}; write {'a whole number' if kind is int else 'a number'}")
        return kind(number)
    if kind is str and not isinstance(value, str):
        raise UserError(f"{where} is {value!r}; write a text in quotes")
    if get_origin(kind) is Literal and value not in get_args(kind):
        raise UserError(f"{where} is {value!r}; choose from: {', '.join(map(str, get_args(kind)))}")
    if get_origin(kind) is tuple:
        items = [word for word in value.split(",") if word not in ("", "none")] if isinstance(value, str) else value
        if not isinstance(items, list | tuple):
            raise UserError(f"{where} is {value!r}; write a list")
        return tuple(convert(item, get_args(kind)[0], where) for item in items)
    return value


def optional_length(table: Mapping[str, Any], key: str, where: Path | str) -> float | None:
    """A length above 0 [m] from a table, or None where it has no such key."""
    if key not in table:
        return None
    length: float = convert(table[key], float, f"{where}: {key}")
    if length <= 0.0:
        raise UserError(f"{where}: {key} is {length:g}; write a length above 0, in metres")
    return length


def parse_words(words: Sequence[str]) -> dict[str, Any]:
    """``key=value`` words from the command line as a table; ``a.b=1`` goes into the table ``a``."""
    table: dict[str, Any] = {}
    for word in words:
        key, equals, value = word.partition("=")
        if not equals or not key:
            raise UserError(f"{word!r} is no setting; write it as key=value")
        *path, last = key.split(".")
        inner = table
        for name in path:
            inner = inner.setdefault(name, {})
            if not isinstance(inner, dict):
                raise UserError(f"{word!r}: {name!r} was given a value of its own already; give it once")
        inner[last] = value
    return table


@dataclass(frozen=True)
class Setting:
    """One setting as a user reads it.

    Attributes:
        name: as ``key=value`` words take it: ``effects.noise_grey`` is a key of the table ``effects``.
        default: as such a word would give it; ``none`` where it would be empty.
        text: what it is; empty where nobody said so.
    """

    name: str
    default: str
    text: str


def explained(cls: type, values: Mapping[str, Any], prefix: str = "") -> Iterator[Setting]:
    """The settings of a dataclass, those of the dataclasses in it among them.

    Args:
        cls: the dataclass.
        values: by field: its default.
        prefix: goes before each name.
    """
    texts = described(cls)
    for name, value in values.items():
        if is_dataclass(value) and not isinstance(value, type):
            inner = {item.name: getattr(value, item.name) for item in fields(value)}
            yield from explained(type(value), inner, f"{prefix}{name}.")
        else:
            yield Setting(f"{prefix}{name}", _as_word(value), texts.get(name, ""))


def _as_word(value: Any) -> str:
    """A value as it is written after ``key=``; a float to six digits."""
    if value is None or value in ((), ""):
        return "none"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return f"{value:g}" if math.isfinite(value) else str(value).replace("inf", "infinite")
    return ",".join(map(_as_word, value)) if isinstance(value, tuple) else str(value)


def described(cls: type) -> dict[str, str]:
    """What each field of a dataclass is, by name: from the ``Attributes:`` of its docstring and its bases'.

    A field that no docstring has an entry for is left out.
    """
    texts: dict[str, str] = {}
    for base in reversed(cls.__mro__):
        texts |= _entries(inspect.getdoc(base) or "")
    return {item.name: texts[item.name] for item in fields(cls) if item.name in texts}


def _entries(docstring: str) -> Iterator[tuple[str, str]]:
    """The entries ``name: text`` or ``one, other: text`` under ``Attributes:``, their lines joined."""
    _, _, section = f"\n{docstring}".partition("\nAttributes:\n")
    section = dedent(re.split(r"^\S", section, maxsplit=1, flags=re.MULTILINE)[0])  # ends where nothing is indented
    for entry in re.split(r"^(?=\w)", section, flags=re.MULTILINE)[1:]:
        names, _, text = entry.partition(":")
        for name in names.split(","):
            yield name.strip(), " ".join(text.split())
