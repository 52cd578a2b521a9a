"""The simulated laboratory and its corridor: plan, furniture, doors, and what changes with time and light."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from oracles.clearance import distance_to_segments

from benchmarks.worlds import LabCorridorWorld, LabWorld, Moment, lab_scene, render_frame
from benchmarks.worlds.drive import Route, drive
from benchmarks.worlds.lab import BOTTOM, DOOR_Y, LAB_PLACES, LEFT, RIGHT, TOP
from benchmarks.worlds.light import tint_at
from topoloc.geometry import Floats
from topoloc.topo_map import Camera
from topoloc.types import Image

CAMERA = Camera()
LOOP = np.array([(place.x, place.y) for place in LAB_PLACES])
TO_DOOR = np.array([LEFT + 3.0, DOOR_Y, np.pi])
TO_WINDOWS = np.array([0.0, 0.5, np.pi / 3.0])


def view(pose: Floats, moment: Moment | None = None, seed: int = 3) -> Image:
    return render_frame(lab_scene(seed, moment), pose, CAMERA)


def test_the_map_is_figure_5_22() -> None:
    expected = [(0, 0), (1, 0), (1, 1), (1, 2), (0, 2), (0, 1), (-1, 1), (-1, 0)]
    assert LabWorld().positions == pytest.approx(np.array(expected, dtype=float))
    to_walls = np.stack([LOOP[:, 0] - LEFT, RIGHT - LOOP[:, 0], LOOP[:, 1] - BOTTOM, TOP - LOOP[:, 1]])
    assert 2.0 <= to_walls.min() <= 2.7


def test_the_corridor_map_is_figure_5_30() -> None:
    """9 follows 8; entry 2 m x 2 m, corridor 2 m x 10 m; 11 to 15 along it."""
    world = LabCorridorWorld()
    assert [place.id for place in world.places] == [str(k) for k in range(1, 16)]
    pairs = {(int(a) + 1, int(b) + 1) for a, b in world.edges()}
    assert {(8, 9), (9, 10), (10, 11), (11, 12), (12, 13), (13, 14), (14, 15), (1, 8)} <= pairs
    assert not any(a <= 7 and b >= 9 for a, b in pairs)
    corridor = world.positions[10:]
    assert np.ptp(corridor[:, 1]) == 0.0
    assert np.diff(corridor[:, 0]) == pytest.approx(-2.0)
    assert [world.mapped_at(k).doors for k in range(15)] == [0.0] * 8 + [1.0] + [0.0] * 6
    assert world.config.doors == 1.0


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("age", [0.0, 1.0])
def test_no_furniture_stands_within_45_cm_of_the_path(seed: int, age: float) -> None:
    path = drive(LOOP, 600, np.random.default_rng(seed), Route(step_m=0.05, step_spread_m=0.0))
    assert distance_to_segments(path[:, :2], lab_scene(seed, Moment(age=age)).faces.ends).min() > 0.45


@pytest.mark.parametrize("seed", range(3))
def test_the_corridor_trip_touches_nothing_and_goes_through_the_doors(seed: int) -> None:
    world = LabCorridorWorld()
    tour = world.positions[list(world.tour)]
    route = Route(step_m=0.05, step_spread_m=0.0)
    path = drive(tour, 900, np.random.default_rng(seed), route, gates=world.gates())
    faces = lab_scene(seed, Moment(doors=1.0)).faces
    standing = faces.heights[:, 0] < 1.2
    assert distance_to_segments(path[:, :2], faces.ends[standing]).min() > 0.3


def test_a_seed_is_a_building_of_its_own() -> None:
    assert (view(TO_WINDOWS) == view(TO_WINDOWS)).all()
    assert (view(TO_WINDOWS, seed=4) != view(TO_WINDOWS)).any()


def test_an_open_door_shows_the_entry_behind_it_and_nothing_else_changes() -> None:
    closed, ajar, opened = (view(TO_DOOR, Moment(doors=share)) for share in (0.0, 0.5, 1.0))
    changed = (closed != opened).any(axis=(0, 2))
    assert 0.15 < changed.mean() < 0.55
    assert not changed[:40].any()
    assert (ajar != opened).any()
    assert (ajar != closed).any()
    assert opened.min(axis=2).min() > 0  # nothing is seen through


@pytest.mark.parametrize(
    "moment", [Moment(age=1.0), Moment(bulbs=1.0), Moment(daylight=1.0), Moment(bulbs=0.4, daylight=0.4)]
)
def test_light_falls_otherwise_and_not_only_weaker(moment: Moment) -> None:
    """Other places of the sources: what is left after the best gain and offset is more than a trace."""
    before, after = (
        cv2.cvtColor(image, cv2.COLOR_RGB2GRAY).astype(float).ravel()
        for image in (view(TO_WINDOWS), view(TO_WINDOWS, moment))
    )
    gain, offset = np.polyfit(before, after, 1)
    assert np.std(after - gain * before - offset) > 8.0


def test_light_has_its_colour() -> None:
    assert tint_at(Moment()) == (1.0, 1.0, 1.0)
    warm, cold = tint_at(Moment(bulbs=1.0)), tint_at(Moment(daylight=1.0))
    assert warm[0] > 1.0 > warm[2]
    assert cold[2] > 1.0 > cold[0]
    assert tint_at(Moment(bulbs=0.5)) == pytest.approx(tuple((1.0 + value) / 2.0 for value in warm))


def test_the_corridor_keeps_its_light_while_the_laboratory_grows_old() -> None:
    inside = np.array([-9.0, DOOR_Y, np.pi])
    fresh, old = view(inside), view(inside, Moment(age=1.0))
    assert np.abs(fresh.astype(float).mean() - old.astype(float).mean()) < 6.0


def test_older_is_more_different() -> None:
    poses = [np.array([*place, heading]) for place in LOOP[::2] for heading in (0.0, 2.0, -2.0)]
    change = [
        np.mean([np.abs(view(pose).astype(int) - view(pose, Moment(age=age))).mean() for pose in poses])
        for age in (0.0, 0.3, 0.6, 1.0)
    ]
    assert change[0] == 0.0
    assert np.all(np.diff(change) > 0.0)
