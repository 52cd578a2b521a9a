"""What would go wrong with a map or a recording that can be read: findings, each with a place and a remedy."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import InputError, UnreadableImage
from topoloc.geometry import between
from topoloc.pictures import PictureFile, held_in
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap

DARK_LEVEL = 15.0
"""A picture whose mean grey level is lower is dark."""
GAP_FACTOR = 10.0
"""A pause so many times longer than the median step in time is a gap."""
JUMP_M_PER_S = 5.0
"""A robot that one odometer reading makes this fast has jumped [m/s]."""


@dataclass(frozen=True)
class Finding:
    """What is wrong, where, and what to do."""

    where: str
    what: str
    remedy: str


@dataclass(frozen=True)
class Report:
    """A line that says what was looked at, and what was found."""

    summary: str
    findings: tuple[Finding, ...]


def check_map(topo_map: TopoMap, folder: Path) -> Report:
    """Look a map over: nodes on one spot, nodes cut off, missing, dark or empty panoramas. ``folder``: or its file."""
    where = str(folder / "nodes.csv" if folder.is_dir() else folder)
    with_panorama = sum(node.has_panorama for node in topo_map.nodes)
    summary = (
        f"map {topo_map.name!r}: {len(topo_map.nodes)} nodes, {len(np.asarray(topo_map.edges))} edges, "
        f"{with_panorama} panoramas, {len(topo_map.views)} views"
    )
    findings = []
    if with_panorama < len(topo_map.nodes) and not topo_map.views:
        lacking = ", ".join(node.id for node in topo_map.nodes if not node.has_panorama)
        findings.append(Finding(where, f"nodes without a panorama: {lacking}", "ima needs one for each"))
    for a, b in _close_pairs(topo_map, 0.05):
        findings.append(Finding(where, f"nodes {a} and {b} are less than 5 cm apart", "keep one of them"))
    findings += _parts(topo_map, where)
    findings += _panorama_findings(topo_map, where)
    _decode_views(topo_map)
    return Report(summary, tuple(findings))


def _panorama_findings(topo_map: TopoMap, where: str) -> list[Finding]:
    findings = []
    for node in topo_map.nodes:
        panorama = node.panorama
        if panorama is None:
            continue
        empty = float((panorama.reshape(len(panorama), panorama.shape[1], -1).max(axis=(0, 2)) == 0).mean())
        if empty > 0.0:
            what = f"{empty * 360.0:.0f} degrees of the panorama of node {node.id} are black"
            findings.append(Finding(where, what, "take the snapshots again, or align them by another method"))
        elif panorama.mean() < DARK_LEVEL:
            findings.append(Finding(where, f"the panorama of node {node.id} is very dark", "take it with more light"))
    return findings


def _decode_views(topo_map: TopoMap) -> None:
    """Raise ``InputError`` for the first picture of a view that is broken: opening a map does not decode them."""
    for view in topo_map.views:
        for picture in (held_in(view, "image"), held_in(view, "right")):
            if isinstance(picture, PictureFile):
                picture.read()


def _parts(topo_map: TopoMap, where: str) -> list[Finding]:
    """Nodes that no edges lead to from the first one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges, count = np.asarray(topo_map.edges), len(topo_map.nodes)
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    if parts == 1:
        return []
    apart = [node.id for node, own in zip(topo_map.nodes, part, strict=True) if own != part[0]]
    listed = ", ".join(apart[:8]) + (", ..." if len(apart) > 8 else "")
    what = f"the map falls into {parts} parts: no edges lead from node {topo_map.nodes[0].id} to {listed}"
    return [Finding(where, what, "add them to edges.csv, or look for a wrong position")]


def _close_pairs(topo_map: TopoMap, distance: float) -> list[tuple[str, str]]:
    from scipy.spatial import cKDTree

    pairs = sorted(cKDTree(topo_map.positions).query_pairs(distance))
    return [(topo_map.nodes[a].id, topo_map.nodes[b].id) for a, b in pairs]


def check_recording(recording: Recording) -> Report:
    """Look a recording over: pictures that cannot be read, dark ones, gaps in time, jumps of the odometer."""
    listed = recording.pictures[recording.kind]
    where = str(recording.folder / f"{recording.kind}.txt")
    times = np.array([picture.time for picture in listed])
    parts = [name for name in ("odometry", "truth", "pan") if getattr(recording, name) is not None]
    beside = f", with {', '.join(parts)}" if parts else ""
    summary = f"recording: {len(listed)} frames in {times[-1] - times[0]:.1f} s{beside}"
    findings = _picture_findings(recording, where)
    steps = np.diff(times)
    if len(steps) > 2:
        for i in np.flatnonzero(steps > GAP_FACTOR * np.median(steps)).tolist():
            what = f"line {listed[i + 1].line} comes {steps[i]:.1f} s after the frame before"
            findings.append(Finding(where, what, "cut the recording there"))
    if recording.odometry is None:
        what = "there is no odometry.txt"
        findings.append(Finding(str(recording.folder), what, "record the odometer: without it each frame stands alone"))
    else:
        findings += _odometry_findings(recording)
    return Report(summary, tuple(findings))


def _picture_findings(recording: Recording, where: str) -> list[Finding]:
    findings = []
    sizes: dict[tuple[int, int], int] = {}
    for picture in recording.pictures[recording.kind]:
        try:
            image = recording.frame(picture).images[recording.kind]
        except UnreadableImage as error:
            findings.append(
                Finding(f"{where}, line {picture.line}", f"{picture.path.name} {error.problem}", error.remedy)
            )
            continue
        except InputError as error:
            findings.append(Finding(str(error.path), error.problem, error.remedy))
            continue
        sizes.setdefault((image.shape[1], image.shape[0]), picture.line)
        if image.mean() < DARK_LEVEL:
            what = f"{picture.path.name} is very dark"
            findings.append(Finding(f"{where}, line {picture.line}", what, "look whether the lens was covered"))
    if len(sizes) > 1:
        listed = ", ".join(f"{width}x{height} (line {line})" for (width, height), line in sizes.items())
        findings.append(Finding(where, f"pictures of different sizes: {listed}", "scale them to one size"))
    return findings


def _odometry_findings(recording: Recording) -> list[Finding]:
    track = recording.odometry
    assert track is not None
    where = str(recording.folder / "odometry.txt")
    findings = []
    if len(track.times) > 1:
        moved = between(track.poses[:-1], track.poses[1:])
        speed = np.hypot(moved[:, 0], moved[:, 1]) / np.diff(track.times)
        for i in np.flatnonzero(speed > JUMP_M_PER_S):
            what = f"at {track.times[i + 1]:.3f} s the odometer moves {speed[i]:.1f} m/s"
            findings.append(Finding(where, what, "look for lost readings, or millimetres instead of metres"))
    pictures = recording.pictures[recording.kind]
    outside = sum(not track.times[0] - 0.5 <= picture.time <= track.times[-1] + 0.5 for picture in pictures)
    if outside:
        findings.append(Finding(where, f"{outside} frames lie outside its times", "record both with one clock"))
    return findings
