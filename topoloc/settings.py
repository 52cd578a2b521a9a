"""Settings are frozen dataclasses; this builds them from TOML tables and ``key=value`` words, refusing unknown keys."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_origin, get_type_hints

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
    if get_origin(kind) is tuple:
        items = [word for word in value.split(",") if word] if isinstance(value, str) else value
        if not isinstance(items, list | tuple):
            raise UserError(f"{where} is {value!r}; write a list")
        return tuple(convert(item, get_args(kind)[0], where) for item in items)
    return value


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
