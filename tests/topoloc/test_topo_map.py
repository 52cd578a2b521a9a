from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from topoloc.geometry import nearest_on_segment
from topoloc.topo_map import WAY_POINT_M, Camera, Node, TopoMap


def map_of(places: list[tuple[float, float]], **fields: object) -> TopoMap:
    nodes = tuple(Node(f"n{i}", f"node {i}", x, y) for i, (x, y) in enumerate(places))
    return TopoMap("toy", Camera(), nodes, **fields)  # type: ignore[arg-type]


LINE = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (6.0, 0.0)]


@pytest.mark.parametrize(("columns", "expected"), [(None, 3456), (384, 3456), (72, 648)])
def test_panorama_columns(columns: int | None, expected: int) -> None:
    """(2.1) with the thesis's camera: 384 columns and 40 degrees."""
    assert Camera(40.0, 384, 288).panorama_columns(columns) == expected


@pytest.mark.parametrize(
    ("rows", "columns", "fits"),
    [
        (288, 384, True),
        (72, 96, True),
        (54, 72, True),
        (289, 384, True),
        (440, 576, False),
        (384, 288, False),
        (216, 384, False),
    ],
)
def test_a_camera_knows_pictures_of_its_aspect_ratio(rows: int, columns: int, fits: bool) -> None:
    assert Camera(40.0, 384, 288).fits(np.zeros((rows, columns, 3), np.uint8)) == fits


