"""Whether the settings that were chosen are better than the defaults, on folds that the choice never saw."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from topoloc.geometry import Floats

CHANCE = 0.10
"""A gain is told from chance where so few sign patterns of the folds' differences, or fewer, have as large a mean."""
MOST_SIGNS = 12
"""For more folds than this the sign patterns are not gone through: 2 to this power are drawn."""


@dataclass(frozen=True)
class Verdict:
    """Chosen settings beside the defaults on the same folds.

    Attributes:
        gains: (F,) how much better the choice made without a fold is on it: above 0 is better, in units of the score.
        chance: share of sign patterns of the gains whose mean is as large or larger: the exact one-sided test by
            random signs (Fisher's). With F folds it is 2^-F at least.
    """

    gains: Floats
    chance: float

    @property
    def better(self) -> bool:
        """The gain is above 0 and can be told from chance."""
        return self.gain > 0.0 and self.chance <= CHANCE

    @property
    def gain(self) -> float:
        """Mean over the folds."""
        return float(self.gains.mean())

    @property
    def spread(self) -> float:
        """Standard deviation over the folds."""
        return float(self.gains.std(ddof=1))

    @property
    def words(self) -> str:
        """What to do, in a sentence."""
        count = len(self.gains)
        if not self.gain > 0.0:
            return "keep the defaults: chosen settings do no better on folds that they were not chosen on"
        if self.better:
            return f"take the proposal: its gain can be told from chance (p = {self.chance:.2g}, {count} folds)"
        if 0.5**count > CHANCE:
            return f"keep the defaults, or record more laps: {count} folds cannot tell a gain from chance; 4 may"
        return f"keep the defaults: the gain cannot be told from chance (p = {self.chance:.2g}, {count} folds)"


def verdict_of(chosen: Floats, default: Floats, higher_is_better: bool) -> Verdict:
    """Compare scores (F,) on held-out folds with those of the defaults (F,); F >= 2.

    A fold on which one has no score counts as a gain or loss of 0 where both have none; else the whole comparison
    fails: its chance is 1.
    """
    gains = (chosen - default) * (1.0 if higher_is_better else -1.0)
    gains = np.where(np.isnan(chosen) & np.isnan(default), 0.0, gains)
    if not np.isfinite(gains).all():
        return Verdict(gains, 1.0)
    means = _signs(len(gains)) @ gains / len(gains)
    return Verdict(gains, float((means >= gains.mean() - 1e-12).mean()))


def _signs(count: int) -> Floats:
    """Rows of signs (N, count): every pattern, or drawn ones."""
    if count <= MOST_SIGNS:
        return np.array(list(product((1.0, -1.0), repeat=count)))
    return np.random.default_rng(0).choice([1.0, -1.0], size=(2**MOST_SIGNS, count))
