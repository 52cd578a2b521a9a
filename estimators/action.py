"""Action selection: the look that is expected to leave the least doubt (second seed, section 4; formula rebuilt)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.special import i0e, xlogy

from topoloc.active import Action, ViewEvidence
from topoloc.geometry import Floats, compose, wrap
from topoloc.types import Ints, WeightedPoses

ALIKE = 1e-9
"""Entropies that differ by less are equal but for rounding [nat]."""


@dataclass(frozen=True)
class LeastEntropyConfig:
    """Settings of the action selection.

    Attributes:
        cell_m: side of the cells that particles are merged into [m]; doubt within a cell does not count.
        cell_deg: heading of such a cell, degrees.
        most_cells: a belief of more cells is thinned to so many draws of equal weight.
        neighbours: hypotheses of a view that count, the likeliest ones (second seed, 6.1: 10).
    """

    cell_m: float = 0.5
    cell_deg: float = 30.0
    most_cells: int = 500
    neighbours: int = 10

    def __post_init__(self) -> None:
        if not 0.0 < self.cell_m < np.inf or not 0.0 < self.cell_deg <= 360.0:
            raise ValueError("cell_m must be positive and finite, and cell_deg lie above 0 and up to 360")
        if self.most_cells < 2:
            raise ValueError(f"most_cells is {self.most_cells}; it must be at least 2")
        if self.neighbours < 1:
            raise ValueError(f"neighbours is {self.neighbours}; it must be at least 1")


class LeastEntropy:
    """Chooses the action after which the expected entropy of the robot's pose is least.

    The map's views are what the robot may come to see, and the belief's cells are where it may be: H(u) of the second
    seed (section 4), as rebuilt in ``expected_entropy``. The likelihood of view k at the camera's pose x is that of
    the view's own evidence, so look-alike places share it. Ours: it is scaled so that the views' probabilities sum to
    one at each pose; otherwise places that look like many others seem likelier to be seen.

    Noise of the action is left out: actions of about the same precision can be compared. Time and memory go with
    cells x different hypotheses of the views; the time also with the number of actions.

    Args:
        views: what the sensor says of the map's views, from ``topoloc.active.view_evidence``.
        config: settings.
    """

    Config = LeastEntropyConfig

    def __init__(self, views: ViewEvidence, config: LeastEntropyConfig | None = None) -> None:
        self.config = config or LeastEntropyConfig()
        kept = _likeliest(views, self.config.neighbours)
        kernels = np.column_stack([views.poses, views.sigma, views.kappa])[kept]
        self._kernels, which = np.unique(kernels, axis=0, return_inverse=True)  # views name each other: few differ
        log_likelihoods = views.log_likelihoods[kept]
        # One factor for all likelihoods changes no probability; this one keeps the largest from overflowing.
        scale = max(views.log_floors.max(), log_likelihoods.max(initial=-np.inf))
        scale = scale if np.isfinite(scale) else 0.0
        self._floors = views.weights * np.exp(views.log_floors - scale)
        mixed = views.weights[views.view[kept]] * np.exp(log_likelihoods - scale)
        shape = (len(self._kernels), len(views.log_floors))
        self._mixture = csr_array((mixed, (which.reshape(-1), views.view[kept])), shape=shape)

    def choose(self, belief: WeightedPoses, actions: Sequence[Action]) -> int:
        """Index of the action of least H(u); of equally good ones the first."""
        entropies = self.entropies(belief, actions)
        return int(np.flatnonzero(entropies <= entropies.min() + ALIKE)[0])

    def entropies(self, belief: WeightedPoses, actions: Sequence[Action]) -> Floats:
        """H(u) (A,) [nat] of each action, for a belief about the robot."""
        cells = merged(belief, self.config.cell_m, self.config.cell_deg, self.config.most_cells)
        cameras = (compose(compose(cells.poses, action.motion), action.camera) for action in actions)
        return np.array([expected_entropy(cells.weights, self.probabilities(camera)) for camera in cameras])

    def probabilities(self, cameras: Floats) -> Floats:
        """p(y_k | x_i) (N, V): how likely each view is to be what a camera at poses (N, 3) sees. Rows sum to one."""
        x, y, heading, sigma, kappa = self._kernels.T
        squared = (cameras[:, :1] - x) ** 2 + (cameras[:, 1:2] - y) ** 2
        turned = np.cos(cameras[:, 2:] - heading) - 1.0
        kernel = np.exp(kappa * turned - squared / (2.0 * sigma**2)) / i0e(kappa)
        likelihoods = self._floors + kernel @ self._mixture
        total = likelihoods.sum(axis=1, keepdims=True)
        likelihoods = np.where(total > 0.0, likelihoods, 1.0)  # where nothing can be seen, any view says as little
        return np.asarray(likelihoods / likelihoods.sum(axis=1, keepdims=True))


def expected_entropy(weights: Floats, likelihoods: Floats) -> float:
    """H(u), the entropy of a pose that is expected after a look (second seed, section 4; rebuilt).

    With g_ik the likelihood of view k at cell i: p(y_k) ~ sum_i w_i g_ik, p_ik = w_i g_ik / sum_i' w_i' g_i'k,
    H = -sum_k p(y_k) sum_i p_ik log p_ik. Where the g_ik of each cell have the same sum, this is the entropy of the
    weights less the information that the look gives, so never above it; otherwise it may be.

    Args:
        weights: (N,) of the cells, summing to one.
        likelihoods: (N, V) g_ik, up to one factor; one of them at least is possible.

    Returns:
        The entropy [nat].
    """
    joint = weights[:, None] * likelihoods
    views = joint.sum(axis=0)
    # sum_k p_k H_k, with p_k H_k = p_k log p_k - sum_i (w_i g_ik) log(w_i g_ik)
    return float((xlogy(views, views).sum() - xlogy(joint, joint).sum()) / views.sum())


def merged(belief: WeightedPoses, cell_m: float, cell_deg: float, most: int) -> WeightedPoses:
    """A belief as cells: the mean pose and the weight of what lies in each, so that copies do not look like doubt.

    Args:
        belief: particles, or the cells of a grid.
        cell_m: side of a cell [m].
        cell_deg: heading of a cell [deg], or a little less or more: a whole number of cells makes the circle.
        most: where there are more cells, so many equal draws stand for them, at equal distances along their weights.
    """
    alive = belief.weights > 0.0
    poses, weights = belief.poses[alive], belief.weights[alive]
    layers = max(1, round(360.0 / cell_deg))
    place = np.floor(poses[:, :2] / cell_m)
    layer = np.floor(poses[:, 2] / (2.0 * np.pi) * layers) % layers
    _, cell = np.unique(np.column_stack([place, layer]), axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    x, y, cos, sin = (
        np.bincount(cell, weights=weights * part)
        for part in (poses[:, 0], poses[:, 1], np.cos(poses[:, 2]), np.sin(poses[:, 2]))
    )
    mass = np.bincount(cell, weights=weights)
    means = np.column_stack([x / mass, y / mass, wrap(np.arctan2(sin, cos))])
    if len(mass) <= most:
        return WeightedPoses(means, np.log(mass))
    chosen, count = np.unique(np.searchsorted(np.cumsum(mass), (np.arange(most) + 0.5) / most), return_counts=True)
    return WeightedPoses(means[chosen], np.log(count))


def _likeliest(views: ViewEvidence, neighbours: int) -> Ints:
    """Indices of the ``neighbours`` likeliest hypotheses of each view."""
    order = np.lexsort((-views.log_likelihoods, views.view))
    first = np.searchsorted(views.view[order], views.view[order])  # where the view of each begins
    return np.sort(order[np.arange(len(order)) - first < neighbours])
