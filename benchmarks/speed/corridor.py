"""A grid of one dimension beside filterpy's ``discrete_bayes``: a robot that drives to and fro in a corridor.

Our grid knows no single row: it carries its fewest headings, four, and two rows of cells, with all mass in one row
and one heading. In more dimensions than one ``discrete_bayes.update`` is wrong, so there is no fuller comparison.
"""

from __future__ import annotations

from functools import partial
from itertools import cycle

import numpy as np

from benchmarks.speed.agreement import same_masses
from benchmarks.speed.case import Case, Pair
from estimators.markov import MarkovGrid
from topoloc.geometry import Floats
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

SIZE = 0.25
"""Side of a cell [m]."""
STEP = 3
"""Cells of a step."""
VARIANCE = 0.3
"""Of its noise [cells^2]."""
KERNEL = np.array([VARIANCE / 2.0, 1.0 - VARIANCE, VARIANCE / 2.0])
CHECKED_STEPS = 10


def corridor_step(cells: int) -> Case:
    """Predict and update of ours beside filterpy's.

    Args:
        cells: length of the corridor, two of them beyond its end nodes.
    """
    return Case("estimators", "grid-1d", f"{cells:,} cells in a row", "filterpy", ("filterpy",), partial(_pair, cells))


def _pair(cells: int) -> Pair:
    return Pair(OurCorridor(cells).step, FilterpyCorridor(cells).step, partial(_agree, cells))


def _agree(cells: int) -> bool:
    ours, peers = OurCorridor(cells), FilterpyCorridor(cells)
    for _ in range(CHECKED_STEPS):
        ours.step()
        peers.step()
    return same_masses(ours.mass, peers.mass)


def _seen(cells: int) -> Evidence:
    """One broad hypothesis at the start, its heading unknown."""
    one = np.ones(1)
    pose = np.array([[_centres(cells)[cells // 2], SIZE / 2.0, 0.0]])
    return Evidence(pose, np.zeros(1, dtype=int), one, 0.0 * one, 2.0 * one, 5.0 * SIZE * one, 0.0 * one)


def _centres(cells: int) -> Floats:
    """(cells,) along the corridor; the first lies before the first node [m]."""
    return np.asarray((np.arange(cells) - 0.5) * SIZE)


class OurCorridor:
    """Ours, which starts in the middle."""

    def __init__(self, cells: int) -> None:
        nodes = (Node("a", "a", 0.0, 0.0), Node("b", "b", (cells - 2) * SIZE, 0.0))
        self._cells, self._seen = cells, _seen(cells)
        self._grid = MarkovGrid(MarkovGrid.Config(resolution_m=SIZE, reach_m=SIZE, headings=4, recovery=0.0))
        start = WeightedPoses.uniform(self._seen.poses)
        self._grid.reset(TopoMap("corridor", Camera(), nodes), np.random.default_rng(0), start)
        noise = np.diag([VARIANCE * SIZE**2, 0.0, 0.0])
        self._motions = cycle([Motion(np.array([way * STEP * SIZE, 0.0, 0.0]), noise) for way in (1, -1)])

    def step(self) -> None:
        """Move and look."""
        self._grid.predict(next(self._motions))
        self._grid.update(self._seen)

    @property
    def mass(self) -> Floats:
        """(cells,) along the corridor, sums to one."""
        belief = self._grid.belief
        cell = np.rint(belief.poses[:, 0] / SIZE + 0.5).astype(int)
        return np.asarray(np.bincount(cell, weights=belief.weights, minlength=self._cells), dtype=np.float64)


class FilterpyCorridor:
    """The peer's, which starts in the middle.

    Attributes:
        mass: (cells,), sums to one.
    """

    def __init__(self, cells: int) -> None:
        self._seen, self._places = _seen(cells), np.column_stack([_centres(cells), np.full(cells, SIZE / 2.0)])
        self.mass = np.zeros(cells)
        self.mass[cells // 2] = 1.0
        self._steps = cycle([STEP, -STEP])

    def step(self) -> None:
        """Move and look."""
        from filterpy import discrete_bayes

        predicted = discrete_bayes.predict(self.mass, next(self._steps), KERNEL, mode="constant")
        likelihood = np.exp(self._seen.log_likelihood(self._places, np.zeros((1, 1)))[:, 0])
        self.mass = discrete_bayes.update(likelihood, predicted)
