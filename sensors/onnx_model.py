"""A network in an ONNX file as a function from picture to vector: by OpenCV or, where it is installed, onnxruntime."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from sensors.images import grey, resize
from topoloc.errors import InputError, UserError
from topoloc.geometry import Floats
from topoloc.types import Image

Runtime = Literal["opencv", "onnxruntime"]
Blob = NDArray[np.float32]
"""(1, channels, rows, columns)."""
Dims = list[int | None]
"""Of a network's input; None where it takes any length."""
VARINT, EIGHT_BYTES, COUNTED, FOUR_BYTES = 0, 1, 2, 5
"""Wire types of protobuf."""


@dataclass(frozen=True)
class Preparation:
    """How a picture becomes the network's input.

    Attributes:
        width, height: it is scaled to [pixels].
        channels: 3, in RGB order, or 1, grey.
        mean, std: taken off each channel, and divided by, where levels run from 0 to 1.
    """

    width: int
    height: int
    channels: int
    mean: tuple[float, ...]
    std: tuple[float, ...]

    def blob(self, image: Image) -> Blob:
        """A picture (rows, cols, 3) as float32 (1, channels, height, width)."""
        levels = resize(image if self.channels == 3 else grey(image), self.width, self.height)
        planes = levels.reshape(self.height, self.width, self.channels).transpose(2, 0, 1) / 255.0
        mean, std = (np.reshape(values, (-1, 1, 1)) for values in (self.mean or (0.0,), self.std or (1.0,)))
        return np.ascontiguousarray((planes - mean) / std, dtype=np.float32)[None]


class OnnxModel:
    """A network of one picture in and one vector out.

    Args:
        path: of the ONNX file.
        size: (width, height) that pictures are scaled to; 0: what the network says.
        mean, std: as in ``Preparation``.
        runtime: what runs it.

    Raises:
        UserError: the file cannot be used so.
    """

    def __init__(
        self,
        path: Path,
        size: tuple[int, int] = (0, 0),
        mean: tuple[float, ...] = (),
        std: tuple[float, ...] = (),
        runtime: Runtime = "opencv",
    ) -> None:
        dims, name = _input_of(path)
        self.preparation = _preparation(path, dims, size, mean, std)
        self._run = _with_opencv(path) if runtime == "opencv" else _with_onnxruntime(path, name)
        self(np.zeros((self.preparation.height, self.preparation.width, 3), np.uint8))  # what it cannot do shows now

    def __call__(self, image: Image) -> Floats:
        """The output (D,), flattened, for a picture (rows, cols, 3)."""
        return np.asarray(self._run(self.preparation.blob(image))).ravel()


def _preparation(
    path: Path, dims: Dims, size: tuple[int, int], mean: tuple[float, ...], std: tuple[float, ...]
) -> Preparation:
    """From what the network's input says and the settings do; they must not contradict each other."""
    if len(dims) != 4 or dims[1] not in (None, 1, 3):
        shown = " x ".join("any" if dim is None else str(dim) for dim in dims) or "nothing"
        raise InputError(path, f"its input is {shown}", "it must be pictures x 1 or 3 channels x rows x columns")
    sides = {}
    for side, own, wanted in (("width", dims[3], size[0]), ("height", dims[2], size[1])):
        if not own and not wanted:
            raise InputError(path, f"its input takes pictures of any {side}", f"set {side}")
        if own and wanted and own != wanted:
            raise InputError(path, f"its input has a {side} of {own}, not {wanted}", f"leave the setting {side} out")
        sides[side] = own or wanted
    channels = dims[1] or 3
    for name, values in (("mean", mean), ("std", std)):
        if len(values) not in (0, 1, channels):
            raise InputError(path, f"its input has {channels} channels, and {name} {len(values)} values", "correct it")
    return Preparation(sides["width"], sides["height"], channels, mean, std)


