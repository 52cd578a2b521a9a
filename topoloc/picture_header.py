"""The size of a picture from the ends of its file, in a hundredth of the time that decoding it takes."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

from topoloc.files import read_image

PNG_HEAD = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
PNG_TAIL = b"\0\0\0\0IEND\xaeB`\x82"
JPEG_TAIL = b"\xff\xd9"
MOST_PIXELS = 2**26
"""What claims to have more is decoded at once: the reader knows what is too much."""
_ORIENTATION = 0x0112
_SIDEWAYS = (5, 6, 7, 8)
"""Orientations of EXIF that exchange rows and columns."""
_TURNED_BY = {"exif", "Raw profile type exif", "XML:com.adobe.xmp"}
"""What a PNG may have beside its pixels that turns it upright."""


def size_of(path: Path) -> tuple[int, int]:
    """Rows and columns of the picture that ``read_image`` gives.

    PNG and JPEG files are not decoded: one that is cut off is known by its last bytes, one with wrong bytes in the
    middle is not noticed. All other files are decoded.

    Raises:
        UnreadableImage: as ``read_image`` does.
    """
    try:
        with path.open("rb", buffering=0) as file:
            head = file.read(64)
            file.seek(-min(len(head), len(PNG_TAIL)), 2)
            tail = file.read()
    except (OSError, ValueError):
        head = tail = b""  # read_image will say why
    size = _plain_png_size(head, tail) or _size_by_pillow(path, tail)
    if size is None:
        rows, columns = read_image(path).shape[:2]
        return rows, columns
    return size


def _plain_png_size(head: bytes, tail: bytes) -> tuple[int, int] | None:
    """Rows and columns of a whole PNG whose pixels follow right on its header, so that nothing says it is turned."""
    if not head.startswith(PNG_HEAD) or head[37:41] != b"IDAT" or tail != PNG_TAIL:
        return None
    columns, rows = struct.unpack(">II", head[16:24])
    if head[29:33] != struct.pack(">I", zlib.crc32(head[12:29])) or not 0 < rows * columns <= MOST_PIXELS:
        return None
    return rows, columns


def _size_by_pillow(path: Path, tail: bytes) -> tuple[int, int] | None:
    """Rows and columns of a whole PNG or JPEG, turned upright; None for what is not surely one."""
    if not (tail == PNG_TAIL or tail.endswith(JPEG_TAIL)):
        return None
    from PIL import Image as Pictures  # here, because importing topoloc loads numpy and scipy only

    try:
        with Pictures.open(path) as picture:
            columns, rows = picture.size
            if picture.format == "PNG" and not _TURNED_BY & picture.info.keys() and rows * columns <= MOST_PIXELS:
                return rows, columns
            if picture.format == "JPEG" and rows * columns <= MOST_PIXELS:
                sideways = picture.getexif().get(_ORIENTATION) in _SIDEWAYS
                return (columns, rows) if sideways else (rows, columns)
    except (OSError, ValueError, SyntaxError, Pictures.DecompressionBombError):
        pass  # read_image will say why
    return None
