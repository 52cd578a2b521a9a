"""What the node says on its terminal: where the robot is, and what is amiss."""

from __future__ import annotations

import shutil
import time as clocks
from collections.abc import Callable, Collection
from threading import Lock
from typing import TextIO

import numpy as np

from topoloc.live.lines import as_line
from topoloc.live.report import LiveReport
from topoloc.topo_map import TopoMap

LINE_EVERY_S = 1.0
"""Where lines are not rewritten, one so often, and at every change of status or place [s]."""
ERASE = "\r\x1b[K"


class Board:
    """Lines from two threads: reports, on a terminal each in the place of the last; and notices, which stay.

    Args:
        topo_map: names the places.
        out: where to.
        clock: goes forward [s].
    """

    def __init__(self, topo_map: TopoMap, out: TextIO, clock: Callable[[], float] = clocks.monotonic) -> None:
        self._map, self._out, self._clock = topo_map, out, clock
        self._rewrites, self._lock = out.isatty(), Lock()
        self._line, self._line_at = "", -np.inf
        self._told: tuple[str, str | None] = ("", None)
        self._noticed: Collection[str] = ()

    def tell(self, report: LiveReport) -> None:
        """Show a report, unless the last line is young and says the same place and status."""
        now, news = self._clock(), (report.status.value, report.node_id)
        if not self._rewrites and news == self._told and now - self._line_at < LINE_EVERY_S:
            return
        self._told, self._line_at = news, now
        with self._lock:
            self._line = as_line(report, self._map)
            self._write(self._line, stays=not self._rewrites)

    def notice(self, notices: Collection[str]) -> None:
        """Say what is amiss, a line each; one that was amiss the last time is not said again."""
        with self._lock:
            for text in notices:
                if text not in self._noticed:
                    self._write(text, stays=True)
            self._noticed = notices

    def close(self) -> None:
        """Leave the last report standing."""
        with self._lock:
            if self._rewrites and self._line:
                self._write(self._line, stays=True)

    def _write(self, text: str, stays: bool) -> None:
        shown = text if stays else text[: shutil.get_terminal_size().columns - 1]
        self._out.write(f"{ERASE if self._rewrites else ''}{shown}{chr(10) if stays else ''}")
        self._out.flush()
