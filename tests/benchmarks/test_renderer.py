"""The simulated camera: projection, hiding, depth, pin-hole against cylinder, and walls that save work."""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np
import pytest

from benchmarks.worlds import casting
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
    render_cylinder_depth,
    render_depth,
    render_frame,
    right_of,
)
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera
from topoloc.types import Image

CAMERA = Camera(40.0, 384, 288)
COLOURS = np.array([(200, 0, 0), (0, 200, 0), (0, 0, 200), (200, 200, 0), (0, 200, 200), (90, 90, 90)], dtype=np.uint8)


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


def cluttered(rng: np.random.Generator) -> Scene:
    """Boxes on a floor before a wall; they stay apart."""
    faces: list[tuple[float, ...]] = [(8.0, 9.0, 8.0, -9.0, -2.0, 6.0, 5.0)]
    tops = [(4.0, 0.0, 9.0, 9.0, 0.0, 0.0, 4.0)]
    for number in range(14):
        x, y = 1.5 + number // 3 + rng.uniform(-0.1, 0.1), 0.9 * (number % 3 - 1) + rng.uniform(-0.04, 0.04)
        low = rng.choice([0.0, 0.6])
        half, high, colour = rng.uniform(0.1, 0.4, 2), low + rng.uniform(0.2, 0.9), float(number % 4)
        faces += box(x, y, half[0], half[1], low, high, colour)
        tops.append((x, y, half[0], half[1], 0.0, high, colour))
    return make_scene(*faces, planes=tuple(tops))


def box(
    x: float, y: float, half_x: float, half_y: float, low: float, high: float, colour: float
) -> list[tuple[float, ...]]:
    """The four sides of a box, as rows for ``make_faces``."""
    corners = [(x - half_x, y - half_y), (x + half_x, y - half_y), (x + half_x, y + half_y), (x - half_x, y + half_y)]
    return [(*corners[k], *corners[(k + 1) % 4], low, high, colour) for k in range(4)]


def test_every_pixel_shows_what_a_ray_cast_one_by_one_meets_first_and_how_far_it_is() -> None:
    rng = np.random.default_rng(5)
    scene, pose, shake = cluttered(rng), np.array([0.0, 0.1, 0.03]), Shake(3.0, 2.0, 4.0)
    image, depth = render_frame(scene, pose, CAMERA, shake=shake), render_depth(scene, pose, CAMERA, shake=shake)
    assert depth.shape == (288, 384)
    assert depth.dtype == np.float32
    rays = frame_rays(pose, CAMERA, shake=shake)
    right = 0
    for row, column in rng.integers((0, 0), (288, 384), (400, 2)):
        slope = (rays.horizon[column] - row - 0.5) / rays.scale
        colour, distance = first_met(scene, rays.eye, np.array([*rays.directions[column], slope]))
        near = depth[row, column] == pytest.approx(distance, rel=1e-4)
        right += bool((image[row, column] == COLOURS[colour]).all() and near)
    assert right >= 394  # a pixel on an edge may go either way


def first_met(scene: Scene, eye: Floats, ray: Floats) -> tuple[int, float]:
    """Colour and distance of what a ray meets first: the plain formula, one surface after the other."""
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
    return colour, best


def test_surfaces_that_pierce_each_other_are_cut_where_they_meet() -> None:
    wall, shelf = (3.0, 1.0, 3.0, -1.0, 0.0, 2.0, 0), (3.0, 0.0, 1.0, 1.0, 0.0, 0.5, 1)
    scene = make_scene(wall, planes=(shelf,))
    column = render_frame(scene, np.zeros(3), CAMERA)[:, 192]
    row = 144.0 + focal_length(CAMERA) * 0.6 / 3.0
    assert (column[round(row) - 1] == COLOURS[0]).all()
    assert (column[round(row) + 1] == COLOURS[1]).all()


def test_where_nothing_is_hit_the_depth_is_infinite() -> None:
    scene = make_scene((3.0, 0.3, 3.0, -0.3, 0.9, 1.3, 0))
    depth, shown = render_depth(scene, np.zeros(3), CAMERA), shows(render_frame(scene, np.zeros(3), CAMERA), 0)
    assert (np.isfinite(depth) == shown).all()
    assert depth[shown] == pytest.approx(3.0)  # along the axis: the same over the whole wall
    assert np.isinf(render_depth(make_scene(), np.zeros(3), CAMERA)).all()


def test_the_depth_of_a_cylinder_is_the_horizontal_distance() -> None:
    room = [(5.0, -3.0, -5.0, -3.0), (-5.0, -3.0, -5.0, 3.0), (-5.0, 3.0, 5.0, 3.0), (5.0, 3.0, 5.0, -3.0)]
    scene = make_scene(*[(*ends, 0.0, 2.7, 0) for ends in room])
    depth, columns = render_cylinder_depth(scene, np.zeros(2), 0.0, CAMERA), CAMERA.panorama_columns()
    assert depth.shape == (288, columns)
    angles = -(np.arange(columns) + 0.5) * 2.0 * np.pi / columns
    expected = np.minimum(5.0 / np.abs(np.cos(angles)), 3.0 / np.abs(np.sin(angles)))
    assert depth[144] == pytest.approx(expected, rel=1e-5)


