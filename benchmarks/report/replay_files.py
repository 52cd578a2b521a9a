"""The replay's files of a scenario, read as they lie in the run's folder; what is missing or broken is said."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.run_files import drive_path
from topoloc.errors import InputError
from topoloc.files import read_text
from topoloc.geometry import Floats
from topoloc.metrics import ADJACENT_WITHIN_M

PICTURE = "data:image/"
"""Every picture begins so; anything else could be loaded from elsewhere."""
BROKEN = (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError)
"""What values of another shape than ``benchmarks.replay`` writes lead to."""


ROUNDED_M = 0.001
"""Places are kept in millimetres: nodes that are a metre apart may come out so much farther apart."""


class Unreadable(Exception):
    """A file of the replay that is missing or broken; the text says so."""


@dataclass(frozen=True)
class DriveRead:
    """What is to be seen of a drive: ``benchmarks.replay.Drive`` in whole centimetres, degrees and tenths of seconds.

    Attributes:
        seed: of the drive.
        nodes: id, name, x, y [cm], heading of the panorama's first column [deg], each.
        panoramas: pictures of the nodes; empty where there is none.
        edges: pairs of indices of nodes.
        truth: x, y [cm], heading [deg] at each frame.
        near: at each frame, the nodes that are adjacent if they are not right: indices.
        reckoned: x, y [cm] at each frame, by the odometer alone; empty without one.
        frames: pictures; empty where there is none.
        kidnapped_at: indices of the first frames after the robot was carried.
    """

    seed: int
    nodes: list[tuple[str, str, int, int, float]]
    panoramas: list[str]
    edges: list[tuple[int, int]]
    truth: list[tuple[int, int, int]]
    near: list[frozenset[int]]
    reckoned: list[tuple[int, int]]
    frames: list[str]
    kidnapped_at: list[int]


def read_json(folder: Path, path: PurePosixPath) -> Any:
    """The content of a file of the replay. Raises ``Unreadable``."""
    try:
        return json.loads(read_text(folder / path, "run the benchmark again"))
    except InputError as error:
        raise Unreadable(f"{path}: {error.problem}") from None
    except (ValueError, RecursionError):
        raise Unreadable(f"{path}: is not valid JSON") from None


def read_drive(folder: Path, scenario: str) -> DriveRead:
    """The drive that is shown of a scenario. Raises ``Unreadable``."""
    path = drive_path(scenario)
    found = read_json(folder, path)
    try:
        drive = _drive(found)
    except BROKEN:
        raise Unreadable(f"{path}: does not hold a drive") from None
    if not drive.truth or len(drive.frames) != len(drive.truth):
        raise Unreadable(f"{path}: does not hold a drive")
    return drive


def _drive(found: Any) -> DriveRead:
    nodes = [
        (str(node["id"]), str(node["name"]), whole(node["x"], 100), whole(node["y"], 100), float(node["heading_deg"]))
        for node in found["nodes"]
    ]
    edges = [(int(a), int(b)) for a, b in found["edges"]]
    if any(not 0 <= index < len(nodes) for edge in edges for index in edge):
        raise ValueError("an edge to a node that is not there")
    places = np.array([(node["x"], node["y"]) for node in found["nodes"]], dtype=np.float64)
    truth = np.array([pose[:2] for pose in found["truth"]], dtype=np.float64).reshape(-1, 2)
    return DriveRead(
        int(found["seed"]),
        nodes,
        [_picture(node["panorama"]) for node in found["nodes"]],
        edges,
        [(whole(x, 100), whole(y, 100), whole(heading)) for x, y, heading in found["truth"]],
        near_nodes(places, edges, truth),
        [(whole(x, 100), whole(y, 100)) for x, y in found["reckoned"]],
        [_picture(frame) for frame in found["frames"]],
        [int(frame) for frame in found["kidnapped_at"]],
    )


def near_nodes(places: Floats, edges: Iterable[tuple[int, int]], truth: Floats) -> list[frozenset[int]]:
    """The nodes within 1 m or one edge of the true one, itself included, as ``topoloc.metrics.Run.adjacent`` has it.

    Args:
        places: (K, 2) of the nodes [m].
        edges: pairs of indices of nodes.
        truth: (N, 2) true positions [m].

    Returns:
        N sets of indices. Raises ``ValueError`` where a place is not finite.
    """
    tree = cKDTree(places)
    true_nodes = tree.query(truth)[1]
    joined: dict[int, set[int]] = {}
    for a, b in edges:
        joined.setdefault(a, set()).add(b)
        joined.setdefault(b, set()).add(a)
    once = np.unique(true_nodes)
    close = tree.query_ball_point(places[once], ADJACENT_WITHIN_M + ROUNDED_M)
    near = {node: frozenset(nodes) | joined.get(node, set()) for node, nodes in zip(once, close, strict=True)}
    return [near[node] for node in true_nodes]


def whole(value: float, scale: float = 1.0) -> int:
    """A number times ``scale``, rounded. Raises ``ValueError`` or ``OverflowError`` where it is not finite."""
    return round(float(value) * scale)


def _picture(url: str) -> str:
    return url if url.startswith(PICTURE) else ""
