"""What is told of the turns that a map is built of: where, what is poor about the panorama, and what to do."""

from __future__ import annotations

import shlex
from collections.abc import Sequence

import numpy as np

from topoloc.mapping.building.circles import Circle
from topoloc.mapping.building.turns import Turn
from topoloc.mapping.building.way import Way
from topoloc.topo_map import TopoMap

SEEN_DEG = 0.5
"""A gap in a panorama no wider than this is not told of [degrees]."""
NAMED = 5
"""Of more nodes than this the others are counted."""

Looked = Sequence[tuple[Turn, Circle | str]]
"""Turns with their panorama, or why there is none."""


def notes_on(looked: Looked, way: Way, topo_map: TopoMap, spacing_m: float) -> tuple[str, ...]:
    """A sentence for each turn whose panorama is poor; where poses and pictures differ at most of them, one for all.

    Args:
        looked: in time.
        way: that the turns are on.
        topo_map: the map made of them.
        spacing_m: a node that is farther from a turn does not name it [m].
    """
    doubtful = [(turn, circle) for turn, circle in looked if isinstance(circle, Circle) and circle.doubt]
    gathered = len(doubtful) > max(1.0, len(looked) / 2.0)
    notes = [_on_all([turn for turn, _ in doubtful], len(looked), topo_map, way)] if gathered else []
    for turn, circle in looked:
        told = _on_one(circle, gathered)
        notes += [f"{_node(turn, topo_map, spacing_m)}{pictures_of(turn, way)}: {told}"] if told else []
    return tuple(notes)


def pictures_of(turn: Turn, way: Way) -> str:
    """The first and the last picture that were taken of a turn."""
    first, last = (way.pictures[int(frame)].path.name for frame in (turn.frames.min(), turn.frames.max()))
    return f"pictures {first} to {last}"


def _on_all(turns: list[Turn], most: int, topo_map: TopoMap, way: Way) -> str:
    names = [topo_map.nodes[_nearest(turn, topo_map)].id for turn in turns]
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return (
        f"at {len(turns)} of {most} turns (nodes {', '.join(names[:NAMED])}{more}) the pictures do not fit together as "
        f"the poses say, and the panoramas are made by the poses: is hfov_deg right? 'topoloc camera turn "
        f"{shlex.quote(str(way.recording.folder))}' measures it"
    )


def _on_one(circle: Circle | str, gathered: bool) -> str:
    if isinstance(circle, str):
        return f"no panorama: {circle}; let the robot turn full circle there, or correct hfov_deg if it is too small"
    found = []
    if circle.doubt and not gathered:
        found.append(
            f"its frames stand where the poses say, since {circle.doubt}; look at its panorama, and if things are torn "
            "or doubled there, drive this turn again, slowly"
        )
    if circle.missing_deg > SEEN_DEG:
        found.append(
            f"{circle.missing_deg:.0f} degrees of its panorama stay black; let the robot turn full circle there"
        )
    return "; ".join(found)


def _nearest(turn: Turn, topo_map: TopoMap) -> int:
    return int(topo_map.nearest_node(turn.position[None])[0])


def _node(turn: Turn, topo_map: TopoMap, spacing_m: float) -> str:
    """The node of a turn, or one that is near it."""
    node = topo_map.nodes[_nearest(turn, topo_map)]
    away = float(np.hypot(node.x - turn.position[0], node.y - turn.position[1]))
    if away > spacing_m:
        return ""
    return f"node {node.id}, " if away < 1e-6 else f"near node {node.id}, "
