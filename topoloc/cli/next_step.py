"""The line that says what to type next, as a shell takes it."""

from __future__ import annotations

import shlex
from pathlib import Path


def next_step(*words: str | Path, lead: str = "next") -> str:
    """``next: topoloc ...``, names with blanks in quotes.

    Args:
        words: of the command, after ``topoloc``.
        lead: what stands before it.
    """
    return f"{lead}: topoloc {shlex.join(str(word) for word in words)}"
