"""Block matching, the sparse disparities of real and simulated pairs, and the sensor made of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from oracles.shared_data import SHARED_DATA

from benchmarks.worlds.office import LargeOfficeWorld, OfficeSettings
from benchmarks.worlds.world import Shot
from sensors.block_matching import BlockMatchingConfig, averaged, disparities
from sensors.disparity import Disparity, DisparityConfig
from topoloc.errors import UserError
from topoloc.files import read_image
from topoloc.geometry import wrap
from topoloc.recording import LazyImages
from topoloc.testing import check_sensor
from topoloc.topo_map import TopoMap, View
from topoloc.types import DEPTH_UNITS_PER_M, Depth, Frame, Image

MATCHING = BlockMatchingConfig()
SEED, BASELINE_M = 1000, 0.12
OFFICE = OfficeSettings(stereo_baseline_m=BASELINE_M, depth=True)
FOCAL_PX = 80.0 / np.tan(np.deg2rad(30.0))
"""Of the office's camera, 160 columns over 60 degrees [px]."""
SETTINGS = DisparityConfig(features=8, columns=16)
REAL = SHARED_DATA / "corridor_two_laps" / "stereo"

Look = Callable[[int, OfficeSettings], Frame]


def noise(rows: int, columns: int, seed: int = 0) -> Image:
    rough = np.random.default_rng(seed).integers(0, 256, (rows, columns)).astype(np.uint8)
    return np.asarray(cv2.GaussianBlur(rough, (3, 3), 0.8), dtype=np.uint8)


class TestBlockMatching:
    def test_a_shifted_picture(self) -> None:
        """Known nearly everywhere, the left margin included as far as the right picture shows it."""
        wide = noise(60, 200)
        left, right = wide[:, 20:180], wide[:, 27:187]
        found = disparities(left, right, MATCHING)
        known = np.isfinite(found)
        assert np.abs(found[known] - 7.0).max() < 0.25
        assert known[:, 12:].mean() > 0.98
        assert not known[:, :6].any()

    def test_two_depths(self) -> None:
        back, front = noise(60, 160, 1), noise(60, 160, 2)
        left, right = back.copy(), np.roll(back, -3, axis=1)
        left[:, 80:120], right[:, 68:108] = front[:, 80:120], front[:, 80:120]
        found = disparities(left, right, MATCHING)
        assert np.nanmedian(found[:, 40:70]) == pytest.approx(3.0, abs=0.1)
        assert np.nanmedian(found[:, 85:115]) == pytest.approx(12.0, abs=0.1)

    def test_low_texture_is_left_out(self) -> None:
        wide = noise(60, 200)
        wide[:, 90:130] = 128 + wide[:, 90:130] // 64
        found = disparities(wide[:, 20:180], wide[:, 25:185], MATCHING)
        assert np.isnan(found[:, 80:100]).all()
        assert np.isfinite(
            disparities(wide[:, 20:180], wide[:, 25:185], replace(MATCHING, texture=0.0))[:, 80:100]
        ).any()

    def test_colour_and_grey_give_the_same(self) -> None:
        wide = noise(60, 200)
        left, right = np.ascontiguousarray(wide[:, 20:180]), np.ascontiguousarray(wide[:, 25:185])
        colour = [np.repeat(image[..., None], 3, axis=2) for image in (left, right)]
        in_colour = disparities(colour[0], colour[1], MATCHING)
        np.testing.assert_array_equal(in_colour, disparities(left, right, MATCHING))

    def test_different_sizes_are_refused(self) -> None:
        with pytest.raises(UserError, match="160x60 and 80x30"):
            disparities(noise(60, 160), noise(30, 80), MATCHING)

    def test_cells_are_means_of_known_pixels(self) -> None:
        found = np.full((4, 6), np.nan, dtype=np.float32)
        found[0, :2], found[1, 0], found[2:, 2:4], found[3, 5] = (1.0, 3.0), 5.0, 4.0, 9.0
        expected = np.array([[3.0, np.nan, np.nan], [np.nan, 4.0, np.nan]])
        np.testing.assert_allclose(averaged(found, 3, 2, 0.3), expected, rtol=1e-6)
        assert averaged(found, 3, 2, 0.0)[1, 2] == pytest.approx(9.0)
        assert np.isnan(averaged(found, 3, 2, 0.0)[0, 1])

    @pytest.mark.parametrize(
        "wrong", [{"range_share": 0.0}, {"window": 4}, {"uniqueness": -1}, {"texture": -1.0}, {"patch_px": -1}]
    )
    def test_settings_that_make_no_sense(self, wrong: dict[str, Any]) -> None:
        with pytest.raises(ValueError, match=next(iter(wrong))):
            replace(MATCHING, **wrong)


@pytest.fixture(scope="module")
def look() -> Look:
    """A view of the large office's map, by its number, under some settings; and its chances are not the map's."""
    poses = LargeOfficeWorld(OFFICE).view_poses

    def taken(number: int, settings: OfficeSettings = OFFICE) -> Frame:
        world = LargeOfficeWorld(settings)
        shot = Shot(world.scene(SEED, settings.now()), (), poses[number], 3.0, False, True, SEED, 2_000_000 + number)
        return Frame(float(number), np.zeros(3), np.zeros(3), LazyImages(world.readers(shot)))

    return taken


