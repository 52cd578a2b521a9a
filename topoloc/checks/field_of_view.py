"""Frames held against panoramas: the field of view that fits them, and whether they lie the right way round (ours).

A panorama is linear in angle over a full circle whatever camera took it. Where keypoints of a frame are found again on
it, their columns on both tell how wide the frame sees: ``angle = axis - atan(column / focal length)``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from topoloc.checks.finding import Finding
from topoloc.checks.panoramas import REMEDIES, reduced
from topoloc.geometry import Floats, circular_mean
from topoloc.going_through import Track
from topoloc.keypoints import LEAST_SUPPORT, Keypoints, WayRound, mirrored, pairs_of, way_round
from topoloc.topo_map import TopoMap
from topoloc.types import Image

FIELDS_DEG = np.arange(15.0, 151.0, 1.0)
"""Fields of view that are tried [degrees]."""
INLIER_DEG = 1.5
"""A keypoint farther from where it should be counts no more than one this far [degrees]."""
OFF_SHARE, FAR_OFF_SHARE = 0.15, 0.3
"""A field of view so far from the one that was told is a finding; parallax alone moves it by less."""
LEAST_FRAMES = 4
"""Fewer frames that were found tell nothing."""
NODES_TRIED = 4
"""A frame is held against so many nodes around it, where its place is known, and ``NODES_BLIND`` of the whole map."""
NODES_BLIND = 20


@dataclass(frozen=True)
class Look:
    """A frame, and the pose (3,) of the camera that took it, if that is known."""

    picture: Image
    pose: Floats | None


def frame_findings(topo_map: TopoMap, placed: Sequence[Placed], where: str) -> Iterator[Finding]:
    """What does not fit between a camera and the map's panoramas: the way round, the field of view.

    Args:
        topo_map: the map.
        placed: frames of the camera that were found on panoramas.
        where: their file.
    """
    if len(placed) < LEAST_FRAMES:
        return
    ways = [one.way for one in placed]
    way = max(set(ways), key=ways.count)
    if way != "same" and ways.count(way) > len(ways) / 2:
        what = f"{ways.count(way)} of {len(ways)} frames that were found on panoramas are {way}"
        yield Finding(where, what, f"turn the pictures, or the panoramas: {REMEDIES[way]}", "serious")
        return
    fitted, told = fitted_field(placed), topo_map.camera.hfov_deg
    off = abs(fitted / told - 1.0)
    if off > OFF_SHARE:
        what = f"the field of view is told as {told:.0f} degrees, but {len(placed)} frames fit best with {fitted:.0f}"
        remedy = "measure it with 'topoloc camera turn', and use one camera for map and recording"
        yield Finding(where, what, remedy, "serious" if off > FAR_OFF_SHARE else "warning")


@dataclass(frozen=True)
class Placed:
    """A frame found on a panorama.

    Attributes:
        look: the frame.
        node: index of the panorama's node.
        way: how it lies on it.
        support: keypoints that speak for that.
        columns: (M,) of keypoints that both show, in the frame, from its middle, 1 at the right edge.
        angles: (M,) of the same on the panorama [rad, counter-clockwise].
    """

    look: Look
    node: int
    way: WayRound
    support: int
    columns: Floats
    angles: Floats

    def heading(self, topo_map: TopoMap) -> float:
        """Of the optical axis, by what the panorama shows [rad]."""
        half_field = np.deg2rad(topo_map.camera.hfov_deg / 2.0)
        axes = topo_map.nodes[self.node].heading + self.angles + np.arctan(self.columns * np.tan(half_field))
        return circular_mean(axes)


def placed_on(topo_map: TopoMap, looks: Sequence[Look], track: Track) -> list[Placed]:
    """The frames that were found on one of the map's panoramas."""
    if not any(node.has_panorama for node in topo_map.nodes):
        return []
    panoramas = _Panoramas(topo_map)
    found = [panoramas.place(looks[i]) for i in track(range(len(looks)), "holding frames against panoramas")]
    return [one for one in found if one is not None]


def fitted_field(frames: Sequence[Placed]) -> float:
    """The horizontal field of view [degrees] that fits best where frames lie the same way round as the panoramas."""
    same = [one for one in frames if one.way == "same"]
    costs = np.array([sum(_cost(one.columns, one.angles, field) for one in same) for field in FIELDS_DEG])
    return float(FIELDS_DEG[costs.argmin()])


def _cost(columns: Floats, angles: Floats, field_deg: float) -> float:
    """Share of keypoints that do not agree with the axis that most of one frame agree with."""
    axes = angles + np.arctan(columns * np.tan(np.deg2rad(field_deg / 2.0)))
    apart = np.abs(np.angle(np.exp(1j * (axes[:, None] - axes[None, :]))))
    return float(np.minimum((apart / np.deg2rad(INLIER_DEG)) ** 2, 1.0).mean(axis=1).min())


class _Panoramas:
    """The keypoints of a map's panoramas, looked for once."""

    def __init__(self, topo_map: TopoMap) -> None:
        self._map = topo_map
        self._having = np.array([number for number, node in enumerate(topo_map.nodes) if node.has_panorama])
        self._known: dict[int, tuple[Keypoints, int]] = {}

    def place(self, look: Look) -> Placed | None:
        """The panorama that shows most of what a frame shows; None where none does."""
        picture = reduced(look.picture)
        straight, flipped = Keypoints.of(picture), Keypoints.of(mirrored(picture))
        found = [self._on(look, number, straight, flipped) for number in self._near(look)]
        return max((one for one in found if one is not None), key=lambda one: one.support, default=None)

    def _near(self, look: Look) -> list[int]:
        evenly = self._having[:: -(-len(self._having) // NODES_BLIND)]
        if look.pose is None:
            return [int(number) for number in evenly]
        distances = np.linalg.norm(self._map.positions[self._having] - look.pose[:2], axis=1)
        around = self._having[np.argsort(distances)[:NODES_TRIED]]
        return [int(number) for number in np.union1d(around, evenly)]

    def _on(self, look: Look, number: int, straight: Keypoints, flipped: Keypoints) -> Placed | None:
        circle, columns = self._keypoints(number)
        way, support = way_round(circle, straight, flipped)
        if way is None:
            return None
        pairs = pairs_of(circle, straight)
        right = pairs.near(0.0)
        if way == "same" and right.sum() < LEAST_SUPPORT:
            return None
        width = reduced(look.picture).shape[1]
        across = straight.places[pairs.second[right], 0] / (0.5 * (width - 1)) - 1.0
        angles = -2.0 * np.pi * circle.places[pairs.first[right], 0] / columns
        return Placed(look, number, way, support, across, angles)

    def _keypoints(self, number: int) -> tuple[Keypoints, int]:
        if number not in self._known:
            panorama = self._map.nodes[number].panorama
            assert panorama is not None  # or it would not be in _having
            small = reduced(panorama)
            self._known[number] = Keypoints.of(small), small.shape[1]
        return self._known[number]
