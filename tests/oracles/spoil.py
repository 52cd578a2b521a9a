"""Ways to spoil a folder that was in order: each makes a function that is handed the folder."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

Spoil = Callable[[Path], object]


def rewrite(name: str, old: str, new: str) -> Spoil:
    """Replace the first ``old`` in a text file, which must be there."""

    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new, 1))

    return change


def write(name: str, data: str | bytes) -> Spoil:
    """Put this into a file."""
    return lambda folder: (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)


def remove(name: str) -> Spoil:
    """Take a file or a folder away."""

    def change(folder: Path) -> None:
        path = folder / name
        shutil.rmtree(path) if path.is_dir() else path.unlink()

    return change
