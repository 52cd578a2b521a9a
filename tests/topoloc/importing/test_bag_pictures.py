"""Encodings of ROS become pictures: each colour where it belongs, paddings and byte orders undone."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest

from topoloc.importing.bags.pictures import COMPRESSED, ENCODINGS, RAW, taken
from topoloc.types import Image

COLOUR = np.array([200, 120, 40], dtype=np.uint8)
"""Red, green, blue: no two alike, so that exchanged ones show."""


def message(data: bytes, encoding: str, columns: int, step: int, rows: int = 4, big: bool = False) -> Any:
    numbers = np.frombuffer(data, dtype=np.uint8)
    return SimpleNamespace(
        height=rows, width=columns, encoding=encoding, is_bigendian=int(big), step=step, data=numbers
    )


def plain() -> Image:
    """A picture (4, 6, 3) of one colour."""
    return np.tile(COLOUR, (4, 6, 1))


def sent_as(encoding: str) -> bytes:
    """The plain picture in an encoding, little endian."""
    red, green, blue = (int(level) for level in COLOUR)
    if encoding.startswith("bayer_"):
        colours = {"r": red, "g": green, "b": blue}
        tile = np.array([colours[letter] for letter in encoding[6:10]]).reshape(2, 2)
        levels = np.tile(tile, (2, 3))
        return levels.astype("<u2").__mul__(256).tobytes() if encoding.endswith("16") else levels.astype("u1").tobytes()
    if encoding in ("yuv422", "uyvy", "yuv422_yuy2", "yuyv"):  # BT.601 for video, by its definition
        y = 16 + (65.738 * red + 129.057 * green + 25.064 * blue) / 256
        u = 128 + (-37.945 * red - 74.494 * green + 112.439 * blue) / 256
        v = 128 + (112.439 * red - 94.154 * green - 18.285 * blue) / 256
        pair = [u, y, v, y] if encoding in ("yuv422", "uyvy") else [y, u, y, v]
        return np.tile(np.rint(pair).astype(np.uint8), 12).tobytes()
    order = {"r": [red, green, blue], "b": [blue, green, red], "8": [blue, green, red]}[encoding[0]]
    channels = [*order, 255] if "a" in encoding or encoding == "8UC4" else order
    pixels = np.tile(np.array(channels), (24, 1))
    return (pixels * 256).astype("<u2").tobytes() if encoding.endswith("16") else pixels.astype(np.uint8).tobytes()


@pytest.mark.parametrize("encoding", sorted(set(ENCODINGS) - {"mono8", "8UC1", "mono16", "16UC1"}))
def test_colours_come_where_they_belong(encoding: str) -> None:
    data = sent_as(encoding)
    picture = taken(RAW, message(data, encoding, 6, len(data) // 4))
    assert isinstance(picture.data, np.ndarray) and picture.data.dtype == np.uint8
    assert (picture.data.shape, picture.width, picture.height, picture.suffix) == ((4, 6, 3), 6, 4, ".png")
    assert np.abs(picture.data.astype(int) - plain()).max() <= 2


@pytest.mark.parametrize("whole", [True, False])
def test_the_padding_of_rows_is_left_out(whole: bool) -> None:
    pixels = np.random.default_rng(1).integers(0, 256, (4, 6, 3)).astype(np.uint8)
    padded = np.full((4, 25), 77, dtype=np.uint8)
    padded[:, :18] = pixels.reshape(4, 18)
    data = padded.tobytes() if whole else padded.tobytes()[:-7]
    assert np.array_equal(taken(RAW, message(data, "rgb8", 6, 25)).data, pixels)


def test_grey_keeps_its_sixteen_bits_in_either_byte_order() -> None:
    levels = np.random.default_rng(2).integers(0, 65536, (4, 6)).astype(np.uint16)
    for order, big in (("<", False), (">", True)):
        picture = taken(RAW, message(levels.astype(f"{order}u2").tobytes(), "mono16", 6, 12, big=big))
        assert isinstance(picture.data, np.ndarray) and picture.data.dtype == np.uint16
        assert (picture.data == levels).all()


def test_depth_is_in_units_of_the_recording() -> None:
    metres = np.array([[1.0, 2.5, np.nan], [np.inf, -1.0, 13.2]], dtype=np.float32)
    expected = [[5000, 12500, 0], [0, 0, 0]]
    assert np.array_equal(taken(RAW, message(metres.tobytes(), "32FC1", 3, 12, 2), depth=True).data, expected)
    millimetres = np.array([[1000, 2500, 0], [0, 0, 13200]], dtype=np.uint16)
    assert np.array_equal(taken(RAW, message(millimetres.tobytes(), "16UC1", 3, 6, 2), depth=True).data, expected)


@pytest.mark.parametrize(
    ("sent", "why"),
    [
        (message(bytes(71), "rgb8", 6, 18), "its data is cut off"),
        (message(bytes(72), "rgb8", 6, 17), "its step is 17 bytes, but a row has 18"),
        (message(b"", "rgb8", 0, 0), "it is empty"),
        (message(bytes(72), "yuv422", 5, 10), "its size does not fit its encoding"),
        (message(bytes(72), "nv21", 6, 18), "the encoding 'nv21' is not read"),
    ],
)
def test_what_cannot_be_read_says_why(sent: Any, why: str) -> None:
    with pytest.raises(ValueError, match=why):
        taken(RAW, sent)


def compressed(data: bytes, told: str = "jpeg") -> Any:
    return SimpleNamespace(format=told, data=np.frombuffer(data, dtype=np.uint8))


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
def test_encoded_pictures_stay_as_they_are(suffix: str) -> None:
    data = bytes(cv2.imencode(suffix, plain())[1])
    picture = taken(COMPRESSED, compressed(data, "bgr8; whatever it says"))
    assert (picture.data, picture.suffix, picture.width, picture.height) == (data, suffix, 6, 4)


def test_other_formats_become_pixels() -> None:
    data = bytes(cv2.imencode(".bmp", plain()[:, :, ::-1])[1])
    picture = taken(COMPRESSED, compressed(data, "bmp"))
    assert np.array_equal(picture.data, plain()) and picture.suffix == ".png"


def test_an_encoded_picture_that_is_cut_off() -> None:
    noise = np.random.default_rng(3).integers(0, 256, (48, 64, 3)).astype(np.uint8)
    for suffix in (".jpg", ".png"):
        data = bytes(cv2.imencode(suffix, noise)[1])
        with pytest.raises(ValueError, match="cut off or of a format that is not read"):
            taken(COMPRESSED, compressed(data[: len(data) // 2]))
    with pytest.raises(ValueError, match="compressedDepth is not read"):
        taken(COMPRESSED, compressed(b"x", "16UC1; compressedDepth png"))
