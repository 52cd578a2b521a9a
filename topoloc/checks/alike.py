"""Nodes that look alike: a frame taken at one would be found at the other as well."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from topoloc import plugins
from topoloc.checks.distances import distance, median_spacing
from topoloc.checks.finding import Finding, Severity
from topoloc.checks.panoramas import MOST_NODES
from topoloc.geometry import Floats
from topoloc.going_through import Track
from topoloc.topo_map import TopoMap
from topoloc.types import Frame, Image

DIRECTIONS = 12
"""A frame is cut from a panorama at so many headings."""
ALIKE = 0.8
"""Match of IMA above which a frame of one node would be taken for another's; unlike nodes hardly reach .6."""
CONFUSED = 0.9
"""And above which it could as well be the other's: a frame's own node has nearly 1."""
SAME = 0.97
"""And above which it is the same picture, near or not."""
NEAR_M, NEAR_SPACINGS = 1.0, 2.0
"""Nodes so near to each other, in metres or in median spacings, may look alike: one for the other is hardly off."""
MOST_PAIRS = 10
"""So many pairs are told one by one."""


def alike_findings(topo_map: TopoMap, where: str, track: Track) -> Iterator[Finding]:
    """Pairs of nodes that are not near and look alike in one direction or more, or near and the same picture.

    The most alike come first.

    Args:
        topo_map: with panoramas; nothing is found in one without.
        where: the map's file.
        track: goes through the nodes.
    """
    having = [number for number, node in enumerate(topo_map.nodes) if node.has_panorama]
    if len(having) < 2:
        return
    shown = _with_nodes(topo_map, having)
    ima = plugins.make_sensor("ima")
    ima.fit(shown)
    looks = np.linspace(0, len(having) - 1, min(len(having), MOST_NODES)).round().astype(int)
    found: dict[tuple[int, int], list[tuple[float, float]]] = {}
    for number in track([int(i) for i in looks], "looking for nodes that look alike"):
        for axis, frame in _frames(shown, number):
            evidence = ima.observe(frame)
            for row in evidence.best_per_node():
                other = int(evidence.nodes[row])
                if evidence.match[row] >= _told_from(shown, number, other):
                    found.setdefault((number, other), []).append((float(np.rad2deg(axis)), float(evidence.match[row])))
    yield from _told(shown, where, found)


def _with_nodes(topo_map: TopoMap, numbers: list[int]) -> TopoMap:
    """The map with some of its nodes only, and the edges between them; IMA takes no map where one has no panorama."""
    if len(numbers) == len(topo_map.nodes):
        return topo_map
    rank = {number: place for place, number in enumerate(numbers)}
    edges = [(rank[a], rank[b]) for a, b in np.asarray(topo_map.edges).tolist() if a in rank and b in rank]
    pairs = np.array(edges, dtype=np.int64).reshape(-1, 2)
    return replace(topo_map, nodes=tuple(topo_map.nodes[number] for number in numbers), edges=pairs)


def _frames(topo_map: TopoMap, number: int) -> Iterator[tuple[float, Frame]]:
    """Frames cut from a node's panorama, and the heading of their optical axes [rad, map frame]."""
    node = topo_map.nodes[number]
    panorama = node.panorama
    assert panorama is not None  # or it would not be asked for
    columns = panorama.shape[1]
    width = round(columns * topo_map.camera.hfov_deg / 360.0)
    for k in range(DIRECTIONS):
        start = k * columns // DIRECTIONS
        cut: Image = np.ascontiguousarray(panorama[:, (start + np.arange(width)) % columns])
        axis = node.heading - 2.0 * np.pi * (start + width / 2.0) / columns
        yield float(axis), Frame(0.0, None, np.zeros(3), {"rgb": cut})


def _told_from(topo_map: TopoMap, a: int, b: int) -> float:
    """The match from which on two nodes are told: where they are near, taking one for the other does little harm."""
    if a == b:
        return np.inf
    close = max(NEAR_M, NEAR_SPACINGS * median_spacing(topo_map))
    near = topo_map.adjacent(a, b) or distance(topo_map, a, b) <= close
    return SAME if near else ALIKE


def _told(topo_map: TopoMap, where: str, found: dict[tuple[int, int], list[tuple[float, float]]]) -> Iterator[Finding]:
    """A finding for each pair, whichever of the two the frames were cut at; the most alike first."""
    strength = {pair: sum(match for _, match in seen) for pair, seen in found.items()}
    pairs = sorted({(min(pair), max(pair)) for pair in found}, key=lambda p: -_both(strength, p))
    remedy = "let a filter over time decide (--estimator particle), or add what tells them apart; or one was copied"
    for a, b in pairs[:MOST_PAIRS]:
        one = (a, b) if (a, b) in found else (b, a)
        seen = found[one]
        first, second = (topo_map.nodes[number].id for number in one)
        directions = ", ".join(f"{_degrees(axis):.0f}" for axis, _ in seen)
        best = max(match for _, match in seen)
        what = (
            f"nodes {first} and {second} look alike: {len(seen)} of {DIRECTIONS} frames at {first} match {second} "
            f"(towards {directions} degrees), at best {best:.2f}"
        )
        yield Finding(where, what, remedy, _severity(seen))
    if len(pairs) > MOST_PAIRS:
        yield Finding(where, f"{len(pairs) - MOST_PAIRS} more pairs of nodes look alike", remedy, "note")


def _severity(seen: list[tuple[float, float]]) -> Severity:
    """By how many of the directions (axis, match) of one node could as well be the other's."""
    same, confused = (sum(match >= level for _, match in seen) for level in (SAME, CONFUSED))
    if same >= DIRECTIONS / 2:
        return "serious"
    return "warning" if confused >= DIRECTIONS / 3 else "note"


def _both(strength: dict[tuple[int, int], float], pair: tuple[int, int]) -> float:
    return max(strength.get(pair, 0.0), strength.get(pair[::-1], 0.0))


def _degrees(angle: float) -> Floats:
    """An angle in degrees, from 0 to 360."""
    return np.asarray(angle % 360.0)
