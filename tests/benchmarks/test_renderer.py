"""The simulated camera: projection, hiding, pin-hole against cylinder, and the errors of the sensor."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.renderer import (
    EYE_M,
    Atlas,
    Faces,
    Planes,
    Scene,
    Shake,
    focal_length,
    frame_rays,
    render_cylinder,
    render_frame,
)
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera
from topoloc.types import Image

CAMERA = Camera(40.0, 384, 288)
COLOURS = np.array([(200, 0, 0), (0, 200, 0), (0, 0, 200), (200, 200, 0), (0, 200, 200), (90, 90, 90)], dtype=np.uint8)
NO_EFFECTS = SensorEffects(0.0, 0.0, 0.0, 0.0, 0.0)


def atlas() -> Atlas:
    return Atlas.of([np.tile(colour, (4, 4, 1)) for colour in COLOURS])


def make_faces(*rows: tuple[float, ...]) -> Faces:
    """x0, y0, x1, y1, low, high, colour."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    count = len(table)
    one, none = np.ones(count), np.zeros(count)
    return Faces(table[:, :4], table[:, 4:6], table[:, 6].astype(np.int64), one, none, np.ones((count, 4)))


def make_planes(*rows: tuple[float, ...]) -> Planes:
    """x, y, half x, half y, yaw, height, colour."""
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    count = len(table)
    texture, one = table[:, 6].astype(np.int64), np.ones(count)
    return Planes(table[:, :2], table[:, 2:4], table[:, 4], table[:, 5], texture, one, one)


def make_scene(*faces: tuple[float, ...], planes: tuple[tuple[float, ...], ...] = ()) -> Scene:
    return Scene(atlas(), make_faces(*faces), make_planes(*planes))


def shows(image: Image, colour: int) -> np.ndarray:
    return np.asarray((image == COLOURS[colour]).all(axis=-1))


@pytest.mark.parametrize("distance", [1.5, 4.0, 9.0])
def test_edges_of_a_wall_appear_in_the_rows_and_columns_that_its_distance_gives(distance: float) -> None:
    low, high, left, right = 0.9, 1.3, 0.3, -0.2  # ahead along x; left is +y
    scene = make_scene((distance, left, distance, right, low, high, 0))
    seen = shows(render_frame(scene, np.zeros(3), CAMERA), 0)
    focal = focal_length(CAMERA)
    rows, columns = np.flatnonzero(seen.any(axis=1)), np.flatnonzero(seen.any(axis=0))
    assert rows[0] == pytest.approx(144.0 - focal * (high - EYE_M) / distance, abs=0.51)
    assert rows[-1] + 1 == pytest.approx(144.0 - focal * (low - EYE_M) / distance, abs=0.51)
    assert columns[0] == pytest.approx(192.0 - focal * left / distance, abs=0.51)
    assert columns[-1] + 1 == pytest.approx(192.0 - focal * right / distance, abs=0.51)


def test_a_face_is_seen_from_the_right_of_its_line_only() -> None:
    assert shows(render_frame(make_scene((2.0, 1.0, 2.0, -1.0, 0.0, 2.0, 0)), np.zeros(3), CAMERA), 0).any()
    assert not shows(render_frame(make_scene((2.0, -1.0, 2.0, 1.0, 0.0, 2.0, 0)), np.zeros(3), CAMERA), 0).any()


def test_a_texture_reads_from_left_to_right_and_from_top_to_bottom() -> None:
    picture = np.zeros((64, 64, 3), dtype=np.uint8)
    picture[:32, :32], picture[:32, 32:], picture[32:, :32], picture[32:, 32:] = COLOURS[:4]
    scene = Scene(Atlas.of([picture]), make_faces((2.0, 0.4, 2.0, -0.4, 0.7, 1.5, 0)), make_planes())
    image = render_frame(scene, np.zeros(3), CAMERA)
    for (row, column), colour in zip(((100, 140), (100, 240), (190, 140), (190, 240)), COLOURS[:4], strict=True):
        assert (image[row, column] == colour).all()


