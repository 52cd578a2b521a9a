"""Panoramas refreshed from sure frames: twice seen, never from a doubtful one, and undone where it went wrong."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from sensors.histogram import ColorHistogram
from sensors.ima import IMA
from sensors.images import crop_centre, grey, resize
from sensors.robust_ima import RobustIMA
from sensors.upkeep import PanoramaUpkeep, UpkeepConfig, View, middle_rows, pasted, slot_ncc, softened
from topoloc.errors import UserError
from topoloc.geometry import wrap
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Estimate, Frame, Image, Status

CAMERA = Camera(40.0, 96, 72)
COLUMNS, LEFT = 864, 300
"""Of the panoramas, and of the window that is looked at."""
CHANGED = slice(LEFT + 36, LEFT + 60)
"""Two slots in the middle of the window."""
SLOTS = (28, 29)
EDGES = np.arange(0, 649, 9)


def noise_circle(seed: int) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (9, 108, 3)).astype(np.uint8)
    return np.kron(blocks, np.ones((8, 8, 1), dtype=np.uint8))


def changed(panorama: Image, seed: int) -> Image:
    """The world as it is now: other things stand in two slots."""
    now = panorama.copy()
    now[:, CHANGED] = noise_circle(seed)[:, CHANGED]
    return now


def noise_map(**options: Any) -> TopoMap:
    nodes = tuple(Node(f"n{k}", "", 2.0 * k, 0.0, 0.7, noise_circle(k)) for k in range(3))
    return TopoMap("noise", CAMERA, nodes, **options)


def panorama_of(topo_map: TopoMap, node: int = 0) -> Image:
    panorama = topo_map.nodes[node].panorama
    assert panorama is not None
    return panorama


def heading_of(topo_map: TopoMap, left: int = LEFT) -> float:
    return float(wrap(topo_map.nodes[0].heading - (left + CAMERA.width / 2.0) * 2.0 * np.pi / COLUMNS))


def frame_of(circle: Image, left: int = LEFT) -> Frame:
    window = circle[:, (left + np.arange(CAMERA.width)) % circle.shape[1]]
    return Frame(5.0, None, np.zeros(3), {"rgb": np.ascontiguousarray(window)})


class Place:
    """A sensor, its upkeep, and a robot that stands on a node and knows it."""

    def __init__(self, config: UpkeepConfig | None = None, topo_map: TopoMap | None = None, kind: Any = IMA) -> None:
        self.map = topo_map or noise_map()
        self.sensor: IMA = kind()
        self.sensor.fit(self.map)
        self.upkeep = PanoramaUpkeep(self.map, self.sensor, config)

    def visit(self, frame: Frame, **other: Any) -> None:
        """Look once, sure of standing on node 0 unless told otherwise, after a while elsewhere."""
        heading = heading_of(self.map)
        known = Estimate(np.array([0.0, 0.0, heading]), 0.01 * np.eye(3), 0, 0.99, Status.LOCALIZED)
        away = replace(known, status=Status.LOST)
        evidence = self.sensor.observe(frame).of_robot(frame.camera)
        for _ in range(self.upkeep.config.visit_updates):
            self.upkeep.after(frame, away, evidence)
        self.upkeep.after(frame, replace(known, **other), evidence)

    @property
    def now(self) -> Image:
        return panorama_of(self.upkeep.topo_map)


def likeness(one: Image, other: Image, columns: slice = CHANGED) -> float:
    return float(np.corrcoef(grey(one)[:, columns].ravel(), grey(other)[:, columns].ravel())[0, 1])


class TestExchange:
    @pytest.mark.parametrize("kind", [IMA, RobustIMA])
    def test_it_is_as_if_fitted_anew(self, kind: Any) -> None:
        the_map, new = noise_map(), noise_circle(50)
        exchanged, fresh = kind(), kind()
        exchanged.fit(the_map)
        exchanged.replace_panorama(1, new)
        fresh.fit(replace(the_map, nodes=(the_map.nodes[0], replace(the_map.nodes[1], panorama=new), the_map.nodes[2])))
        for node in range(3):
            pairs = zip(exchanged.prepared(node), fresh.prepared(node), strict=True)
            for one, other in pairs:
                assert np.array_equal(one.pixels, other.pixels) and np.array_equal(one.scales, other.scales)

    def test_a_frame_is_found_as_observe_finds_it(self) -> None:
        place, frame = Place(), frame_of(noise_circle(1))
        evidence = place.sensor.observe(frame)
        for node in range(3):
            found = place.sensor.find(frame.images["rgb"], place.sensor.prepared(node))
            assert found.value[0] == pytest.approx(evidence.match[node], abs=1e-6)


class TestRefresh:
    @pytest.mark.parametrize("kind", [IMA, RobustIMA])
    def test_what_two_visits_show_is_pasted_there_and_nowhere_else(self, kind: Any) -> None:
        place = Place(kind=kind)
        before, world = panorama_of(place.map), changed(panorama_of(place.map), 9)
        place.visit(frame_of(world))
        assert place.now is before and not place.upkeep.log
        place.visit(frame_of(world))
        assert likeness(before, world) < 0.2 and likeness(place.now, world) > 0.7  # the robust one refines its zoom
        outside = np.ones(COLUMNS, dtype=bool)
        outside[CHANGED.start - 3 : CHANGED.stop + 3] = False
        assert np.array_equal(place.now[:, outside], before[:, outside])
        (change,) = place.upkeep.log
        assert (change.node, change.timestamp, change.restored) == (0, 5.0, False)
        assert tuple(change.slots) == SLOTS
        assert change.middles == pytest.approx((EDGES[list(SLOTS)] + 4.5 - LEFT * 0.75) / 72.0, abs=0.02)
        assert panorama_of(place.upkeep.topo_map, 1) is panorama_of(place.map, 1)

    def test_the_sensor_matches_better_afterwards(self) -> None:
        place = Place()
        frame = frame_of(changed(panorama_of(place.map), 9))
        first = place.sensor.observe(frame).match[0]
        place.visit(frame)
        place.visit(frame)
        assert place.sensor.observe(frame).match[0] > first + 0.1

    def test_two_looks_of_one_visit_are_one(self) -> None:
        place = Place()
        frame = frame_of(changed(panorama_of(place.map), 9))
        evidence = place.sensor.observe(frame)
        there = Estimate(np.array([0.0, 0.0, heading_of(place.map)]), 0.01 * np.eye(3), 0, 0.99, Status.LOCALIZED)
        for _ in range(5):
            place.upkeep.after(frame, there, evidence)
        assert not place.upkeep.log

    def test_who_stood_there_once_is_never_burnt_in(self) -> None:
        """Another person at each visit, or nobody: no two visits show the same, or they show what is known."""
        place = Place()
        plain = panorama_of(place.map)
        for world in (changed(plain, 9), plain, changed(plain, 10), changed(plain, 11), plain, changed(plain, 12)):
            place.visit(frame_of(world))
        assert not place.upkeep.log and place.now is plain

    def test_a_frame_from_ahead_is_shrunk_to_the_nodes_view(self) -> None:
        """(2.5): ten per cent nearer, so pasted at 1 / 1.1; the upper and lower rows that it lacks stay."""
        place = Place()
        world = changed(panorama_of(place.map), 9)
        window = frame_of(world).images["rgb"]
        nearer = resize(crop_centre(window, 1.0 / 1.09, 1.0 / 1.09), 96, 72)
        frame = replace(frame_of(world), images={"rgb": nearer})
        place.visit(frame)
        place.visit(frame)
        before = panorama_of(place.map)
        assert likeness(place.now[6:-6], world[6:-6]) > 0.8
        assert np.array_equal(place.now[0, CHANGED], before[0, CHANGED])
        unscaled = pasted(before, View(nearer, LEFT), np.ones(COLUMNS))
        assert likeness(place.now[6:-6], world[6:-6]) > likeness(unscaled[6:-6], world[6:-6]) + 0.05

    def test_a_slot_across_the_seam_of_the_circle(self) -> None:
        place, left = Place(), COLUMNS - 48
        world = np.roll(panorama_of(place.map), 48, axis=1)
        world[:, 36:60] = noise_circle(9)[:, :24]
        world = np.roll(world, -48, axis=1)
        for _ in range(2):
            heading = heading_of(place.map, left)
            place.visit(frame_of(world, left), pose=np.array([0.0, 0.0, heading]))
        around = np.r_[COLUMNS - 12 : COLUMNS, 0:12]
        assert tuple(place.upkeep.log[0].slots) == (0, 71)
        assert np.corrcoef(place.now[:, around].ravel(), world[:, around].ravel())[0, 1] > 0.9

    @pytest.mark.parametrize("filtered", [False, True])
    def test_grey_and_filtered_maps_stay_so(self, filtered: bool) -> None:
        plain = noise_map(filtered=filtered)
        nodes = tuple(replace(node, panorama=grey(panorama_of(plain, k))) for k, node in enumerate(plain.nodes))
        place = Place(topo_map=replace(plain, nodes=nodes))
        world = changed(panorama_of(plain), 9)
        place.visit(frame_of(world))
        place.visit(frame_of(world))
        assert place.now.ndim == 2 and place.now.dtype == np.uint8
        assert likeness(place.now, world) > 0.8


class TestDoubt:
    @pytest.mark.parametrize(
        "other",
        [
            {"status": Status.AMBIGUOUS},
            {"status": Status.LOST},
            {"probability": 0.5},
            {"covariance": np.eye(3)},
            {"node": None},
            {"node": 1},
            {"pose": np.array([0.6, 0.0, heading_of(noise_map())])},
            {"pose": np.array([0.0, 0.0, heading_of(noise_map()) + 0.3])},
        ],
        ids=["ambiguous", "lost", "unlikely", "spread", "no node", "another node", "far off", "turned"],
    )
    def test_a_doubtful_frame_is_not_used(self, other: dict[str, Any]) -> None:
        place = Place()
        frame = frame_of(changed(panorama_of(place.map), 9))
        for _ in range(3):
            place.visit(frame, **other)
        assert not place.upkeep.log
        for _ in range(2):
            place.visit(frame)
        assert place.upkeep.log, "or the frame would never have been used"

    def test_nor_one_that_does_not_match(self) -> None:
        place = Place()
        for _ in range(3):
            place.visit(frame_of(noise_circle(9)))
        assert not place.upkeep.log

    def test_nor_one_that_another_node_matches_as_well(self) -> None:
        plain = noise_map()
        twin = replace(plain.nodes[1], panorama=panorama_of(plain))
        place = Place(topo_map=replace(plain, nodes=(plain.nodes[0], twin, plain.nodes[2])))
        for _ in range(3):
            place.visit(frame_of(changed(panorama_of(plain), 9)))
        assert not place.upkeep.log


class TestHindsight:
    """Sure on nodes 0 and 2, doubtful on node 1 between them, two metres from each."""

    def drive(self, place: Place, odometer: tuple[float, ...] | None, changed_now: Image, turned: float = 0.0) -> None:
        heading = heading_of(place.map)
        circles = [panorama_of(place.map, 0), changed_now, panorama_of(place.map, 2)]
        for node, circle in enumerate(circles):
            reading = None if odometer is None else np.array([odometer[node], 0.0, heading + turned * node])
            frame = replace(frame_of(circle), odometry=reading)
            sure = Status.AMBIGUOUS if node == 1 else Status.LOCALIZED
            pose = np.array([2.0 * node, 0.0, heading])
            estimate = Estimate(pose, 0.01 * np.eye(3), node, 0.99, sure)
            place.upkeep.after(frame, estimate, place.sensor.observe(frame).of_robot(frame.camera))
        lost = replace(estimate, status=Status.LOST)
        for _ in range(place.upkeep.config.visit_updates):
            place.upkeep.after(replace(frame, odometry=None), lost, place.sensor.observe(frame))

    @pytest.mark.parametrize(
        ("odometer", "turned", "config", "used"),
        [
            ((7.0, 9.0, 11.0), 0.0, UpkeepConfig(), True),
            ((7.0, 9.0, 11.6), 0.0, UpkeepConfig(), True),
            ((6.5, 9.0, 11.6), 0.0, UpkeepConfig(), False),
            ((7.0, 9.0, 11.0), 0.2, UpkeepConfig(), False),
            ((7.0, 8.0, 11.0), 0.0, UpkeepConfig(), False),
            ((7.0, 9.0, 11.0), 0.0, UpkeepConfig(look_back=0), False),
            (None, 0.0, UpkeepConfig(), False),
        ],
        ids=["agree", "nearly", "far apart", "turned", "off the node", "switched off", "no odometer"],
    )
    def test_a_doubtful_frame_counts_where_the_odometry_on_and_back_agree(
        self, odometer: tuple[float, ...] | None, turned: float, config: UpkeepConfig, used: bool
    ) -> None:
        place = Place(config)
        world = changed(panorama_of(place.map, 1), 9)
        for _ in range(2):
            self.drive(place, odometer, world, turned)
        now = panorama_of(place.upkeep.topo_map, 1)
        assert (likeness(now, world) > 0.9) == used
        assert [change.node for change in place.upkeep.log] == [1] * used

    def test_a_visit_looked_back_at_later_is_still_the_same_visit(self) -> None:
        """A sure look at a node and a doubtful one right after it are one visit, however late the robot looks back."""
        place = Place()
        heading, world = heading_of(place.map), changed(panorama_of(place.map, 0), 9)
        drive = [(0, 7.0, Status.LOCALIZED), (0, 7.05, Status.AMBIGUOUS), *[(1, 9.0, Status.AMBIGUOUS)] * 10]
        for node, reading, sure in [*drive, (2, 11.0, Status.LOCALIZED)]:
            circle = world if node == 0 else panorama_of(place.map, node)
            frame = replace(frame_of(circle), odometry=np.array([reading, 0.0, heading]))
            estimate = Estimate(np.array([2.0 * node, 0.0, heading]), 0.01 * np.eye(3), node, 0.99, sure)
            place.upkeep.after(frame, estimate, place.sensor.observe(frame).of_robot(frame.camera))
        assert not place.upkeep.log

    def test_a_frame_that_matches_with_another_heading_does_not(self) -> None:
        place = Place()
        elsewhere = np.roll(changed(panorama_of(place.map, 1), 9), 60, axis=1)
        for _ in range(3):
            self.drive(place, (7.0, 9.0, 11.0), elsewhere)
        assert not place.upkeep.log


class TestRecovery:
    def wrong(self, place: Place) -> None:
        """A picture of somewhere else, put on half of the node's panorama."""
        slots = np.zeros(72, dtype=bool)
        slots[10:46] = True
        place.upkeep.paste(0, View(noise_circle(30), 0), slots)

    def test_restoring_gives_the_maps_own_panorama_back(self) -> None:
        place = Place()
        before, matches = panorama_of(place.map), place.sensor.observe(frame_of(noise_circle(0))).match
        assert place.upkeep.before == {}
        self.wrong(place)
        assert not np.array_equal(place.now, before)
        assert place.upkeep.before == {0: before}
        place.upkeep.restore(0)
        assert place.now is before and place.upkeep.before == {}
        assert np.array_equal(place.sensor.observe(frame_of(noise_circle(0))).match, matches)

    @pytest.mark.parametrize("unsure", [{}, {"probability": 0.4, "status": Status.AMBIGUOUS}], ids=["sure", "unsure"])
    def test_a_wrong_refresh_is_undone_by_itself(self, unsure: dict[str, Any]) -> None:
        place = Place()
        frame = frame_of(panorama_of(place.map))
        self.wrong(place)
        assert place.sensor.observe(frame).match[0] < 0.6
        for _ in range(place.upkeep.config.restore_looks):
            assert place.now is not panorama_of(place.map)
            place.visit(frame, **unsure)
        assert place.now is panorama_of(place.map)
        assert place.upkeep.log[-1].restored
        assert place.sensor.observe(frame).match[0] > 0.95

    def test_a_right_refresh_stays(self) -> None:
        place = Place()
        frame = frame_of(changed(panorama_of(place.map), 9))
        for _ in range(20):
            place.visit(frame)
        assert len(place.upkeep.log) == 1 and not place.upkeep.log[0].restored

    def test_what_lies_elsewhere_on_the_circle_says_nothing(self) -> None:
        place = Place()
        place.upkeep.paste(0, View(noise_circle(30), 0), np.arange(72) < 10)
        for _ in range(10):
            place.visit(frame_of(panorama_of(place.map)))
        assert place.now is not panorama_of(place.map)


