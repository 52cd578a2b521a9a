"""The simulated offices: as many images as published, furniture off the positions, pictures where they should be."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.clearance import distance_to_segments
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from benchmarks.worlds.drive import drive, wander
from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.office import (
    CLEAR_M,
    SMALL,
    LargeOfficeWorld,
    OfficeRoute,
    OfficeSettings,
    OfficeWorld,
    headings,
)
from benchmarks.worlds.renderer import render_frame, right_of
from benchmarks.worlds.snapshots import Scan
from benchmarks.worlds.world import Simulation
from topoloc.geometry import Floats, compose
from topoloc.localizer import Localizer
from topoloc.plugins import make_estimator, make_sensor
from topoloc.topo_map import TopoMap

WORLDS = [OfficeWorld, LargeOfficeWorld]
STANDING_M = 1.4
"""What hangs higher than this is in nobody's way."""


class FewImages(OfficeWorld):
    """The small office with four headings at each position."""

    plan = replace(SMALL, step_deg=105.0)


def exact(**changes: Any) -> OfficeSettings:
    """Pictures without the camera's errors."""
    return OfficeSettings(
        updates=6, turning_shake_px=0.0, shake_px=0.0, grille_shake_px=0.0, effects=SensorEffects.none(), **changes
    )


@lru_cache(maxsize=1)
def exact_run() -> Simulation:
    return FewImages(exact(stereo_baseline_m=0.1, camera_ahead_m=0.2)).simulate(1)


def distance_to_things(points: Floats, world: OfficeWorld, seed: int, moment: Moment) -> Floats:
    """Distance (N,) from points (N, 2) to the nearest wall or furniture [m]."""
    faces = world.scene(seed, moment).faces
    ends = faces.ends[faces.heights[:, 0] < STANDING_M]
    return np.asarray(distance_to_segments(points, ends).min(axis=1))


@pytest.mark.parametrize(("world", "published", "turns"), [(OfficeWorld, 400, 22), (LargeOfficeWorld, 4000, 32)])
def test_there_are_about_as_many_images_as_published(world: type[OfficeWorld], published: int, turns: int) -> None:
    office = world()
    assert len(headings(office.plan)) == turns
    assert abs(office.image_count - published) <= 0.05 * published
    assert office.view_poses.shape == (office.image_count, 3)
    assert len(np.unique(office.view_poses.round(6), axis=0)) == office.image_count


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("seed", range(3))
def test_no_furniture_stands_on_a_position(world: type[OfficeWorld], seed: int) -> None:
    office = world()
    assert distance_to_things(office.positions, office, seed, Moment()).min() >= CLEAR_M


@pytest.mark.parametrize("world", WORLDS)
def test_positions_lie_in_the_published_area_on_a_grid_and_hang_together(world: type[OfficeWorld]) -> None:
    office = world()
    positions, pairs, spacing = office.positions, office.edges(), office.plan.spacing_m
    assert (positions >= 0.0).all()
    assert (positions <= office.plan.area).all()
    steps = positions - positions[0]
    assert steps == pytest.approx(np.round(steps / spacing) * spacing)
    assert np.linalg.norm(np.diff(positions[pairs], axis=1)[:, 0], axis=1) == pytest.approx(spacing)
    graph = coo_array((np.ones(len(pairs)), pairs.T), shape=(len(positions),) * 2)
    assert connected_components(graph, directed=False)[0] == 1
    joined = {frozenset(pair) for pair in pairs.tolist()}
    tour = list(office.tour)
    assert all(frozenset(leg) in joined for leg in zip(tour, [*tour[1:], tour[0]], strict=True))


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("moment", [Moment(), Moment(age=1.0, seated=1.0)])
def test_the_robot_keeps_20_cm_off_furniture(world: type[OfficeWorld], moment: Moment) -> None:
    office, route = world(), OfficeRoute(step_m=0.1, step_spread_m=0.0)
    both = np.concatenate([office.edges(), office.edges()[:, ::-1]])
    near = [both[both[:, 0] == node, 1] for node in range(len(office.places))]
    for seed in range(3):
        rng = np.random.default_rng(seed)
        paths = (
            wander(office.positions, near, office.tour[0], 400, rng, route),
            drive(office.positions[list(office.tour)], 300, rng, route),
        )
        for path in paths:
            assert distance_to_things(path[:, :2], office, seed, moment).min() > 0.2


def test_a_seed_fixes_every_byte() -> None:
    one, same, other = (FewImages(OfficeSettings(updates=5)).simulate(seed) for seed in (3, 3, 4))
    assert np.array_equal(one.truth, same.truth)
    assert not np.array_equal(one.truth, other.truth)
    views = [np.stack([view.image for view in run.topo_map.views]) for run in (one, same, other)]
    assert np.array_equal(views[0], views[1])
    assert not np.array_equal(views[0], views[2])
    for first, second in zip(one.frames, same.frames, strict=True):
        assert np.array_equal(first.images["rgb"], second.images["rgb"])
        assert np.array_equal(np.asarray(first.odometry), np.asarray(second.odometry))