@pytest.mark.parametrize("fields", [{"hfov_deg": 0.0}, {"hfov_deg": 180.0}, {"hfov_deg": -40.0}, {"width": 0}])
def test_an_impossible_camera_is_refused(fields: dict[str, float]) -> None:
    with pytest.raises(ValueError, match=r"hfov_deg|pixels"):
        Camera(**fields)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("places", "problem"),
    [([], "at least one"), ([(0.0, np.nan)], "finite"), ([(np.inf, 0.0)], "finite")],
    ids=["empty", "NaN", "inf"],
)
def test_a_map_without_usable_nodes_is_refused(places: list[tuple[float, float]], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        map_of(places)


@pytest.mark.parametrize(("columns", "fits"), [(432, True), (440, True), (424, True), (442, False), (48, False)])
def test_a_camera_knows_its_panoramas_at_any_scale(columns: int, fits: bool) -> None:
    assert Camera(40.0, 384, 288).fits_panorama(np.zeros((36, columns, 3), np.uint8)) == fits


@pytest.mark.parametrize("baseline", [0.0, -0.1, np.nan])
def test_a_baseline_of_no_length_is_refused(baseline: float) -> None:
    with pytest.raises(ValueError, match="baseline_m"):
        map_of(LINE, baseline_m=baseline)


def test_repeated_ids_are_refused() -> None:
    node = Node("a", "a", 0.0, 0.0)
    with pytest.raises(ValueError, match="ids"):
        TopoMap("twice", Camera(), (node, replace(node, x=1.0)))


class TestEdges:
    def test_nodes_closer_than_one_and_a_half_median_spacings_are_joined(self) -> None:
        """Nearest spacings 1, 1, 1, 4: median 1, so 1.49 m is joined and 1.5 m is not."""
        edges = map_of([(0, 0), (1, 0), (2.49, 0), (2.49, 1), (3.99, 1)]).edges
        assert np.asarray(edges).tolist() == [[0, 1], [1, 2], [2, 3]]
        assert np.asarray(map_of(LINE).edges).tolist() == [[0, 1], [1, 2]]

    def test_on_a_grid_the_diagonals_are_joined(self) -> None:
        assert len(np.asarray(map_of([(x, y) for x in range(3) for y in range(3)]).edges)) == 12 + 8

    def test_given_edges_are_kept_even_if_there_are_none(self) -> None:
        assert np.asarray(map_of(LINE, edges=np.array([[0, 3]])).edges).tolist() == [[0, 3]]
        assert np.asarray(map_of(LINE, edges=np.zeros((0, 2), int)).edges).shape == (0, 2)

    @pytest.mark.parametrize("places", [[(0.0, 0.0)], [(0.0, 0.0), (0.0, 0.0)]], ids=["one node", "one spot"])
    def test_degenerate_maps(self, places: list[tuple[float, float]]) -> None:
        assert np.asarray(map_of(places).edges).shape[1] == 2

    def test_adjacent_in_either_direction(self) -> None:
        the_map = map_of(LINE, edges=np.array([[2, 1]]))
        assert the_map.adjacent(1, 2) and the_map.adjacent(2, 1)
        assert not the_map.adjacent(0, 1)


def test_nearest_node_and_its_distance() -> None:
    points = np.array([[0.4, 0.1], [0.6, -3.0], [4.1, 0.0], [1e6, 0.0]])
    assert map_of(LINE).nearest_node(points).tolist() == [0, 1, 3, 3]
    by_hand = np.linalg.norm(points[:, None] - np.array(LINE), axis=2).min(axis=1)
    assert map_of(LINE).distance_to_nearest(points) == pytest.approx(by_hand)


class TestFreeArea:
    SQUARE = np.array([[10.0, 10.0], [12.0, 10.0], [12.0, 12.0], [10.0, 12.0]])

    def test_around_nodes_and_edges(self) -> None:
        the_map = map_of(LINE, edges=np.array([[2, 3]]))
        points = np.array([[0.0, 0.5], [0.0, 0.51], [4.0, 0.5], [4.0, -0.51], [6.4, 0.2], [0.5, 0.2], [-9.0, 0.0]])
        assert the_map.is_free(points, 0.5).tolist() == [True, False, True, False, True, False, False]

    def test_between_joined_nodes_only(self) -> None:
        middle = np.array([[4.0, 0.0]])
        assert map_of(LINE, edges=np.array([[2, 3]])).is_free(middle, 0.3).all()
        assert not map_of(LINE, edges=np.array([[0, 1]])).is_free(middle, 0.3).any()

    @given(st.integers(0, 10_000), st.sampled_from([0.01, 0.3, 0.75]))
    @settings(max_examples=30, deadline=None)
    def test_against_every_edge(self, seed: int, reach: float) -> None:
        rng = np.random.default_rng(seed)
        the_map = map_of([tuple(place) for place in rng.uniform(0, 4, (6, 2))], edges=rng.integers(0, 6, (5, 2)))
        points = rng.uniform(-1, 5, (300, 2))
        ways = [*np.asarray(the_map.edges), *((k, k) for k in range(6))]
        feet = np.stack([nearest_on_segment(points, *the_map.positions[list(way)]) for way in ways])
        distance = np.linalg.norm(feet - points, axis=2)
        assert np.array_equal(the_map.is_free(points, reach), distance.min(axis=0) <= reach)
        ends, found = the_map.nearest_way(points)
        assert (np.linalg.norm(found - points, axis=1) <= distance.min(axis=0) + WAY_POINT_M / 2.0).all()
        assert {tuple(pair) for pair in ends} <= {tuple(way) for way in ways}

    def test_an_edge_around_the_world_does_not_fill_the_memory(self) -> None:
        far = map_of([(0.0, 0.0), (4e7, 0.0)], edges=np.array([[0, 1]]))
        assert far.is_free(np.array([[1.23e7, 0.3], [1.23e7, 0.4]]), 0.35).tolist() == [True, False]

    def test_inside_polygons(self) -> None:
        the_map = map_of(LINE, free=(self.SQUARE,))
        points = np.array([[11.0, 11.0], [10.01, 11.99], [9.9, 11.0], [12.1, 11.0], [11.0, 12.1], [11.0, 9.9]])
        assert the_map.is_free(points, 0.2).tolist() == [True, True, False, False, False, False]

    def test_a_polygon_may_be_concave_and_of_either_orientation(self) -> None:
        corner = np.array([[0, 0], [4, 0], [4, 1], [1, 1], [1, 4], [0, 4]], dtype=float) + 20.0
        points = np.array([[20.5, 23.5], [23.5, 20.5], [22.0, 22.0]])
        for polygon in (corner, corner[::-1]):
            assert map_of(LINE, free=(polygon,)).is_free(points, 0.1).tolist() == [True, True, False]

    def test_cells_are_a_regular_grid_over_all_of_it(self) -> None:
        the_map = map_of([(0.0, 0.0), (1.0, 0.0)], free=(np.array([[0, 0], [0, 2.0], [0.4, 2.0]]),))
        xs, ys, free = the_map.free_cells(0.1, 0.35)
        assert free.shape == (len(xs), len(ys))
        assert np.diff(xs) == pytest.approx(np.full(len(xs) - 1, 0.1))
        assert xs[0] - 0.05 <= -0.35 and xs[-1] + 0.05 >= 1.35
        assert ys[0] - 0.05 <= -0.35 and ys[-1] + 0.05 >= 2.0
        for i, j in ((0, 0), (len(xs) // 2, len(ys) // 4), (4, len(ys) - 2), (len(xs) - 1, len(ys) - 1)):
            assert free[i, j] == the_map.is_free(np.array([[xs[i], ys[j]]]), 0.35)[0]
        stadium = np.pi * 0.35**2 + 0.7  # two half circles and the strip between; the triangle adds some
        assert stadium < free.sum() * 0.01 < stadium + 0.4 + 0.1
