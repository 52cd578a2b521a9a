"""Which pictures of a recording are taken: those of a stretch of time, one every so often."""

from __future__ import annotations

from dataclasses import dataclass
from math import floor, inf, isfinite

from topoloc.errors import UserError

SLACK_S = 1e-3
"""A picture this much early still counts as on time: cameras' clocks tremble [s]."""


@dataclass(frozen=True)
class Thinning:
    """One picture every so often, of a stretch; the times are counted from the first picture.

    Attributes:
        every_s: from one to the next [s]; 0 takes all.
        start_s: of the stretch [s].
        end_s: of the stretch [s].
    """

    every_s: float = 0.0
    start_s: float = 0.0
    end_s: float = inf

    def __post_init__(self) -> None:
        if not (isfinite(self.every_s) and self.every_s >= 0.0):
            raise UserError(f"--every is {self.every_s:g}; give seconds, or 0 for all pictures")
        if not 0.0 <= self.start_s < self.end_s:
            raise UserError(f"--start is {self.start_s:g} and --end {self.end_s:g}; give 0 or more, and a later end")

    def takes(self, time: float, before: float | None) -> bool:
        """Whether a picture is taken.

        Args:
            time: of the picture, since the first [s].
            before: of the picture that was taken before it, or None.
        """
        if not self.start_s - SLACK_S <= time <= self.end_s + SLACK_S:
            return False
        return before is None or self.every_s == 0.0 or self._slot(time) > self._slot(before)

    def _slot(self, time: float) -> int:
        return floor((time - self.start_s + SLACK_S) / self.every_s)
