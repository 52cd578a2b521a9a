"""Files are written whole or not at all, and images are read with an error that names the file."""

from __future__ import annotations

import csv
import io
import os
import re
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from topoloc.errors import InputError, OutputExists, UnreadableImage, UserError
from topoloc.types import Depth, Image, Pixels

PICTURE_ENDINGS = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".ppm")
"""Files that end so, in small letters or capitals, are taken for pictures where a folder is looked through."""
RESTORE = "restore the image or its entry"
"""What to do about a picture that cannot be read."""


def pictures_in(folder: Path) -> list[Path]:
    """The picture files of a folder, 2.jpg before 10.jpg, as cameras number them."""
    return sorted((path for path in folder.iterdir() if path.suffix.lower() in PICTURE_ENDINGS), key=_in_order)


def _in_order(path: Path) -> list[tuple[int, str]]:
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"(\d+)", path.name)]


@contextmanager
def _plain_os_errors(path: Path) -> Iterator[None]:
    """Turn the system's refusals (full disk, no permission) into one clear line."""
    try:
        yield
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise UserError(f"{path}: cannot be written ({reason}); choose a place with room, yours to write to") from error


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file whole: a temporary file beside it, flushed to disk, then renamed over it."""
    with _plain_os_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            Path(name).chmod(0o666 & ~umask())
            Path(name).replace(path)
        except BaseException:
            Path(name).unlink(missing_ok=True)
            raise


def umask() -> int:
    """The process's umask: files made by ``mkstemp`` are private until given the usual mode."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 text file whole."""
    write_bytes(path, text.encode())


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a CSV file whole, one header line first."""
    buffer = io.StringIO(newline="")
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    write_text(path, buffer.getvalue())


@contextmanager
def new_folder(path: Path, overwrite: bool = False, owned: Sequence[str] = ()) -> Iterator[Path]:
    """A folder that appears whole or not at all: yields a temporary sibling that is renamed to ``path`` at the end.

    With ``overwrite``, entries of the same names are replaced, those that are ``owned`` but were not written again
    are removed, since they belong to what was there before, and all others in ``path`` stay.

    Raises:
        OutputExists: ``path`` is a file, or a folder that holds something, and ``overwrite`` is not set.
    """
    refuse_to_overwrite(path, overwrite)
    with _plain_os_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
        temporary.chmod(0o777 & ~umask())
    try:
        yield temporary  # what goes wrong here is not for this place to explain
        with _plain_os_errors(path):
            _move_into(temporary, path, owned)
    except BaseException:
        shutil.rmtree(temporary, ignore_errors=True)
        raise


def _move_into(temporary: Path, path: Path, owned: Sequence[str]) -> None:
    """Rename a finished folder to ``path``; where that exists, replace only the entries of the same or owned names."""
    if not path.exists():
        temporary.replace(path)
        return
    for name in owned:
        (path / name).unlink(missing_ok=True)
    for entry in temporary.iterdir():
        target = path / entry.name
        if target.is_dir():
            shutil.rmtree(target)
        entry.replace(target)
    temporary.rmdir()


def refuse_to_overwrite(path: Path, overwrite: bool = False) -> None:
    """Raise ``OutputExists`` for a file, or a folder that holds something; ``overwrite`` allows both."""
    with _plain_os_errors(path):
        if overwrite or not path.exists() or (path.is_dir() and not any(path.iterdir())):
            return
    raise OutputExists(path)


def read_text(path: Path, remedy: str) -> str:
    """The text of a file, UTF-8; a missing or unreadable one is an ``InputError`` with this remedy."""
    try:
        return path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise InputError(path, "no such file", remedy) from None
    except UnicodeDecodeError:
        raise InputError(path, "is not a text file in UTF-8", remedy) from None
    except (OSError, ValueError) as error:
        raise InputError(path, f"cannot be read ({reason(error)})", remedy) from None


def reason(error: OSError | ValueError) -> str:
    """Why a path cannot be opened; a ValueError is what a NUL in it raises."""
    return getattr(error, "strerror", None) or str(error)


def read_image(path: Path) -> Image:
    """An image file as uint8 (rows, cols, 3) in RGB order.

    Raises:
        UnreadableImage: the file is missing or does not decode.
    """
    return as_rgb(_decoded(path))


def as_rgb(levels: Pixels) -> Image:
    """What ``decode_image`` gives, as uint8 (rows, cols, 3): of 16 bits a pixel the upper eight."""
    if levels.ndim == 2:
        grey = (levels >> 8).clip(0, 255).astype(np.uint8)
        return np.repeat(grey[:, :, None], 3, axis=2)
    return levels.astype(np.uint8, copy=False)


def read_depth(path: Path) -> Depth:
    """A depth picture, 16-bit grey, as uint16 (rows, cols), every bit as it stands in the file.

    Raises:
        UnreadableImage: the file is missing or does not decode.
        InputError: it decodes, but is no grey picture of 16 bits.
    """
    levels = _decoded(path)
    if levels.ndim != 2 or levels.min(initial=0) < 0 or levels.max(initial=0) > np.iinfo(np.uint16).max:
        raise InputError(path, "is no grey picture of 16 bits", "save depth as 16-bit PNG, 5000 units a metre")
    return levels.astype(np.uint16)


def _decoded(path: Path) -> Pixels:
    """The pixels of an image file, upright: RGB (rows, cols, 3) uint8; grey of more than 8 bits (rows, cols) int64."""
    try:
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        raise UnreadableImage(path, f"cannot be read ({reason(error)})", RESTORE) from None
    return decode_image(data, path, "save it again as PNG or JPEG")


def decode_image(data: bytes, name: Path, remedy: str) -> Pixels:
    """The pixels of an encoded image, upright: RGB (rows, cols, 3) uint8; grey of over 8 bits (rows, cols) int64.

    Args:
        data: of a file, or of a message.
        name: of the picture, for the error.
        remedy: what to do about one that does not decode.

    Raises:
        UnreadableImage: it does not decode.
    """
    from PIL import Image as Pictures  # here, because importing topoloc loads numpy and scipy only
    from PIL import ImageOps

    try:
        with Pictures.open(io.BytesIO(data)) as picture:
            upright = ImageOps.exif_transpose(picture)
            if upright.mode.startswith("I"):
                return np.asarray(upright).astype(np.int64)
            return np.asarray(upright.convert("RGB"), dtype=np.uint8)
    except (OSError, ValueError, SyntaxError, Pictures.DecompressionBombError):
        raise UnreadableImage(name, "does not decode as an image", remedy) from None


def write_image(path: Path, image: Image | Depth) -> None:
    """Write an image, grey (rows, cols) or RGB (rows, cols, 3), whole, in the format of the file's ending.

    A uint16 one, as depth is, keeps its 16 bits; that takes a PNG.
    """
    import cv2

    if image.dtype == np.uint16 and path.suffix.lower() != ".png":  # others would drop eight of them without a word
        raise UserError(f"{path}: a picture of 16 bits keeps them only as PNG; end the name in .png")
    pixels = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2BGR)
    try:
        done, data = cv2.imencode(path.suffix, pixels)
    except cv2.error:
        done, data = False, np.zeros(0, dtype=np.uint8)
    if not done:
        raise UserError(f"{path}: no image format is called {path.suffix!r}; end the name in .png or .jpg")
    write_bytes(path, data.tobytes())
