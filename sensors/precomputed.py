"""Vectors that somebody computed beforehand, in ``.npy`` files: of a map's views in order, of frames by their times."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from zipfile import BadZipFile

import numpy as np

from topoloc.errors import InputError
from topoloc.files import read_text
from topoloc.geometry import Floats

SAME_TIME_S = 1e-3
"""A frame's row is the one whose time differs by at most this [s]."""


def read_vectors(path: Path) -> Floats:
    """The rows (N, D) of a ``.npy`` file.

    Raises:
        InputError: it is missing, is no such file, is not two-dimensional, or holds what is no finite number.
    """
    remedy = "write it with numpy.save, a row a picture"
    try:
        vectors = np.load(path, allow_pickle=False)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror or 'cut off'})", remedy) from None
    except (ValueError, EOFError, MemoryError, BadZipFile, TokenError):  # whatever a broken header makes numpy do
        raise InputError(path, "is no .npy file of numbers", remedy) from None
    if not isinstance(vectors, np.ndarray) or vectors.dtype.kind not in "fiu":
        raise InputError(path, "is no .npy file of numbers", remedy)
    if vectors.ndim != 2 or 0 in vectors.shape:
        shape = " x ".join(map(str, vectors.shape))
        raise InputError(path, f"is an array of {shape or 'no dimensions'}", "write one of pictures x numbers")
    bad = np.flatnonzero(~np.isfinite(vectors).all(axis=1))
    if len(bad):
        raise InputError(path, f"row {bad[0]} holds what is no finite number", "compute it again")
    return np.asarray(vectors)


@dataclass(frozen=True)
class FrameVectors:
    """Vectors of a recording's frames.

    Attributes:
        times: (N,) [s], increasing.
        vectors: (N, D).
        source: file of the times, for messages.
    """

    times: Floats
    vectors: Floats
    source: Path

    @classmethod
    def read(cls, vectors: Path, times: Path) -> FrameVectors:
        """From a ``.npy`` file and the times of its rows, as ``rgb.txt`` has them.

        Raises:
            InputError: a file cannot be used, or there are not as many times as rows.
        """
        rows, moments = read_vectors(vectors), _read_times(times)
        if len(rows) != len(moments):
            raise InputError(vectors, f"has {len(rows)} rows, and {times} {len(moments)} times", "write a row for each")
        return cls(moments, rows, times)

    def at(self, time: float) -> Floats:
        """The vector (D,) of the frame of a time [s]. Raises ``InputError`` where there is none."""
        after = int(np.searchsorted(self.times, time))
        near = [row for row in (after - 1, after) if 0 <= row < len(self.times)]
        row = min(near, key=lambda one: abs(self.times[one] - time))
        if abs(self.times[row] - time) > SAME_TIME_S:
            raise InputError(
                self.source, f"has no line for the frame at {time:.6f}", "give every frame of the recording a row"
            )
        return np.asarray(self.vectors[row])


def _read_times(path: Path) -> Floats:
    """(N,) the first word of each line, which must increase; empty lines and comments are left out."""
    times: list[float] = []
    for line, text in enumerate(read_text(path, "name a file of a time a row, such as rgb.txt").splitlines(), start=1):
        word = (text.split() or ["#"])[0]
        if word.startswith("#"):
            continue
        try:
            time = float(word)
        except ValueError:
            time = float("nan")
        if not np.isfinite(time) or (times and time <= times[-1]):
            raise InputError(path, f"{word!r} is no time after those before it", "correct the line", line=line)
        times.append(time)
    return np.array(times)