@pytest.fixture(scope="module")
def office(look: Look) -> TopoMap:
    """Every fourth heading at every fourth position of the large office: 248 stereo pairs."""
    world = LargeOfficeWorld(OFFICE)
    chosen = [position * 32 + heading for position in range(0, len(world.places), 4) for heading in range(0, 32, 4)]
    frames = [look(number, OFFICE) for number in chosen]
    views = tuple(
        View(world.view_poses[number], np.asarray(frame.images["rgb"]), np.asarray(frame.images["right"]))
        for number, frame in zip(chosen, frames, strict=True)
    )
    return replace(world.layout(), views=views, baseline_m=BASELINE_M)


@pytest.fixture(scope="module")
def sensor(office: TopoMap) -> Disparity:
    made = Disparity(SETTINGS)
    made.fit(office)
    return made


class TestSimulatedPairs:
    def errors(self, frames: list[Frame]) -> tuple[Any, Any]:
        """Found disparities of all pixels, and how far off they are by the true depth [px]; NaN where unknown."""
        found = np.stack([disparities(frame.images["rgb"], frame.images["right"], MATCHING) for frame in frames])
        depth: Depth = np.stack([frame.images["depth"] for frame in frames])
        true = np.where(depth > 0, FOCAL_PX * BASELINE_M * DEPTH_UNITS_PER_M / np.maximum(depth, 1), np.nan)
        return found, np.abs(found - true)

    def test_disparity_is_that_of_the_true_depth(self, look: Look) -> None:
        found, error = self.errors([look(number, OFFICE) for number in range(5, 3968, 330)])
        assert 0.3 < np.isfinite(found).mean() < 0.7
        assert np.nanmedian(error) < 0.4
        assert np.mean(error[np.isfinite(error)] > 1.5) < 0.15

    def test_it_hardly_changes_with_the_light(self, look: Look) -> None:
        """Where a pixel is known in both, while its grey level changes by more than ten in the mean."""
        daylight = replace(OFFICE, daylight=1.0)
        pairs = [[look(number, settings) for settings in (OFFICE, daylight)] for number in range(5, 3968, 330)]
        usual, other = (np.stack(self.errors([pair[side] for pair in pairs])[0]) for side in (0, 1))
        change = np.abs(usual - other)
        assert np.nanmedian(change) < 0.15
        assert np.mean(change[np.isfinite(change)] > 1.5) < 0.08
        grey = [np.abs(a.images["rgb"].astype(float) - b.images["rgb"]).mean() for a, b in pairs]
        assert np.mean(grey) > 10.0


