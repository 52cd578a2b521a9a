"""Whether IMA sees on the pictures of a large map what it sees on full-size ones.

One office floor of 103 nodes, seed 2000, 100 queries on its nodes and 100 off them under each condition. Its map is
made four times: at full size, as ``simulate`` would; the same pictures kept at IMA's scale; rendered at half size, as
large maps are; and at full size once more with other chances of scan and sensor, which is how much two maps of one
floor differ anyway.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from benchmarks.large_map.making import CONDITIONS, ON, PLACES
from benchmarks.large_map.pictures import KEPT, ON_NODE_M, RENDERED, frames, half_way, panorama, query_pose
from benchmarks.worlds.building import BuildingSettings, BuildingWorld
from benchmarks.worlds.world import World
from sensors.ima import IMA
from topoloc.geometry import Floats
from topoloc.topo_map import Camera, TopoMap
from topoloc.types import Frame, Image, Ints

SEED, ROOMS, QUERIES = 2000, 10, 100
NEAR_M = 1.7
"""A node at most this far from the true one is right: one spacing, that of the corridor [m]."""


@dataclass(frozen=True)
class Row:
    """A map of the floor beside the full-size one, over all conditions.

    Attributes:
        name: how the map was made.
        place: one of ``PLACES``, where the robot stands.
        same: share of the queries with the same best node.
        right: share whose best node is right.
        best: mean of their best matches.
        match: mean of all their matches.
    """

    name: str
    place: str
    same: float
    right: float
    best: float
    match: float


def rows(rooms: int = ROOMS, queries: int = QUERIES) -> Iterator[Row]:
    """The four maps in turn."""
    world = BuildingWorld(BuildingSettings(rooms=rooms, updates=1))
    truth = np.random.default_rng([SEED, queries]).integers(len(world.places), size=(len(CONDITIONS), queries))
    taken = {place: _queries(world, truth, place) for place in PLACES}
    full = world.topo_map(SEED)
    other = partial(_errors, SEED + 1)
    ways: dict[str, Callable[[], TopoMap]] = {
        "full size": lambda: full,
        "full size, kept at 72 columns": lambda: _kept(world, full, Camera()),
        "half size, kept at 72 columns": lambda: _kept(world, full, RENDERED),
        "full size, other chances, kept at 72 columns": lambda: _kept(world, full, Camera(), other),
    }
    usual: dict[str, Ints] = {}
    for name, way in ways.items():
        topo_map = way()
        for place in PLACES:
            matches = _matches(topo_map, taken[place])
            best = matches.argmax(axis=1)
            near = np.linalg.norm(world.positions[best] - world.positions[truth.ravel()], axis=1) <= NEAR_M
            same = best == usual.setdefault(place, best)
            shares = (float(same.mean()), float(near.mean()))
            yield Row(name, place, *shares, float(matches.max(axis=1).mean()), float(matches.mean()))


def _queries(world: World, truth: Ints, place: str) -> list[Frame]:
    """Frames at the nodes ``truth`` (C, queries), under every condition in turn."""
    taken: list[Image] = []
    group, queries = PLACES.index(place), truth.shape[1]
    for number, (changes, nodes) in enumerate(zip(CONDITIONS.values(), truth, strict=True), group * len(CONDITIONS)):
        now = BuildingWorld(replace(world.config, **changes))
        scene, rng = now.scene(SEED, now.config.now()), np.random.default_rng([SEED, queries, number])
        at = world.positions[nodes]
        reach = [ON_NODE_M if place == ON else half_way(world, node) for node in at]
        poses = np.stack([query_pose(scene, node, far, rng) for node, far in zip(at, reach, strict=True)])
        taken += [*frames(now, scene, SEED, poses, range(number * queries, (number + 1) * queries))]
    return [Frame(float(at), None, world.mount, {"rgb": image}) for at, image in enumerate(taken)]


def _errors(seed: int, place: int) -> np.random.Generator:
    """Chances of scan and sensor at a place."""
    return np.random.default_rng([seed, place])


def _kept(
    world: World,
    full: TopoMap,
    camera: Camera,
    errors: Callable[[int], np.random.Generator | None] = lambda place: None,
) -> TopoMap:
    """The map with panoramas as large maps keep them, of snapshots rendered with ``camera``."""
    nodes = tuple(
        replace(node, panorama=panorama(world, SEED, place, camera, errors(place)))
        for place, node in enumerate(full.nodes)
    )
    return replace(full, camera=KEPT, nodes=nodes, filtered=True)


def _matches(topo_map: TopoMap, taken: list[Frame]) -> Floats:
    """Match (Q, K) of every query with every node; 0 for a blind frame."""
    ima = IMA()
    ima.fit(topo_map)
    seen = [ima.observe(frame) for frame in taken]
    blind = np.zeros(len(topo_map.nodes))
    return np.stack([blind if one.is_blind else one.match for one in seen])
