"""A file that one process at a time holds; the system lets go of it when the process ends, however it ends."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from typing import IO

PAUSE_S = 0.05
PATIENCE_S = 1.0
"""Who waits longer than this is told [s]."""
LONGEST_WAIT_S = 600.0
"""Nobody waits longer: the other process hangs [s]."""


def wait_for(file: IO[str], tell: Callable[[], None]) -> bool:
    """Hold an open file, and wait for it while another process does.

    Args:
        file: is let go of when it is closed.
        tell: called once where it takes longer than ``PATIENCE_S``.

    Returns:
        Whether it is held; it is not where the other process hangs, or the system or the disk knows no locks.
    """
    began, told = time.monotonic(), False
    while True:
        try:
            return _lock(file)
        except BlockingIOError:
            waited = time.monotonic() - began
        if waited > LONGEST_WAIT_S:
            return False
        if waited > PATIENCE_S and not told:
            tell()
            told = True
        time.sleep(PAUSE_S)


def _lock(file: IO[str]) -> bool:
    """Whether the file is ours alone from now on. Raises ``BlockingIOError`` while it is another's."""
    if sys.platform == "win32":
        return False
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise
    except OSError:  # a disk without locks
        return False
    return True
