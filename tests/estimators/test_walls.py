"""Walls that only the edges tell of, and what they do to the grid and to particles."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from estimators.auxiliary import AuxiliaryParticleFilter
from estimators.free_area import FreeArea
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter
from topoloc.estimate import node_masses
from topoloc.interfaces import Estimator
from topoloc.testing import toy_map
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

PLACES = {"a0": (0.0, 0.4), "a1": (2.0, 0.4), "b0": (0.0, -0.4), "b1": (2.0, -0.4), "door": (4.5, 0.0)}
"""Two rooms back to back, a and b; from each a door leads to the corridor, and round it to the other."""
EDGES = np.array([[0, 1], [2, 3], [1, 4], [3, 4]])
AT_THE_WALL = Motion(np.array([0.25, 0.0, 0.0]), np.diag([0.0009, 0.0009, 1e-6]))


def rooms(edges: np.ndarray = EDGES, free: tuple[np.ndarray, ...] = ()) -> TopoMap:
    nodes = tuple(Node(name, name, x, y) for name, (x, y) in PLACES.items())
    return TopoMap("back to back", Camera(), nodes, edges, free)


def at(area: FreeArea, *steps: tuple[float, float, float, float]) -> list[bool]:
    ends = np.array(steps)
    return [bool(value) for value in area.barred(ends[:, :2], ends[:, 2:])]


def test_the_way_round_makes_the_wall() -> None:
    area = FreeArea(rooms(), 0.25, 0.75)
    through, along, the_other_way = (0.0, 0.1, 0.0, -0.2), (0.0, 0.4, 1.0, 0.4), (0.3, -0.4, 0.3, 0.4)
    assert at(area, through, along, the_other_way) == [True, False, True]
    near_the_door = (4.0, 0.1, 4.0, -0.1)  # the way round is 1 m
    assert at(area, near_the_door) == [False]


def test_a_long_step_does_not_jump_the_wall() -> None:
    area = FreeArea(rooms(), 0.25, 0.75)
    assert at(area, (0.0, 0.9, 0.0, -0.9), (0.0, -0.9, 0.5, 0.9), (-0.7, 0.9, 2.0, 0.9)) == [True, True, False]


def test_three_sides_of_a_square_lead_around_no_wall() -> None:
    square = np.array([[0, 1], [1, 3], [3, 2]])
    nodes = tuple(Node(str(n), "", x, y) for n, (x, y) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]))
    assert not FreeArea(TopoMap("square", Camera(), nodes, square), 0.25, 0.75).has_walls
    assert not FreeArea(toy_map(), 0.25, 0.75).has_walls


def test_two_parts_that_no_edge_joins_are_apart() -> None:
    nodes = tuple(Node(str(n), "", x, y) for n, (x, y) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]))
    area = FreeArea(TopoMap("two", Camera(), nodes, np.array([[0, 1], [2, 3]])), 0.25, 0.75)
    assert at(area, (0.5, 0.4, 0.5, 0.6), (0.1, 0.0, 0.9, 0.1)) == [True, False]


def test_a_polygon_is_free_of_walls() -> None:
    hall = np.array([[-1.0, -2.0], [6.0, -2.0], [6.0, 2.0], [-1.0, 2.0]])
    assert not FreeArea(rooms(free=(hall,)), 0.25, 0.75).has_walls


def test_guessed_edges_and_none_tell_of_no_walls() -> None:
    row = tuple(Node(str(n), "", x, 0.0) for n, x in enumerate([0.0, 0.9, 1.8, 3.2, 4.1]))  # no edge over the 1.4 m
    assert not FreeArea(TopoMap("a gap", Camera(), row), 0.25, 0.75).has_walls
    assert not FreeArea(TopoMap("none", Camera(), row, np.zeros((0, 2), dtype=int)), 0.25, 0.75).has_walls
    assert FreeArea(TopoMap("told", Camera(), row, np.array([[0, 1], [3, 4]])), 0.25, 0.75).has_walls


def test_one_may_turn_where_edges_cross() -> None:
    ends = [(-4.0, 0.0), (4.0, 0.0), (0.0, -4.0), (0.0, 4.0)]
    cross = tuple(Node(str(n), "", x, y) for n, (x, y) in enumerate(ends))
    area = FreeArea(TopoMap("cross", Camera(), cross, np.array([[0, 1], [2, 3]])), 0.25, 0.75)
    assert at(area, (-0.4, 0.1, -0.1, 0.4), (-0.6, 0.0, 0.6, 0.0)) == [False, False]


def test_a_thick_wall_is_one() -> None:
    places = [(0.0, 0.0), (8.0, 0.0), (8.0, 2.0), (0.0, 2.0)]
    hairpin = tuple(Node(str(n), "", x, y) for n, (x, y) in enumerate(places))
    area = FreeArea(TopoMap("hairpin", Camera(), hairpin, np.array([[0, 1], [1, 2], [2, 3]])), 0.25, 0.75)
    assert at(area, (1.0, 0.0, 1.0, 2.0), (8.0, 0.0, 8.0, 2.0)) == [True, False]


def test_an_edge_told_twice_is_no_longer() -> None:
    assert at(FreeArea(rooms(np.repeat(EDGES, 4, axis=0)), 0.25, 0.75), (3.0, 0.4, 4.0, 0.1)) == [False]


def test_passages_of_the_grid_are_the_steps_of_particles() -> None:
    area = FreeArea(rooms(), 0.25, 0.75)
    cells = np.argwhere(area.free)
    corner = np.array([area.xs[0], area.ys[0]])
    for shift in [(0, 1), (0, -3), (2, 1), (-1, -2), (5, 0)]:
        end = corner + cells * area.resolution
        start = end - np.array(shift) * area.resolution
        assert np.array_equal(area.passage(*shift)[area.free], ~area.barred(start, end))
    assert not area.passage(0, 3)[area.free].all()


@pytest.mark.parametrize("make", [MarkovGrid, ParticleFilter, AuxiliaryParticleFilter])
def test_two_rooms_back_to_back(make: Callable[[], Estimator]) -> None:
    """A robot in room a that drives at the wall is not in room b; where a door is there instead, it is."""
    shares = {}
    for name, topo_map in {"wall": rooms(), "door": rooms(np.append(EDGES, [[0, 2]], axis=0))}.items():
        estimator = make()
        start = WeightedPoses.uniform([[0.0, 0.4, -np.pi / 2.0]], [0.005, 0.005, 0.005])
        estimator.reset(topo_map, np.random.default_rng(1), start)
        for _ in range(2):
            estimator.predict(AT_THE_WALL)
            estimator.update(Evidence.blind())
        masses = node_masses(estimator.belief, topo_map)
        shares[name] = masses[2] + masses[3]
    assert shares["wall"] < 0.02
    assert shares["door"] > 0.7


def test_noise_does_not_leak_through_the_wall() -> None:
    grid = MarkovGrid()
    topo_map = rooms()
    grid.reset(topo_map, np.random.default_rng(0), WeightedPoses.uniform([[0.0, 0.4, 0.0]]))
    for _ in range(20):
        grid.predict(Motion(np.zeros(3), np.diag([0.01, 0.01, 0.001])))
    masses = node_masses(grid.belief, topo_map)
    assert masses[2] + masses[3] < 1e-9 < masses[1]
