"""What a check finds: what, where, how bad, and what to do about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

Severity = Literal["note", "warning", "serious"]
SEVERITIES: tuple[Severity, ...] = ("note", "warning", "serious")
"""From the least: worth knowing; makes answers worse; makes them wrong."""
MOST_NAMED = 8
"""So many places are named one by one, the rest are counted."""


@dataclass(frozen=True)
class Finding:
    """One thing that would go wrong.

    Attributes:
        where: file, and line or time where there is one.
        what: is wrong, with how much.
        remedy: what to do.
        severity: how bad it is.
    """

    where: str
    what: str
    remedy: str
    severity: Severity = "warning"


@dataclass(frozen=True)
class Report:
    """A line that says what was looked at, and what was found."""

    summary: str
    findings: tuple[Finding, ...]

    def at_least(self, severity: Severity) -> tuple[Finding, ...]:
        """The findings that are so bad or worse."""
        least = SEVERITIES.index(severity)
        return tuple(one for one in self.findings if SEVERITIES.index(one.severity) >= least)


def listed(names: Sequence[str]) -> str:
    """Names as a sentence has them, the first few of many."""
    more = len(names) - MOST_NAMED
    return ", ".join(names[:MOST_NAMED]) + (f" and {more} more" if more > 0 else "")
