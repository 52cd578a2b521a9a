"""Whether a drive's headings are those it drove along: what a wrong unit or sign of the angles shows in."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from topoloc.geometry import Floats, wrap
from topoloc.importing.public.sequence import Shot

FEWEST_STEPS = 5
"""Fewer steps tell nothing."""
FAR_DEG = 20.0
"""Headings this far from the direction of travel, in the median, are hardly right [degrees]."""


def heading_note(shots: Sequence[Shot], least_m: float) -> str | None:
    """A sentence on how far the headings are from the directions of travel; None where too little was driven.

    A robot that drives ahead has a median near 0; one that backs up all the way has 180.

    Args:
        shots: of one drive, in time.
        least_m: shorter steps are left out [m].
    """
    off = heading_off(np.array([shot.pose for shot in shots]), least_m)
    if off is None:
        return None
    told = f"headings differ from the directions of travel by {off:.1f} degrees in the median"
    if off <= FAR_DEG:
        return told
    return f"warning: {told}; the angles' unit or sign is not what is documented, or the robot did not drive ahead"


def heading_off(poses: Floats, least_m: float) -> float | None:
    """Median angle [degrees] between heading and direction of travel of poses (N, 3), over steps of that length."""
    steps = np.diff(poses[:, :2], axis=0)
    far = np.hypot(steps[:, 0], steps[:, 1]) >= least_m
    if np.count_nonzero(far) < FEWEST_STEPS:
        return None
    along = np.arctan2(steps[far, 1], steps[far, 0])
    halfway = poses[:-1, 2] + 0.5 * wrap(np.diff(poses[:, 2]))
    return float(np.rad2deg(np.median(np.abs(wrap(along - halfway[far])))))
