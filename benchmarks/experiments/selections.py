"""Ways to choose the next look that the choice by least entropy is held against."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from topoloc.active import Action
from topoloc.types import WeightedPoses


class InTurn:
    """Takes the first of the actions: fixed steps, in the order that they are listed in."""

    def choose(self, belief: WeightedPoses, actions: Sequence[Action]) -> int:
        """0."""
        return 0


class ByLot:
    """Takes any one of the actions."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng

    def choose(self, belief: WeightedPoses, actions: Sequence[Action]) -> int:
        """Drawn evenly."""
        return int(self._rng.integers(len(actions)))