def test_a_stereo_pair_shows_the_same_point_apart_by_its_disparity() -> None:
    scene, pose, baseline = cluttered(np.random.default_rng(6)), np.array([0.2, -0.1, 0.05]), 0.12
    other = right_of(pose, baseline)
    left, right = (render_frame(scene, at, CAMERA) for at in (pose, other))
    depth, depth_right = (render_depth(scene, at, CAMERA) for at in (pose, other))
    row, column = np.nonzero(np.isfinite(depth))
    shifted = column + 0.5 - focal_length(CAMERA) * baseline / depth[row, column]
    inside = shifted >= 0.0
    row, column, there = row[inside], column[inside], shifted[inside].astype(int)
    visible = depth_right[row, there] > 0.97 * depth[row, column]  # else something nearer hides it from the right
    same = (left[row, column] == right[row, there]).all(axis=1)
    assert visible.mean() > 0.8
    assert same[visible].mean() > 0.985  # pixels on edges may differ
    assert not same[~visible].all()


def rooms(rng: np.random.Generator) -> Scene:
    """Four by four rooms of their own heights with doorways, boxes and shelves, and tall things far outside."""
    faces, planes = [], [(0.0, 0.0, 30.0, 30.0, 0.0, 0.0, 4.0)]
    for number in range(16):
        x, y, ceiling = 4.0 * (number % 4) - 6.0, 4.0 * (number // 4) - 6.0, rng.uniform(2.3, 3.4)
        corners = np.array([(x - 1.9, y - 1.9), (x - 1.9, y + 1.9), (x + 1.9, y + 1.9), (x + 1.9, y - 1.9)])
        planes.append((x, y, 1.9, 1.9, 0.0, ceiling, 5.0))
        for k in range(4):
            one, other, colour = corners[k], corners[(k + 1) % 4], float(rng.integers(5))
            begin, end = one + (other - one) * 0.4, one + (other - one) * rng.uniform(0.5, 0.7)
            for start, stop, low in ((one, begin, 0.0), (begin, end, rng.uniform(0.4, 2.2)), (end, other, 0.0)):
                faces.append((*start, *stop, low, ceiling, colour))
                faces.append((*stop, *start, low, ceiling + 0.1, colour))
        for _ in range(6):
            at, half = np.array([x, y]) + rng.uniform(-1.5, 1.5, 2), rng.uniform(0.1, 0.4, 2)
            low, high, colour = rng.choice([0.0, 0.9]), rng.uniform(1.0, 3.0), float(rng.integers(5))
            faces += box(at[0], at[1], half[0], half[1], low, high, colour)
            planes.append((at[0], at[1], half[0], half[1], 0.0, high, colour))
    faces += [(*side[:4], -9.0, 20.0, 3.0) for side in box(0.0, 0.0, -25.0, 25.0, 0.0, 0.0, 0.0)]
    return make_scene(*faces, planes=tuple(planes))


@pytest.mark.parametrize("seed", range(4))
def test_what_walls_hide_is_left_out_without_a_trace(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng([9, seed])
    scene = rooms(rng)
    poses = np.column_stack([rng.uniform(-9.0, 9.0, (12, 2)), rng.uniform(-np.pi, np.pi, 12)])
    shakes = [Shake(*rng.normal(0.0, (20.0, 4.0, 15.0))) for _ in poses]
    small, wide = Camera(40.0, 96, 72), Camera(120.0, 128, 72)

    def views() -> list[Image]:
        frames = [render_frame(scene, *seen) for seen in zip(poses, [CAMERA, small, wide] * 4, strict=True)]
        shaken = [render_frame(scene, pose, small, 1.1, shake) for pose, shake in zip(poses, shakes, strict=True)]
        return [*frames, *shaken, *(render_cylinder(scene, pose[:2], pose[2], small) for pose in poses)]

    def surfaces() -> int:
        rays = [frame_rays(pose, CAMERA) for pose in poses]
        return sum(len(casting.cast(scene.faces, scene.planes, view).hits.column) for view in rays)

    with_walls, few = views(), surfaces()
    monkeypatch.setattr(casting, "WALL_M", np.inf)  # no face is recognised as a wall
    assert all((one == other).all() for one, other in zip(with_walls, views(), strict=True))
    assert few < 0.7 * surfaces()


def test_with_walls_every_pixel_still_shows_what_a_ray_meets_first() -> None:
    rng = np.random.default_rng(12)
    scene, right = rooms(rng), 0
    for pose in np.column_stack([rng.uniform(-8.0, 8.0, (4, 2)), rng.uniform(-np.pi, np.pi, 4)]):
        image, rays = render_frame(scene, pose, CAMERA), frame_rays(pose, CAMERA)
        for row, column in rng.integers((0, 0), (288, 384), (25, 2)):
            slope = (rays.horizon[column] - row - 0.5) / rays.scale
            colour, _ = first_met_from_its_front(scene, rays.eye, np.array([*rays.directions[column], slope]))
            right += bool((image[row, column] == (COLOURS[colour] if colour >= 0 else 0)).all())
    assert right >= 97


def first_met_from_its_front(scene: Scene, eye: Floats, ray: Floats) -> tuple[int, float]:
    """``first_met``, with the faces that show their backs to the eye left out."""
    faces = scene.faces
    start, along = faces.ends[:, :2] - eye[:2], faces.ends[:, 2:] - faces.ends[:, :2]
    front = start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0] < 0.0
    kept = {field.name: getattr(faces, field.name)[front] for field in fields(Faces)}
    return first_met(replace(scene, faces=Faces(**kept)), eye, ray)


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
