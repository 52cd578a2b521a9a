"""A profile by our own functions: time in other people's code counts as that of our function which called it."""

from __future__ import annotations

import ast
import pstats
from collections import defaultdict
from collections.abc import Iterator
from cProfile import Profile
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
ROOMS = ("topoloc", "sensors", "estimators")
"""What is ours; the benchmarks only call it."""
Called = tuple[str, int, str]
"""A function as ``pstats`` names it: file, line, name."""


@dataclass(frozen=True)
class Function:
    """One of our functions.

    Attributes:
        name: with its module, ``sensors.images.clahe``.
        what: the first line of its docstring, or of its class's where it has none.
    """

    name: str
    what: str


Shares = tuple[tuple[Function, float], ...]
"""Functions and their shares of the whole, largest first."""


def own_shares(profile: Profile) -> Shares:
    """What of a profile's time belongs to each of our functions; shares of one."""
    seconds: dict[Function, float] = defaultdict(float)
    stats = pstats.Stats(profile).stats  # type: ignore[attr-defined]
    for called, (_, _, own, _, callers) in stats.items():
        function = _ours(called)
        if function is not None:
            seconds[function] += own
            continue
        for caller, (_, _, _, within) in callers.items():
            if (of := _ours(caller)) is not None:
                seconds[of] += within
    total = sum(seconds.values())
    ordered = sorted(seconds.items(), key=lambda item: -item[1])
    return tuple((function, taken / total) for function, taken in ordered)


def _ours(called: Called) -> Function | None:
    """Our function that code belongs to, with the comprehensions and lambdas in it; None for others'."""
    path = Path(called[0])
    if not path.is_relative_to(ROOT) or path.relative_to(ROOT).parts[0] not in ROOMS:
        return None
    inside = [one for one in _functions(path) if one[0] <= called[1] <= one[1]]
    return max(inside)[2] if inside else None


@lru_cache
def _functions(path: Path) -> list[tuple[int, int, Function]]:
    """First line, with its decorators, last line and name of every function in a file."""
    module = ".".join(path.relative_to(ROOT).with_suffix("").parts)
    found = []
    for node, owner in _definitions(ast.parse(path.read_text(encoding="utf-8"))):
        first = min([node.lineno, *(decorator.lineno for decorator in node.decorator_list)])
        told = ast.get_docstring(node) or (ast.get_docstring(owner) if owner else "") or ""
        name = ".".join([module, *([owner.name] if owner else []), node.name])
        found.append((first, node.end_lineno or first, Function(name, told.split("\n")[0])))
    return found


def _definitions(module: ast.Module) -> Iterator[tuple[ast.FunctionDef, ast.ClassDef | None]]:
    """Functions and methods, each with its class; what is defined inside of them is theirs."""
    for node in module.body:
        if isinstance(node, ast.FunctionDef):
            yield node, None
        elif isinstance(node, ast.ClassDef):
            yield from ((method, node) for method in node.body if isinstance(method, ast.FunctionDef))