class TestParts:
    def test_slot_ncc_is_the_correlation_of_each_slot_at_its_best_shift(self) -> None:
        rng = np.random.default_rng(3)
        one, other = rng.normal(size=(2, 5, 40))
        edges = np.array([0, 9, 20, 31, 40])
        for slack in (0, 2):
            expected = [
                max(
                    np.corrcoef(one[:, a:b].ravel(), np.roll(other, shift, axis=1)[:, a:b].ravel())[0, 1]
                    for shift in range(-slack, slack + 1)
                )
                for a, b in pairwise(edges)
            ]
            got = slot_ncc(one, other, edges, slack, 1e-9)
            assert got == pytest.approx((np.array(expected) + 1.0) / 2.0, abs=1e-12)

    def test_a_flat_slot_has_no_correlation(self) -> None:
        one = np.random.default_rng(0).normal(100.0, 30.0, (5, 20))
        other = one.copy()
        other[:, :10] = 80.0
        assert slot_ncc(one, other, np.array([0, 10, 20]), 0, 1.0 / 12.0) == pytest.approx([0.5, 1.0])

    def test_softened_steps_become_slopes(self) -> None:
        weights = np.zeros(30)
        weights[[28, 29, 0, 1, 2]] = 1.0
        soft = softened(weights, 1)
        assert soft[[26, 27, 28, 29, 0, 1, 2, 3, 4]] == pytest.approx([0, 1 / 3, 2 / 3, 1, 1, 1, 2 / 3, 1 / 3, 0])
        assert softened(weights, 0) == pytest.approx(weights)

    def test_a_low_picture_leaves_the_other_rows(self) -> None:
        panorama = np.zeros((40, 60, 3), dtype=np.uint8)
        result = pasted(panorama, View(np.full((30, 20, 3), 200, dtype=np.uint8), 50), np.ones(60))
        assert not result[:5].any() and not result[35:].any() and not result[:, 10:50].any()
        assert (result[15:25][:, np.r_[50:60, 0:10]] == 200).all()
        assert not panorama.any()

    @pytest.mark.parametrize(("rows", "share", "kept"), [(54, 1.0, (0, 54)), (54, 0.9, (3, 51)), (10, 0.5, (3, 7))])
    def test_middle_rows_lie_inside(self, rows: int, share: float, kept: tuple[int, int]) -> None:
        assert middle_rows(rows, share) == slice(*kept)


@pytest.mark.parametrize(
    ("settings", "problem"),
    [
        ({"probability": 1.5}, "probability is 1.5"),
        ({"lead": -0.1}, "lead is -0.1"),
        ({"reach_m": 0.0}, "reach_m is 0.0"),
        ({"feather_slots": 0.6}, "feather_slots is 0.6"),
        ({"visit_updates": 0}, "visit_updates"),
        ({"look_back": -1}, "look_back"),
        ({"slack_columns": -1}, "slack_columns"),
    ],
)
def test_settings_that_cannot_be(settings: dict[str, Any], problem: str) -> None:
    with pytest.raises(ValueError, match=problem):
        UpkeepConfig(**settings)


def test_another_sensor_has_no_panoramas_to_keep() -> None:
    with pytest.raises(UserError, match="ColorHistogram; take the sensor ima"):
        PanoramaUpkeep(noise_map(), ColorHistogram())
