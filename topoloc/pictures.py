"""Pictures of a map that stay on the disk until they are asked for."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from dataclasses import dataclass
from pathlib import Path
from threading import Lock
from typing import Any, TypeVar, cast

from topoloc.errors import InputError
from topoloc.file_stamp import FileStamp, digest_of
from topoloc.files import RESTORE, read_image, reason
from topoloc.types import Image

RECENT_BYTES = 512 * 2**20
"""Decoded pictures of a map that are kept [bytes]: 170 panoramas of 3456x288, so that a small map is decoded once."""

Class = TypeVar("Class", bound=type)


class Recent:
    """The pictures that were decoded last, as many as fit; threads may share it. A pickled one comes back empty.

    Args:
        budget: [bytes].
    """

    def __init__(self, budget: int = RECENT_BYTES) -> None:
        self.budget, self.held = budget, 0
        self._kept: OrderedDict[Hashable, Image] = OrderedDict()
        self._lock = Lock()

    def __reduce__(self) -> tuple[type[Recent], tuple[int]]:
        """To another process goes the budget only."""
        return Recent, (self.budget,)

    def get(self, key: Hashable, decode: Callable[[], Image]) -> Image:
        """The picture of a key, decoded if it is not among the recent ones."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
                return self._kept[key]
        image = decode()  # outside the lock: a slow disk holds no other thread up
        if image.nbytes <= self.budget:
            with self._lock:
                self._keep(key, image)
        return image

    def _keep(self, key: Hashable, image: Image) -> None:
        if key not in self._kept:
            self._kept[key] = image
            self.held += image.nbytes
        while self.held > self.budget:
            self.held -= self._kept.popitem(last=False)[1].nbytes


@dataclass(frozen=True)
class Shelf:
    """Where the pictures of a map lie, and those that were decoded last.

    Attributes:
        folder: of the map, absolute.
        recent: shared by all of its pictures.
        is_map_folder: whether the map may keep there what is worked out from it (``topoloc.map_store``).
    """

    folder: Path
    recent: Recent
    is_map_folder: bool = True


@dataclass(eq=False, slots=True)
class PictureFile:
    """A picture of a map on the disk: decoded when it is asked for, and of those asked for last kept.

    Attributes:
        path: of the file, absolute.
        size: rows and columns.
        stamp: of the file when the map was opened.
        source: the file that names it, with its 1-based ``line``, for messages.
        shelf: of the map.
    """

    path: Path
    size: tuple[int, int]
    stamp: FileStamp
    source: Path
    line: int
    shelf: Shelf

    @property
    def shape(self) -> tuple[int, int, int]:
        """Of the array that ``read`` gives."""
        return *self.size, 3

    def read(self) -> Image:
        """The picture, uint8 (rows, cols, 3) in RGB order, read-only.

        Raises:
            InputError: it does not decode, or was changed after the map was opened; names line and picture.
        """
        return self.shelf.recent.get((self.path, self.stamp), self._decoded)

    def stamp_now(self) -> FileStamp:
        """The stamp of the file as it lies there now, which from now on is the picture's.

        Raises:
            InputError: it was written to after the map was opened, or is gone; a new owner or link does no harm.
        """
        try:
            stamp = FileStamp.of(self.path)
        except OSError as error:
            raise self._unreadable(error) from None
        if not stamp.same_writing(self.stamp):
            raise self._complaint("was changed after the map was opened", "open the map again")
        self.stamp = stamp
        return stamp

    def digest(self) -> str:
        """Of the file's content: 32 hexadecimal digits. Raises ``InputError`` where it cannot be read."""
        try:
            return digest_of(self.path)
        except OSError as error:
            raise self._unreadable(error) from None

    def _unreadable(self, error: OSError) -> InputError:
        return self._complaint(f"cannot be read ({reason(error)})", RESTORE)

    def _complaint(self, problem: str, remedy: str) -> InputError:
        """What is wrong with the picture; names it, and the line that it stands on."""
        return InputError(self.source, f"the picture {self.path.name} {problem}", remedy, line=self.line)

    def moved(self, path: Path) -> None:
        """From now on the picture, the same to the pixel, is read from another file."""
        self.path = path.absolute()
        self.stamp = FileStamp.of(self.path)

    def _decoded(self) -> Image:
        self.stamp_now()
        try:
            image = read_image(self.path)
        except InputError as error:
            raise self._complaint(error.problem.removeprefix("is "), error.remedy) from None
        if image.shape != self.shape:
            problem = f"is {image.shape[1]}x{image.shape[0]}, and its head says {self.size[1]}x{self.size[0]}"
            raise self._complaint(problem, "save it again as PNG or JPEG, upright")
        image.flags.writeable = False  # a change would be lost when the picture is decoded again
        return image


Held = Image | PictureFile | None
"""What a field of ``lazy_pictures`` holds."""


class _PictureField:
    """An attribute that is given an array, a ``PictureFile`` or None, and gives an array or None."""

    def __init__(self, name: str) -> None:
        self._name = name

    def __get__(self, owner: object | None, kind: type | None = None) -> Any:
        if owner is None:
            return self
        held = held_in(owner, self._name)
        return held.read() if isinstance(held, PictureFile) else held

    def __set__(self, owner: object, value: Any) -> None:
        vars(owner)[self._name] = value


def lazy_pictures(*names: str) -> Callable[[Class], Class]:
    """Let fields of a dataclass hold pictures that are still on the disk; who asks for the field gets the array.

    The decorator stands above ``dataclass``, so that the fields keep their defaults. An object that is pickled or
    copied takes the ``PictureFile`` along, not the pixels; one made by ``dataclasses.replace`` has the array.
    """

    def decorate(kind: Class) -> Class:
        for name in names:
            setattr(kind, name, _PictureField(name))
        return kind

    return decorate


def as_image(picture: PictureFile) -> Image:
    """A picture as a field of ``lazy_pictures`` takes it: typed as the array that the field will give."""
    return cast(Image, picture)


def held_in(owner: object, name: str) -> Held:
    """What a field of ``lazy_pictures`` holds, not decoded."""
    try:
        return cast(Held, vars(owner)[name])
    except KeyError:
        raise AttributeError(name) from None


def follow(written: Iterable[tuple[Held, str]], folder: Path) -> None:
    """Pictures that lay in a folder that was written over are from now on those that were written there.

    Args:
        written: what a field held, and the name in the folder that it was written under.
        folder: that is complete now.
    """
    place = folder.resolve()
    for held, name in written:
        if isinstance(held, PictureFile) and held.path.resolve().is_relative_to(place):
            held.moved(folder / name)