def _with_opencv(path: Path) -> Callable[[Blob], Any]:
    remedy = "correct it, or install onnxruntime and set runtime=onnxruntime"
    loud = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # what goes wrong is told once, below
    try:
        network = cv2.dnn.readNetFromONNX(str(path))
    except cv2.error as error:
        raise InputError(path, f"OpenCV cannot read it ({_short(error)})", remedy) from None
    finally:
        cv2.utils.logging.setLogLevel(loud)

    def run(blob: Blob) -> Any:
        try:
            network.setInput(blob)
            return network.forward()
        except cv2.error as error:
            raise InputError(path, f"OpenCV cannot run it ({_short(error)})", remedy) from None

    return run


def _with_onnxruntime(path: Path, name: str) -> Callable[[Blob], Any]:
    try:
        onnxruntime: Any = import_module("onnxruntime")
    except ModuleNotFoundError:
        raise UserError(f"{path}: runtime=onnxruntime needs the package 'onnxruntime'; install it with pip") from None
    options = onnxruntime.SessionOptions()
    options.log_severity_level = 4  # what goes wrong is told once, below
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
    except Exception as error:  # its errors have no base of their own
        raise InputError(path, f"onnxruntime cannot read it ({_short(error)})", "correct it") from None

    def run(blob: Blob) -> Any:
        try:
            return session.run(None, {name: blob})[0]
        except Exception as error:
            raise InputError(path, f"onnxruntime cannot run it ({_short(error)})", "correct it") from None

    return run


def _short(error: Exception) -> str:
    text = " ".join((getattr(error, "err", "") or str(error)).split())
    return text if len(text) <= 200 else f"{text[:197]}..."


def _input_of(path: Path) -> tuple[Dims, str]:
    """Dimensions and name of a network's only input; numbers of fields are those of onnx.proto.

    Raises:
        InputError: no such file, no ONNX, or more than one input or output.
    """
    try:
        data = memoryview(path.read_bytes())
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})", "name the ONNX file of the network") from None
    try:
        graph = _messages(data, 7)[0]
        held = {_text(tensor, 8) for tensor in _messages(graph, 5)}  # older files name their weights as inputs, too
        inputs = [value for value in _messages(graph, 11) if _text(value, 1) not in held]
        outputs = len(_messages(graph, 12))
        dims = [_length(dim) for value in inputs for dim in _messages(value, 2, 1, 2, 1)]
        name = _text(inputs[0], 1) if inputs else ""
    except (ValueError, IndexError):
        raise InputError(path, "is no ONNX file", "export the network as ONNX") from None
    if len(inputs) != 1 or outputs != 1:
        found = f"has {len(inputs)} inputs and {outputs} outputs"
        raise InputError(path, found, "export it with one picture in and one vector out")
    return dims, name


def _messages(data: memoryview, *path: int) -> list[memoryview]:
    """What the fields of these numbers, one within the other, hold in a message."""
    found = [data]
    for number in path:
        found = [
            value for part in found for key, value in _fields(part) if key == number and not isinstance(value, int)
        ]
    return found


def _text(message: memoryview, number: int) -> str:
    return bytes((_messages(message, number) or [memoryview(b"")])[0]).decode()


def _length(dim: memoryview) -> int | None:
    """Of one dimension; a name stands for any."""
    lengths = [value for key, value in _fields(dim) if key == 1 and isinstance(value, int) and value > 0]
    return lengths[0] if lengths else None


def _fields(data: memoryview) -> Iterator[tuple[int, int | memoryview]]:
    """Number and value of each field of a protobuf message; ``ValueError`` where it is none."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        kind = key & 7
        if kind == VARINT:
            value, at = _varint(data, at)
            yield key >> 3, value
            continue
        if kind == COUNTED:
            size, at = _varint(data, at)
        elif kind in (EIGHT_BYTES, FOUR_BYTES):
            size = 8 if kind == EIGHT_BYTES else 4
        else:
            raise ValueError("no such wire type")
        if at + size > len(data):
            raise ValueError("cut off")
        yield key >> 3, data[at : at + size]
        at += size


def _varint(data: memoryview, at: int) -> tuple[int, int]:
    """A number of seven bits a byte, the last of them below 128, and where it ends."""
    value = shift = 0
    while shift < 64:
        if at >= len(data):
            break
        value |= (data[at] & 127) << shift
        at += 1
        if data[at - 1] < 128:
            return value, at
        shift += 7
    raise ValueError("cut off")
