"""Off the node, the matched heading errs by parallax: what the scene's distance does to it, and how to take it out.

Ours; the distance is fitted on seeds that nothing is reported of: ``python -m benchmarks.experiments.parallax``.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.experiments.tracking import Tracked, tracked
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from topoloc.geometry import Floats, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import TopoMap

FITTED_SEEDS = range(1000, 1004)
SCENE_M = 3.37
"""Distance D of the scene in the laboratory, as ``fitted_scene_m`` finds it [m]."""


def parallax_corrected(heading: Floats, offset: Floats, scene_m: float = SCENE_M) -> Floats:
    """Headings without the parallax of a robot that stands beside the node.

    From the left of the node, what the robot has straight ahead at a distance D is seen from the node farther to the
    left, by offset / D: so much is the matched heading too large.

    Args:
        heading: (N,) matched on the node's panorama [rad].
        offset: (N,) of the robot to the left of that heading, from the node [m].
        scene_m: distance of the scene [m].

    Returns:
        (N,) [rad].
    """
    return wrap(heading - offset / scene_m)


def sideways(positions: Floats, nodes: Floats, heading: Floats) -> Floats:
    """How far positions (N, 2) lie to the left of headings (N,) from nodes (N, 2) [m]."""
    away = positions - nodes
    return np.asarray(np.cos(heading) * away[:, 1] - np.sin(heading) * away[:, 0])


def heading_updates(seen: Tracked, threshold: float) -> NDArray[np.bool_]:
    """(U,) the right updates whose heading counts: a normal destination won, at the right node, above a match."""
    above = np.nan_to_num(seen.match) > threshold
    return np.asarray((seen.kind == "normal") & seen.right & above)


def offsets(seen: Tracked, topo_map: TopoMap, positions: Floats) -> Floats:
    """(U,) how far positions (U, 2) lie to the left of the winner's matched heading from its node [m]."""
    return sideways(positions, topo_map.positions[seen.said], seen.truth[:, 2] + seen.heading_error)


def scene_distance(error: Floats, offset: Floats) -> float:
    """D [m] of the least squares line error = offset / D through the origin; (N,) each [rad], [m]."""
    return float(offset @ offset / (offset @ error))


def fitted_scene_m(seeds: Sequence[int] = FITTED_SEEDS) -> float:
    """D [m] from three fresh rounds of the laboratory each, where the match allows to correct the heading (eps_phi)."""
    error, offset = [], []
    for seed in seeds:
        drive = LabWorld(WorldSettings()).simulate(seed)
        seen = tracked(drive)
        chosen = heading_updates(seen, THESIS.head_threshold)
        error.append(seen.heading_error[chosen])
        offset.append(offsets(seen, drive.topo_map, seen.truth[:, :2])[chosen])
    return scene_distance(np.concatenate(error), np.concatenate(offset))


if __name__ == "__main__":
    print(f"distance of the scene, seeds {FITTED_SEEDS[0]} to {FITTED_SEEDS[-1]}: {fitted_scene_m():.2f} m")
