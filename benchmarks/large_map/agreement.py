"""What sensors take the queries of a large map for, and how often two of them agree."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray

from benchmarks.large_map.making import CONDITIONS, PLACES, LargeMap
from topoloc.geometry import Floats
from topoloc.interfaces import Sensor
from topoloc.types import Evidence, Frame, Ints

SURE = 0.5
"""The thesis's eps_M: a best match above it would make a destination."""
AS_GOOD = 0.01
"""A best match at most this far below the exact one is as good."""
NO_NODE = -1
"""What a blind frame is taken for."""
Z_95 = 1.96
"""Of a 95 % interval."""
Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Share:
    """How many of how many.

    Attributes:
        hits: that many.
        of: so many.
    """

    hits: int
    of: int

    @property
    def value(self) -> float:
        """The share; NaN of none."""
        return self.hits / self.of if self.of else float("nan")

    @property
    def interval(self) -> tuple[float, float]:
        """Wilson's 95 % interval; of none, from 0 to 1."""
        if not self.of:
            return 0.0, 1.0
        squared = Z_95**2 / self.of
        middle = (self.value + squared / 2.0) / (1.0 + squared)
        half = np.sqrt(squared * self.value * (1.0 - self.value) + squared**2 / 4.0) / (1.0 + squared)
        return max(0.0, float(middle - half)), min(1.0, float(middle + half))

    def row(self) -> dict[str, float]:
        """The share for JSON, with its interval."""
        low, high = self.interval
        return {**asdict(self), "low": round(low, 4), "high": round(high, 4)}


@dataclass(frozen=True)
class Answers:
    """What the queries are taken for, by one sensor.

    Attributes:
        best: (Q,) index of the node of the best match, ``NO_NODE`` for a blind frame.
        match: (Q,) that match, 0 for a blind frame.
    """

    best: Ints
    match: Floats


@dataclass(frozen=True)
class Agreement:
    """Coarse beside exact IMA on some queries.

    Attributes:
        same: queries for which both name the same best node.
        same_if_sure: of those whose exact best match exceeds ``SURE``.
        same_if_right: of those whose exact best node is right.
        same_under: of those under each condition.
        as_good: queries whose coarse best match is at most ``AS_GOOD`` below the exact one, on whatever node.
        right_exact, right_coarse: queries whose best node is at most one spacing from the true one.
    """

    same: Share
    same_if_sure: Share
    same_if_right: Share
    same_under: Mapping[str, Share]
    as_good: Share
    right_exact: Share
    right_coarse: Share

    def row(self) -> dict[str, object]:
        """The agreement for JSON."""
        shares = {name: value.row() for name, value in vars(self).items() if isinstance(value, Share)}
        return {**shares, "same_under": {name: share.row() for name, share in self.same_under.items()}}


def answers_of(sensor: Sensor, frames: Sequence[Frame]) -> Answers:
    """What a sensor takes each of the frames for."""
    best, match = zip(*(_best(sensor.observe(frame)) for frame in frames), strict=True)
    return Answers(np.array(best, dtype=np.int64), np.array(match))


def _best(evidence: Evidence) -> tuple[int, float]:
    if evidence.is_blind:
        return NO_NODE, 0.0
    best = int(evidence.match.argmax())
    return int(evidence.nodes[best]), float(evidence.match[best])


def right(large: LargeMap, best: Ints) -> Mask:
    """Whether (Q,) nodes are the true ones or at most one spacing away: the distance from the true node to its next."""
    positions = large.topo_map.positions
    spacing = large.spacing[large.nodes]
    away = np.linalg.norm(positions[best] - positions[large.nodes], axis=1)
    return np.asarray((best != NO_NODE) & (away <= spacing * (1.0 + 1e-9)))


def agreements(large: LargeMap, exact: Answers, coarse: Answers) -> dict[str, Agreement]:
    """For each of ``PLACES`` that there are queries at."""
    at = np.array(large.places)
    return {place: _agreement(large, exact, coarse, at == place) for place in PLACES if (at == place).any()}


def _agreement(large: LargeMap, exact: Answers, coarse: Answers, chosen: Mask) -> Agreement:
    """On the chosen ones (Q,) of the queries."""
    same, is_right = chosen & (coarse.best == exact.best), chosen & right(large, exact.best)
    sure, conditions = chosen & (exact.match > SURE), np.array(large.conditions)
    return Agreement(
        same=_share(same, chosen),
        same_if_sure=_share(same & sure, sure),
        same_if_right=_share(same & is_right, is_right),
        same_under={name: _share(same & (conditions == name), chosen & (conditions == name)) for name in CONDITIONS},
        as_good=_share(chosen & (coarse.match >= exact.match - AS_GOOD), chosen),
        right_exact=_share(is_right, chosen),
        right_coarse=_share(chosen & right(large, coarse.best), chosen),
    )


def _share(hits: Mask, of: Mask) -> Share:
    return Share(int(hits.sum()), int(of.sum()))
