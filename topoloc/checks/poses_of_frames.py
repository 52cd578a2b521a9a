"""Frames found on panoramas beside the poses that are told of them: headings, places, clocks (ours)."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from topoloc.checks.distances import median_spacing
from topoloc.checks.field_of_view import Placed
from topoloc.checks.finding import Finding
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap

LEAST_FRAMES = 6
"""Fewer frames that were found tell nothing of poses."""
HEADING_OFF_DEG = 20.0
"""Headings may be off by so much: parallax turns frames that were taken off the nodes [degrees]."""
TOGETHER = 0.8
"""Resultant length of differences in heading above which they are one difference, and below which they are chance."""
AWAY_SPACINGS = 1.5
"""A frame belongs elsewhere where its panorama's node is so many spacings farther than the nearest one."""
MOST_AWAY = 0.4
"""Share of the frames that may belong elsewhere: things far away are found on far panoramas, too."""


def pose_findings(topo_map: TopoMap, placed: Sequence[Placed], where: str) -> Iterator[Finding]:
    """What does not fit between what frames show and the poses that are told of them.

    Args:
        topo_map: the map.
        placed: frames that were found on its panoramas, the right way round; those without a pose do not count.
        where: the file of the poses.
    """
    known = [one for one in placed if one.look.pose is not None]
    if len(known) < LEAST_FRAMES:
        return
    told = np.array([one.look.pose for one in known])
    yield from _headings(np.array([one.heading(topo_map) for one in known]), told[:, 2], where)
    yield from _places(topo_map, known, told[:, :2], where)


def _headings(shown: Floats, told: Floats, where: str) -> Iterator[Finding]:
    """One turn too much or too little, the wrong sense, or no relation at all."""
    apart, mirrored = (np.exp(1j * angles).mean() for angles in (shown - told, shown + told))
    off = float(np.rad2deg(np.angle(apart)))
    if abs(apart) >= TOGETHER and abs(off) > HEADING_OFF_DEG:
        what = f"headings are off by {off:+.0f} degrees in {len(told)} frames that were found on panoramas"
        remedy = "correct yaw_deg of [mount] in camera.toml by that, or the truth, or the headings in nodes.csv"
        yield Finding(where, what, remedy, "serious")
    elif abs(mirrored) >= TOGETHER > abs(apart):
        what = f"headings grow the other way than the panoramas show, in {len(told)} frames"
        yield Finding(where, what, "write them counter-clockwise", "serious")
    elif abs(apart) < TOGETHER / 2.0:
        what = f"headings have nothing to do with what {len(told)} frames show on the panoramas"
        remedy = "look whether pictures and poses have one clock and the same order"
        yield Finding(where, what, remedy, "serious")


def _places(topo_map: TopoMap, known: Sequence[Placed], told: Floats, where: str) -> Iterator[Finding]:
    """Frames that are found on panoramas far from where they are said to be taken."""
    if len(topo_map.nodes) < 2:
        return
    nodes = topo_map.positions[[one.node for one in known]]
    farther = np.linalg.norm(nodes - told, axis=1) - topo_map.distance_to_nearest(told)
    away = farther > AWAY_SPACINGS * median_spacing(topo_map)
    if away.mean() > MOST_AWAY:
        east, north = np.median((nodes - told)[away], axis=0)
        what = f"{away.sum()} of {len(known)} frames are found on panoramas elsewhere, {east:+.1f}, {north:+.1f} m away"
        remedy = "look whether poses and map have one frame, and pictures and poses one clock"
        yield Finding(where, what, remedy, "serious")
