"""The folder of a benchmark run: one process at a time writes there, and what a killed one left half written goes."""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from itertools import chain
from pathlib import Path
from typing import IO

from topoloc.errors import InputError

LOCK_FILE = ".lock"
"""Stays when the run ends: who removes it may take it from under another who has just opened it."""
KEPT_FOLDERS = ("steps", "replay")
"""Of a run's folder, where ``benchmarks.run_files`` lie."""
_TEMPORARY = re.compile(r"\..+\.(csv|html|json|toml)\.[a-z0-9_]{8}")
"""Names that ``topoloc.files.write_bytes`` gives to files of a run until they are whole."""


def is_free(folder: Path) -> bool:
    """Whether a new run may begin here: nothing is there but what one leaves that is killed before it began."""
    if not folder.is_dir():
        return not folder.exists()
    return all(path.name == LOCK_FILE or _TEMPORARY.fullmatch(path.name) for path in folder.iterdir())


@contextmanager
def only_writer(folder: Path) -> Iterator[None]:
    """Hold a run's folder, made if need be, against other processes, and clear away what a killed one left there.

    The system lets go of it when the process ends, however it ends. Nothing is held where the system or the disk knows
    no such locks.

    Raises:
        UserError: another process holds it, or it cannot be written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / LOCK_FILE).open("a")
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise InputError(folder, f"cannot be written ({reason})", "choose a place that is yours to write to") from error
    with file:
        if not _lock(file):
            raise InputError(folder, "another benchmark is writing here", "wait until it ends, or stop it")
        _clear(folder)
        try:
            yield
        finally:
            _clear(folder)  # Ctrl-C may come between a temporary file and the place that removes it


def _lock(file: IO[str]) -> bool:
    """Whether the file is ours alone from now on."""
    if sys.platform == "win32":
        return True
    import fcntl

    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a disk without locks
        return True
    return True


def _clear(folder: Path) -> None:
    """Remove the temporary files of writes that were killed."""
    hidden = chain(folder.glob(".*"), *((folder / name).rglob(".*") for name in KEPT_FOLDERS))
    for path in [path for path in hidden if _TEMPORARY.fullmatch(path.name)]:
        with suppress(OSError):  # it does no harm
            path.unlink()
