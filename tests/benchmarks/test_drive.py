"""Where the simulated robot drives, and what its odometer says of it."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles.clearance import distance_to_segments

from benchmarks.worlds.drive import Route, drive, frames_per_tour, wander
from benchmarks.worlds.lab import LAB_PLACES, LabWorld
from benchmarks.worlds.lab_corridor import CORRIDOR_PLACES, CORRIDOR_TOUR, LabCorridorWorld
from benchmarks.worlds.odometer import Drift, odometer, on_grille
from topoloc.geometry import Floats, between, wrap
from topoloc.odometry import MotionGate

LOOP = np.array([(place.x, place.y) for place in LAB_PLACES])
SEEDS = range(30)
MOUNT = np.array([0.10, 0.0, 0.0])
FINE = Route(step_m=0.04, step_spread_m=0.0)


def passing_distances(path: Floats, nodes: Floats) -> Floats:
    """Distance at every local minimum below 0.6 m."""
    distance = np.linalg.norm(path[:, None, :2] - nodes, axis=2)
    low = (distance[1:-1] < distance[:-2]) & (distance[1:-1] <= distance[2:]) & (distance[1:-1] < 0.6)
    return np.asarray(distance[1:-1][low])


def test_the_path_starts_on_node_1_and_then_keeps_25_to_35_cm_outside_the_nodes() -> None:
    for seed in SEEDS:
        path = drive(LOOP, 800, np.random.default_rng(seed), FINE)
        assert path[0, :2] == pytest.approx(LOOP[0])
        nearest = passing_distances(path[40:], LOOP)
        assert len(nearest) >= 3 * 8 - 4
        assert nearest.min() > 0.24
        assert nearest.max() < 0.36
        turned = np.unwrap(path[:, 2])
        assert turned[-1] > turned[0] + 4.0 * np.pi  # counter-clockwise, from 1 to 2
        ahead = np.diff(path[:, :2], axis=0)
        assert np.abs(np.cos(path[:-1, 2]) * ahead[:, 1] - np.sin(path[:-1, 2]) * ahead[:, 0]).max() < 0.01


def test_the_corridor_trip_passes_its_nodes_in_order_and_turns_on_the_spot_at_the_end() -> None:
    nodes = np.array([(place.x, place.y) for place in CORRIDOR_PLACES])
    tour = nodes[list(CORRIDOR_TOUR)]
    path = drive(tour, 1000, np.random.default_rng(3), FINE, gates=LabCorridorWorld().gates())
    nearest = np.argmin(np.linalg.norm(path[:, None, :2] - nodes, axis=2), axis=1)
    order = [int(node) for node, before in zip(nearest[1:], nearest[:-1], strict=True) if node != before]
    passed = [0, *order[: len(CORRIDOR_TOUR) - 1]]
    assert passed == list(CORRIDOR_TOUR)
    standing = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1) < 1e-9
    turned = np.abs(np.rad2deg(wrap(np.diff(path[:, 2]))))[standing].sum()
    assert 110.0 < turned < 200.0
    assert np.linalg.norm(path[:-1][standing][:, :2] - nodes[14], axis=1).max() < 0.36


def test_laps_have_the_published_number_of_updates() -> None:
    """Tables 5.3 and 5.5: 255 and 253 in ten rounds; Table 5.9: 30 in the laboratory and 21 outside of it."""
    assert LabWorld().frames_per_lap == pytest.approx(25.4, abs=0.5)
    world = LabCorridorWorld()
    counts = []
    for seed in range(10):
        _, truth = world.drive(seed)
        counts.append(((truth[:, 0] > -3.3).sum(), (truth[:, 0] <= -3.3).sum()))
    inside, outside = np.mean(counts, axis=0)
    assert inside == pytest.approx(30, abs=2)
    assert outside == pytest.approx(21, abs=2)


def test_every_frame_opens_the_motion_gate() -> None:
    gate = MotionGate()
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        truth = drive(LOOP, 80, rng)
        readings = odometer(between(truth[:-1], truth[1:]), truth[0], Drift(), rng)
        for before, after in pairwise(readings):
            assert gate.opens(before, MOUNT, after, MOUNT)


@given(seed=st.integers(0, 10_000), spacing=st.floats(0.5, 3.0))
@settings(max_examples=25, deadline=None)
def test_a_random_drive_goes_along_edges_and_passes_every_node_at_its_distance(seed: int, spacing: float) -> None:
    rng = np.random.default_rng(seed)
    places = spacing * np.array([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (1.0, 1.0)])
    neighbours = [np.array([1]), np.array([0, 2, 3]), np.array([1]), np.array([1])]
    route = Route(0.1 * spacing, 0.15 * spacing, 0.1 * spacing, 0.0)
    path = wander(places, neighbours, 0, 150, rng, route)
    assert path.shape == (150, 3)
    assert path[0, :2] == pytest.approx(places[0])
    step = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)
    assert step.max() < 0.1001 * spacing
    to_hub = distance_to_segments(path[:, :2], np.array([[*places[1], *end] for end in places]))
    assert to_hub.min(axis=1).max() < 0.35 * spacing


def test_a_random_drive_never_runs_out_of_way_and_a_lonely_node_is_refused() -> None:
    neighbours = [np.array([(k - 1) % 8, (k + 1) % 8]) for k in range(8)]
    for seed in range(8):
        path = wander(LOOP, neighbours, 0, 300, np.random.default_rng(seed), Route(0.45, 0.5))
        step = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1) + np.abs(wrap(np.diff(path[:, 2])))
        assert step.min() > 0.1
    with pytest.raises(ValueError, match="no neighbour"):
        wander(LOOP, [*neighbours[:-1], np.array([], dtype=int)], 0, 10, np.random.default_rng(0))


@pytest.mark.parametrize(
    "name", ["rotation_scale_sd", "curvature_sd_deg", "distance_sd", "slip_deg", "grille_jolt_deg"]
)
def test_spreads_are_never_negative(name: str) -> None:
    with pytest.raises(ValueError, match=name):
        Drift(**{name: -1.0})


def test_two_random_drives_differ_and_one_seed_repeats() -> None:
    neighbours = [np.array([(k - 1) % 8, (k + 1) % 8]) for k in range(8)]
    one, again, other = (wander(LOOP, neighbours, 0, 40, np.random.default_rng(seed)) for seed in (1, 1, 2))
    assert (one == again).all()
    assert np.abs(one - other).max() > 0.5


def test_a_pace_spreads_the_frames_where_it_says_so() -> None:
    line = np.array([(0.0, 0.0), (6.0, 0.0)])

    def pace(positions: Floats) -> Floats:
        return np.where(positions[:, 0] > 3.0, 2.0, 1.0)

    path = drive(line, 12, np.random.default_rng(0), Route(step_spread_m=0.0), pace)
    step = np.linalg.norm(np.diff(path[:, :2], axis=0), axis=1)
    assert step[:6] == pytest.approx(0.4, abs=0.01)
    assert step[8:10] == pytest.approx(0.8, abs=0.01)
    assert frames_per_tour(line, Route(), pace) < frames_per_tour(line, Route())


@pytest.mark.parametrize(
    ("wrong", "named"),
    [({"nearest_m": 0.5}, "nearest_m"), ({"step_m": 0.0}, "step_m"), ({"turn_step_deg": 0.0}, "turn_step_deg")],
)
def test_routes_that_lead_nowhere_are_refused(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        Route(**wrong)  # type: ignore[arg-type]


def three_laps_off(seed: int, drift: Drift) -> float:
    rng = np.random.default_rng(seed)
    truth = drive(LOOP, round(3.0 * frames_per_tour(LOOP, Route())) + 1, rng)
    readings = odometer(between(truth[:-1], truth[1:]), truth[0], drift, rng, on_grille(truth, drift.grille_spacing_m))
    return float(np.linalg.norm(readings[-1, :2] - truth[-1, :2]))


def test_dead_reckoning_ends_12_to_25_decimetres_off_after_three_laps() -> None:
    off = [three_laps_off(seed, Drift()) for seed in SEEDS]
    assert 1.2 <= np.median(off) <= 2.5
    low, high = np.percentile(off, [10, 90])
    assert low >= 1.2
    assert high <= 2.6


def test_the_odometer_is_45_degrees_off_after_seven_turns_on_the_spot() -> None:
    turning = np.zeros((7 * 36, 3))
    turning[:, 2] = np.deg2rad(10.0)
    off = [
        np.rad2deg(abs(odometer(turning, np.zeros(3), Drift(), np.random.default_rng(seed))[-1, 2])) for seed in SEEDS
    ]
    assert np.mean(off) == pytest.approx(45.0, abs=5.0)
    assert np.std(off) < 8.0


def test_an_odometer_without_errors_repeats_the_drive_in_its_own_frame() -> None:
    truth = drive(LOOP, 40, np.random.default_rng(0))
    start = np.array([3.0, -2.0, 1.0])
    readings = odometer(between(truth[:-1], truth[1:]), start, Drift.none(), np.random.default_rng(1))
    assert readings[0] == pytest.approx(start)
    assert between(readings[0], readings) == pytest.approx(between(truth[0], truth), abs=1e-9)


def test_slip_lengthens_what_the_odometer_says_and_grilles_turn_it() -> None:
    ahead = np.tile((0.5, 0.0, 0.0), (400, 1))
    start, rng = np.zeros(3), np.random.default_rng
    slipping = odometer(ahead, start, replace(Drift.none(), slip_share=0.5, slip_loss=0.2), rng(0))
    assert slipping[-1, 0] == pytest.approx(200.0 * 1.1, rel=0.02)
    grille = np.arange(400) % 4 == 0
    jolting = replace(Drift.none(), grille_spacing_m=2.0, grille_jolt_deg=3.0)
    jolted = odometer(ahead, start, jolting, rng(0), grille)
    turned = np.rad2deg(wrap(np.diff(jolted[:, 2])))
    assert (turned[~grille] == 0.0).all()
    assert turned[grille].std() == pytest.approx(3.0, rel=0.2)


def test_grilles_lie_every_two_metres_across_the_room() -> None:
    along_x = np.column_stack([np.linspace(-5.0, 5.0, 101), np.zeros(101), np.zeros(101)])
    assert on_grille(along_x, 2.0).sum() == 5
    assert on_grille(along_x[:, [1, 0, 2]], 2.0).sum() == 0
    assert on_grille(along_x, 0.0).sum() == 0
