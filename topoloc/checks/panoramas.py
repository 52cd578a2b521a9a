"""Panoramas: black parts, darkness, a circle that does not close, one that lies the wrong way round."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from topoloc.checks.distances import distance
from topoloc.checks.finding import Finding, Severity, listed
from topoloc.checks.lightness import flaw_of
from topoloc.geometry import Floats
from topoloc.going_through import Track
from topoloc.keypoints import Keypoints, mirrored, pairs_of, way_round
from topoloc.topo_map import TopoMap
from topoloc.types import Image

SEAM_STEP = 8.0
"""Where a circle closes, the step in grey from its last column to its first is below so many times the usual one."""
SEAM_RANK = 0.005
"""And more than this share of all steps from column to column are as large."""
LEAST_STEP = 1.0
"""Usual steps are taken for at least this [grey levels], in panoramas that are smooth."""
REPEATED, LEAST_TURN_DEG = 0.85, 30
"""A circle that is so like itself, turned by so much or more, shows the same twice [correlation; degrees]."""
TURNED_DEG = 25.0
"""Things that two panoramas show lie in the same direction to so much, but for those near by [degrees]."""
TURNED_TOGETHER = 0.7
"""Resultant length of the differences in direction above which they are one turn, and not parallax."""
MOST_NODES = 60
"""So many nodes are held against their neighbours; on larger maps every so-manieth."""
KEYPOINT_ROWS = 200
"""Panoramas are reduced to so many rows before keypoints are looked for."""


def grey_levels(picture: Image) -> Floats:
    """Mean over the colours (rows, columns)."""
    return np.asarray(picture.reshape(*picture.shape[:2], -1).mean(axis=2))


def seam(panorama: Image) -> tuple[float, float]:
    """How much the last column of a circle differs from its first.

    Returns:
        The step in grey as a multiple of the median step between neighbouring columns, and the share of those steps
        that are as large.
    """
    grey = grey_levels(panorama)
    steps = np.abs(grey - np.roll(grey, 1, axis=1)).mean(axis=0)
    return float(steps[0] / max(float(np.median(steps)), LEAST_STEP)), float((steps[1:] >= steps[0]).mean())


def panorama_findings(topo_map: TopoMap, where: str, track: Track) -> Iterator[Finding]:
    """What is wrong with single panoramas."""
    for number in track(range(len(topo_map.nodes)), "looking at panoramas"):
        node = topo_map.nodes[number]
        panorama = node.panorama
        if panorama is None:
            continue
        name = f"the panorama of node {node.id}"
        empty = float((panorama.reshape(len(panorama), panorama.shape[1], -1).max(axis=(0, 2)) == 0).mean())
        flaw = flaw_of(panorama)
        if empty > 0.0:
            what = f"{empty * 360.0:.0f} degrees of {name} are black"
            severity: Severity = "serious" if empty > 0.25 else "warning"
            yield Finding(where, what, "take the snapshots again, or align them by another method", severity)
        elif flaw is not None:
            yield Finding(where, f"{name} {flaw.what}", flaw.remedy, "serious")
        else:
            step, rank = seam(panorama)
            if step > SEAM_STEP and rank < SEAM_RANK:
                what = f"{name} does not close: its last column differs from its first {step:.0f} times the usual step"
                remedy = "look whether the turn was a full circle and hfov_deg is right; 'topoloc panorama' closes it"
                yield Finding(where, what, remedy, "warning")
            likeness, turn = repetition(panorama)
            if likeness > REPEATED:
                what = f"{name} shows the same again {turn:.0f} degrees on (correlation {likeness:.2f})"
                yield Finding(where, what, "look whether its snapshots were taken twice, and make it again", "serious")


def repetition(panorama: Image) -> tuple[float, float]:
    """How far a circle repeats itself: the largest correlation with itself, turned, and the turn [degrees]."""
    import cv2

    grey = grey_levels(np.asarray(cv2.resize(panorama, (360, 32), interpolation=cv2.INTER_AREA)))
    spectrum = np.fft.rfft(grey - grey.mean(), axis=1)
    correlation = np.fft.irfft((np.abs(spectrum) ** 2).sum(axis=0), 360)
    turned = correlation[LEAST_TURN_DEG:181] / max(float(correlation[0]), 1e-9)
    best = int(turned.argmax())
    return float(turned[best]), float(LEAST_TURN_DEG + best)


@dataclass(frozen=True)
class _Seen:
    """Keypoints of a panorama, as it is and flipped left to right, and how many columns it has."""

    straight: Keypoints
    flipped: Keypoints
    columns: int


def way_round_findings(topo_map: TopoMap, where: str, track: Track) -> Iterator[Finding]:
    """Panoramas that lie otherwise than those of the nodes beside them: mirrored, upside down."""
    seen: dict[int, _Seen] = {}
    votes: dict[int, list[tuple[int, str]]] = {}
    for a, b in _pairs_to_compare(topo_map, track):
        for number in (a, b):
            if number not in seen:
                seen[number] = _keypoints(topo_map.nodes[number].panorama)
        way, _ = way_round(seen[a].straight, seen[b].straight, seen[b].flipped)
        if way is not None:
            turn = _turn(topo_map, (a, b), (seen[a], seen[b])) if way == "same" else 0.0
            votes.setdefault(a, []).append((b, f"turned by {-turn:.0f} degrees" if turn else way))
            votes.setdefault(b, []).append((a, f"turned by {turn:.0f} degrees" if turn else way))
    yield from _outvoted(topo_map, where, votes)


def _keypoints(panorama: Image | None) -> _Seen:
    assert panorama is not None  # or it would not be compared
    small = reduced(panorama)
    return _Seen(Keypoints.of(small), Keypoints.of(mirrored(small)), small.shape[1])


def _turn(topo_map: TopoMap, nodes: tuple[int, int], seen: tuple[_Seen, _Seen]) -> float:
    """How far the second panorama is turned to the first, beyond its heading [degrees, counter-clockwise]; mostly 0."""
    pairs = pairs_of(seen[0].straight, seen[1].straight)
    upright = pairs.near(0.0)
    directions = [
        topo_map.nodes[node].heading - 2.0 * np.pi * one.straight.places[found[upright], 0] / one.columns
        for node, one, found in zip(nodes, seen, (pairs.first, pairs.second), strict=True)
    ]
    together = np.exp(1j * (directions[1] - directions[0])).mean()
    turn = float(np.rad2deg(np.angle(together)))
    return turn if abs(together) > TURNED_TOGETHER and abs(turn) > TURNED_DEG else 0.0


def reduced(picture: Image) -> Image:
    """A picture of at most ``KEYPOINT_ROWS`` rows, in which keypoints are found sooner."""
    import cv2

    scale = KEYPOINT_ROWS / len(picture)
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA) if scale < 1.0 else picture
    return np.asarray(small)


def _pairs_to_compare(topo_map: TopoMap, track: Track) -> Iterator[tuple[int, int]]:
    """Edges between nodes with panoramas: all of them, or those of evenly picked nodes."""
    having = [number for number, node in enumerate(topo_map.nodes) if node.has_panorama]
    joined: dict[int, list[int]] = {number: [] for number in having}
    for a, b in np.asarray(topo_map.edges).tolist():
        if a in joined and b in joined:
            joined[a].append(b)
            joined[b].append(a)
    if len(having) < 2:
        return
    picked = [having[i] for i in np.unique(np.linspace(0, len(having) - 1, MOST_NODES).round().astype(int))]
    done: set[tuple[int, int]] = set()
    for number in track(picked, "comparing panoramas"):
        for other in sorted(joined[number], key=lambda j: distance(topo_map, number, j))[:3]:
            pair = (min(number, other), max(number, other))
            if pair not in done:
                done.add(pair)
                yield pair


def _outvoted(topo_map: TopoMap, where: str, votes: dict[int, list[tuple[int, str]]]) -> Iterator[Finding]:
    """The nodes that most neighbours disagree with, the most disputed first; each is then left out of the count."""
    left = {number: list(said) for number, said in votes.items()}
    while True:
        disputed = {n: sum(way != "same" for _, way in said) for n, said in left.items()}
        worst = max(disputed, key=lambda n: (disputed[n] / max(1, len(left[n])), disputed[n]), default=None)
        if worst is None or disputed[worst] == 0:
            return
        said = left.pop(worst)
        ways = [way for _, way in said if way != "same"]
        against = [topo_map.nodes[other].id for other, way in said if way != "same"]
        way = max(set(ways), key=ways.count)
        left = {n: [(other, vote) for other, vote in theirs if other != worst] for n, theirs in left.items()}
        what = f"the panorama of node {topo_map.nodes[worst].id} is {way}, seen from {listed(against)}"
        if len(said) == 1:
            what += ", or the other way about"
        yield Finding(where, what, f"turn the picture back, or take it again: {REMEDIES.get(way, OTHER)}", "serious")


OTHER = "its heading in nodes.csv is that of the left edge of its first column; or it is another node's picture"
"""What to look at where a panorama is turned about the vertical."""
REMEDIES: dict[str, str] = {
    "same": "",
    "mirrored": "columns of a panorama run clockwise, and a front camera of a phone or a mirror flips left and right",
    "rotated by 180 degrees": "the camera was mounted upside down",
    "upside down": "its rows begin at the bottom",
}
"""What to look at, by the way round that a picture lies."""
