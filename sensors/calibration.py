"""From a sensor's own distance to ``match`` and log-likelihood: one way for all sensors that compare with views.

In ``fit`` every view of the map is a query once, held out together with the other views of its node: what is left
are wrong places. Their distances give the scale (DESIGN.md, "Values"): a match of 0.5 is what 95 % of them stay below.
"""

from __future__ import annotations

import numpy as np

from topoloc.geometry import Floats
from topoloc.types import Ints

WRONG_QUANTILE = 0.05
"""Share of wrong places whose distance is smaller than that of a match of 0.5."""


def wrong_distance(distances: Floats, nodes: Ints) -> float:
    """Distance that 95 % of wrong places exceed.

    Args:
        distances: (V, V) between the map's views.
        nodes: (V,) node of each view.

    Returns:
        The quantile over each view's nearest view of every other node; over all pairs where there is one node only.
    """
    names = np.unique(nodes)
    if len(names) == 1:
        pairs = distances[~np.eye(len(distances), dtype=bool)]
        return float(np.quantile(pairs, WRONG_QUANTILE)) if len(pairs) else 1.0
    nearest = np.stack([distances[:, nodes == name].min(axis=1) for name in names], axis=1)
    return float(np.quantile(nearest[nodes[:, None] != names], WRONG_QUANTILE))


def match_of(distance: Floats, wrong: float) -> Floats:
    """Match in [0, 1]: 1 for an identical image, 0.5 at the distance ``wrong``, halved by each such distance."""
    return np.asarray(0.5 ** (distance / max(wrong, np.finfo(float).tiny)))


def log_density(poses: Floats, sigma: float, kappa: float) -> Floats:
    """Log of how many views (V, 3) stand around each of them, itself included: taken out of the log-likelihoods.

    So a corner photographed twice changes nothing (EQUATIONS.md, 4). That text asks for a mean of 1 as well; but then
    copies of some views would scale all the others, so the constant stays in, for ``margin`` to absorb.

    Args:
        poses: (V, 3).
        sigma: width of the position kernel [m].
        kappa: concentration of the heading kernel.
    """
    squared = np.sum((poses[:, None, :2] - poses[None, :, :2]) ** 2, axis=2)
    turned = np.cos(poses[:, None, 2] - poses[None, :, 2]) - 1.0
    return np.asarray(np.log(np.exp(-squared / (2.0 * sigma**2) + kappa * turned).sum(axis=1)))
