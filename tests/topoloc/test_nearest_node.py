from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial import cKDTree

from topoloc.nearest_node import MOST_CELLS, NearestNode
from topoloc.topo_map import Camera, Node, TopoMap


def made(nodes: np.ndarray, margin: float = 1.0) -> NearestNode:
    """With its table: as many places were asked for as it has cells."""
    nearest = NearestNode(cKDTree(nodes), nodes.min(axis=0) - margin, nodes.max(axis=0) + margin)
    nearest.of(np.zeros((MOST_CELLS + 10_000, 2)))
    return nearest


def scattered(count: int) -> np.ndarray:
    return np.random.default_rng(count).uniform([-3.0, 2.0], [9.0, 7.0], (count, 2))


MAPS = {
    "one node": np.array([[2.0, -1.0]]),
    "two in one place": np.array([[0.0, 0.0], [0.0, 0.0], [1.0, 1.0]]),
    "a lattice": np.stack(np.meshgrid(np.arange(5.0), np.arange(3.0)), axis=-1).reshape(-1, 2),
    "a line": np.column_stack([np.arange(30.0), np.zeros(30)]),
    "scattered": scattered(60),
    "more than cells are for": scattered(700),
    "one far away": np.append(scattered(20), [[1e7, 0.0]], axis=0),
    "close together": 1e-7 * scattered(10),
}


@pytest.mark.parametrize("name", MAPS)
def test_the_nearest_node_is_the_trees(name: str) -> None:
    nodes = MAPS[name]
    nearest, rng = made(nodes), np.random.default_rng(1)
    low, high = nodes.min(axis=0) - 2.0, nodes.max(axis=0) + 2.0
    around = nodes[rng.integers(len(nodes), size=20_000)] + rng.normal(0.0, 0.7, (20_000, 2))
    places = np.concatenate([rng.uniform(low, high, (20_000, 2)), around, nodes, [[1e12, -1e12]]])
    np.testing.assert_array_equal(nearest.of(places), cKDTree(nodes).query(places)[1])


def test_places_on_the_borders_and_on_the_tables_lines() -> None:
    nodes = MAPS["a lattice"]
    nearest = made(nodes)
    lines = np.arange(-1.0, 5.0, 0.125)  # nodes' borders at halves, and whatever lines the table has near them
    places = np.stack(np.meshgrid(lines, lines), axis=-1).reshape(-1, 2)
    close = np.concatenate([places + shift for shift in (-1e-9, -1e-16, 0.0, 1e-16, 1e-9)])
    np.testing.assert_array_equal(nearest.of(close), cKDTree(nodes).query(close)[1])


class CountingTree:
    """A tree that tells how many places it was asked for."""

    def __init__(self, nodes: np.ndarray) -> None:
        self.tree, self.n, self.asked = cKDTree(nodes), len(nodes), 0

    def query(self, places: np.ndarray, **options: int) -> tuple[np.ndarray, np.ndarray]:
        self.asked += places.size // 2
        distance, node = self.tree.query(places, **options)
        return np.asarray(distance), np.asarray(node)


def test_the_table_is_made_once_it_pays_and_spares_most_of_the_trees_work() -> None:
    nodes = MAPS["a lattice"]
    tree, rng = CountingTree(nodes), np.random.default_rng(2)
    nearest = NearestNode(tree, nodes.min(axis=0) - 1.0, nodes.max(axis=0) + 1.0)
    places = rng.uniform(nodes.min(axis=0) - 1.0, nodes.max(axis=0) + 1.0, (1000, 2))
    for _ in range(10):
        nearest.of(places)
    assert tree.asked == 10_000  # of some 15,000 cells: no table yet
    for _ in range(10):
        nearest.of(places)
    tree.asked = 0
    for _ in range(10):
        nearest.of(places)
    assert 0 < tree.asked < 2_000
    nearest.of(places[:5])
    assert tree.asked < 2_005  # and none is made again


def test_a_map_asks_it() -> None:
    nodes = MAPS["scattered"]
    the_map = TopoMap("m", Camera(), tuple(Node(str(i), "", x, y) for i, (x, y) in enumerate(nodes)))
    places = np.random.default_rng(3).uniform(-6.0, 12.0, (100_000, 2))
    expected = np.argmin(((places[:2000, None] - nodes) ** 2).sum(axis=2), axis=1)
    for _ in range(2):
        np.testing.assert_array_equal(the_map.nearest_node(places)[:2000], expected)
    np.testing.assert_array_equal(the_map.nearest_node(places[:3]), expected[:3])
    assert the_map.nearest_node(np.zeros((0, 2))).shape == (0,)
