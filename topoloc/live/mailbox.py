"""One picture waits at most; a younger one takes its place."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from threading import Condition

import numpy as np

from topoloc.geometry import Floats
from topoloc.live.clock import SetBack
from topoloc.live.report import LiveConfig, Tally
from topoloc.types import Image, Pixels

ImageData = bytes | Image | Mapping[str, Pixels]
"""An encoded picture; one as uint8 (rows, cols[, 3]), RGB; or straightened ones by kind, as in ``Frame.images``."""


@dataclass(frozen=True)
class Letter:
    """A picture that arrived.

    Attributes:
        time: its stamp [s].
        data: the picture.
        camera: (3,) pose of the camera on the robot at that time.
        arrived: when, on the localizer's clock [s].
        set_back: how far the pictures' clock was set back before it [s]; 0: not at all.
    """

    time: float
    data: ImageData
    camera: Floats
    arrived: float
    set_back: float = 0.0


class Mailbox:
    """Keeps the youngest picture until it is taken. Any thread may put, one takes."""

    def __init__(self, config: LiveConfig, tally: Tally) -> None:
        self._least_step = 1.0 / config.most_hz if config.most_hz else 0.0
        self._set_back, self._tally = SetBack(config.clock_back_s), tally
        self._changed = Condition()
        self._waiting: Letter | None = None
        self._taken = -np.inf  # time of the last one taken
        self.heard = 0
        """Pictures that came in time so far."""

    def put(self, letter: Letter) -> None:
        """A picture came; one that is of no use is counted and forgotten."""
        self._tally.add("frames")
        if not np.isfinite(letter.time):
            self._tally.add("bad")
            return
        with self._changed:
            if letter.time <= self._taken:
                self._old(letter)
                return
            self._set_back.forget()
            self.heard += 1
            if letter.time < self._taken + self._least_step:
                self._tally.add("skipped")
            elif self._waiting is None:
                self._waiting = letter
            else:
                self._tally.add("dropped")
                if letter.time > self._waiting.time:
                    self._waiting = replace(letter, set_back=self._waiting.set_back)
            self._changed.notify_all()

    def _old(self, letter: Letter) -> None:
        """A picture that is not younger than the last one taken: late, or of a clock that was set back."""
        back = self._taken - letter.time
        if back <= self._set_back.allowed_s or not self._set_back.says(letter.time):
            self._tally.add("late")
            return
        self._set_back.forget()
        self.heard += 1
        if self._waiting is not None:
            self._tally.add("dropped")
        self._waiting, self._taken = replace(letter, set_back=back), -np.inf
        self._changed.notify_all()

    def take(self) -> Letter | None:
        """The picture that waits, if one does."""
        with self._changed:
            letter, self._waiting = self._waiting, None
            if letter is not None:
                self._taken = letter.time
            return letter

    @property
    def is_empty(self) -> bool:
        """Whether no picture waits."""
        with self._changed:
            return self._waiting is None

    def wait(self, timeout_s: float) -> None:
        """Until a picture waits, or so long [s]."""
        with self._changed:
            self._changed.wait_for(lambda: self._waiting is not None, timeout_s)
