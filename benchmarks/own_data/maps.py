"""How well robots localize on maps that were built from recorded drives, with and without the odometer's drift."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from benchmarks.own_data.built import where_nodes_are
from benchmarks.own_data.driving import drive_of, part, scan_of, true_poses
from benchmarks.own_data.localizing import judged, localized
from benchmarks.own_data.own_table import Figures, OwnTable, each, mean
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import World
from topoloc.geometry import Floats, compose
from topoloc.mapping.building import BuildConfig, build_map, way_of
from topoloc.mapping.building.config import Poses
from topoloc.metrics import evaluate
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap

SENSORS = ("ima", "pca", "local")
POSITION_BY = "local"
ESTIMATOR = "particle"
SOURCES: tuple[Poses, ...] = ("truth", "odometry")


def measure(seed: int, kind: type[World] = LabWorld) -> Iterator[Figures]:
    """The world's own map, then one of each drive and source of poses, with the rest of the drive to localize."""
    world = kind(WorldSettings())
    lap = round(world.frames_per_lap) + 1
    with TemporaryDirectory() as folder:
        drive, scan = drive_of(world, seed, Path(folder) / "drive"), scan_of(world, seed, Path(folder) / "scan")
        rest = part(drive, lap)
        own = world.topo_map(seed)
        yield _localized(own, own, rest, None)
        for recording in (scan, part(drive, 0, lap)):
            for poses in SOURCES:
                yield _on_built(recording, poses, rest)


def _on_built(recording: Recording, poses: Poses, rest: Recording) -> Figures:
    """Of the map that is built from a recording with the poses of a source."""
    topo_map = build_map(recording, BuildConfig(poses=poses)).topo_map
    truth = true_poses(recording)
    figures = _localized(
        topo_map, where_nodes_are(topo_map, recording), rest, truth[0] if poses == "odometry" else None
    )
    if poses == "truth":
        return figures
    driven = way_of(recording, poses, None, Counter()).robot
    off = np.linalg.norm(compose(truth[0], driven)[:, :2] - truth[:, :2], axis=1)
    return {**figures, "frames off, median": float(np.median(off)), "at most": float(off.max())}


def _localized(topo_map: TopoMap, there: TopoMap, rest: Recording, origin: Floats | None) -> Figures:
    """Figures of all sensors that a map can serve, and the number of its nodes."""
    figures: dict[str, float] = {"nodes": len(topo_map.nodes)}
    for sensor in SENSORS:
        if sensor == "ima" and not all(node.has_panorama for node in topo_map.nodes):
            continue
        values = evaluate(judged(there, rest, localized(topo_map, rest, sensor, ESTIMATOR), origin))
        named = {f"`{sensor}`": values["node_accuracy"]}
        if sensor == POSITION_BY:
            named[f"position, `{sensor}`"] = values["position_median_m"]
        figures.update({name: value for name, value in named.items() if value is not None})
    return figures


MAPS = OwnTable(
    name="maps",
    page="maps.md",
    about=(
        f"Simulated laboratory: share of the updates in the right node, with `{ESTIMATOR}`; median position error; how "
        "far the poses that the map was built from are off, median and at most over its frames."
    ),
    seeds=(0, 1, 2),
    heads=("map",),
    rows=(
        ("the world's own (panoramas only)",),
        ("`scan`, truth",),
        ("`scan`, odometry",),
        ("`lap`, truth",),
        ("`lap`, odometry",),
    ),
    columns={
        "nodes": each,
        **{f"`{sensor}`": mean(3) for sensor in SENSORS},
        f"position, `{POSITION_BY}`": mean(2, " m"),
        "frames off, median": mean(2, " m"),
        "at most": mean(2, " m"),
    },
    measure=measure,
)
