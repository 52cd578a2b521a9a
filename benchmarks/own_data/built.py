"""A map built from a simulated recording, and where its places truly are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.own_data.driving import true_poses
from topoloc.recording import Recording
from topoloc.topo_map import Node, TopoMap


def where_nodes_are(topo_map: TopoMap, recording: Recording) -> TopoMap:
    """A map whose nodes stand where the robot truly was as they were made; without pictures.

    Args:
        topo_map: built from the recording, whose poses may have drifted: its nodes are named after pictures.
        recording: with the truth.
    """
    names = [picture.path.stem for picture in recording.pictures[recording.kind]]
    truth = dict(zip(names, true_poses(recording), strict=True))
    places = [truth[node.name] for node in topo_map.nodes]
    nodes = tuple(
        Node(node.id, node.name, float(x), float(y)) for node, (x, y, _) in zip(topo_map.nodes, places, strict=True)
    )
    return replace(topo_map, nodes=nodes, edges=np.asarray(topo_map.edges), views=())
