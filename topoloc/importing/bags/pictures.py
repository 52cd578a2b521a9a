"""Pictures as ROS sends them -> files or pixels as a recording keeps them."""

from __future__ import annotations

import io
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from topoloc.types import DEPTH_UNITS_PER_M, Depth, Image, Pixels

RAW, COMPRESSED = "sensor_msgs/Image", "sensor_msgs/CompressedImage"
KEPT = ((b"\xff\xd8\xff", ".jpg"), (b"\x89PNG\r\n\x1a\n", ".png"))
"""First bytes of the files that are kept as they are, and how their names end."""
CUT_OFF = "its data is cut off"
BAYER = ("rggb", "bggr", "gbrg", "grbg")
"""Colours of the first two pixels of the first two rows, as ROS and OpenCV 4 name them."""


@dataclass(frozen=True)
class Taken:
    """A picture: an encoded file or pixels, how its name ends, and its size in pixels."""

    data: bytes | Pixels
    suffix: str
    width: int
    height: int


@dataclass(frozen=True)
class Layout:
    """How an encoding of ``sensor_msgs/Image`` lies in memory, and what makes a picture of it.

    Attributes:
        dtype: of a number, without byte order.
        channels: numbers a pixel; a yuv422 pixel has two.
        picture: from (rows, cols[, channels]) to RGB or grey.
    """

    dtype: str
    channels: int
    picture: Callable[[Pixels], Pixels]


def _converted(code: str) -> Callable[[Pixels], Pixels]:
    """A conversion of OpenCV's, by its name without ``COLOR_``; of 16 bits the upper eight are taken."""

    def convert(levels: Pixels) -> Pixels:
        import cv2

        try:
            return np.asarray(cv2.cvtColor(_eight_bits(levels), getattr(cv2, f"COLOR_{code}")))
        except cv2.error:  # an odd number of columns, where two pixels share their colour
            raise ValueError("its size does not fit its encoding") from None

    return convert


def _eight_bits(levels: Pixels) -> Image:
    return np.ascontiguousarray(levels >> 8 if levels.dtype == np.uint16 else levels).astype(np.uint8, copy=False)


def _as_it_is(levels: Pixels) -> Pixels:
    return levels


def _depth(metres: Pixels) -> Depth:
    """Distances (rows, cols) [m] in units of 1/5000 m; 0, unknown, for what is no number or farther than 13.1 m."""
    units = np.nan_to_num(metres * float(DEPTH_UNITS_PER_M), nan=0.0, posinf=0.0, neginf=0.0)
    return np.where((units > 0.0) & (units <= np.iinfo(np.uint16).max), np.rint(units), 0.0).astype(np.uint16)


ENCODINGS: Mapping[str, Layout] = {
    "rgb8": Layout("u1", 3, _as_it_is),
    "bgr8": Layout("u1", 3, _converted("BGR2RGB")),
    "8UC3": Layout("u1", 3, _converted("BGR2RGB")),
    "rgba8": Layout("u1", 4, _converted("RGBA2RGB")),
    "bgra8": Layout("u1", 4, _converted("BGRA2RGB")),
    "8UC4": Layout("u1", 4, _converted("BGRA2RGB")),
    "rgb16": Layout("u2", 3, _eight_bits),
    "bgr16": Layout("u2", 3, _converted("BGR2RGB")),
    "mono8": Layout("u1", 1, _as_it_is),
    "8UC1": Layout("u1", 1, _as_it_is),
    "mono16": Layout("u2", 1, _as_it_is),
    "16UC1": Layout("u2", 1, _as_it_is),
    **{f"bayer_{order}8": Layout("u1", 1, _converted(f"Bayer{order.upper()}2RGB")) for order in BAYER},
    **{f"bayer_{order}16": Layout("u2", 1, _converted(f"Bayer{order.upper()}2RGB")) for order in BAYER},
    **{name: Layout("u1", 2, _converted("YUV2RGB_UYVY")) for name in ("yuv422", "uyvy")},
    **{name: Layout("u1", 2, _converted("YUV2RGB_YUYV")) for name in ("yuv422_yuy2", "yuyv")},
}  # fmt: skip
"""What ``sensor_msgs/image_encodings`` names and is read; a single number a pixel of 16 bits stays so."""
DEPTHS: Mapping[str, Layout] = {
    "16UC1": Layout("u2", 1, lambda levels: _depth(levels / 1000.0)),
    "mono16": Layout("u2", 1, lambda levels: _depth(levels / 1000.0)),
    "32FC1": Layout("f4", 1, _depth),
}
"""Depth by REP 118: millimetres as whole numbers, metres as others."""


def taken(kind: str, message: Any, depth: bool = False) -> Taken:
    """The picture in a message.

    Args:
        kind: ``sensor_msgs/Image`` or ``sensor_msgs/CompressedImage``.
        message: its fields.
        depth: it is a depth picture.

    Raises:
        ValueError: why it cannot be read.
    """
    if kind == COMPRESSED:
        return _kept(np.asarray(message.data).tobytes(), message.format, depth)
    layouts = DEPTHS if depth else ENCODINGS
    if message.encoding not in layouts:
        raise ValueError(f"the encoding {message.encoding!r} is not read")
    layout = layouts[message.encoding]
    pixels = layout.picture(_levels(message, layout))
    return Taken(pixels, ".png", pixels.shape[1], pixels.shape[0])


def _levels(message: Any, layout: Layout) -> Pixels:
    """The numbers (rows, cols[, channels]) of an image, the padding of its rows left out."""
    rows, columns, step = int(message.height), int(message.width), int(message.step)
    used = columns * layout.channels * np.dtype(layout.dtype).itemsize
    if not used * rows:
        raise ValueError("it is empty")
    if step < used:
        raise ValueError(f"its step is {step} bytes, but a row has {used}")
    data = np.asarray(message.data).view(np.uint8)
    if len(data) < (rows - 1) * step + used:
        raise ValueError(CUT_OFF)
    padded = np.zeros(rows * step, dtype=np.uint8)  # some leave out the padding of the last row
    padded[: len(data)] = data[: rows * step]
    order = ">" if message.is_bigendian else "<"
    levels = np.ascontiguousarray(padded.reshape(rows, step)[:, :used]).view(f"{order}{layout.dtype}")
    shape = (rows, columns) if layout.channels == 1 else (rows, columns, layout.channels)
    return levels.astype(layout.dtype).reshape(shape)


def _kept(data: bytes, told: str, depth: bool) -> Taken:
    """An encoded picture: JPEG and PNG as they are, others as pixels."""
    from PIL import Image as Pictures

    if "compresseddepth" in told.lower():
        raise ValueError("compressedDepth is not read; republish it as sensor_msgs/Image")
    if depth:
        raise ValueError("compressed depth is not read; republish it as sensor_msgs/Image")
    try:
        with Pictures.open(io.BytesIO(data)) as picture:
            picture.load()  # all of it: what is cut off shows here
            suffix = next((ending for sign, ending in KEPT if data.startswith(sign)), None)
            kept: bytes | Pixels = data if suffix else np.asarray(picture.convert("RGB"), dtype=np.uint8)
            return Taken(kept, suffix or ".png", picture.width, picture.height)
    except (OSError, ValueError, SyntaxError, Pictures.DecompressionBombError):
        raise ValueError(f"its data is cut off or of a format that is not read ({told or 'no format told'})") from None
