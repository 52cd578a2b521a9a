"""Late messages are told from a clock that was set back, as when a bag is played again or a simulator is restarted."""

from __future__ import annotations

import numpy as np


class SetBack:
    """Watches messages that are too old to be merely late: several in a row, in order, are a clock that was set back.

    Args:
        allowed_s: how much older than the newest a late message may be [s].
        needed: how many in a row.
    """

    def __init__(self, allowed_s: float, needed: int = 3) -> None:
        self.allowed_s, self.needed = allowed_s, needed
        self.forget()

    def forget(self) -> None:
        """A message in time came: those before it were late."""
        self._last, self._count = -np.inf, 0

    def says(self, time: float) -> bool:
        """Whether the clock was set back, after one more message that is too old."""
        self._count = self._count + 1 if time > self._last else 1
        self._last = time
        return self._count >= self.needed
