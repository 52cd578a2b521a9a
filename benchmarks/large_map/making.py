"""A map of thousands of nodes from many simulated buildings side by side, and frames seen on and off its nodes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from benchmarks.large_map.pictures import KEPT, ON_NODE_M, frames, half_way, panorama, query_pose
from benchmarks.large_map.sites import Site, sites_of
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.snapshots import first_column_heading
from benchmarks.worlds.world import World
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Frame, Ints

SIZES = (300, 1_000, 3_000, 10_000)
"""Maps that are measured: the first so many nodes of a larger one."""
QUERIES = 300
"""For each size and each of ``PLACES``."""
OFF, ON = "off the nodes", "on a node"
PLACES = (OFF, ON)
"""Where the robot stands: up to half the way to the next node, or on the node, as in the thesis's single-image tests.

Queries are numbered all of the first, then all of the second: the same nodes under the same conditions.
"""
CONDITIONS: Mapping[str, Mapping[str, float]] = {
    "as mapped": {},
    "old": {"age": 1.0},
    "lights": {"bulbs": 0.5, "daylight": 0.5},
}
"""What has changed since the map was made, as in the scenarios lab-fresh, lab-old and lab-lights."""
TURNS = ("as mapped", "old", "as mapped", "lights")
"""Conditions of the queries, by turns: half of them see the building as it was mapped."""
Progress = Callable[[int], object]
"""Told how many nodes more are done."""


@dataclass(frozen=True)
class LargeMap:
    """A large map and what a robot sees on it.

    Attributes:
        topo_map: nodes with panoramas that are filtered and scaled already.
        frames: Q grey full-size pictures of a camera on a robot.
        truth: (Q, 3) poses of the robot's axis [m, m, rad, map frame].
        nodes: (Q,) index of the node nearest to it.
        drawn_from: (Q,) the robot stands near one of the first so many nodes, all equally likely.
        conditions: Q keys of ``CONDITIONS``.
        places: Q of ``PLACES``.
    """

    topo_map: TopoMap
    frames: Sequence[Frame]
    truth: Floats
    nodes: Ints
    drawn_from: Ints
    conditions: Sequence[str]
    places: Sequence[str]

    @cached_property
    def spacing(self) -> Floats:
        """(K,) distance from each node to the one nearest to it [m]."""
        positions = self.topo_map.positions
        return np.asarray(cKDTree(positions).query(positions, k=2)[0][:, 1])

    def subset(self, nodes: int, queries: int | None = None) -> LargeMap:
        """The map of the first ``nodes`` nodes with the queries drawn from it, or with the first few on and off nodes.

        Raises:
            UserError: no queries were drawn from so many nodes.
        """
        own, places = self.drawn_from == nodes, np.array(self.places)
        chosen = np.concatenate([np.flatnonzero(own & (places == place))[:queries] for place in PLACES])
        if not len(chosen):
            sizes = ", ".join(str(size) for size in np.unique(self.drawn_from))
            raise UserError(f"no queries are drawn from the first {nodes} nodes; choose from: {sizes}")
        edges = np.asarray(self.topo_map.edges)
        kept = replace(self.topo_map, nodes=self.topo_map.nodes[:nodes], edges=edges[(edges < nodes).all(axis=1)])
        return LargeMap(
            kept,
            [self.frames[query] for query in chosen],
            self.truth[chosen],
            self.nodes[chosen],
            self.drawn_from[chosen],
            [self.conditions[query] for query in chosen],
            [self.places[query] for query in chosen],
        )


@dataclass(frozen=True)
class Seen:
    """What a robot sees in one building.

    Attributes:
        queries: (R,) numbers of the queries in this building.
        truth: (R, 3) of the robot's axis [m, m, rad, map frame].
        frames: (R, 288, 384) grey.
    """

    queries: Ints
    truth: Floats
    frames: NDArray[np.uint8]


@dataclass(frozen=True)
class Part(Seen):
    """What one building adds to a large map; seen is what there is to see off its nodes.

    Attributes:
        panoramas: (count, 54, 648) grey.
    """

    panoramas: NDArray[np.uint8]


@dataclass(frozen=True)
class Plan:
    """What there is to make: the same plan is the same map, bit by bit.

    Attributes:
        nodes: of the map.
        seed: of buildings, panoramas and queries; from 1 on, since those below 10,000 times that belong to others.
        queries: for each size and each of ``PLACES``.
    """

    nodes: int
    seed: int
    queries: int = QUERIES

    def __post_init__(self) -> None:
        if min(self.nodes, self.queries, self.seed) < 1:
            raise UserError(
                f"a large map of {self.nodes} nodes with {self.queries} queries and seed {self.seed} cannot be made; "
                "give at least 1 of each"
            )

    @cached_property
    def sites(self) -> list[Site]:
        """The buildings."""
        return list(sites_of(self.nodes, self.seed))

    @cached_property
    def first_nodes(self) -> Ints:
        """Index of the first node of each building, and at last the number of nodes."""
        return np.concatenate([[0], np.cumsum([site.count for site in self.sites])])

    @property
    def sizes(self) -> list[int]:
        """Of the maps that queries are drawn from."""
        return [*(size for size in SIZES if size < self.nodes), self.nodes]

    @cached_property
    def nodes_of_queries(self) -> Ints:
        """The node that each query is taken at, the same for each of ``PLACES``: ``queries`` for each size."""
        drawn = [np.random.default_rng([self.seed, size]).integers(size, size=self.queries) for size in self.sizes]
        return np.tile(np.concatenate(drawn), len(PLACES))

    @cached_property
    def places(self) -> list[str]:
        """Of ``PLACES``, of each query."""
        return np.repeat(PLACES, len(self.sizes) * self.queries).tolist()

    def condition(self, query: int) -> str:
        """Key of ``CONDITIONS``."""
        return TURNS[query % (len(self.sizes) * self.queries) % len(TURNS)]

    def make(self, site: Site, progress: Progress) -> Part:
        """The panoramas of a building, and the queries off its nodes."""
        panoramas, world = [], site.world()
        for place in range(site.count):
            panoramas.append(panorama(world, site.seed, place))
            progress(1)
        return Part(**vars(self.seen(site, OFF)), panoramas=np.stack(panoramas))

    def seen(self, site: Site, place: str) -> Seen:
        """The queries in a building, of one of ``PLACES``."""
        first, last = self.first_nodes[site.number], self.first_nodes[site.number + 1]
        inside = (self.nodes_of_queries >= first) & (self.nodes_of_queries < last)
        queries = np.flatnonzero(inside & (np.array(self.places) == place))
        taken = [self._taken(site, name, queries) for name in CONDITIONS]
        numbers, poses, pictures = (np.concatenate(values) for values in zip(*taken, strict=True))
        return Seen(numbers, poses + np.append(site.shift, 0.0), pictures)

    def _taken(self, site: Site, name: str, queries: Ints) -> tuple[Ints, Floats, NDArray[np.uint8]]:
        """Numbers, poses in the building's own frame and frames of its queries under one condition."""
        numbers = np.array([query for query in queries.tolist() if self.condition(query) == name], dtype=np.int64)
        world = site.world(CONDITIONS[name])
        if not len(numbers):  # and the scene need not be drawn
            return numbers, np.zeros((0, 3)), np.zeros((0, world.camera.height, world.camera.width), dtype=np.uint8)
        scene = world.scene(site.seed, world.config.now())
        poses = np.stack([self._pose(site, world, scene, query) for query in numbers.tolist()])
        return numbers, poses, frames(world, scene, site.seed, poses, numbers.tolist())

    def _pose(self, site: Site, world: World, scene: Scene, query: int) -> Floats:
        """Of the robot (3,), in the building's own frame."""
        place = site.places[self.nodes_of_queries[query] - self.first_nodes[site.number]]
        reach = ON_NODE_M if self.places[query] == ON else half_way(world, place)
        return query_pose(scene, place, reach, np.random.default_rng([self.seed, query, 1]))

    def assemble(self, parts: Sequence[Part], on_nodes: Sequence[Seen]) -> LargeMap:
        """The map of all buildings' parts and what is seen on their nodes."""
        heading = first_column_heading(KEPT)
        nodes = [
            Node(f"{site.number}-{place.id}", f"{site.kind.title} {site.number}, {place.name}", x, y, heading, picture)
            for site, part in zip(self.sites, parts, strict=True)
            for place, (x, y), picture in zip(
                site.world().places, (site.places + site.shift).tolist(), part.panoramas, strict=False
            )
        ]
        edges = [site.edges() + first for site, first in zip(self.sites, self.first_nodes[:-1], strict=True)]
        name = f"{len(self.sites)} buildings, seed {self.seed} (simulated)"
        topo_map = TopoMap(name, KEPT, tuple(nodes), np.concatenate(edges), filtered=True)
        seen = [*parts, *on_nodes]
        order = np.argsort(np.concatenate([part.queries for part in seen]))
        truth = np.concatenate([part.truth for part in seen])[order]
        pictures = [picture for part in seen for picture in part.frames]
        mount = self.sites[0].world().mount
        taken = [Frame(float(query), None, mount, {"rgb": pictures[at]}) for query, at in enumerate(order)]
        return LargeMap(
            topo_map,
            taken,
            truth,
            topo_map.nearest_node(truth[:, :2]),
            np.tile(np.repeat(self.sizes, self.queries), len(PLACES)),
            [self.condition(query) for query in range(len(taken))],
            self.places,
        )


def make_large_map(nodes: int, seed: int, progress: Progress = lambda done: None, queries: int = QUERIES) -> LargeMap:
    """A large map, in memory.

    Args:
        nodes: how many, 36 KB each.
        seed: of buildings, panoramas and queries.
        progress: told how many nodes more are done.
        queries: on nodes and as many off them, for each of ``SIZES`` below that of the map, and for the whole map.
    """
    plan = Plan(nodes, seed, queries)
    parts = [plan.make(site, progress) for site in plan.sites]
    return plan.assemble(parts, [plan.seen(site, ON) for site in plan.sites])