class TestSensor:
    def test_a_view_of_the_map_is_recognized(self, sensor: Disparity, office: TopoMap) -> None:
        """Unless it faces a bare wall and shows too little to be told from others."""
        blind = 0
        for view in office.views[::20]:
            assert view.right is not None
            evidence = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": view.image, "right": view.right}))
            blind += evidence.is_blind
            if not evidence.is_blind:
                assert evidence.match[0] == pytest.approx(1.0)
                np.testing.assert_allclose(evidence.poses[0], view.pose)
        assert blind <= 3

    def test_the_place_is_found_in_daylight(self, sensor: Disparity, office: TopoMap, look: Look) -> None:
        """Among 248 views the right one is one of the ten nearest mostly; by chance it would be in 4 %."""
        daylight, right = replace(OFFICE, daylight=1.0), 0
        numbers = [position * 32 + heading for position in range(0, 124, 8) for heading in (4, 16, 28)]
        for number in numbers:
            frame, pose = look(number, daylight), LargeOfficeWorld(OFFICE).view_poses[number]
            poses = sensor.observe(frame).poses
            near = (np.linalg.norm(poses[:, :2] - pose[:2], axis=1) < 0.1) & (np.abs(wrap(poses[:, 2] - pose[2])) < 0.1)
            right += bool(near.any())
        assert right / len(numbers) > 0.6

    def test_it_keeps_the_contract(self, office: TopoMap, look: Look) -> None:
        frames = [look(number, OFFICE) for number in (7, 900)]
        pairs = [replace(one, images={kind: one.images[kind] for kind in ("rgb", "right")}) for one in frames]
        check_sensor(Disparity(SETTINGS), office, pairs)

    def test_features_are_weighted_posterior_means(self, sensor: Disparity, look: Look) -> None:
        frame = look(7, OFFICE)
        found = disparities(frame.images["rgb"], frame.images["right"], SETTINGS.matching)
        cells = averaged(found, 16, 12, SETTINGS.least_known).reshape(1, -1) / 1.6
        expected = sensor.basis.project(cells)[0][0] * np.sqrt(sensor.basis.lengths)
        np.testing.assert_allclose(sensor.describe(frame.images), expected, rtol=1e-6)

    def test_pictures_that_are_filled_again_are_looked_at_again(self, sensor: Disparity, look: Look) -> None:
        """A camera may write into the same arrays."""
        first, second = look(7, OFFICE), look(900, OFFICE)
        buffer = {kind: np.array(first.images[kind]) for kind in ("rgb", "right")}
        frame = Frame(0.0, None, np.zeros(3), buffer)
        sensor.observe(frame)
        for kind, array in buffer.items():
            array[...] = second.images[kind]
        np.testing.assert_array_equal(sensor.describe(buffer), sensor.describe(second.images))
        np.testing.assert_array_equal(sensor.observe(frame).distance, sensor.observe(second).distance)

    def test_covered_cameras_are_blind(self, sensor: Disparity, look: Look) -> None:
        pair = dict(look(7, OFFICE).images)
        dark = np.zeros_like(pair["rgb"])
        assert not sensor.observe(Frame(0.0, None, np.zeros(3), pair)).is_blind
        for covered in ({"rgb": dark}, {"right": dark}, {"rgb": dark, "right": dark}):
            assert sensor.observe(Frame(0.0, None, np.zeros(3), {**pair, **covered})).is_blind

    def test_maps_without_right_pictures_are_refused(self, office: TopoMap) -> None:
        some = tuple(replace(view, right=None) if number % 2 else view for number, view in enumerate(office.views))
        with pytest.raises(UserError, match=r"large office.*right picture.*124 of its views lack it.*views\.csv"):
            Disparity().fit(replace(office, views=some))
        with pytest.raises(UserError, match="it has no views"):
            Disparity().fit(replace(office, views=()))

    def test_too_many_features_are_refused(self, office: TopoMap) -> None:
        with pytest.raises(UserError, match="disparity: 20 features need more pixels"):
            Disparity().fit(replace(office, views=office.views[:5]))

    def test_before_a_map_and_without_pairs(self) -> None:
        with pytest.raises(RuntimeError, match="call fit"):
            Disparity().describe({"rgb": noise(60, 80), "right": noise(60, 80)})
        with pytest.raises(UserError, match="single pictures"):
            Disparity().distances_between([noise(60, 80)])

    @pytest.mark.parametrize("wrong", [{"features": 0}, {"columns": 3}, {"least_known": 1.5}, {"least_cells": -0.1}])
    def test_settings_that_make_no_sense(self, wrong: dict[str, Any]) -> None:
        with pytest.raises(ValueError, match=next(iter(wrong))):
            replace(SETTINGS, **wrong)


@pytest.mark.skipif(not REAL.is_dir(), reason="the real photographs are not on this machine")
@pytest.mark.parametrize("number", [50, 60])
class TestRealPairs:
    """A camera over a speckled floor; focal length, centre and baseline as left.yaml and right.yaml have them."""

    focal_px, centre, baseline_m = 487.60873, (318.11621, 249.44424), 58.3627 / 487.60873

    def pair(self, number: int) -> tuple[Image, Image]:
        left, right = (read_image(REAL / f"{side}_{number}.jpg") for side in ("left", "right"))
        return left, right

    def test_left_and_right_agree(self, number: int) -> None:
        """Matched the other way round, nearly every pixel finds back to where it came from."""
        left, right = self.pair(number)
        found = disparities(left, right, MATCHING)
        mirrored = [np.ascontiguousarray(image[:, ::-1]) for image in (right, left)]
        back = disparities(mirrored[0], mirrored[1], MATCHING)[:, ::-1]
        assert 0.3 < np.isfinite(found).mean() < 0.5
        row, column = np.nonzero(np.isfinite(found))
        returned = back[row, np.rint(column - found[row, column]).astype(int)]
        assert np.isfinite(returned).mean() > 0.9
        assert np.mean(np.abs(returned - found[row, column])[np.isfinite(returned)] <= 1.0) > 0.99

    def test_the_floor_is_a_plane_below_the_camera(self, number: int) -> None:
        """1 / Z is linear in the ray on a plane: its normal is upright, and the camera 1.1 m above it."""
        found = disparities(*self.pair(number), MATCHING)
        row, column = np.nonzero(np.isfinite(found) & (np.arange(len(found))[:, None] > 330))
        rays = np.column_stack([column - self.centre[0], row - self.centre[1], np.full(len(row), self.focal_px)])
        plane, *_ = np.linalg.lstsq(rays, found[row, column], rcond=None)
        off = np.abs(found[row, column] - rays @ plane)
        normal = plane / self.baseline_m
        assert 1.0 / np.linalg.norm(normal) == pytest.approx(1.1, abs=0.05)
        assert normal[1] / np.linalg.norm(normal) > np.cos(np.deg2rad(8.0))
        assert np.median(off) < 0.2

    def test_the_far_wall_is_as_far_in_both(self, number: int) -> None:
        found = disparities(*self.pair(number), MATCHING)[100:230, 350:600]
        assert self.focal_px * self.baseline_m / np.nanmedian(found) == pytest.approx(8.4, abs=0.3)
