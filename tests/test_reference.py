"""The reference pages: every public name is on them, with shapes and errors; and they build without a warning."""

from __future__ import annotations

import dataclasses
import importlib
import inspect
import re
import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
PAGES = sorted((ROOT / "docs" / "reference").glob("*.rst"))
DOORS = (
    "topoloc",
    "topoloc.behaviours",
    "topoloc.camera",
    "topoloc.checks",
    "topoloc.importing",
    "topoloc.live",
    "topoloc.mapping",
    "topoloc.mapping.building",
    "topoloc.testing",
    "topoloc.tuning",
    "sensors",
    "estimators",
    "benchmarks.scenarios",
)
"""Modules whose public names outsiders are meant to use."""
NOT_EXPLAINED = {"benchmarks.scenarios.DEFAULT", "topoloc.checks.Severity"}
"""Names that commands use, and names of types that are a choice of words."""
SHAPE = re.compile(r"\((\.\.\.|\d+|[A-Za-z_ .+*/-]+)(, (\.\.\.|\d+|[A-Za-z_ .+*/-]+))*(\[, 3\])?,?\)")
ARRAYS = re.compile(r"\b(ArrayLike|Floats|Ints|ndarray)\b")
"""Types of arrays that have no shape of their own; that of a picture is told once for all."""
RAISED = re.compile(r"^\s+raise (?!RuntimeError)[A-Z]\w*\(", re.MULTILINE)
"""All but what the reference's first page tells of all: a class that is asked before it is ready."""


def documented() -> list[str]:
    text = "".join(page.read_text() for page in PAGES)
    return re.findall(r"^\.\. (?:autoclass|autofunction|autoexception|py:data):: (\S+)$", text, re.MULTILINE)


def found(name: str) -> Any:
    module, _, attribute = name.rpartition(".")
    return getattr(importlib.import_module(module), attribute)


def public(module: str) -> list[str]:
    """Names behind a door: those of its ``__all__``, or the functions and classes that it defines."""
    room = importlib.import_module(module)
    own = [name for name, thing in vars(room).items() if getattr(thing, "__module__", "") == module]
    return [name for name in getattr(room, "__all__", own) if not name.startswith("_")]


def verbs(thing: Any) -> Iterator[tuple[str, Callable[..., Any], str]]:
    """Name, function and what documents it, of a function itself or of all public methods that a class defines."""
    if not inspect.isclass(thing):
        yield thing.__qualname__, thing, inspect.getdoc(thing) or ""
        return
    for name, member in vars(thing).items():
        function = inspect.unwrap(getattr(member, "__func__", getattr(member, "fget", getattr(member, "func", member))))
        if not inspect.isfunction(function) or function.__code__.co_filename != inspect.getsourcefile(thing):
            continue  # made by somebody else, such as a dataclass's __init__
        if name in ("__init__", "__post_init__"):
            yield f"{thing.__qualname__}.{name}", function, inspect.getdoc(thing) or ""
        elif not name.startswith("_"):
            yield f"{thing.__qualname__}.{name}", function, inspect.getdoc(function) or ""


NAMES = documented()


@pytest.mark.parametrize("door", DOORS)
def test_every_public_name_is_on_a_page(door: str) -> None:
    names = {f"{door}.{name}" for name in public(door)}
    assert names
    assert names - NOT_EXPLAINED <= set(NAMES)


def test_none_is_there_twice() -> None:
    assert len(NAMES) == len(set(NAMES))


@pytest.mark.parametrize("name", NAMES)
def test_it_says_what_it_is(name: str) -> None:
    thing = found(name)
    if not inspect.isclass(thing) and not inspect.isfunction(thing):
        return  # a table of functions: the page says what it is
    assert vars(thing).get("__doc__") or (inspect.isfunction(thing) and thing.__doc__), "has no docstring of its own"
    undocumented = [verb for verb, _, text in verbs(thing) if not text]
    assert undocumented == []


@pytest.mark.parametrize("name", NAMES)
def test_arrays_have_shapes(name: str) -> None:
    thing = found(name)
    shapeless = []
    if dataclasses.is_dataclass(thing):
        text = inspect.getdoc(thing) or ""
        arrays = [field.name for field in dataclasses.fields(thing) if ARRAYS.search(str(field.type))]
        own = [field for field in arrays if field in inspect.get_annotations(thing)]  # type: ignore[arg-type]
        shapeless += [f"{name}: {field}" for field in own if not tells_shape(text, field)]
    for verb, function, text in verbs(thing) if inspect.isclass(thing) or inspect.isfunction(thing) else ():
        kinds = inspect.get_annotations(function).values()
        if any(ARRAYS.search(str(kind)) for kind in kinds) and not SHAPE.search(text):
            shapeless.append(f"{verb}: its docstring names no shape")
    assert shapeless == []


def tells_shape(text: str, field: str) -> bool:
    """Whether what is told of an attribute, in an entry of its own or in a sentence that names it, has a shape."""
    entry = re.search(rf"^( *)(\w+, )*{field}(, \w+)*: (?P<told>.*(\n\1 +\S.*)*)", text, re.MULTILINE)
    told = entry["told"] if entry else (text.partition(f"{field} ")[2].partition(";")[0])
    return SHAPE.search(told) is not None


@pytest.mark.parametrize("name", NAMES)
def test_errors_are_told(name: str) -> None:
    thing = found(name)
    silent = []
    for verb, function, text in verbs(thing) if inspect.isclass(thing) or inspect.isfunction(thing) else ():
        raises = RAISED.search(textwrap.dedent(inspect.getsource(function)))
        # What a class refuses when it is made is told of all on the reference's first page.
        if raises and not verb.endswith("__") and not re.search(r"\b[Rr]aises?\b", text):
            silent.append(verb)
    assert silent == []


@pytest.mark.slow
def test_pages_build_without_a_warning(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-b", "html", "docs", str(tmp_path / "html")]
    built = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stderr
    page = (tmp_path / "html" / "reference" / "topoloc.html").read_text()
    assert "TypeAliasForwardRef" not in page
    assert 'src="http' not in page
