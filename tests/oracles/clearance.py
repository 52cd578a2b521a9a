"""How far a path stays from what stands about."""

from __future__ import annotations

import numpy as np

from topoloc.geometry import Floats


def distance_to_segments(points: Floats, ends: Floats) -> Floats:
    """Distance (P, S) of points (P, 2) from segments (S, 4), x0, y0, x1, y1 [m]."""
    along = ends[:, 2:] - ends[:, :2]
    offset = points[:, None, :] - ends[:, :2]
    share = np.clip((offset * along).sum(axis=2) / np.maximum((along**2).sum(axis=1), 1e-12), 0.0, 1.0)
    return np.asarray(np.linalg.norm(offset - share[..., None] * along, axis=2))
