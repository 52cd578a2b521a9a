"""The grid beside the same done with scipy and numpy.

Its predict: whole cells of motion, then a blur along x, y and heading. Its update: Bayes' rule with some recovery.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.ndimage import correlate1d
from scipy.special import i0e

from benchmarks.speed.agreement import same_masses
from benchmarks.speed.case import Case, Pair
from estimators.markov import MarkovGrid
from topoloc.geometry import Floats, rotate, wrap
from topoloc.testing import evidence_for
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

CHECKED_STEPS = 5
RECOVERY = 0.01
"""Of the updates: without it repeated looks at the same would bring cells down to the least numbers there are."""


@dataclass(frozen=True)
class Hall:
    """A rectangular hall, all of it free, that a robot drives through in a curve.

    Attributes:
        columns, rows: cells along x and along y.
        headings: layers.
        resolution_m: side of a cell [m].
        deviation_m: of a step's noise, along and across alike, so that all layers blur alike [m].
        deviation_deg: of a step's noise in heading, degrees.
    """

    columns: int
    rows: int
    headings: int = 24
    resolution_m: float = 0.25
    deviation_m: float = 0.1
    deviation_deg: float = 3.0

    @property
    def place_variance(self) -> float:
        """Of a step's noise along x and along y [cells^2]."""
        return (self.deviation_m / self.resolution_m) ** 2

    @property
    def heading_variance(self) -> float:
        """Of a step's noise in heading [layers^2]."""
        return (self.deviation_deg * self.headings / 360.0) ** 2

    @property
    def topo_map(self) -> TopoMap:
        """Ten nodes, none near a wall."""
        x, y = self.columns * self.resolution_m, self.rows * self.resolution_m
        nodes = [Node(f"{a}-{b}", f"{a}-{b}", x * (a + 1) / 6.0, y * (b + 1) / 3.0) for a in range(5) for b in range(2)]
        return TopoMap("hall", Camera(), tuple(nodes), free=(np.array([[0.0, 0.0], [x, 0.0], [x, y], [0.0, y]]),))

    @property
    def motion(self) -> Motion:
        """A step that is no whole number of cells in any direction."""
        deviations = np.array([self.deviation_m, self.deviation_m, np.deg2rad(self.deviation_deg)])
        return Motion(np.array([1.37 * self.resolution_m, 0.21 * self.resolution_m, 0.05]), np.diag(deviations**2))

    @property
    def seen(self) -> Evidence:
        """What the robot has seen before: peaks at the nodes."""
        return evidence_for(self.topo_map, (*self.topo_map.positions[4], 0.7), log_floor=-8.0)

    def our_grid(self) -> MarkovGrid:
        """Ours, after the first look."""
        size = self.resolution_m
        grid = MarkovGrid(MarkovGrid.Config(resolution_m=size, reach_m=size, headings=self.headings, recovery=RECOVERY))
        grid.reset(self.topo_map, np.random.default_rng(0))
        grid.update(self.seen)
        return grid


