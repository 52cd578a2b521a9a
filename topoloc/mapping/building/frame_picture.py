"""Pictures of a recording as those of a map: read, and made ready, when they are asked for."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from topoloc.file_stamp import FileStamp
from topoloc.pictures import PictureFile, Recent, Shelf
from topoloc.recording import MAX_OFFSET_S, Picture, Recording
from topoloc.types import Image

KEPT_BYTES = 64 * 2**20
"""Decoded pictures that are kept [bytes]: they are asked for once by who saves the map."""


@dataclass(eq=False, slots=True)
class FramePicture(PictureFile):
    """A picture of a frame: as the recording gives it, and then made ready.

    Attributes:
        reader: reads it whole.
    """

    reader: Callable[[], Image]

    def read(self) -> Image:
        """The picture, uint8, read-only. Raises ``InputError`` as the recording does."""
        return self.shelf.recent.get(self.path, self._made)

    def _made(self) -> Image:
        image = self.reader()
        image.flags.writeable = False
        return image


class FramePictures:
    """Reads the pictures of one recording, now or when they are asked for."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording
        self._shelf = Shelf(recording.folder.absolute(), Recent(KEPT_BYTES), is_map_folder=False)

    def read(self, picture: Picture, kind: str, size: tuple[int, int] | None = None) -> Image:
        """A picture of the frame around one of the main kind, scaled to rows and columns where these are given."""
        image: Image = self._recording.frame(picture).images[kind]
        return image if size is None or size == image.shape[:2] else _scaled(image, size)

    def lazy(self, picture: Picture, kind: str, size: tuple[int, int], reader: Callable[[], Image]) -> FramePicture:
        """What a map holds for a picture of so many rows and columns, that a reader makes."""
        own = self._own(picture, kind)
        listed = self._recording.folder / f"{kind}.txt"
        return FramePicture(own.path, size, FileStamp.of(own.path), listed, own.line, self._shelf, reader)

    def _own(self, picture: Picture, kind: str) -> Picture:
        """The entry of that kind in the frame around a picture of the main kind."""
        if kind == self._recording.kind:
            return picture
        nearest = min(self._recording.pictures[kind], key=lambda other: abs(other.time - picture.time))
        assert abs(nearest.time - picture.time) <= MAX_OFFSET_S  # or the frame would not have it
        return nearest


def _scaled(image: Image, size: tuple[int, int]) -> Image:
    """A picture scaled to rows and columns by averaging areas."""
    import cv2

    return np.asarray(cv2.resize(image, size[::-1], interpolation=cv2.INTER_AREA), dtype=np.uint8)
