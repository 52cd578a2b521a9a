"""A map looked over."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from topoloc.checks.alike import alike_findings
from topoloc.checks.field_of_view import Look, frame_findings, placed_on
from topoloc.checks.finding import Finding, Report, listed
from topoloc.checks.panoramas import panorama_findings, way_round_findings
from topoloc.checks.poses_of_frames import pose_findings
from topoloc.going_through import Track, in_silence
from topoloc.pictures import PictureFile, held_in
from topoloc.topo_map import TopoMap

ONE_SPOT_M = 0.05
"""Nodes nearer to each other than this are on one spot [m]."""
MOST_VIEWS = 30
"""So many training views are held against the panoramas."""


def check_map(topo_map: TopoMap, folder: Path, track: Track = in_silence) -> Report:
    """Look a map over: its nodes, its panoramas one by one, beside each other, and for nodes that look alike.

    Args:
        topo_map: that was read.
        folder: it was read from, or the text map's file.
        track: goes through numbers and may show how far it is.

    Raises:
        InputError: a picture that does not decode.
    """
    where = str(folder / "nodes.csv" if folder.is_dir() else folder)
    with_panorama = sum(node.has_panorama for node in topo_map.nodes)
    summary = (
        f"map {topo_map.name!r}: {len(topo_map.nodes)} nodes, {len(np.asarray(topo_map.edges))} edges, "
        f"{with_panorama} panoramas, {len(topo_map.views)} views"
    )
    _decode_views(topo_map)
    flaws = [*_nodes(topo_map, where), *panorama_findings(topo_map, where, track)]
    flaws += way_round_findings(topo_map, where, track)
    flaws += alike_findings(topo_map, where, track)
    flaws += _view_findings(topo_map, where, track)
    return Report(summary, tuple(flaws))


def _nodes(topo_map: TopoMap, where: str) -> Iterator[Finding]:
    """Nodes that are lacking, on one spot, or cut off."""
    lacking = [node.id for node in topo_map.nodes if not node.has_panorama]
    if lacking and not topo_map.views:
        what = f"nodes without a panorama: {listed(lacking)}"
        yield Finding(where, what, "ima needs one for each: turn on the spot there", "serious")
    elif lacking:
        what = f"{len(lacking)} of {len(topo_map.nodes)} nodes have no panorama: {listed(lacking)}"
        yield Finding(where, what, "ima never names them; pca, local, histogram use the views", "note")
    if len(topo_map.nodes) == 1:
        yield Finding(where, "there is one node only", "add more: with one there is nothing to tell apart", "warning")
    for a, b in _close_pairs(topo_map):
        yield Finding(where, f"nodes {a} and {b} are less than 5 cm apart", "keep one of them", "warning")
    yield from _parts(topo_map, where)


def _view_findings(topo_map: TopoMap, where: str, track: Track) -> Iterator[Finding]:
    """Views held against the panoramas around them."""
    chosen = np.unique(np.linspace(0, len(topo_map.views) - 1, MOST_VIEWS).round().astype(int))
    views = [topo_map.views[i] for i in chosen] if topo_map.views else []
    placed = placed_on(topo_map, [Look(view.image, view.pose) for view in views], track)
    yield from frame_findings(topo_map, placed, where)
    yield from pose_findings(topo_map, [one for one in placed if one.way == "same"], where)


def _decode_views(topo_map: TopoMap) -> None:
    """Raise ``InputError`` for the first picture of a view that is broken: opening a map does not decode them."""
    for view in topo_map.views:
        for picture in (held_in(view, "image"), held_in(view, "right")):
            if isinstance(picture, PictureFile):
                picture.read()


def _parts(topo_map: TopoMap, where: str) -> Iterator[Finding]:
    """Nodes that no edges lead to from the first one."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    edges, count = np.asarray(topo_map.edges), len(topo_map.nodes)
    graph = coo_array((np.ones(len(edges)), (edges[:, 0], edges[:, 1])), shape=(count, count))
    parts, part = connected_components(graph, directed=False)
    if parts > 1:
        apart = [node.id for node, own in zip(topo_map.nodes, part, strict=True) if own != part[0]]
        what = f"the map falls into {parts} parts: no edges lead from node {topo_map.nodes[0].id} to {listed(apart)}"
        yield Finding(where, what, "add them to edges.csv, or look for a wrong position", "warning")


def _close_pairs(topo_map: TopoMap) -> list[tuple[str, str]]:
    from scipy.spatial import cKDTree

    pairs = sorted(cKDTree(topo_map.positions).query_pairs(ONE_SPOT_M))
    return [(topo_map.nodes[a].id, topo_map.nodes[b].id) for a, b in pairs]
