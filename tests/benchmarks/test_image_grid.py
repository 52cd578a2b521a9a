"""The simulated image grids: published sizes, full circles that turn with the robot, frames between the points."""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from pathlib import Path
from typing import Any, get_args

import numpy as np
import pytest

from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.image_grid import (
    GRIDS,
    HEADING,
    GridName,
    GridRoute,
    ImageGridSettings,
    ImageGridWorld,
    points_of,
)
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.renderer import render_cylinder
from benchmarks.worlds.snapshots import Scan
from benchmarks.worlds.world import Shot, Simulation
from topoloc.errors import UserError
from topoloc.geometry import Floats, compose, wrap
from topoloc.settings import build
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Image

COLUMN = 2.0 * np.pi / 256
NAMES: tuple[GridName, ...] = get_args(GridName)


@lru_cache(maxsize=2)
def short_run(grid: GridName = "6x8") -> Simulation:
    return ImageGridWorld(ImageGridSettings(grid=grid, updates=30)).simulate(2)


class WithoutPictures(ImageGridWorld):
    """Its map comes without panoramas, for tests of the drive alone."""

    def topo_map(self, seed: int) -> TopoMap:
        return TopoMap(self.title, self.camera, tuple(Node(*place) for place in self.places))


def drive_of(seed: int = 2, **settings: Any) -> Simulation:
    return WithoutPictures(ImageGridSettings(**settings)).simulate(seed)


def circle_at(world: ImageGridWorld, pose: Floats) -> Image:
    """What a frame shows at a pose (3,)."""
    shot = Shot(world.scene(2, Moment()), (), pose, 0.0, False, True, 0, 0)
    return world.readers(shot)["omni"]()


def rotation_of(circle: Image, panorama: Image) -> float:
    """Heading of the circle's first column against the panorama's, where the two match best [rad]."""
    grey = [image.mean(axis=2) - image.mean() for image in (circle, panorama)]
    one, other = (np.fft.rfft(picture, axis=1) for picture in grey)
    match = np.fft.irfft((np.conj(one) * other).sum(axis=0))
    return -int(match.argmax()) * COLUMN


@pytest.mark.parametrize("name", NAMES)
def test_every_grid_has_its_published_size_and_pictures(name: GridName) -> None:
    grid, world = GRIDS[name], ImageGridWorld(ImageGridSettings(grid=name))
    rows, columns = map(int, name.split("x"))
    assert (grid.rows, grid.columns, len(world.places)) == (rows, columns, rows * columns)
    extent = np.ptp(points_of(grid), axis=0)
    assert extent == pytest.approx([(columns - 1) * grid.spacing_m, (rows - 1) * grid.spacing_m])
    assert (extent[::-1] < grid.area).all()
    assert len(world.edges()) == rows * (columns - 1) + columns * (rows - 1)
    apart = np.linalg.norm(np.diff(world.positions[world.edges()], axis=1)[:, 0], axis=1)
    assert apart == pytest.approx(grid.spacing_m)
    tour = world.positions[list(world.tour)]
    assert all(np.linalg.norm(b - a) == pytest.approx(grid.spacing_m) for a, b in pairwise([*tour, tour[0]]))
    picture = circle_at(world, np.array([*world.positions[0], 1.0]))
    assert picture.shape == (56, 256, 3)
    assert picture.std() > 15.0


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("age", [0.0, 1.0])
def test_furniture_stands_outside_the_captured_area(name: GridName, age: float) -> None:
    grid, world = GRIDS[name], ImageGridWorld(ImageGridSettings(grid=name))
    faces = world.scene(0, Moment(age=age)).faces
    ends = faces.ends.reshape(-1, 2) - grid.middle
    beyond = np.abs(ends) - np.array(grid.area[::-1]) / 2.0
    assert np.linalg.norm(np.maximum(beyond, 0.0), axis=1).min() > 0.0


@pytest.mark.parametrize("name", NAMES)
def test_the_drive_starts_on_a_point_and_stays_between_the_points(name: GridName) -> None:
    run, spacing = drive_of(5, grid=name, updates=150), GRIDS[name].spacing_m
    apart = run.topo_map.distance_to_nearest(run.truth[:, :2]) / spacing
    steps = np.linalg.norm(np.diff(run.truth[:, :2], axis=0), axis=1) / spacing
    assert apart[0] == pytest.approx(0.0, abs=1e-9)
    assert 0.25 < np.median(apart) < 0.5
    assert apart.max() < 0.75
    assert 0.3 < np.median(steps) < 0.44


def test_the_map_has_a_full_circle_on_every_point() -> None:
    topo_map = short_run().topo_map
    assert topo_map.name == "image grid 6x8, 48 panoramas (simulated)"
    assert topo_map.camera.panorama_columns() == 256
    for node in topo_map.nodes:
        assert node.heading == HEADING
        assert node.panorama is not None
        assert node.panorama.shape == (56, 256, 3)
        assert topo_map.camera.fits_panorama(node.panorama)


def test_frames_are_full_circles_and_nothing_else() -> None:
    for frame in short_run().frames[:5]:
        assert set(frame.images) == {"omni"}
        assert frame.images["omni"].shape == (56, 256, 3)


