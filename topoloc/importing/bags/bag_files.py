"""Which files make up a bag, and of which format each is, told by its first bytes."""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum
from pathlib import Path

from topoloc.errors import InputError, UserError

METADATA = "metadata.yaml"
MAGIC_BYTES = 16


class Format(Enum):
    """Formats of bags, each with what to do about one that cannot be read."""

    ROS1 = "if it was cut off, mend a copy: rosbag reindex COPY.bag"
    SQLITE = "if it was cut off, mend it: sqlite3 BAG.db3 .recover | sqlite3 MENDED.db3"
    MCAP = "it must be recorded by ROS 2; if it was cut off, mend it: mcap recover BAG.mcap -o MENDED.mcap"
    FOLDER = "give its .db3 or .mcap files themselves, or convert it: ros2 bag convert"

    @property
    def remedy(self) -> str:
        """What to do about a bag of this format that cannot be read."""
        return self.value


SIGNS = (
    (b"#ROSBAG V", Format.ROS1, ""),
    (b"SQLite format 3", Format.SQLITE, ".db3"),
    (b"\x89MCAP", Format.MCAP, ".mcap"),
)
"""First bytes, the format they tell, and the ending that ``rosbags`` wants of it."""


@dataclass(frozen=True)
class BagFile:
    """What is opened as one: a file, or a folder of ROS 2 with its metadata."""

    path: Path
    format: Format


def bag_files(path: Path) -> list[BagFile]:
    """What is to be opened for a path that a user gives: itself, or the bags in a folder without metadata.

    Raises:
        InputError: there is no bag.
        UserError: ``rosbags`` is not installed.
    """
    _need_rosbags()
    if not path.exists():
        raise InputError(
            path, "no such file or folder", "name a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag"
        )
    if not path.is_dir():
        return [BagFile(path, _format(path))]
    if (path / METADATA).exists():
        return [BagFile(path, Format.FOLDER)]
    parts = sorted((one for one in path.iterdir() if one.suffix in (".bag", ".db3", ".mcap")), key=_in_order)
    if not parts:
        raise InputError(path, _why_no_bag(path), "name a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag")
    return [BagFile(part, _format(part)) for part in parts]


def _need_rosbags() -> None:
    try:
        import rosbags.rosbag1
        import rosbags.rosbag2  # noqa: F401
    except ModuleNotFoundError as error:
        missing = error.name or "rosbags"
        raise UserError(f'bags are read with {missing}, which is not installed; pip install "topoloc[ros]"') from None


def _in_order(path: Path) -> list[tuple[int, str]]:
    """So that ``drive_10.db3`` comes after ``drive_9.db3``."""
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"(\d+)", path.name)]


def _why_no_bag(folder: Path) -> str:
    if any(one.suffix in (".zstd", ".lz4") for one in folder.iterdir()):
        return f"holds compressed files, but no {METADATA} that tells how"
    return "holds no bag"


def _format(path: Path) -> Format:
    """Of a file, by its first bytes."""
    with path.open("rb") as file:
        head = file.read(MAGIC_BYTES)
    if not head:
        raise InputError(path, "is empty", "copy or record it again")
    for sign, form, ending in SIGNS:
        if head.startswith(sign):
            if ending and path.suffix != ending:
                raise InputError(path, f"is a bag, but its name does not end in {ending}", "rename it so that it does")
            return form
    if path.suffix in (".zstd", ".lz4") or path.name == METADATA:
        raise InputError(path, "is a part of a bag", "name the folder it lies in")
    raise InputError(
        path, "is no bag of ROS 1 or ROS 2", "name a .bag, .db3 or .mcap file, or the folder of a ROS 2 bag"
    )
