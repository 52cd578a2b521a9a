"""How far nodes are apart."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from topoloc.topo_map import TopoMap


def distance(topo_map: TopoMap, a: int, b: int) -> float:
    """Between two nodes, given by index [m]."""
    return float(np.linalg.norm(topo_map.positions[a] - topo_map.positions[b]))


def median_spacing(topo_map: TopoMap) -> float:
    """Median distance of a map's nodes to the nearest other one [m]; there are two or more."""
    return float(np.median(cKDTree(topo_map.positions).query(topo_map.positions, k=2)[0][:, 1]))
