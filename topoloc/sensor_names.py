"""Names of sensors that look together: ``ima+histogram``, ``mix(pca,disparity)``, and any nesting of the two.

    sensor = part { "+" part }
    part   = name | fusion "(" sensor { "," sensor } ")" | "(" sensor ")"

``a+b`` is short for ``product(a,b)``. Blanks between names and marks do not count.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass

from topoloc.errors import UserError

PRODUCT = "product"
"""The fusion that is spelled ``+``."""
MARKS = "+(),"
DEEPEST = 20
"""Brackets within brackets; nobody means more."""


@dataclass(frozen=True)
class SensorName:
    """The name of a sensor or, where it has parts, of the fusion of them."""

    name: str
    parts: tuple[SensorName, ...] = ()

    def __str__(self) -> str:
        """As it is spelled shortest; ``parse`` gives the same back."""
        if not self.parts:
            return self.name
        if self.name == PRODUCT:
            return "+".join(map(str, self.parts))  # of which none is a product: see ``_joined``
        return f"{self.name}({','.join(map(str, self.parts))})"

    def inner(self) -> Iterator[SensorName]:
        """All parts, and theirs."""
        for part in self.parts:
            yield part
            yield from part.inner()


def parse(text: str) -> SensorName:
    """What a sensor's name stands for.

    Raises:
        UserError: it is none; the message says at which character.
    """
    reader = _Reader(text)
    found = reader.sensor()
    if reader.mark:
        raise reader.error(f"{reader.mark!r} does not belong")
    return found


class _Reader:
    """Reads a text word by word; ``mark`` is the next one, empty at the end."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._words = [(word[0], word.start()) for word in re.finditer(r"[+(),]|[^\s+(),]+", text)]
        self._next, self._depth = 0, 0

    @property
    def mark(self) -> str:
        return self._words[self._next][0] if self._next < len(self._words) else ""

    def error(self, problem: str) -> UserError:
        at_end = self._next >= len(self._words)
        place = "at its end" if at_end else f"at character {self._words[self._next][1] + 1}"
        return UserError(f"sensor {self._text!r}: {problem} {place}; write ima, ima+histogram or mix(ima,histogram)")

    def sensor(self) -> SensorName:
        parts = [self._part()]
        while self.mark == "+":
            self._next += 1
            parts.append(self._part())
        return parts[0] if len(parts) == 1 else _joined(PRODUCT, parts)

    def _part(self) -> SensorName:
        if self.mark == "(":
            start, found = self._next, self._bracket()
            if len(found) > 1:
                self._next = start
                raise self.error("the name of a fusion is missing")
            return found[0]
        name = self.mark
        if not name or name in MARKS:
            raise self.error("a name is missing")
        self._next += 1
        if self.mark != "(":
            return SensorName(name)
        start, found = self._next, self._bracket()
        if len(found) < 2:
            self._next = start
            raise self.error(f"{name} is given one sensor, and takes two or more,")
        return _joined(name, found)

    def _bracket(self) -> list[SensorName]:
        self._depth += 1
        if self._depth > DEEPEST:
            raise self.error(f"more than {DEEPEST} brackets are open")
        self._next += 1
        found = [self.sensor()]
        while self.mark == ",":
            self._next += 1
            found.append(self.sensor())
        if self.mark != ")":
            raise self.error("',' or ')' is missing")
        self._next += 1
        self._depth -= 1
        return found


def _joined(name: str, parts: list[SensorName]) -> SensorName:
    """Parts under one fusion; products of products are one product."""
    if name != PRODUCT:
        return SensorName(name, tuple(parts))
    flat = [inner for part in parts for inner in (part.parts if part.name == PRODUCT and part.parts else (part,))]
    return SensorName(PRODUCT, tuple(flat))
