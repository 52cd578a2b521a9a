"""Right and wrong nodes among an update's normal destinations: the image's answer before the tracker's."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from benchmarks.experiments.tracking import Tracked, right_nodes
from topoloc.geometry import Floats
from topoloc.metrics import Bools
from topoloc.topo_map import TopoMap


@dataclass(frozen=True)
class Rivals:
    """An entry an update (U,).

    Attributes:
        right: best match among the normal destinations that are right; 0 where there is none.
        wrong: the same of those that are wrong.
    """

    right: Floats
    wrong: Floats

    @property
    def aliased(self) -> Bools:
        """Whether a wrong destination matches better than the right one (5.2.5)."""
        return np.asarray((self.right > 0.0) & (self.wrong > self.right))

    @property
    def misled(self) -> Bools:
        """Whether there are normal destinations, and all of them are wrong (5.2.6)."""
        return np.asarray((self.right == 0.0) & (self.wrong > 0.0))


def rivals(seen: Tracked, topo_map: TopoMap) -> Rivals:
    """Those of a drive."""
    rows = []
    for is_right, step in zip(right_nodes(topo_map, seen.truth), seen.steps, strict=True):
        normal = ~step.destinations.virtual
        right, match = is_right[step.destinations.nodes[normal]], step.destinations.match[normal]
        rows.append((match[right].max(initial=0.0), match[~right].max(initial=0.0)))
    right_match, wrong_match = np.array(rows).reshape(-1, 2).T
    return Rivals(right_match, wrong_match)


def share_of(part: Bools, whole: Bools) -> float:
    """Share of the entries in ``whole`` that are in ``part``; NaN where there are none."""
    return float(part[whole].mean()) if whole.any() else float("nan")
