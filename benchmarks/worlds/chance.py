"""Every kind of chance in a world has a generator of its own, so that one change leaves all else as it was."""

from __future__ import annotations

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What is left to chance."""

    TEXTURES = 1
    FURNITURE = 2
    LATER = 3
    MAP = 4
    PATH = 5
    ODOMETER = 6
    PEOPLE = 7
    COVER = 8
    FRAME = 9
    SHAKE = 10
    NOISE = 11
    PATCHES = 12
    MEASUREMENT = 13


def generator(seed: int, stream: Stream, *numbers: int) -> np.random.Generator:
    """The generator of a stream, and of one of its parts where ``numbers`` tell which."""
    return np.random.default_rng([seed, stream, len(numbers), *numbers])  # numpy pads with zeros: lengths must differ
