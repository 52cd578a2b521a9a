"""The Fourier signature (third seed, section 2): its law, its formulas transcribed, headings on the simulated grid."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.worlds.image_grid import ImageGridSettings, ImageGridWorld
from benchmarks.worlds.world import Simulation
from sensors.fourier import FourierSignature, FourierSignatureConfig, Moduli, averaged, columns_turned, signature
from sensors.homomorphic import HomomorphicConfig, homomorphic
from topoloc.errors import UserError
from topoloc.geometry import Floats, compose, wrap
from topoloc.testing import check_headings, check_sensor
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

COLUMNS = 64
COLUMN = 2.0 * np.pi / COLUMNS
CAMERA = Camera(45.0, COLUMNS // 8, 16)
SMALL = FourierSignatureConfig(columns=COLUMNS, rows=8, components=12)


def picture(seed: int, rows: int = 16, columns: int = COLUMNS) -> Image:
    """Smooth noise on a circle."""
    spectrum = np.fft.rfft2(np.random.default_rng(seed).normal(size=(rows, columns)))
    spectrum[4:-3], spectrum[:, 9:] = 0.0, 0.0
    smooth = np.fft.irfft2(spectrum, s=(rows, columns))
    return np.asarray(np.clip(128.0 + 50.0 * smooth / smooth.std(), 0, 255), dtype=np.uint8)


def small_map(nodes: int = 8) -> TopoMap:
    made = tuple(Node(f"n{k}", f"n{k}", float(k % 4), float(k // 4), 0.1 * k, picture(k)) for k in range(nodes))
    return TopoMap("circles", CAMERA, made)


def fitted(config: FourierSignatureConfig = SMALL, topo_map: TopoMap | None = None) -> FourierSignature:
    sensor = FourierSignature(config)
    sensor.fit(topo_map or small_map())
    return sensor


def frame_of(image: Image, camera: Floats | None = None) -> Frame:
    return Frame(0.0, None, np.zeros(3) if camera is None else camera, {"omni": image})


@lru_cache(maxsize=1)
def grid_run() -> Simulation:
    return ImageGridWorld(ImageGridSettings(grid="6x8", updates=25)).simulate(1000)


@given(st.integers(0, 30), st.integers(0, COLUMNS - 1))
def test_a_rotation_leaves_the_moduli_and_turns_the_phases(seed: int, shift: int) -> None:
    """The shift theorem: right by q columns multiplies A_k by exp(-2 pi i k q / N)."""
    plain = picture(seed).astype(np.float32)
    one, turned = signature(plain, 12), signature(np.roll(plain, shift, axis=1), 12)
    np.testing.assert_allclose(np.abs(turned), np.abs(one), rtol=1e-4, atol=1e-2)
    phases = np.exp(-2j * np.pi * np.arange(12) * shift / COLUMNS)
    np.testing.assert_allclose(turned, one * phases, atol=1e-3 * np.abs(one).max())
    assert columns_turned(one[None], turned, COLUMNS)[0] == pytest.approx(shift, abs=0.02)


@given(st.integers(0, 30), st.floats(0.0, COLUMNS - 1.0))
def test_a_part_of_a_column_is_found(seed: int, shift: float) -> None:
    one = signature(picture(seed).astype(np.float32), 12)
    turned = np.asarray(one * np.exp(-2j * np.pi * np.arange(12) * shift / COLUMNS), dtype=np.complex64)
    assert columns_turned(one[None], turned, COLUMNS)[0] == pytest.approx(shift, abs=0.05)


def test_the_signature_is_the_formula() -> None:
    rows, columns, components = 3, 16, 5
    plain = picture(1, 8, columns)[:rows].astype(np.float32)
    found = signature(plain, components)
    assert found.shape == (rows, components)
    for row in range(rows):
        for k in range(components):
            terms = (float(plain[row, n]) * cmath.exp(-2j * math.pi * k * n / columns) for n in range(columns))
            assert complex(found[row, k]) == pytest.approx(sum(terms), rel=1e-5, abs=1e-2)


def test_the_distance_is_euclid_over_rows_and_components_of_the_moduli() -> None:
    signatures = np.stack([signature(picture(k).astype(np.float32), 7) for k in range(5)])
    found = Moduli(signatures).distances(signatures)
    for i in range(5):
        for j in range(5):
            total = 0.0
            for a, b in zip(signatures[i].ravel().tolist(), signatures[j].ravel().tolist(), strict=True):
                total += (abs(a) - abs(b)) ** 2
            assert found[i, j] == pytest.approx(math.sqrt(total), rel=1e-3, abs=1e-3 * found.max())


def test_the_filter_is_the_formula() -> None:
    """Against transforms by their own sums, of the picture and its mirror image below it."""
    rows, columns, config = 4, 6, HomomorphicConfig(cutoff=1.5, low_gain=0.3, high_gain=1.4)
    plain = np.random.default_rng(3).integers(0, 256, (rows, columns)).astype(np.uint8)
    logs = np.log(np.concatenate([plain, plain[::-1]]) + 1.0)
    down, around = (np.exp(-2j * np.pi * np.outer(range(n), range(n)) / n) for n in (2 * rows, columns))
    spectrum = down @ logs @ around
    for u in range(2 * rows):
        for v in range(columns):
            cycles_down = min(u, 2 * rows - u) * columns / (2 * rows)  # a circle's worth of rows
            squared = cycles_down**2 + min(v, columns - v) ** 2
            low_pass = math.exp(-squared / (2.0 * 1.5**2))
            spectrum[u, v] *= (1.4 - 0.3) * (1.0 - low_pass) + 0.3
    filtered = (down.conj() @ spectrum @ around.conj()).real / (2 * rows * columns)
    np.testing.assert_allclose(homomorphic(plain, config), (np.exp(filtered) - 1.0)[:rows], rtol=1e-3, atol=1e-3)


def test_the_filter_has_no_seam_and_no_fold_between_bottom_and_top() -> None:
    plain, config = picture(4), HomomorphicConfig()
    turned = homomorphic(np.roll(plain, 20, axis=1), config)
    np.testing.assert_allclose(turned, np.roll(homomorphic(plain, config), 20, axis=1), rtol=1e-3, atol=1e-2)
    ramp = np.tile(np.linspace(20, 240, 16).astype(np.uint8)[:, None], (1, COLUMNS))
    other = ramp.copy()
    other[-2:] = 20  # were the rows a circle, the top would feel it most
    change = np.abs(np.log1p(homomorphic(other, config)) - np.log1p(homomorphic(ramp, config)))[:, 0]
    assert change[0] < 0.5 * change[-1]


def test_the_filter_takes_out_a_change_of_the_light() -> None:
    """One side of the room darker: with the filter, a place is nearer to itself than to others all the same."""
    plain = [np.asarray(picture(k) // 2 + 100, dtype=np.uint8) for k in range(6)]
    light = 0.7 + 0.3 * np.cos(np.arange(COLUMNS) * COLUMN)
    darker = [np.asarray(image * light, dtype=np.uint8) for image in plain]
    ratio = []
    for on in (False, True):
        sensor = FourierSignature(replace(SMALL, homomorphic=HomomorphicConfig(on=on)))
        distance = sensor.distances_between([*plain, *darker])[:6, 6:]
        ratio.append(float(np.median(np.diag(distance)) / np.median(distance[~np.eye(6, dtype=bool)])))
    assert ratio[1] < 0.7 * ratio[0]


def test_rows_are_averaged_where_they_do_not_divide_too() -> None:
    plain = np.arange(10, dtype=np.float32)[:, None].repeat(2, axis=1)
    np.testing.assert_allclose(averaged(plain, 5)[:, 0], [0.5, 2.5, 4.5, 6.5, 8.5])
    np.testing.assert_allclose(averaged(plain, 4)[:, 0], [(0 + 1 + 0.5 * 2) / 2.5, 3.2, 5.8, (8 + 9 + 0.5 * 7) / 2.5])
    assert averaged(plain, 20) is plain


@pytest.mark.parametrize("shift", [0, 1, 17, 63])
def test_a_robot_that_turned_counter_clockwise_sees_the_circle_shifted_right(shift: int) -> None:
    the_map = small_map()
    for number, node in enumerate(the_map.nodes):
        assert node.panorama is not None
        evidence = fitted().observe(frame_of(np.roll(node.panorama, shift, axis=1)))
        best = int(evidence.match.argmax())
        assert evidence.nodes[best] == number
        assert evidence.match[best] == pytest.approx(1.0, abs=0.01)
        assert abs(wrap(evidence.poses[best, 2] - (node.heading + shift * COLUMN))) < 0.05 * COLUMN
        np.testing.assert_allclose(evidence.poses[best, :2], (node.x, node.y))


def test_headings_on_the_simulated_grid() -> None:
    run = grid_run()
    sensor = fitted(FourierSignatureConfig(neighbours=0), run.topo_map)
    nearest = run.topo_map.nearest_node(run.truth[:, :2])
    wrong = []
    for frame, pose, node in zip(run.frames, run.truth, nearest, strict=True):
        evidence = sensor.observe(frame)
        assert len(evidence.poses) == len(run.topo_map.nodes)
        of_nearest = int(np.flatnonzero(evidence.nodes == node)[0])
        wrong.append(abs(float(wrap(evidence.poses[of_nearest, 2] - pose[2]))))
    assert np.rad2deg(np.median(wrong)) < 2.0
    assert np.rad2deg(np.max(wrong)) < 15.0


def test_the_best_place_is_near_and_the_contract_holds() -> None:
    run = grid_run()
    sensor = fitted(FourierSignatureConfig(), run.topo_map)
    best = [sensor.observe(frame).poses[0] for frame in run.frames]
    apart = np.linalg.norm(np.array(best)[:, :2] - run.truth[:, :2], axis=1)
    assert np.mean(apart < 0.5) > 0.9  # the spacing of this grid
    check_sensor(FourierSignature(), run.topo_map, run.frames[:4])
    check_headings(FourierSignature(), run.topo_map, run.frames[:10], run.truth[:10])


def test_nearest_come_first_and_all_where_asked_for() -> None:
    frame = frame_of(picture(3))
    some, every = (fitted(replace(SMALL, neighbours=count)).observe(frame) for count in (3, 0))
    assert (len(some.poses), len(every.poses)) == (3, 8)
    assert (np.diff(every.distance) >= 0.0).all()
    np.testing.assert_array_equal(every.nodes[:3], some.nodes)


def test_the_axis_of_the_robot_stood_on_the_node_when_its_circle_was_taken() -> None:
    """The mirror ahead of the axis: a robot on the node that has not turned gets the node back."""
    mount = np.array([0.2, 0.05, 0.3])
    the_map = small_map()
    for number in (0, 5):
        node = the_map.nodes[number]
        assert node.panorama is not None
        still = fitted().observe(frame_of(node.panorama, mount)).of_robot(mount)
        np.testing.assert_allclose(still.poses[0, :2], (node.x, node.y), atol=1e-3)
        turned = fitted().observe(frame_of(np.roll(node.panorama, 16, axis=1), mount))
        robot = np.array([node.x, node.y, node.heading - mount[2]])
        np.testing.assert_allclose(turned.poses[0, :2], compose(robot, mount)[:2], atol=1e-9)


def test_grey_pictures_and_other_sizes_do_as_well() -> None:
    frame = np.repeat(np.repeat(picture(2), 2, axis=0), 2, axis=1)
    for image in (frame, frame[..., None].repeat(3, axis=2)):
        evidence = fitted().observe(frame_of(np.ascontiguousarray(image)))
        assert evidence.nodes[0] == 2
        assert evidence.match[0] > 0.9


def test_covered_and_flat_frames_are_blind() -> None:
    covered = np.clip(np.random.default_rng(0).normal(8, 2, (16, COLUMNS, 3)), 0, 255).astype(np.uint8)
    for image in (covered, np.full((16, COLUMNS), 90, np.uint8), np.full((16, COLUMNS, 3), (200, 60, 40), np.uint8)):
        assert fitted().observe(frame_of(image)).is_blind


def test_distances_between_pictures_need_no_map() -> None:
    images = [picture(0), np.roll(picture(0), 9, axis=1), picture(1)]
    distance = FourierSignature(SMALL).distances_between(images)
    assert distance.shape == (3, 3)
    np.testing.assert_allclose(distance, distance.T, rtol=1e-3, atol=1e-3 * distance.max())
    assert distance[0, 1] < 0.02 * distance[0, 2]


def test_maps_that_do_not_suit_are_refused() -> None:
    with pytest.raises(UserError, match=r"'bare'.*panoramas"):
        FourierSignature().fit(TopoMap("bare", CAMERA, (Node("a", "a", 0.0, 0.0),)))
    with pytest.raises(UserError, match="--no-clahe"):
        FourierSignature().fit(replace(small_map(), filtered=True))
    with pytest.raises(RuntimeError, match="fit"):
        FourierSignature().observe(frame_of(picture(0)))


@pytest.mark.parametrize(
    "changes", [{"components": 1}, {"components": 33}, {"rows": 0}, {"neighbours": -1}, {"sigma_m": 0.0}]
)
def test_settings_that_make_no_sense_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(changes))) as error:
        replace(SMALL, **changes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("changes", [{"cutoff": 0.0}, {"low_gain": 1.2}, {"low_gain": -0.1}, {"high_gain": 0.9}])
def test_filters_that_make_no_sense_are_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(changes))):
        HomomorphicConfig(**changes)
