"""Natural lengths of the springs: image distances as they are, or summed over chains of near images."""

from __future__ import annotations

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree, shortest_path

from topoloc.geometry import Floats


def chained(distances: Floats, neighbours: int) -> Floats:
    """Shortest ways (N, N) from image to image over near ones.

    Distances of images hardly grow any more once nothing is alike in them; a sum of small ones goes on growing. Each
    image is joined with its nearest ones, and with whom else the minimum spanning tree has, so that all are connected.
    Ours: this is the first step of Isomap (Tenenbaum, de Silva and Langford, 2000).

    Args:
        distances: (N, N) symmetric, zero diagonal.
        neighbours: nearest images of each that it is joined with; 0 leaves all distances as they are.
    """
    count = len(distances)
    if neighbours == 0 or neighbours >= count - 1:
        return distances
    least = np.finfo(np.float64).tiny  # to these graphs, 0 is no edge
    apart = np.maximum(distances, least)
    others = apart + np.diag(np.full(count, np.inf))
    nearest = np.argpartition(others, neighbours - 1, axis=1)[:, :neighbours]
    joined = minimum_spanning_tree(apart - np.diag(np.diag(apart))).toarray() > 0.0
    joined[np.arange(count)[:, None], nearest] = True
    joined |= joined.T
    ways = shortest_path(csr_array(np.where(joined, apart, 0.0)), directed=False)
    return np.asarray(ways, dtype=np.float64)
