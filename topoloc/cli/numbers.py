"""Whole numbers on the command line: 1.5 is a mistake, not 2."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

from cyclopts import Parameter, Token

from topoloc.errors import UserError


def whole(kind: Any, tokens: Sequence[Token]) -> int:
    """The number that a word stands for. Raises ``UserError`` where it is no whole one."""
    del kind
    word = tokens[0].value
    try:
        return int(word)
    except ValueError:
        raise UserError(f"{tokens[0].keyword} is {word!r}; write a whole number") from None


Whole = Annotated[int, Parameter(converter=whole)]
