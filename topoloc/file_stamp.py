"""What a file system says of a file, by which it is known again without reading it, and a digest of what is in it."""

from __future__ import annotations

import os
import tempfile
from hashlib import blake2b, file_digest
from pathlib import Path
from typing import NamedTuple

GRAIN_NS = 2_000_000_000
"""The coarsest clock that file systems keep, FAT's [ns]."""


class FileStamp(NamedTuple):
    """Size and times of a file; who changes it changes these, but for what ``is_settled`` tells of.

    Attributes:
        size: [bytes].
        modified_ns: when its content was last written, which anybody may set back [ns].
        changed_ns: when anything of it was last changed, which nobody can set; on Windows, when it was made [ns].
        inode: its number on its disk.
    """

    size: int
    modified_ns: int
    changed_ns: int
    inode: int

    @classmethod
    def of(cls, path: Path) -> FileStamp:
        """Of a file. Raises ``OSError``, and ``ValueError`` for a path with a NUL."""
        status = path.stat()
        return cls(status.st_size, status.st_mtime_ns, status.st_ctime_ns, status.st_ino)

    def is_settled(self, now_ns: int) -> bool:
        """Whether a change after ``now_ns``, by the clock of its disk [ns], will show in the stamp.

        Of two writes within one tick of the disk's clock, the second leaves no trace in a stamp taken between them.
        """
        return max(self.modified_ns, self.changed_ns) + GRAIN_NS < now_ns

    def same_writing(self, other: FileStamp) -> bool:
        """Whether size and time of writing agree: a new name, owner or link does not count."""
        return self[:2] == other[:2]


def disk_time(folder: Path) -> int:
    """What the clock of a folder's disk says, which need not be this machine's [ns]. Raises ``OSError``."""
    handle, name = tempfile.mkstemp(prefix=".clock.", dir=folder)
    try:
        return os.fstat(handle).st_mtime_ns
    finally:
        os.close(handle)
        Path(name).unlink(missing_ok=True)


def digest_of(path: Path) -> str:
    """32 hexadecimal digits that another content does not have. Raises ``OSError``."""
    with path.open("rb") as file:
        return file_digest(file, lambda: blake2b(digest_size=16)).hexdigest()
