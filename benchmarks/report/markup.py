"""Pieces of HTML that every part of the report is made of; whatever is put into them is escaped there."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from html import escape
from importlib.resources import files
from typing import Any

from benchmarks.spread import Interval, Pair

NONE = "\N{EN DASH}"
"""Where there is no value."""


def asset(name: str) -> str:
    """A file of this package: a template, a stylesheet, a script."""
    return files("benchmarks.report").joinpath(name).read_text(encoding="utf-8")


def number(value: float | None) -> str:
    """Two digits behind the point, fewer of large numbers, a dash for none; a true minus sign."""
    if value is None or not math.isfinite(value):
        return NONE
    digits = next((digits for limit, digits in ((10.0, 2), (100.0, 1)) if abs(value) < limit), 0)
    text = f"{value:.{digits}f}"
    return text.removeprefix("-") if float(text) == 0.0 else text.replace("-", "\N{MINUS SIGN}")


def span(interval: Interval | None) -> str:
    """An interval in brackets; empty where there is none."""
    return "" if interval is None else f"[{number(interval.low)}, {number(interval.high)}]"


def reach(interval: Interval) -> str:
    """An interval of a value that is never negative, where there is little room."""
    return f"{number(interval.low)}\N{EN DASH}{number(interval.high)}"


def pair_name(pair: Pair) -> str:
    """Sensor and estimator as ``topoloc compare --pairs`` has them."""
    return "/".join(pair)


def plural(count: int, what: str) -> str:
    """``1 seed``, ``2 seeds``."""
    return f"{count} {what}" if count == 1 else f"{count} {what}s"


def items(texts: Iterable[str]) -> str:
    """Texts as items of a list."""
    return "".join(f"<li>{escape(text)}</li>" for text in texts)


def options(names: Sequence[str], chosen: int = 0) -> str:
    """Options of a select; their values are indices into ``names``."""
    return "".join(
        f'<option value="{index}"{" selected" * (index == chosen)}>{escape(name)}</option>'
        for index, name in enumerate(names)
    )


def select(label: str, names: Sequence[str], role: str, chosen: int = 0) -> str:
    """A select with its label; the page's script knows it by ``role``."""
    return f'<label>{escape(label)} <select data-role="{role}">{options(names, chosen)}</select></label>'


def json_script(role: str, value: Any) -> str:
    """Data for the page's script; without a ``<`` nothing in it can end the element."""
    text = json.dumps(value, separators=(",", ":"), ensure_ascii=False, allow_nan=False).replace("<", "\\u003c")
    return f'<script type="application/json" data-role="{role}">{text}</script>'