def test_the_nearer_surface_hides_and_a_low_one_leaves_free_what_is_above_it() -> None:
    desk = (2.0, 1.0, 2.0, -1.0, 0.0, 0.75, 1)
    wall = (5.0, 4.0, 5.0, -4.0, 0.0, 2.7, 0)
    monitor = (2.4, 0.2, 2.4, -0.2, 0.75, 1.2, 2)
    top = (2.5, 0.0, 0.5, 1.0, 0.0, 0.75, 3)
    image = render_frame(make_scene(wall, monitor, desk, planes=(top,)), np.zeros(3), CAMERA)
    focal = focal_length(CAMERA)
    column = image[:, 192]
    expected = np.zeros(288, dtype=int)
    expected[: round(144 - focal * 0.1 / 2.4)] = 0
    expected[round(144 - focal * 0.1 / 2.4) : round(144 + focal * 0.35 / 2.4)] = 2
    expected[round(144 + focal * 0.35 / 2.4) : round(144 + focal * 0.35 / 2.0)] = 3
    expected[round(144 + focal * 0.35 / 2.0) :] = 1
    assert (column == COLOURS[expected]).all(axis=1).mean() > 0.985
    beside = image[:, 120]  # no monitor: the table top ends where the wall behind it begins
    assert (beside[round(144 + focal * 0.35 / 3.0) + 1] == COLOURS[3]).all()
    assert (beside[round(144 + focal * 0.35 / 3.0) - 2] == COLOURS[0]).all()


def test_the_pattern_of_a_floor_lies_where_it_is_in_the_world() -> None:
    stripes = np.zeros((64, 64, 3), dtype=np.uint8)
    stripes[:, :32], stripes[:, 32:] = COLOURS[0], COLOURS[1]  # half a metre each, across x
    scene = Scene(Atlas.of([stripes]), make_faces(), make_planes((0.0, 0.0, 20.0, 20.0, 0.0, 0.0, 0)))
    image = render_frame(scene, np.array([0.2, 0.0, 0.0]), CAMERA)[:, 192]
    for x in (4.75, 5.25, 5.75, 6.25):  # the middles of stripes
        row = int(144.0 + focal_length(CAMERA) * EYE_M / (x - 0.2))
        assert (image[row] == COLOURS[0 if x % 1.0 < 0.5 else 1]).all()
    for x in (5.0, 5.5, 6.0):
        row = round(144.0 + focal_length(CAMERA) * EYE_M / (x - 0.2))
        assert (image[row - 3] != image[row + 2]).any()


def test_every_pixel_shows_what_a_ray_cast_one_by_one_meets_first() -> None:
    rng = np.random.default_rng(5)
    faces, tops = [(8.0, 9.0, 8.0, -9.0, -2.0, 6.0, 5.0)], [(4.0, 0.0, 9.0, 9.0, 0.0, 0.0, 4.0)]
    for number in range(14):
        x, y = 1.5 + number // 3 + rng.uniform(-0.1, 0.1), 0.9 * (number % 3 - 1) + rng.uniform(-0.04, 0.04)
        low = rng.choice([0.0, 0.6])  # the boxes stay apart: surfaces must not pierce each other
        half, high, colour = rng.uniform(0.1, 0.4, 2), low + rng.uniform(0.2, 0.9), float(number % 4)
        corners = np.array([(x - half[0], y - half[1]), (x + half[0], y - half[1])])
        corners = np.concatenate([corners, [(x + half[0], y + half[1]), (x - half[0], y + half[1])]])
        faces += [(*corners[k], *corners[(k + 1) % 4], low, high, colour) for k in range(4)]
        tops.append((x, y, half[0], half[1], 0.0, high, colour))
    scene = make_scene(*faces, planes=tuple(tops))
    pose = np.array([0.0, 0.1, 0.03])
    image = render_frame(scene, pose, CAMERA, shake=Shake(3.0, 2.0, 4.0))
    pixels = rng.integers((0, 0), (288, 384), (400, 2))
    rays = frame_rays(pose, CAMERA, shake=Shake(3.0, 2.0, 4.0))
    right = 0
    for row, column in pixels:
        slope = (rays.horizon[column] - row - 0.5) / rays.scale
        colour = first_met(scene, rays.eye, np.array([*rays.directions[column], slope]))
        right += bool((image[row, column] == COLOURS[colour]).all())
    assert right >= 394  # a pixel on an edge may go either way


def first_met(scene: Scene, eye: Floats, ray: Floats) -> int:
    """Colour of what a ray meets first: the plain formula, one surface after the other."""
    best, colour = np.inf, -1
    for ends, (low, high), texture in zip(scene.faces.ends, scene.faces.heights, scene.faces.texture, strict=True):
        along = ends[2:] - ends[:2]
        system = np.column_stack([ray[:2], -along])
        if abs(np.linalg.det(system)) < 1e-12:
            continue
        distance, share = np.linalg.solve(system, ends[:2] - eye[:2])
        if 0.0 < distance < best and 0.0 <= share < 1.0 and low <= eye[2] + distance * ray[2] < high:
            best, colour = distance, int(texture)
    for centre, half, height, texture in zip(
        scene.planes.centre, scene.planes.half, scene.planes.height, scene.planes.texture, strict=True
    ):
        distance = (height - eye[2]) / ray[2]
        inside = np.abs(eye[:2] + distance * ray[:2] - centre) <= half
        if 0.0 < distance < best and inside.all():
            best, colour = distance, int(texture)
    return colour