def test_views_and_frames_show_what_there_is_at_their_poses() -> None:
    run, office = exact_run(), FewImages(exact(stereo_baseline_m=0.1, camera_ahead_m=0.2))
    scene, camera = office.scene(1, Moment()), office.camera
    assert run.topo_map.baseline_m == pytest.approx(0.1)
    for view in run.topo_map.views[::9]:
        assert np.array_equal(view.image, render_frame(scene, view.pose, camera))
        assert view.right is not None
        assert np.array_equal(view.right, render_frame(scene, right_of(view.pose, 0.1), camera))
    for frame, pose in zip(run.frames, run.truth, strict=True):
        seen = compose(pose, frame.camera)
        assert np.array_equal(frame.images["rgb"], render_frame(scene, seen, camera))
        assert np.array_equal(frame.images["right"], render_frame(scene, right_of(seen, 0.1), camera))


def test_the_camera_stands_on_the_positions_or_ahead_of_them() -> None:
    office, ahead = OfficeWorld(), OfficeWorld(OfficeSettings(camera_ahead_m=0.2))
    turns = len(headings(SMALL))
    assert office.view_poses[:, :2] == pytest.approx(np.repeat(office.positions, turns, axis=0))
    assert ahead.view_poses[:, :2] - office.view_poses[:, :2] == pytest.approx(np.tile((0.0, 0.2), (18 * turns, 1)))
    degrees = np.rad2deg(np.unwrap(office.view_poses[:turns, 2]))
    assert np.diff(degrees) == pytest.approx(15.0)
    assert degrees[-1] - degrees[0] == pytest.approx(315.0)


def test_the_map_tells_its_images_and_comes_back_from_disk(tmp_path: Path) -> None:
    topo_map = exact_run().topo_map
    assert topo_map.name == "office, 72 images (simulated)"
    assert all(node.panorama is None for node in topo_map.nodes)
    topo_map.save(tmp_path / "map")
    loaded = TopoMap.load(tmp_path / "map")
    assert loaded.nodes == topo_map.nodes
    assert np.array_equal(np.asarray(loaded.edges), np.asarray(topo_map.edges))
    assert loaded.baseline_m == topo_map.baseline_m
    for saved, made in zip(loaded.views, topo_map.views, strict=True):
        assert saved.pose == pytest.approx(made.pose)
        assert np.array_equal(saved.image, made.image)
        assert np.array_equal(np.asarray(saved.right), np.asarray(made.right))


def test_the_head_sweeps() -> None:
    pans = np.rad2deg(OfficeWorld(OfficeSettings(pan_deg=40.0)).pans(30))
    assert pans.max() == pytest.approx(40.0)
    assert pans.min() == pytest.approx(-40.0)
    assert not OfficeWorld(OfficeSettings(pan_deg=0.0)).pans(5).any()


def test_settings_that_mean_nothing_are_refused() -> None:
    with pytest.raises(ValueError, match=r"pan_deg is 170\.0"):
        OfficeSettings(pan_deg=170.0)
    with pytest.raises(ValueError, match="scan is"):
        OfficeSettings(scan=Scan(short_deg=10.0))


@pytest.mark.parametrize("world", WORLDS)
@pytest.mark.parametrize("moment", [Moment(), Moment(daylight=1.0, doors=1.0)])
def test_the_building_has_no_holes(world: type[OfficeWorld], moment: Moment) -> None:
    office = world()
    scene, some = office.scene(0, moment), office.view_poses[:: office.image_count // 100]
    assert min(int(render_frame(scene, pose, office.camera).max(axis=2).min()) for pose in some) > 0


def test_daylight_opens_the_curtains() -> None:
    office = OfficeWorld()
    to_the_windows = [pose for pose in office.view_poses if abs(pose[2] - np.pi / 2.0) < 0.2]
    bright = []
    for moment in (Moment(), Moment(daylight=1.0)):
        scene = office.scene(0, moment)
        bright.append(np.mean([render_frame(scene, pose, office.camera).min(axis=2) > 230 for pose in to_the_windows]))
    assert bright[1] > 1.5 * bright[0]


def test_histograms_find_the_position_under_the_light_of_the_map() -> None:
    run = OfficeWorld(OfficeSettings(updates=25)).simulate(0)
    localizer = Localizer(run.topo_map, make_sensor("histogram"), make_estimator("grid"))
    found = [localizer.step(frame).node for frame in run.frames]
    right = run.topo_map.nearest_node(run.truth[:, :2])
    assert np.mean([node == true for node, true in zip(found[5:], right[5:], strict=True)]) > 0.6  # by chance 1 in 18


@pytest.mark.slow
def test_the_large_map_is_made() -> None:
    topo_map = LargeOfficeWorld().topo_map(0)
    assert len(topo_map.views) == LargeOfficeWorld().image_count == 3968
    assert topo_map.name == "large office, 3968 images (simulated)"
