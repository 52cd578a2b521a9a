"""What was worked out from a map, kept beside it: a large map opens in a moment the second time."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from dataclasses import dataclass
from hashlib import blake2b
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from topoloc.array_folder import Arrays, discard, read_arrays, read_only, write_arrays
from topoloc.errors import InputError
from topoloc.file_lock import wait_for
from topoloc.picture_index import STORE_FOLDER, digests
from topoloc.pictures import Held, PictureFile, Shelf, held_in
from topoloc.topo_map import TopoMap

MOST_KEPT = 4
"""Results of one name that are kept, those last used."""
FORMAT = 1
"""Of the store: with another number all is made again."""
MADE_WITH = ("topoloc", "numpy", "pillow", "opencv-python-headless", "opencv-python", "opencv-contrib-python")
"""Packages whose versions a result depends on: OpenCV 4 and 5, for example, scale pictures differently."""
_NAME = re.compile(r"[a-z0-9][a-z0-9_-]*")
_told: set[Path] = set()


def precomputed(topo_map: TopoMap, name: str, settings: object, build: Callable[[], Arrays]) -> Arrays:
    """The arrays that ``build`` makes from a map, or those that it made before.

    They are kept in the folder that the map was read from, for the map's content (all of it but what things are
    called for people), these settings and the versions of ``MADE_WITH``. A map that has no pictures, or pictures in
    memory, is not known again, and ``build`` is called. It is also called where nothing can be written; a warning
    says so once. What is found damaged is made again. Two processes that need the same do not do it both.

    Args:
        topo_map: the map.
        name: what the arrays are for: small letters, digits, ``-`` and ``_``.
        settings: what ``build`` depends on besides the map, a number of its own version included; its ``repr``, such
            as that of a frozen dataclass or a tuple, tells all of it.
        build: makes the arrays, by names that can be Python's; it must not ask for the same ``name``.

    Returns:
        Read-only arrays; those from the disk are mapped, and read as they are used.

    Raises:
        InputError: a picture is broken, or was changed after the map was opened.
    """
    if not _NAME.fullmatch(name):
        raise ValueError(f"{name!r} is no name for a folder; use small letters, digits, - and _")
    shelf = _shelf_of(topo_map)
    if shelf is None:
        return read_only(build())
    store = shelf.folder / STORE_FOLDER
    trouble = _begin(store)
    if trouble is not None and not store.is_dir():
        _tell(store, trouble)
        return read_only(build())
    key = _Key(name, _settings_digest(settings), content_digest(topo_map))
    found = read_arrays(store / key.folder)
    return found if found is not None else _made(topo_map, store, key, build)


def _shelf_of(topo_map: TopoMap) -> Shelf | None:
    """The folder that a map was read from; None where a picture is in memory, and for a map that may keep nothing."""
    pictures = [held for held in _held_by(topo_map) if held is not None]
    shelves = {held.shelf.folder: held.shelf for held in pictures if isinstance(held, PictureFile)}
    if len(shelves) != 1 or not all(isinstance(held, PictureFile) for held in pictures):
        return None
    shelf = next(iter(shelves.values()))
    return shelf if shelf.is_map_folder else None


def _held_by(topo_map: TopoMap) -> list[Held]:
    """The panorama of each node, the two pictures of each view."""
    panoramas = [held_in(node, "panorama") for node in topo_map.nodes]
    return panoramas + [held_in(view, side) for view in topo_map.views for side in ("image", "right")]


@dataclass(frozen=True)
class _Key:
    """What a result is known by.

    Attributes:
        name: what it is for.
        settings: digest of the settings and the versions.
        content: digest of the map.
    """

    name: str
    settings: str
    content: str

    @property
    def folder(self) -> str:
        """Of the result, in the store."""
        return f"{self.name}.{self.settings}.{self.content}"


def _settings_digest(settings: object) -> str:
    return _digest((FORMAT, repr(settings), [_version(package) for package in MADE_WITH]))


def _version(package: str) -> str:
    try:
        return version(package)
    except PackageNotFoundError:
        return ""


def content_digest(topo_map: TopoMap) -> str:
    """Of all that a map from a folder says, its pictures included, but for the names of map and nodes.

    Raises:
        InputError: a picture was changed after the map was opened.
    """
    held = _held_by(topo_map)
    pictures = [one for one in held if isinstance(one, PictureFile)]
    seen = iter(digests(pictures, pictures[0].shelf.folder))
    said = (
        topo_map.camera,
        (topo_map.filtered, topo_map.baseline_m),
        [(node.id, float(node.heading)) for node in topo_map.nodes],
        topo_map.positions.tolist(),
        np.asarray(topo_map.edges).tolist(),
        [polygon.tolist() for polygon in topo_map.free],
        [view.pose.tolist() for view in topo_map.views],
        [next(seen) if isinstance(one, PictureFile) else "" for one in held],
    )
    return _digest(said)


def _digest(said: object) -> str:
    return blake2b(repr(said).encode(), digest_size=12).hexdigest()


def _begin(store: Path) -> OSError | None:
    """Make the store's folder, which git leaves out; what stands against it, if anything."""
    try:
        store.mkdir(exist_ok=True)
        ignore = store / ".gitignore"
        if not ignore.exists() or not ignore.stat().st_size:  # a full disk may have left it empty
            ignore.write_text("*\n")
    except OSError as error:
        return error
    return None


def _made(topo_map: TopoMap, store: Path, key: _Key, build: Callable[[], Arrays]) -> Arrays:
    """What ``build`` makes, from the disk where it can be kept; or what another process has made meanwhile."""
    try:
        lock = (store / f".{key.name}.lock").open("a")
    except OSError as error:
        _tell(store, error)
        return read_only(build())
    with lock:
        alone = wait_for(
            lock, lambda: print(f"waiting: another process prepares {key.name} in {store}", file=sys.stderr)
        )
        found = read_arrays(store / key.folder)
        if found is not None:
            return found
        arrays = build()
        if not _is_still(topo_map, key):
            return read_only(arrays)
        try:
            _make_room(store, key, alone)
            write_arrays(store / key.folder, arrays)
        except OSError as error:
            if not (store / key.folder).exists():  # or another was first, which only happens without locks
                _tell(store, error)
        found = read_arrays(store / key.folder)
        return read_only(arrays) if found is None else found


def _is_still(topo_map: TopoMap, key: _Key) -> bool:
    """Whether the pictures are those that the key was made of: ``build`` may have taken minutes."""
    try:
        return content_digest(topo_map) == key.content
    except InputError:
        return False


def _make_room(store: Path, key: _Key, alone: bool) -> None:
    """Remove what a new result takes the place of, and where nobody else writes, what killed processes left."""
    others = []
    for path in list(store.iterdir()):
        name, _, rest = path.name.partition(".")
        left_over = alone and path.name.startswith(f".{key.name}.") and path.is_dir()
        if left_over or (name == key.name and rest.startswith(f"{key.settings}.")):
            discard(path)
        elif name == key.name:
            others.append((path.stat().st_mtime_ns, path))
    for _, path in sorted(others, reverse=True)[MOST_KEPT - 1 :]:
        discard(path)


def _tell(store: Path, error: OSError) -> None:
    """Say, once a process, that a map is prepared anew at each start."""
    if store not in _told:
        _told.add(store)
        problem = f"cannot be written ({error.strerror or type(error).__name__})"
        print(f"warning: {store}: {problem}; what is prepared for the map is not kept", file=sys.stderr)
