"""Pictures that show nothing: too dark, too bright, or all of one grey."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topoloc.types import Image

DARK_LEVEL = 15.0
"""A picture whose mean grey level is lower is dark."""
BRIGHT_LEVEL = 245.0
"""A picture whose mean grey level is higher is overexposed."""
FLAT_LEVEL = 4.0
"""A picture whose grey levels spread less (standard deviation) shows nothing."""


@dataclass(frozen=True)
class Flaw:
    """What is wrong with a picture, and what to do."""

    what: str
    remedy: str


def flaw_of(picture: Image) -> Flaw | None:
    """Why a picture shows nothing, or None."""
    grey = np.asarray(picture.reshape(*picture.shape[:2], -1).mean(axis=2))
    mean, spread = float(grey.mean()), float(grey.std())
    if mean < DARK_LEVEL:
        return Flaw("is very dark", "look whether the lens was covered, or take it with more light")
    if mean > BRIGHT_LEVEL:
        return Flaw("is overexposed", "take it with a shorter exposure")
    if spread < FLAT_LEVEL:
        return Flaw("is all of one grey", "look whether the lens was covered or fogged")
    return None