@pytest.mark.parametrize("columns", [0, 1, 64, 200])
def test_a_circle_turns_with_the_robot(columns: int) -> None:
    world = ImageGridWorld(ImageGridSettings(grid="6x8", effects=SensorEffects.none()))
    position = world.positions[11]
    panorama = render_cylinder(world.scene(2, Moment()), position, HEADING, world.camera)
    turned = circle_at(world, np.array([*position, HEADING - columns * COLUMN]))
    expected = np.roll(panorama, -columns, axis=1)
    assert (turned == expected).all(axis=2).mean() > 0.99  # rounding moves the edges of few things
    assert rotation_of(turned, panorama) == pytest.approx(-columns * COLUMN)


def test_the_panorama_of_a_point_is_a_cylinder_round_it() -> None:
    settings = ImageGridSettings(grid="6x8", effects=SensorEffects.none(), updates=2)
    world = ImageGridWorld(settings)
    topo_map = world.topo_map(2)
    for number in (0, 20, 47):
        expected = render_cylinder(world.scene(2, Moment()), world.positions[number], HEADING, world.camera)
        panorama = topo_map.nodes[number].panorama
        assert panorama is not None
        assert np.array_equal(panorama, expected)


@pytest.mark.parametrize("name", ["6x8", "5x10"])
def test_the_best_rotation_between_the_points_tells_the_heading(name: GridName) -> None:
    run = short_run(name)
    nearest = run.topo_map.nearest_node(run.truth[:, :2])
    wrong = []
    for frame, pose, node in zip(run.frames, run.truth, nearest, strict=True):
        panorama = run.topo_map.nodes[node].panorama
        assert panorama is not None
        seen = HEADING + rotation_of(frame.images["omni"], panorama)
        wrong.append(abs(float(wrap(seen - compose(pose, frame.camera)[2]))))
    assert np.rad2deg(np.median(wrong)) < 8.0
    assert np.mean(np.rad2deg(wrong) < 20.0) > 0.9


def test_a_seed_fixes_every_byte() -> None:
    one, other = short_run(), drive_of(3, grid="6x8", updates=30)
    same = ImageGridWorld(ImageGridSettings(grid="6x8", updates=30)).simulate(2)
    for node, its_twin in zip(one.topo_map.nodes, same.topo_map.nodes, strict=True):
        assert np.array_equal(np.asarray(node.panorama), np.asarray(its_twin.panorama))
    for frame, again in zip(one.frames[:4], same.frames[:4], strict=True):
        assert np.array_equal(frame.images["omni"], again.images["omni"])
    assert not np.array_equal(one.frames[0].images["omni"], other.frames[0].images["omni"])


def test_the_errors_of_the_sensor_leave_no_seam() -> None:
    world = ImageGridWorld(ImageGridSettings(grid="6x8", effects=SensorEffects(noise_grey=0.0, jpeg_quality=0)))
    jumps = []
    for heading in np.linspace(-3.0, 3.0, 12):
        circle = circle_at(world, np.array([*world.positions[20], heading])).astype(np.float64)
        step = np.abs(np.diff(np.concatenate([circle, circle[:, :1]], axis=1), axis=1)).mean(axis=(0, 2))
        jumps.append(step[-1] / step.mean())
    assert np.median(jumps) < 1.5


def test_people_light_and_covered_frames_change_the_circles() -> None:
    changed: tuple[dict[str, Any], ...] = (
        {"people": 1.0},
        {"age": 1.0},
        {"bulbs": 1.0},
        {"doors": 1.0},
        {"covered": (2,)},
    )
    plain = short_run().frames[2].images["omni"]
    for changes in changed:
        image = drive_of(grid="6x8", updates=30, **changes).frames[2].images["omni"]
        assert not np.array_equal(image, plain), changes


def test_the_map_comes_back_from_disk(tmp_path: Path) -> None:
    topo_map = short_run().topo_map
    topo_map.save(tmp_path / "map")
    loaded = TopoMap.load(tmp_path / "map")
    assert loaded.nodes == topo_map.nodes
    for saved, made in zip(loaded.nodes, topo_map.nodes, strict=True):
        assert np.array_equal(np.asarray(saved.panorama), np.asarray(made.panorama))


@pytest.mark.parametrize(
    "changes", [{"stereo_baseline_m": 0.1}, {"depth": True}, {"shake_px": 1.0}, {"scan": Scan(short_deg=10.0)}]
)
def test_what_full_circles_do_not_have_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(changes))) as error:
        ImageGridSettings(**changes)
    assert "\n" not in str(error.value)


def test_an_unknown_grid_is_refused_with_the_known_ones() -> None:
    with pytest.raises(UserError, match="5x10, 10x15, 6x8, 12x9, 11x6, 35x10"):
        build(ImageGridSettings, {"grid": "7x7"}, "settings")


def test_lengths_of_the_route_shrink_with_the_spacing() -> None:
    route = ImageGridWorld(ImageGridSettings(grid="12x9")).route
    assert (route.step_m, route.farthest_m) == pytest.approx((0.04, 0.03))
    assert ImageGridWorld(ImageGridSettings(grid="5x10")).route == GridRoute()


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_all_maps_are_made(name: GridName) -> None:
    topo_map = ImageGridWorld(ImageGridSettings(grid=name)).topo_map(0)
    assert len(topo_map.nodes) == GRIDS[name].rows * GRIDS[name].columns