class ScipyGrid:
    """The same grid as a user of scipy would write it: ``correlate1d`` along each axis, slices for whole cells.

    All layers have one kernel here, so that one call blurs them all. Its likelihood is what a user of numpy would
    write, who sees that the heading's factor is one for a layer: a Gaussian for each hypothesis, exponentiated as it
    comes.

    Attributes:
        mass: (H, X, Y), sums to one.
        headings: (H,) that the layers stand for now [rad].
        offsets: (H, 2) of the layers from the cells' centres [m].
    """

    def __init__(self, hall: Hall) -> None:
        self._size, self._motion, self._seen = hall.resolution_m, hall.motion, hall.seen
        self.headings: Floats = wrap(2.0 * np.pi * np.arange(hall.headings) / hall.headings)
        self.offsets = np.zeros((hall.headings, 2))
        self._free = np.ones((hall.columns, hall.rows))
        self._place, self._heading = kernel(hall.place_variance), kernel(hall.heading_variance)
        self.mass: Floats = np.full((hall.headings, *self._free.shape), 1.0 / (hall.headings * self._free.size))
        self.update()

    def predict(self) -> None:
        """Take in the motion."""
        moved = self.offsets + rotate(self._motion.delta[:2], self.headings)
        cells = np.rint(moved / self._size).astype(int)
        self.offsets = moved - cells * self._size
        mass = np.zeros_like(self.mass)
        for target, source, (x, y) in zip(mass, self.mass, cells, strict=True):
            target[_into(x), _into(y)] = source[_into(-x), _into(-y)]
        mass = correlate1d(mass, self._place, axis=1, mode="constant")
        mass = correlate1d(mass, self._place, axis=2, mode="constant")
        mass = correlate1d(mass, self._heading, axis=0, mode="wrap") * self._free
        self.mass = mass / mass.sum()
        self.headings = wrap(self.headings + self._motion.delta[2])

    def update(self) -> None:
        """Take in what is seen."""
        predicted = (1.0 - RECOVERY) * self.mass + RECOVERY / self.mass.size
        likelihood = np.stack([self._likelihood(*layer) for layer in zip(self.offsets, self.headings, strict=True)])
        joint = likelihood * predicted
        self.mass = joint / joint.sum()

    def _likelihood(self, offset: Floats, heading: float) -> Floats:
        """(X, Y) of what is seen, at the cells of a layer."""
        seen = self._seen
        x, y = ((np.arange(count) + 0.5) * self._size for count in self._free.shape)
        squared = (x[:, None, None] + offset[0] - seen.poses[:, 0]) ** 2 + (
            y[:, None] + offset[1] - seen.poses[:, 1]
        ) ** 2
        turned = np.exp(seen.kappa * (np.cos(heading - seen.poses[:, 2]) - 1.0)) / i0e(seen.kappa)
        gaussians = np.exp(-squared / (2.0 * seen.sigma**2))  # (X, Y, M)
        return np.asarray(np.exp(seen.log_floor) + gaussians @ (np.exp(seen.log_likelihoods) * turned))


def kernel(variance: float) -> Floats:
    """The grid's kernel for a variance in cells^2: a sampled Gaussian; below half a cell^2 three taps that have it."""
    if variance < 0.5:
        return np.array([variance / 2.0, 1.0 - variance, variance / 2.0])
    reach = int(np.ceil(4.0 * np.sqrt(variance)))
    gauss = np.exp(-(np.arange(-reach, reach + 1) ** 2) / (2.0 * variance))
    return np.asarray(gauss / gauss.sum())


def _into(cells: int) -> slice:
    """Where an axis lands that moves by whole cells; by the opposite: what of it does not leave."""
    return slice(max(cells, 0), min(cells, 0) or None)


def grid_predict(hall: Hall) -> Case:
    """Ours beside scipy's separable filter."""
    size = f"{_size(hall)}, {len(kernel(hall.place_variance))} taps"
    return Case("estimators", "grid-predict", size, "scipy.ndimage", (), partial(_predict_pair, hall))


def grid_update(hall: Hall) -> Case:
    """Ours beside plain numpy."""
    size = f"{_size(hall)}, {len(hall.seen.poses)} hypotheses"
    return Case("estimators", "grid-update", size, "numpy, plain", (), partial(_update_pair, hall))


def _size(hall: Hall) -> str:
    return f"{hall.headings} x {hall.columns} x {hall.rows}"


def _predict_pair(hall: Hall) -> Pair:
    return Pair(partial(hall.our_grid().predict, hall.motion), ScipyGrid(hall).predict, partial(_agree, hall, False))


def _update_pair(hall: Hall) -> Pair:
    return Pair(partial(hall.our_grid().update, hall.seen), ScipyGrid(hall).update, partial(_agree, hall, True))


def _agree(hall: Hall, looking: bool) -> bool:
    """The same masses after a few steps, with or without a look after each."""
    ours, peers = hall.our_grid(), ScipyGrid(hall)
    for _ in range(CHECKED_STEPS):
        ours.predict(hall.motion)
        peers.predict()
        if looking:
            ours.update(hall.seen)
            peers.update()
    return same_masses(_on_the_cells_of(peers, ours.belief, hall), peers.mass)


def _on_the_cells_of(peers: ScipyGrid, belief: WeightedPoses, hall: Hall) -> Floats:
    """A belief's weights as masses (H, X, Y) of the peer's cells: by heading the layer, by place the cell."""
    turned = (belief.poses[:, 2] - peers.headings[0]) * hall.headings / (2.0 * np.pi)
    layers = np.rint(turned).astype(int) % hall.headings
    cells = np.rint((belief.poses[:, :2] - peers.offsets[layers]) / hall.resolution_m - 0.5).astype(int)
    mass: Floats = np.zeros(peers.mass.shape)
    np.add.at(mass, (layers, *cells.T), belief.weights)
    return mass
