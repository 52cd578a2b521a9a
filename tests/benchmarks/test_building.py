"""The office floor: how many nodes, how they are joined, and that the robot drives through doors only."""

from __future__ import annotations

import numpy as np
import pytest
from oracles.clearance import distance_to_segments
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from benchmarks.worlds.building import BuildingSettings, BuildingWorld, building_scene
from benchmarks.worlds.drive import Route
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.renderer import render_depth
from topoloc.geometry import Floats

OPEN = Moment(doors=1.0)


def crossings(segments: Floats, walls: Floats) -> int:
    """How many of the segments (S, 4) cross a wall (W, 4)."""

    def side(line: Floats, x: Floats, y: Floats) -> Floats:
        return np.asarray((line[2] - line[0]) * (y - line[1]) - (line[3] - line[1]) * (x - line[0]))

    count = 0
    for leg in segments:
        ends = side(leg, walls[:, 0], walls[:, 1]) * side(leg, walls[:, 2], walls[:, 3]) < 0.0
        legs = np.array([side(wall, leg[0], leg[1]) * side(wall, leg[2], leg[3]) < 0.0 for wall in walls])
        count += bool((ends & legs).any())
    return count


def test_more_than_300_nodes_each_with_an_id_of_its_own_all_joined() -> None:
    world = BuildingWorld()
    assert len(world.places) == 313
    assert len({place.id for place in world.places}) == 313
    pairs = world.edges()
    graph = coo_matrix((np.ones(len(pairs)), pairs.T), shape=(313, 313))
    assert connected_components(graph, directed=False)[0] == 1
    apart = np.linalg.norm(world.positions[pairs[:, 0]] - world.positions[pairs[:, 1]], axis=1)
    assert apart.min() > 1.1
    assert apart.max() < 3.0
    assert set(world.tour) >= {node for node in range(313) if (node - 43) % 9 != 4 or node < 43}


def test_no_edge_leads_through_a_wall() -> None:
    world = BuildingWorld(BuildingSettings(rooms=4))
    faces = building_scene(4, 0, OPEN).faces
    walls = faces.ends[(faces.heights[:, 0] < 0.1) & (faces.heights[:, 1] > 2.5)]
    legs = world.positions[world.edges()].reshape(-1, 4)
    assert crossings(legs, walls) == 0
    through = np.array([[*world.positions[7], world.positions[7][0] - 2.0, world.positions[7][1]]])
    assert crossings(through, walls) == 1


@pytest.mark.parametrize("moment", [OPEN, Moment(age=1.0, doors=1.0, seated=1.0)])
@pytest.mark.parametrize("random", [False, True])
def test_the_robot_touches_nothing(random: bool, moment: Moment) -> None:
    route = Route(step_m=0.06, step_spread_m=0.0, random=random)
    world = BuildingWorld(BuildingSettings(rooms=8, updates=2500, route=route))
    for seed in range(2):
        faces = building_scene(8, seed, moment).faces
        standing = faces.ends[faces.heights[:, 0] < 1.2]
        path = world.drive(seed)[1]
        assert distance_to_segments(path[:, :2], standing).min() > 0.2


def test_a_seed_repeats_and_another_furnishes_otherwise() -> None:
    one, other = building_scene(4, 0, OPEN), building_scene(4, 1, OPEN)
    building_scene.cache_clear()
    assert np.array_equal(building_scene(4, 0, OPEN).faces.ends, one.faces.ends)
    assert one.faces.ends.shape != other.faces.ends.shape or (one.faces.ends != other.faces.ends).any()


def test_nowhere_is_a_hole_in_the_walls() -> None:
    """But for single pixels where three surfaces meet."""
    world = BuildingWorld(BuildingSettings(rooms=4))
    scene = building_scene(4, 0, OPEN)
    for x, y in world.positions[[0, 2, 5, 8, 14, 30]]:
        for heading in np.linspace(-np.pi, np.pi, 12, endpoint=False):
            depth = render_depth(scene, np.array([x, y, heading]), world.camera)
            assert np.isinf(depth).mean() < 1e-4


@pytest.mark.parametrize("rooms", [0, 3, 402])
def test_numbers_of_rooms_that_make_no_floor_are_refused(rooms: int) -> None:
    with pytest.raises(ValueError, match="rooms"):
        BuildingSettings(rooms=rooms)


@pytest.mark.slow
def test_the_whole_floor_is_mapped_and_driven() -> None:
    drive = BuildingWorld(BuildingSettings(updates=5)).simulate(0)
    assert len(drive.topo_map.nodes) == 313
    for node in drive.topo_map.nodes:
        assert node.panorama is not None
        assert node.panorama.max(axis=(0, 2)).min() > 10
    assert all(frame.images["rgb"].std() > 3.0 for frame in drive.frames)
