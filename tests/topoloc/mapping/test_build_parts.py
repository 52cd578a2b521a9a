"""The parts that a map is built of: turns found on a way, places, edges, views, and frames pasted by their headings."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from topoloc.geometry import Floats, wrap
from topoloc.mapping.building.pasting import LEFT_EDGE, beginning, pasted
from topoloc.mapping.building.places import edges_along, frames_between, turns_apart, views_apart
from topoloc.mapping.building.turns import Turn, missing, snapshots, turns_on_the_spot
from topoloc.topo_map import Camera
from topoloc.types import Image

HFOV = np.deg2rad(40.0)


def spun(x: float, y: float, degrees: Floats) -> Floats:
    return np.column_stack([np.full(len(degrees), x), np.full(len(degrees), y), wrap(np.deg2rad(degrees))])


def driven(start: tuple[float, float], end: tuple[float, float], step: float = 0.1) -> Floats:
    length = float(np.hypot(end[0] - start[0], end[1] - start[1]))
    share = np.linspace(0.0, 1.0, round(length / step) + 1)[:, None]
    heading = np.arctan2(end[1] - start[1], end[0] - start[0])
    places = np.array(start) + share * (np.array(end) - np.array(start))
    return np.column_stack([places, np.full(len(places), heading)])


class TestTurns:
    @pytest.mark.parametrize("step", [1.0, 7.0, 30.0, -1.0, -30.0])
    def test_a_turn_within_a_drive_is_found(self, step: float) -> None:
        """However fast the camera is, and either way round."""
        turn = spun(2.0, 0.0, np.arange(0.0, 360.0, abs(step)) * np.sign(step))
        way = np.concatenate([driven((0.0, 0.0), (1.9, 0.0)), turn, driven((2.1, 0.0), (4.0, 0.0))])
        [found] = turns_on_the_spot(way, way[:, 2], HFOV)
        assert found.position == pytest.approx([2.0, 0.0], abs=1e-9)
        assert found.missing_deg == pytest.approx(0.0, abs=1e-9)
        headings = way[found.frames, 2]
        assert wrap(headings - headings[0] + found.clockwise) == pytest.approx(np.zeros(len(headings)), abs=1e-9)
        assert (np.diff(found.clockwise) > 0.0).all()

    def test_a_curve_is_no_turn(self) -> None:
        angle = np.linspace(0.0, 2.0 * np.pi, 80)
        way = np.column_stack([np.cos(angle), np.sin(angle), wrap(angle + np.pi / 2.0)])
        assert turns_on_the_spot(way, way[:, 2], HFOV) == []

    def test_nor_is_a_corner(self) -> None:
        way = np.concatenate([driven((0.0, 0.0), (1.0, 0.0)), spun(1.0, 0.0, np.arange(0.0, 91.0, 5.0))])
        assert turns_on_the_spot(way, way[:, 2], HFOV) == []

    def test_noise_of_the_poses_does_not_matter(self) -> None:
        way = spun(0.0, 0.0, np.arange(0.0, 360.0, 2.0))
        way[:, :2] += np.random.default_rng(0).normal(0.0, 0.005, (len(way), 2))
        [found] = turns_on_the_spot(way, way[:, 2], HFOV)
        assert found.missing_deg == pytest.approx(0.0)

    def test_what_was_not_seen_is_told(self) -> None:
        way = spun(0.0, 0.0, np.arange(0.0, 271.0, 10.0))
        [found] = turns_on_the_spot(way, way[:, 2], HFOV)
        assert found.missing_deg == pytest.approx(360.0 - 270.0 - 40.0)

    def test_a_camera_may_turn_on_a_robot_that_stands(self) -> None:
        robot, headings = np.zeros((37, 3)), np.deg2rad(np.arange(0.0, 361.0, 10.0))
        assert len(turns_on_the_spot(robot, wrap(headings), HFOV)) == 1

    @given(st.lists(st.floats(1.0, 39.0), min_size=4, max_size=60), st.floats(0.5, 2.0))
    def test_snapshots_leave_no_gap_that_frames_could_fill(self, steps: list[float], hfov: float) -> None:
        turned = np.deg2rad(np.cumsum(steps))
        chosen = snapshots(turned, hfov)
        angle = turned[chosen] - turned[chosen[0]]
        assert chosen[0] == 0 and (np.diff(angle) > 0.0).all() and angle[-1] < 2.0 * np.pi
        within = turned[turned - turned[0] <= 2.0 * np.pi - 0.3 * hfov]
        assert missing(angle, hfov) <= missing(within - within[0], hfov) + 1e-6


class TestPlaces:
    def test_nodes_are_a_spacing_apart_and_the_way_is_near_them(self) -> None:
        way = driven((0.0, 0.0), (10.0, 0.0))[:, :2]
        chosen = frames_between(way, np.zeros((0, 2)), 1.0)
        assert way[chosen, 0] == pytest.approx(np.arange(11.0))

    def test_a_place_passed_again_is_one_node(self) -> None:
        way = np.concatenate([driven((0.0, 0.0), (5.0, 0.0)), driven((5.0, 0.3), (0.0, 0.3))])[:, :2]
        assert len(frames_between(way, np.zeros((0, 2)), 1.0)) == 6

    def test_nodes_that_are_there_count(self) -> None:
        way = driven((0.0, 0.0), (3.0, 0.0))[:, :2]
        chosen = frames_between(way, np.array([[1.5, 0.0]]), 1.0)
        assert way[chosen, 0] == pytest.approx([0.0, 2.5])

    def test_of_near_turns_the_better_one_is_kept(self) -> None:
        none = np.zeros(0, dtype=np.int64)
        turns = [
            Turn(first, np.array([x, 0.0]), none, np.zeros(0), missing_deg)
            for first, x, missing_deg in ((0, 0.0, 30.0), (5, 0.2, 0.0), (9, 0.8, 10.0))
        ]
        assert [turn.first for turn in turns_apart(turns, 1.0)] == [5, 9]

    def test_edges_are_what_was_driven(self) -> None:
        """A hairpin: its two legs are near each other, and no edge crosses from one to the other."""
        way = np.concatenate([driven((0.0, 0.0), (4.0, 0.0)), driven((4.0, 1.2), (0.0, 1.2))])[:, :2]
        nodes = np.array([(x, y) for y in (0.0, 1.2) for x in (0.0, 1.0, 2.0, 3.0, 4.0)])
        nearest = np.linalg.norm(way[:, None] - nodes, axis=2).argmin(axis=1)
        edges, jumps = edges_along(way, nearest, 1.0)
        assert edges.tolist() == [[0, 1], [1, 2], [2, 3], [3, 4], [4, 9], [5, 6], [6, 7], [7, 8], [8, 9]]
        assert jumps == 0

    def test_a_jump_is_no_edge(self) -> None:
        way = np.array([[0.0, 0.0], [0.5, 0.0], [9.0, 0.0]])
        edges, jumps = edges_along(way, np.array([0, 0, 1]), 1.0)
        assert (edges.shape, jumps) == ((0, 2), 1)


class TestViews:
    def test_each_moved_or_turned(self) -> None:
        way = np.concatenate([driven((0.0, 0.0), (1.0, 0.0)), spun(1.0, 0.0, np.arange(0.0, 91.0, 5.0))])
        chosen = way[views_apart(way, 0.3, np.deg2rad(15.0), lambda frame: True)]
        assert chosen[:4, 0] == pytest.approx([0.0, 0.3, 0.6, 0.9])
        assert np.rad2deg(chosen[4:, 2]) == pytest.approx(np.arange(15.0, 91.0, 15.0))

    def test_one_that_does_not_fit_gives_way_to_the_next(self) -> None:
        way = driven((0.0, 0.0), (0.9, 0.0))
        chosen = views_apart(way, 0.3, 0.3, lambda frame: frame != 3)
        assert way[chosen, 0] == pytest.approx([0.0, 0.4, 0.7])


class TestPasting:
    camera = Camera(60.0, 60, 40)

    def looking(self, heading: float) -> Image:
        """What a pinhole camera sees of a far wall whose brightness is the direction's cosine, as 128 + 100 cos."""
        focal = self.camera.width / 2.0 / np.tan(np.deg2rad(self.camera.hfov_deg) / 2.0)
        column = np.arange(self.camera.width) + 0.5 - self.camera.width / 2.0
        direction = heading - np.arctan(column / focal)
        levels = np.tile(128.0 + 100.0 * np.cos(direction), (self.camera.height, 1))
        return np.asarray(np.repeat(levels[:, :, None], 3, axis=2).round().astype(np.uint8))

    def test_every_column_shows_its_direction(self) -> None:
        headings = np.deg2rad(np.array([10.0, 57.0, 95.0, 140.0, 190.0, 230.0, 281.0, 330.0]))
        circle = pasted([self.looking(heading) for heading in headings], headings, self.camera)
        columns = self.camera.panorama_columns()
        assert circle.shape == (40, columns, 3)
        direction = LEFT_EDGE - (np.arange(columns) + 0.5) * 2.0 * np.pi / columns
        wanted = np.broadcast_to((128.0 + 100.0 * np.cos(direction))[:, None], (columns, 3))
        assert circle[20].astype(float) == pytest.approx(wanted, abs=2.0)

    def test_what_nobody_looks_at_is_black(self) -> None:
        circle = pasted([self.looking(0.0)], np.zeros(1), self.camera)
        dark = np.flatnonzero(circle.max(axis=(0, 2)) == 0)
        assert len(dark) == 300 and set(range(150)) <= set(dark.tolist())

    @given(st.integers(8, 4000), st.floats(-np.pi, np.pi))
    def test_a_panorama_rolled_to_begin_looks_the_same_way(self, columns: int, heading: float) -> None:
        shift, begins = beginning(columns, heading)
        column = 2.0 * np.pi / columns
        assert abs(wrap(begins - LEFT_EDGE)) <= column / 2.0 + 1e-9
        assert wrap(begins + shift * column - heading) == pytest.approx(0.0, abs=1e-9)
