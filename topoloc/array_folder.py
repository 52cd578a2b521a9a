"""A folder of ``.npy`` files that is there whole or not at all, and is known to be as it was written."""

from __future__ import annotations

import json
import os
import shutil
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from topoloc.errors import UserError
from topoloc.file_stamp import FileStamp, digest_of
from topoloc.files import umask, write_text

Arrays = Mapping[str, NDArray[Any]]
LIST_FILE = "arrays.json"
"""Of each array: size, times and digest of its file."""


def write_arrays(folder: Path, arrays: Arrays) -> None:
    """Write arrays into a new folder.

    Raises:
        OSError: it cannot be written, or is there already.
        ValueError: an array holds Python objects, or a name is none of Python's.
    """
    temporary = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
    try:
        temporary.chmod(0o777 & ~umask())
        for name, array in arrays.items():
            _write_array(temporary / f"{name}.npy", array)
        _write_list(temporary, {name: digest_of(temporary / f"{name}.npy") for name in arrays})
        temporary.rename(folder)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _write_array(path: Path, array: NDArray[Any]) -> None:
    if not path.stem.isidentifier():
        raise ValueError(f"{path.stem!r} is no name for an array; use one that Python would take")
    with path.open("wb") as file:
        np.save(file, array, allow_pickle=False)
        file.flush()
        os.fsync(file.fileno())


def _write_list(folder: Path, digests: Mapping[str, str]) -> None:
    said = {name: [*FileStamp.of(folder / f"{name}.npy"), digest] for name, digest in digests.items()}
    try:
        write_text(folder / LIST_FILE, json.dumps(said))
    except UserError as error:
        raise OSError(str(error)) from error


def read_arrays(folder: Path) -> Arrays | None:
    """The arrays of a folder, read-only and mapped, so that only what is used of them is read.

    None where there is no such folder, or it is not as it was written. That is judged by size and times of the files;
    where the times are others, as in a copy of the folder, by their content.
    """
    try:
        said = json.loads((folder / LIST_FILE).read_text(encoding="utf-8"))
        if not said:
            return None
        digests = {name: str(row[-1]) for name, row in said.items()}
        moved = [name for name, row in said.items() if [*FileStamp.of(folder / f"{name}.npy")] != row[:-1]]
        if any(digest_of(folder / f"{name}.npy") != digests[name] for name in moved):
            return None
        arrays = {name: _mapped(folder / f"{name}.npy") for name in said}
    except (OSError, ValueError, TypeError, KeyError, AttributeError, IndexError, RecursionError):
        return None  # whatever is wrong with it, it is made again
    with suppress(OSError):  # it is as good without
        if moved:
            _write_list(folder, digests)
        os.utime(folder)  # which results are used is known by this time
    return arrays


def _mapped(path: Path) -> NDArray[Any]:
    return np.asarray(np.load(path, mmap_mode="r", allow_pickle=False)).view(np.ndarray)


def read_only(arrays: Arrays) -> Arrays:
    """Views of arrays that cannot be written to."""
    views = {name: array.view() for name, array in arrays.items()}
    for view in views.values():
        view.flags.writeable = False
    return views


def discard(folder: Path) -> None:
    """Remove a folder at once for who looks for it; who has its arrays mapped keeps them. Raises ``OSError``."""
    hidden = Path(tempfile.mkdtemp(prefix=f".{folder.name.lstrip('.')}.", dir=folder.parent))
    try:
        folder.replace(hidden / folder.name)
    finally:
        shutil.rmtree(hidden, ignore_errors=True)
