"""Passes of a node: the updates in a row that it is the nearest in."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from benchmarks.experiments.tracking import Tracked
from topoloc.types import Ints


def visits(nearest: Ints) -> list[slice]:
    """Each pass among the nearest nodes (U,) of a drive."""
    edges = [0, *(np.flatnonzero(np.diff(nearest)) + 1).tolist(), len(nearest)]
    return [slice(start, end) for start, end in pairwise(edges)]


def passed_unnamed(seen: Tracked) -> list[tuple[int, int]]:
    """Node and first update of each pass in which no update names the node."""
    passes = [(int(seen.nearest[visit.start]), visit) for visit in visits(seen.nearest)]
    return [(node, visit.start) for node, visit in passes if not (seen.said[visit] == node).any()]


def identified(seen: Tracked) -> float:
    """Share of the passes in which a normal destination, at the node passed, wins at least once."""
    own = (seen.kind == "normal") & seen.strict
    return float(np.mean([own[visit].any() for visit in visits(seen.nearest)]))