@pytest.mark.parametrize("bearing", np.deg2rad([0.0, 37.0, 151.0, -120.0]))
def test_pin_hole_and_cylinder_agree_on_where_a_landmark_is(bearing: float) -> None:
    heading, position = 1.0, np.array([0.3, -0.2])
    centre = position + 3.0 * np.array([np.cos(bearing), np.sin(bearing)])
    across = 0.03 * np.array([-np.sin(bearing), np.cos(bearing)])
    scene = make_scene((*(centre + across), *(centre - across), 0.8, 1.4, 0))
    cylinder = shows(render_cylinder(scene, position, heading, CAMERA), 0)
    columns = CAMERA.panorama_columns()
    assert cylinder.shape == (288, columns)
    found = np.flatnonzero(cylinder.any(axis=0)).mean() + 0.5
    assert found == pytest.approx(wrap(heading - bearing) % (2.0 * np.pi) / (2.0 * np.pi) * columns, abs=1.0)
    axis = bearing - np.deg2rad(8.0)  # the landmark is 8 degrees left of the optical axis
    frame = shows(render_frame(scene, np.array([*position, axis]), CAMERA), 0)
    expected = 192.0 - focal_length(CAMERA) * np.tan(np.deg2rad(8.0))
    assert np.flatnonzero(frame.any(axis=0)).mean() + 0.5 == pytest.approx(expected, abs=1.0)
    assert frame.any(axis=1).sum() == pytest.approx(cylinder.any(axis=1).sum(), rel=0.03)


def test_shake_moves_the_picture_by_its_pixels() -> None:
    scene = make_scene((3.0, 0.3, 3.0, -0.3, 0.9, 1.3, 0))
    still = shows(render_frame(scene, np.zeros(3), CAMERA), 0)
    moved = shows(render_frame(scene, np.zeros(3), CAMERA, shake=Shake(down=7.0, aside=4.0)), 0)
    assert (np.roll(still, (7, 4), axis=(0, 1)) == moved).all()
    rolled = shows(render_frame(scene, np.zeros(3), CAMERA, shake=Shake(roll=20.0)), 0)
    tops = rolled.argmax(axis=0)[np.flatnonzero(rolled.any(axis=0))]
    assert tops[-1] - tops[0] == pytest.approx(20.0 * len(tops) / 384, abs=1.5)


def test_a_fine_pattern_far_away_turns_grey_instead_of_flickering() -> None:
    checks = np.indices((128, 128)).sum(axis=0) % 2 * np.uint8(200)
    pattern = np.repeat(checks[:, :, None], 3, axis=2).astype(np.uint8)
    scene = Scene(Atlas.of([pattern]), make_faces((40.0, 1.0, 40.0, -1.0, 0.2, 2.2, 0)), make_planes())
    image = render_frame(scene, np.zeros(3), CAMERA).astype(float)[..., 0]
    inside = image[135:155, 185:200]
    assert inside.mean() == pytest.approx(100.0, abs=2.0)
    assert inside.std() < 10.0


def test_faces_that_are_added_are_seen_and_the_scene_stays_as_it_was() -> None:
    scene = make_scene((5.0, 4.0, 5.0, -4.0, 0.0, 2.7, 0))
    before = render_frame(scene, np.zeros(3), CAMERA)
    more = scene.with_faces(make_faces((2.0, 0.2, 2.0, -0.2, 0.0, 1.7, 1)))
    assert shows(render_frame(more, np.zeros(3), CAMERA), 1).any()
    assert (render_frame(scene, np.zeros(3), CAMERA) == before).all()


def test_noise_and_exposure_have_the_size_that_their_settings_say() -> None:
    grey = np.full((288, 384, 3), 120, dtype=np.uint8)
    rng = np.random.default_rng(0)
    assert (sense(grey, NO_EFFECTS, rng) == grey).all()
    noisy = sense(grey, SensorEffects(0.0, 5.0, 0.0, 0.0, 0.0), rng).astype(float)
    assert noisy.std() == pytest.approx(5.0, rel=0.05)
    means = [sense(grey, SensorEffects(0.1, 0.0, 0.0, 0.0, 0.0), rng).mean() / 120.0 for _ in range(200)]
    assert np.std(np.log(means)) == pytest.approx(0.1, rel=0.2)
    dark = sense(grey, SensorEffects(0.0, 0.0, 0.0, 0.3, 0.0), rng)
    assert dark[0, 0, 0] == pytest.approx(0.7 * 120.0, abs=1.5)
    assert dark[144, 192, 0] == pytest.approx(120.0, abs=1.5)
