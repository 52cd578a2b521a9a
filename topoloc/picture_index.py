"""What is in the pictures of a map folder, remembered beside the map so that only those that changed are read again."""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

from topoloc.errors import UserError
from topoloc.file_stamp import FileStamp, disk_time
from topoloc.files import write_text
from topoloc.pictures import PictureFile

STORE_FOLDER = ".topoloc"
"""Of a map folder: what can be worked out again from the map. It may be deleted at any time."""
INDEX_FILE = "index.json"
INDEX_FORMAT = 1
"""One of another number is as good as none."""


class Entry(NamedTuple):
    """What is known of a picture.

    Attributes:
        stamp: of its file when it was read.
        size: rows and columns.
        digest: of the file's content.
    """

    stamp: FileStamp
    size: tuple[int, int]
    digest: str


@dataclass(frozen=True)
class PictureIndex:
    """What is known of the pictures of a map folder.

    Attributes:
        folder: of the map.
        began_ns: the disk's time before the first of the stamps was taken [ns].
        entries: by path, relative to the folder where it lies inside.
    """

    folder: Path
    began_ns: int = 0
    entries: dict[str, Entry] = field(default_factory=dict)

    @classmethod
    def read(cls, folder: Path) -> PictureIndex:
        """The index of a map folder; an empty one where it is missing or damaged."""
        try:
            said = json.loads((folder / STORE_FOLDER / INDEX_FILE).read_text(encoding="utf-8"))
            if said["format"] == INDEX_FORMAT:
                entries = {name: _entry(*row) for name, row in said["pictures"].items()}
                return cls(folder, int(said["began_ns"]), entries)
        except (OSError, ValueError, TypeError, KeyError, AttributeError, RecursionError):
            pass  # a damaged one is as good as none
        return cls(folder)

    def known(self, path: Path, stamp: FileStamp) -> Entry | None:
        """What is known of a picture if its file is still the one that was read."""
        entry = self.entries.get(self.name_of(path))
        return entry if entry is not None and entry.stamp == stamp and stamp.is_settled(self.began_ns) else None

    def name_of(self, path: Path) -> str:
        """How the index calls a file."""
        return str(path).removeprefix(f"{self.folder}{os.sep}")

    def write(self) -> None:
        """Write it beside the map. Raises ``UserError`` where that cannot be."""
        rows = {name: [*entry.stamp, *entry.size, entry.digest] for name, entry in self.entries.items()}
        said = {"format": INDEX_FORMAT, "began_ns": self.began_ns, "pictures": rows}
        write_text(self.folder / STORE_FOLDER / INDEX_FILE, json.dumps(said))

    def others(self, names: set[str]) -> dict[str, Entry]:
        """Entries of files that are not named but still there, such as those that another part of the map uses."""
        return {
            name: entry
            for name, entry in self.entries.items()
            if name not in names and entry.stamp.is_settled(self.began_ns) and (self.folder / name).exists()
        }


def _entry(size: Any, modified: Any, changed: Any, inode: Any, rows: Any, columns: Any, digest: Any) -> Entry:
    if not isinstance(digest, str) or {type(part) for part in (size, modified, changed, inode, rows, columns)} != {int}:
        raise ValueError("no entry of an index")
    return Entry(FileStamp(size, modified, changed, inode), (rows, columns), digest)


def digests(pictures: Sequence[PictureFile], folder: Path) -> list[str]:
    """Digests of what is in each picture's file; read are only those whose stamps are new, or too young to be trusted.

    What was read goes into the index, where the store's folder is there and can be written to.

    Raises:
        InputError: a picture was written to, or removed, after the map was opened.
    """
    index = PictureIndex.read(folder)
    began_ns = _time_at(folder / STORE_FOLDER)
    entries: dict[str, Entry] = {}
    names, read = [], 0
    for picture in pictures:
        name, stamp = index.name_of(picture.path), picture.stamp_now()
        names.append(name)
        if name in entries:
            continue
        known = index.known(picture.path, stamp)
        entries[name] = known or Entry(stamp, picture.size, picture.digest())
        read += known is None
    if read and began_ns:
        with suppress(UserError):  # then they are read again next time
            PictureIndex(folder, began_ns, {**index.others(set(entries)), **entries}).write()
    return [entries[name].digest for name in names]


def _time_at(folder: Path) -> int:
    """The time of a folder's disk [ns]; 0 where nothing can be written."""
    try:
        return disk_time(folder)
    except OSError:
        return 0
