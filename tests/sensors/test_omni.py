"""Unwrapped pictures against a ray tracer of their own, the laws both ways, and the mirror of appendix C."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.worlds.lab import LabWorld, lab_scene
from benchmarks.worlds.renderer import render_cylinder, render_frame
from sensors.ima import IMA
from sensors.omni import (
    Conical,
    Equirectangular,
    Hyperbolic,
    OmniModel,
    Polynomial,
    RadialLaw,
    RadialPicture,
    Spherical,
    Unwrapper,
    conical_mirror,
    from_table,
)
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 48, 36)
"""Its panoramas are 432 x 36, 15 degrees up and down."""
SIZE = 480
CENTER = (250.3, 236.8)
TOP_DEG = 25.0
FOCAL, RIM = 300.0, 220.0
MEAN_GREY_BOUND = 1.0
"""Of the mean difference to the panorama that is seen directly, in grey levels."""

Surface = Callable[[Floats], Floats]
Scene = Callable[[Floats], Floats]


def far_scene(direction: Floats) -> Floats:
    """Grey levels (...) of a sphere far away, by directions (..., 3); nothing about it is symmetric."""
    azimuth = np.arctan2(direction[..., 1], direction[..., 0])
    elevation = np.arctan2(direction[..., 2], np.hypot(direction[..., 0], direction[..., 1]))
    grey = 120.0 + 40.0 * np.sin(7.0 * azimuth + 5.0 * elevation) + 25.0 * np.sin(23.0 * azimuth - 9.0 * elevation)
    mark = np.exp(-(((azimuth - 0.7) / 0.08) ** 2) - ((elevation - 0.1) / 0.06) ** 2)
    return np.asarray(grey + 60.0 * mark)


def direct(scene: Scene, camera: Camera, heading: float) -> Floats:
    """The panorama itself: the colour of each pixel's direction, columns clockwise."""
    focal = camera.width / 2 / math.tan(math.radians(camera.hfov_deg) / 2)
    columns = camera.panorama_columns()
    azimuth = heading - 2 * math.pi * (np.arange(columns) + 0.5) / columns
    up = (camera.height / 2 - np.arange(camera.height) - 0.5)[:, None] / focal
    return scene(np.stack(np.broadcast_arrays(np.cos(azimuth), np.sin(azimuth), up), axis=-1))


def camera_axes(looks: str) -> np.ndarray:
    """Rows: right, up and ahead of a camera in the robot's frame; the picture's top is towards ``TOP_DEG``."""
    ahead = np.array([0.0, 0.0, 1.0 if looks == "up" else -1.0])
    up = np.array([math.cos(math.radians(TOP_DEG)), math.sin(math.radians(TOP_DEG)), 0.0])
    return np.stack([np.cross(ahead, up), up, ahead])


def pixel_rays(focal: float) -> Floats:
    """(SIZE, SIZE, 3) in the camera's own axes: right, up, ahead."""
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    return np.stack([(x - CENTER[0]) / focal, (CENTER[1] - y) / focal, np.ones_like(x)], axis=-1)


def cone(gamma_deg: float, tip_m: float) -> Surface:
    return lambda p: p[..., 2] - tip_m - np.hypot(p[..., 0], p[..., 1]) * math.tan(math.radians(gamma_deg))


def hyperboloid(a: float, b: float) -> Surface:
    middle = math.hypot(a, b)
    return lambda p: (p[..., 2] - middle) / a - np.sqrt(1 + (p[..., 0] ** 2 + p[..., 1] ** 2) / b**2)


def ball(radius: float, center: float) -> Surface:
    return lambda p: radius - np.sqrt(p[..., 0] ** 2 + p[..., 1] ** 2 + (p[..., 2] - center) ** 2)


def reflect(surface: Surface, rays: Floats, farthest: float) -> tuple[Floats, Floats]:
    """Where rays from the origin first pass a surface (negative before it), by bisection, and where they go on."""
    near, far = np.zeros(rays.shape[:-1]), np.full(rays.shape[:-1], farthest)
    hit = surface(rays * far[..., None]) > 0
    for _ in range(45):
        middle = (near + far) / 2
        behind = surface(rays * middle[..., None]) > 0
        near, far = np.where(behind, near, middle), np.where(behind, middle, far)
    point = rays * near[..., None]
    step = 1e-9 * np.eye(3)
    normal = np.stack([surface(point + d) - surface(point - d) for d in step], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    gone = rays - 2 * (rays * normal).sum(axis=-1, keepdims=True) * normal
    return np.where(hit[..., None], point, np.nan), np.where(hit[..., None], gone, np.nan)


def onto_wall(point: Floats, direction: Floats, radius: float) -> Floats:
    """Where rays meet a round wall about the axis."""
    a = (direction[..., :2] ** 2).sum(axis=-1)
    b = (point[..., :2] * direction[..., :2]).sum(axis=-1)
    c = (point[..., :2] ** 2).sum(axis=-1) - radius**2
    return np.asarray(point + ((-b + np.sqrt(b**2 - a * c)) / a)[..., None] * direction)


def mirror_directions(
    surface: Surface, farthest: float, looks: str = "up", wall: float | None = None, eye: float = 0.0
) -> Floats:
    """Direction (SIZE, SIZE, 3) in the robot's frame that each pixel sees, nan for none.

    With a round ``wall``, the direction of the point seen there, from the axis at ``eye`` in front of the camera.
    """
    point, gone = reflect(surface, pixel_rays(FOCAL), farthest)
    if wall is not None:
        gone = onto_wall(point, gone, wall) - np.array([0.0, 0.0, eye])
    return np.asarray(gone @ camera_axes(looks))


def shown(scene: Scene, directions: Floats) -> Image:
    picture = scene(directions)
    return np.asarray(np.where(np.isnan(picture), 0, np.round(picture)), dtype=np.uint8)


CONE = Conical(focal_px=FOCAL, rim_px=RIM, gamma_deg=36.0)
HYPERBOLA = Hyperbolic(focal_px=FOCAL, rim_px=RIM, a_m=0.03, b_m=0.04)
BALL = Spherical(focal_px=FOCAL * 1.0, rim_px=100.0, ball_m=0.1, center_m=0.3)
LENS = Polynomial(coefficients=(140.0, 0.0, -0.0046), rim_px=RIM)


def lens_directions() -> Floats:
    right, up, _ = np.moveaxis(pixel_rays(1.0), -1, 0)
    radius = np.hypot(right, up)
    return np.asarray(np.stack([right, up, 140.0 - 0.0046 * radius**2], axis=-1) @ camera_axes("up"))


def equirectangular_directions() -> Floats:
    """A 360-degree camera's picture whose left edge looks 170 degrees to the left, from -50 to 70 degrees high."""
    azimuth = math.radians(170.0) - 2 * math.pi * (np.arange(SIZE) + 0.5) / SIZE
    elevation = np.radians(70.0 - 120.0 * (np.arange(SIZE) + 0.5) / SIZE)[:, None]
    parts = np.cos(azimuth) * np.cos(elevation), np.sin(azimuth) * np.cos(elevation), np.sin(elevation)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def radial(law: RadialLaw, looks: Any = "up") -> RadialPicture:
    return RadialPicture(law=law, center_x=CENTER[0], center_y=CENTER[1], top_deg=TOP_DEG, looks=looks)


CASES: dict[str, tuple[OmniModel, Callable[[], Floats]]] = {
    "conical": (radial(CONE), lambda: mirror_directions(cone(36.0, 0.2), 2.0)),
    "conical, looking down": (radial(CONE, "down"), lambda: mirror_directions(cone(36.0, 0.2), 2.0, "down")),
    "conical, near scene": (
        radial(replace(CONE, tip_m=0.2, scene_m=1.0)),
        lambda: mirror_directions(cone(36.0, 0.2), 2.0, wall=1.0, eye=0.2),
    ),
    "hyperbolic": (radial(HYPERBOLA), lambda: mirror_directions(hyperboloid(0.03, 0.04), 2.0)),
    "spherical": (radial(BALL), lambda: mirror_directions(ball(0.1, 0.3), 0.3)),
    "spherical, looking down": (radial(BALL, "down"), lambda: mirror_directions(ball(0.1, 0.3), 0.3, "down")),
    "spherical, near scene": (
        radial(replace(BALL, scene_m=1.0)),
        lambda: mirror_directions(ball(0.1, 0.3), 0.3, wall=1.0, eye=0.2),
    ),
    "polynomial": (radial(LENS), lens_directions),
    "equirectangular": (
        Equirectangular(left_deg=170.0, upper_deg=70.0, lower_deg=-50.0),
        equirectangular_directions,
    ),
}


def mean_difference(one: Image, other: Floats, where: np.ndarray) -> float:
    return float(np.abs(one.astype(float) - other)[where].mean())


class TestUnwrapper:
    @pytest.mark.parametrize("case", CASES)
    def test_is_the_panorama_that_is_seen_directly(self, case: str) -> None:
        model, directions = CASES[case]
        picture = shown(far_scene, directions())
        unwrapper = Unwrapper(model, CAMERA, SIZE, SIZE, heading=0.4)
        circle, expected = unwrapper.unwrap(picture), direct(far_scene, CAMERA, 0.4)
        assert circle.shape == (36, 432) and circle.dtype == np.uint8
        assert unwrapper.seen_share > 0.95 and not circle[~unwrapper.seen].any()
        assert mean_difference(circle, expected, unwrapper.seen) < MEAN_GREY_BOUND
        by_shift = {s: mean_difference(circle, np.roll(expected, s, axis=1), unwrapper.seen) for s in range(-6, 7)}
        assert min(by_shift, key=lambda shift: by_shift[shift]) == 0
        for wrong in (expected[:, ::-1], expected[::-1], np.roll(expected, 6, axis=1), np.roll(expected, 2, axis=0)):
            assert mean_difference(circle, wrong, unwrapper.seen) > 4 * MEAN_GREY_BOUND, "the scene tells them apart"

    @pytest.mark.parametrize("case", ["conical", "spherical"])
    def test_a_near_scene_taken_for_a_far_one_is_off(self, case: str) -> None:
        """What ``scene_m`` is for: without it the same picture unwraps elsewhere."""
        picture = shown(far_scene, CASES[f"{case}, near scene"][1]())
        unwrapper = Unwrapper(CASES[case][0], CAMERA, SIZE, SIZE)
        assert mean_difference(unwrapper.unwrap(picture), direct(far_scene, CAMERA, 0.0), unwrapper.seen) > 2.0

    def test_a_mark_to_the_left_is_left(self) -> None:
        """A camera in a hall sees a lamp 40 degrees to the left (counter-clockwise) and none elsewhere."""

        def lamp(direction: Floats) -> Floats:
            azimuth = np.arctan2(direction[..., 1], direction[..., 0])
            return np.where(np.abs(azimuth - math.radians(40.0)) < 0.05, 250.0, 20.0)

        for model, directions in CASES.values():
            circle = Unwrapper(model, CAMERA, SIZE, SIZE, math.pi).unwrap(shown(lamp, directions()))
            bright = np.flatnonzero(circle[18] > 130)
            assert bright.mean() + 0.5 == pytest.approx(432 * (180 - 40) / 360, abs=1.0)

    def test_a_frame_fits_in_its_middle_column(self) -> None:
        """Rows of the cylinder are those of a pin-hole frame, as the renderer's cylinder has them (simulated room)."""
        wide = Camera(40.0, 96, 200)
        camera, scene = Camera(40.0, 96, 72), lab_scene(0)
        picture = equirectangular_of(render_cylinder(scene, np.zeros(2), 0.0, wide), wide, 35.0)
        model = Equirectangular(left_deg=0.0, upper_deg=35.0, lower_deg=-35.0)
        circle = Unwrapper(model, camera, *picture.shape[1::-1]).unwrap(picture)
        for column in (48, 300, 700):
            pose = np.array([0.0, 0.0, -2 * math.pi * column / 864])
            frame = render_frame(scene, pose, camera)[:, 46:50].mean(axis=(1, 2))
            there = circle[:, column - 2 : column + 2].mean(axis=(1, 2))
            assert np.abs(frame - there).mean() < 8.0 and np.corrcoef(frame, there)[0, 1] > 0.95

    def test_colour_comes_through(self) -> None:
        picture = np.tile(np.array([10, 20, 30], dtype=np.uint8), (90, 180, 1))
        circle = Unwrapper(Equirectangular(), CAMERA, 180, 90).unwrap(picture)
        assert circle.shape == (36, 432, 3) and (circle == (10, 20, 30)).all()

    def test_what_lies_beyond_the_rim_or_the_picture_is_black(self) -> None:
        rim = float(CONE.radius(np.array(0.0)))  # the horizon
        white = np.full((SIZE, SIZE), 255, dtype=np.uint8)
        unwrapper = Unwrapper(radial(replace(CONE, rim_px=rim)), CAMERA, SIZE, SIZE)
        assert (unwrapper.seen == (np.arange(36) >= 18)[:, None]).all()
        assert (unwrapper.unwrap(white) == np.where(unwrapper.seen, 255, 0)).all()
        assert unwrapper.seen_share == 0.5
        cut = Unwrapper(RadialPicture(law=CONE, center_x=0.0, center_y=SIZE / 2), CAMERA, SIZE, SIZE)
        assert cut.seen[:, 219:429].all() and not cut.seen[:, 3:213].any(), "the picture's left half is missing"

    def test_a_fine_picture_is_averaged_not_picked_from(self) -> None:
        """Columns black and white in turn, three to a column of the panorama: all grey."""
        picture = np.tile(np.array([0, 255], dtype=np.uint8), (180, 3 * 432 // 2))
        circle = Unwrapper(Equirectangular(upper_deg=30.0, lower_deg=-30.0), CAMERA, 3 * 432, 180).unwrap(picture)
        assert np.abs(circle.astype(int) - 127).max() < 60

    def test_another_size_is_refused(self) -> None:
        unwrapper = Unwrapper(Equirectangular(), CAMERA, 180, 90)
        with pytest.raises(ValueError, match="the picture is 90x45, not 180x90"):
            unwrapper.unwrap(np.zeros((45, 90), dtype=np.uint8))

    def test_nothing_seen_or_too_large_is_refused(self) -> None:
        with pytest.raises(ValueError, match="shows no part of the panorama"):
            Unwrapper(Equirectangular(upper_deg=90.0, lower_deg=60.0), CAMERA, 180, 90)
        with pytest.raises(ValueError, match="32766 pixels a side"):
            Unwrapper(Equirectangular(), Camera(40.0, 4000, 3000), 180, 90)


LAWS = {
    "conical": st.builds(
        Conical,
        focal_px=st.floats(50, 2000),
        rim_px=st.floats(20, 1000),
        gamma_deg=st.floats(1, 44),
        tip_m=st.floats(0.02, 0.5),
        scene_m=st.one_of(st.just(math.inf), st.floats(0.3, 20)),
    ),
    "hyperbolic": st.builds(
        lambda focal, a, b, share: Hyperbolic(focal_px=focal, rim_px=0.98 * share * focal * b / a, a_m=a, b_m=b),
        st.floats(50, 2000),
        st.floats(0.005, 0.1),
        st.floats(0.005, 0.1),
        st.floats(0.1, 1.0),
    ),
    "spherical": st.builds(
        lambda focal, radius, away, share, scene: Spherical(
            focal_px=focal,
            rim_px=share * focal / math.sqrt(away**2 - 1),  # the ball's outline
            ball_m=radius,
            center_m=away * radius,
            scene_m=scene,
        ),
        st.floats(50, 2000),
        st.floats(0.01, 0.2),
        st.floats(1.1, 20),
        st.floats(0.1, 0.99),
        st.one_of(st.just(math.inf), st.floats(1.0, 20)),
    ),
    "polynomial": st.builds(
        lambda middle, bend, rim, sign: Polynomial(coefficients=(sign * middle, 0.0, -sign * bend), rim_px=rim),
        st.floats(50, 500),
        st.floats(0.0, 0.01),
        st.floats(50, 1000),
        st.sampled_from([1.0, -1.0]),
    ),
}


class TestLaws:
    @pytest.mark.parametrize("name", LAWS)
    def test_there_and_back(self, name: str) -> None:
        @given(law=LAWS[name], share=st.floats(0.01, 0.999))
        def holds(law: Any, share: float) -> None:
            radii = np.array([share, 0.5 * share, 0.999]) * law.rim_px
            elevations = law.elevation(radii)
            assert np.isfinite(elevations).all() and (np.abs(elevations) < math.pi / 2).all()
            assert law.radius(elevations) == pytest.approx(radii, rel=1e-6, abs=1e-3)
            assert np.isnan(law.elevation(np.array(1.01 * law.rim_px)))

        holds()

    @pytest.mark.parametrize("law", [CONE, HYPERBOLA, BALL, LENS], ids=lambda law: type(law).__name__)
    def test_what_is_not_seen_has_no_radius(self, law: Any) -> None:
        """Elevations in 1 degree steps: seen exactly from that of the middle to that of the rim."""
        low, high = sorted(np.rad2deg(law.elevation(np.array([0.0, law.rim_px]))))
        elevations = np.arange(-89.5, 90.0)
        radii = law.radius(np.radians(elevations))
        assert (np.isfinite(radii) == ((elevations > low) & (elevations < high))).all()
        assert np.isfinite(radii).sum() > 30 and np.nanmax(radii) <= law.rim_px

    def test_a_cone_by_hand(self) -> None:
        """2 gamma + alpha - 90: the tip shows -18 degrees, and the horizon lies at tan(18) of the focal length."""
        assert np.rad2deg(CONE.elevation(np.array(0.0))) == pytest.approx(-18.0)
        assert float(CONE.radius(np.array(0.0))) == pytest.approx(FOCAL * math.tan(math.radians(18.0)))

    def test_a_hyperbola_by_hand(self) -> None:
        """a, b, e = 3, 4, 5: at the height of its focus the mirror is b^2 / a = 16 / 3 wide, 10 above the camera."""
        assert float(HYPERBOLA.radius(np.array(0.0))) == pytest.approx(FOCAL * 16 / 30)

    def test_a_ball_far_away_by_hand(self) -> None:
        """Parallel rays: the horizon is where the surface stands at 45 degrees, sin(45) of the outline."""
        law = Spherical(focal_px=1e6, rim_px=1.0, ball_m=0.1, center_m=1e5)
        outline = 1e6 * 0.1 / 1e5
        assert float(law.radius(np.array(0.0))) == pytest.approx(outline * math.sin(math.pi / 4), rel=1e-4)

    @pytest.mark.parametrize(
        ("make", "says"),
        [
            (lambda: replace(CONE, focal_px=0.0), "focal_px is 0.0; it must be above 0"),
            (lambda: replace(CONE, rim_px=math.nan), "rim_px is nan; it must be above 0"),
            (lambda: replace(CONE, gamma_deg=50.0), "gamma_deg is 50.0; it must lie between 0 and 45"),
            (lambda: replace(CONE, scene_m=2.0), r"tip_m is 0.0; with scene_m it must be above 0"),
            (lambda: replace(CONE, scene_m=-2.0), r"scene_m is -2.0; it must be above 0"),
            (lambda: replace(HYPERBOLA, a_m=0.0), "a_m is 0.0; it must be above 0"),
            (lambda: replace(HYPERBOLA, rim_px=500.0), "rim_px is 500, but .* ends at 400.0 pixels"),
            (lambda: replace(BALL, center_m=0.1), "center_m is 0.1; it must be above 0.1"),
            (lambda: replace(BALL, scene_m=0.05), "scene_m is 0.05; it must be above 0.1"),
            (lambda: replace(BALL, rim_px=120.0), "rim_px is 120, but .* ends at 106.1 pixels"),
            (lambda: replace(LENS, rim_px=0.0), "rim_px is 0.0"),
            (lambda: replace(LENS, coefficients=()), "coefficients must make the elevation grow"),
            (lambda: replace(LENS, coefficients=(-100.0, 0.0, 0.01, -1e-4)), "coefficients must make"),
            (lambda: Equirectangular(upper_deg=-10.0, lower_deg=10.0), "lower_deg is 10.0 and upper_deg -10.0"),
            (lambda: Equirectangular(upper_deg=100.0), "upper_deg 100.0"),
        ],
    )
    def test_a_setting_that_cannot_be(self, make: Callable[[], object], says: str) -> None:
        with pytest.raises(ValueError, match=says) as caught:
            make()
        assert "\n" not in str(caught.value)


def test_a_law_of_ones_own() -> None:
    """An equidistant fish-eye lens, 90 degrees at 200 pixels: all that is needed is a method."""

    class Equidistant:
        def radius(self, elevation: Floats) -> Floats:
            return np.asarray((math.pi / 2 - elevation) * 200.0 / (math.pi / 2))

    radius, clockwise = np.meshgrid(np.arange(SIZE) + 0.5 - 240, np.arange(SIZE) + 0.5 - 240)
    elevation = math.pi / 2 * (1 - np.hypot(radius, clockwise) / 200.0)
    picture = np.asarray(np.clip(100 + 2 * np.rad2deg(elevation), 0, 255), dtype=np.uint8)
    model = RadialPicture(law=Equidistant(), center_x=240.0, center_y=240.0)
    circle = Unwrapper(model, CAMERA, SIZE, SIZE).unwrap(picture)
    focal = 24 / math.tan(math.radians(20))
    expected = 100 + 2 * np.rad2deg(np.arctan((17.5 - np.arange(36)) / focal))
    assert np.abs(circle - expected[:, None]).max() < 2.0


class TestTable:
    def test_each_model(self) -> None:
        place = {"center_x": 250.3, "center_y": 236.8, "top_deg": 25, "focal_px": 300, "rim_px": 220}
        assert from_table({"model": "conical", "gamma_deg": 36, **place}) == CASES["conical"][0]
        made = from_table({"model": "hyperbolic", "a_m": 0.03, "b_m": 0.04, **place})
        assert made == CASES["hyperbolic"][0]
        made = from_table(
            {"model": "spherical", "ball_m": 0.1, "center_m": 0.3, "looks": "down", **place, "rim_px": 100}
        )
        assert made == CASES["spherical, looking down"][0]
        of_lens = {key: value for key, value in place.items() if key != "focal_px"}
        made = from_table({"model": "polynomial", "coefficients": [140, 0, -0.0046], **of_lens})
        assert made == CASES["polynomial"][0]
        made = from_table({"model": "equirectangular", "left_deg": 170, "upper_deg": 70, "lower_deg": -50})
        assert made == CASES["equirectangular"][0]

    @pytest.mark.parametrize(
        ("changes", "says"),
        [
            ({"model": "flat"}, "model is 'flat'; choose from: conical, hyperbolic"),
            ({"model": None}, "model is None; choose from"),
            ({"radius": 3}, "nothing is called 'radius' here; .*gamma_deg"),
            ({"model": "equirectangular"}, "nothing is called 'gamma_deg' here; .*left_deg"),
            ({"model": "spherical"}, "nothing is called 'gamma_deg' here"),
            ({"rim_px": None}, "rim_px is missing; a conical model needs it"),
            ({"center_x": None}, "center_x is missing"),
            ({"gamma_deg": "steep"}, "gamma_deg is 'steep'; write a number"),
            ({"gamma_deg": 60}, "gamma_deg is 60.0; it must lie between 0 and 45"),
            ({"looks": "ahead"}, "looks is 'ahead'; choose from: up, down"),
        ],
    )
    def test_mistakes_are_one_line(self, changes: dict[str, Any], says: str) -> None:
        table = {"model": "conical", "gamma_deg": 36, "center_x": 1, "center_y": 2, "focal_px": 300, "rim_px": 220}
        changed = {key: value for key, value in {**table, **changes}.items() if value is not None}
        with pytest.raises(UserError, match=rf"^camera\.toml \[omni\]: {says}") as caught:
            from_table(changed, "camera.toml [omni]")
        assert "\n" not in str(caught.value) and ";" in str(caught.value)


class TestConicalMirror:
    def test_by_hand(self) -> None:
        """d = H, D = sqrt(3) H: gamma = 45 / 2, beta = 60 - 45, l / h = (2 + sqrt 3)(sqrt 2 + 1) - 1."""
        ratio = (2 + math.sqrt(3)) * (math.sqrt(2) + 1) - 1
        mirror = conical_mirror(1.2, 1.2, 1.2 * math.sqrt(3), cone_m=0.01)
        assert [mirror.gamma_deg, mirror.beta_deg] == pytest.approx([22.5, 15.0])
        assert ratio == pytest.approx(8.009968, abs=1e-6)
        assert mirror.tip_m == pytest.approx(0.01 * ratio)
        assert mirror.rim_m == pytest.approx(0.01 * (math.sqrt(2) + 1)), "h = r tan(gamma)"

    def test_to_the_horizon(self) -> None:
        mirror = conical_mirror(0.5, 1.0, math.inf, rim_m=0.04)
        assert 2 * mirror.gamma_deg + mirror.beta_deg == pytest.approx(90.0)

    @given(near=st.floats(0.05, 3), more=st.floats(0.05, 20), height=st.floats(0.2, 3), scale=st.floats(0.01, 0.2))
    def test_any_of_the_three_gives_the_others(self, near: float, more: float, height: float, scale: float) -> None:
        mirror = conical_mirror(near, height, near + more, rim_m=scale)
        assert conical_mirror(near, height, near + more, tip_m=mirror.tip_m).rim_m == pytest.approx(scale)
        assert conical_mirror(near, height, near + more, cone_m=mirror.cone_m).rim_m == pytest.approx(scale)
        assert math.tan(math.radians(mirror.beta_deg)) == pytest.approx(scale / (mirror.tip_m + mirror.cone_m))

    @given(near=st.floats(0.2, 2), more=st.floats(0.2, 6), height=st.floats(0.5, 2), scale=st.floats(0.005, 0.05))
    def test_rays_end_where_they_were_meant_to(self, near: float, more: float, height: float, scale: float) -> None:
        """Traced: the tip's ray ends at d, the rim's at D + r + D h / H, what the thesis neglects (r, h << H)."""
        far = near + more
        mirror = conical_mirror(near, height, far, rim_m=scale)
        beta, floor = math.radians(mirror.beta_deg), mirror.tip_m - height
        rays = np.array([[3e-5, 0.0, 1.0], [0.9999999 * math.tan(beta), 0.0, 1.0]])
        point, gone = reflect(cone(mirror.gamma_deg, mirror.tip_m), rays, 10 * (mirror.tip_m + mirror.cone_m))
        fall = (point[:, 2] - floor) / -gone[:, 2]
        ends = point[:, 0] + fall * gone[:, 0]
        assert point[1, 0] == pytest.approx(mirror.rim_m, rel=1e-5)
        assert ends[0] == pytest.approx(near, rel=1e-3)
        assert ends[1] == pytest.approx(far + mirror.rim_m + far * mirror.cone_m / height, rel=1e-3)

    def test_its_law_shows_what_it_was_made_for(self) -> None:
        """Its floor, from d in the middle of the picture to D at the rim, as angles from height H."""
        law = conical_mirror(0.5, 1.0, 6.0, rim_m=0.04).law(rim_px=200.0)
        ends = np.tan(law.elevation(np.array([0.0, 200.0])))
        assert -1.0 / ends == pytest.approx([0.5, 6.0])

    @pytest.mark.parametrize(
        ("values", "scale"),
        [
            ((0.5, 1.0, 6.0), {}),
            ((0.5, 1.0, 6.0), {"rim_m": 0.04, "tip_m": 0.1}),
            ((0.5, 1.0, 6.0), {"rim_m": 0.0}),
            ((6.0, 1.0, 0.5), {"rim_m": 0.04}),
            ((0.0, 1.0, 6.0), {"rim_m": 0.04}),
            ((0.5, -1.0, 6.0), {"rim_m": 0.04}),
            ((0.5, math.nan, 6.0), {"rim_m": 0.04}),
        ],
    )
    def test_lengths_that_cannot_be(self, values: tuple[float, float, float], scale: dict[str, float]) -> None:
        with pytest.raises(ValueError, match=r"give one, it sets the scale|must be above 0, and far_m above near_m"):
            conical_mirror(*values, **scale)


def sampled(cylinder: Image, camera: Camera, directions: Floats) -> Image:
    """What a picture shows whose pixels see directions (R, C, 3), of a room given by a cylinder from heading 0."""
    focal = camera.width / 2 / math.tan(math.radians(camera.hfov_deg) / 2)
    x, y, z = np.moveaxis(directions, -1, 0)
    column = -np.arctan2(y, x) / (2 * math.pi) % 1.0 * cylinder.shape[1] - 0.5
    row = camera.height / 2 - focal * z / np.hypot(x, y) - 0.5
    x, y = (np.nan_to_num(part, nan=-9.0).astype(np.float32) for part in (column, row))
    return np.asarray(cv2.remap(cylinder, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP), dtype=np.uint8)


def equirectangular_of(cylinder: Image, camera: Camera, highest_deg: float) -> Image:
    """The same room as an equirectangular picture from heading 0, so many degrees up and down."""
    columns, rows = cylinder.shape[1], round(cylinder.shape[1] * 2 * highest_deg / 360)
    azimuth = -2 * math.pi * (np.arange(columns) + 0.5) / columns
    elevation = np.radians(highest_deg * (1 - 2 * (np.arange(rows) + 0.5) / rows))[:, None]
    parts = np.cos(azimuth), np.sin(azimuth), np.tan(elevation)
    return sampled(cylinder, camera, np.stack(np.broadcast_arrays(*parts), axis=-1))


class TestInTheLaboratory:
    """Panoramas of the simulated laboratory's nodes, seen by an omnidirectional camera, make a map for IMA."""

    WIDE = Camera(40.0, 192, 260)
    MAP_CAMERA = Camera(40.0, 192, 144)

    def node(self, position: Floats, number: int, kind: str) -> Node:
        """A node whose robot stood at another heading each."""
        robot = 0.9 * number
        room = render_cylinder(lab_scene(3), position, robot, self.WIDE)
        if kind == "conical":
            picture = sampled(room, self.WIDE, mirror_directions(cone(36.0, 0.2), 2.0))
            model = CASES["conical"][0]
        else:
            picture = equirectangular_of(room, self.WIDE, 25.0)
            model = Equirectangular(left_deg=0.0, upper_deg=25.0, lower_deg=-25.0)
        height, width = picture.shape[:2]
        circle = Unwrapper(model, self.MAP_CAMERA, width, height).unwrap(picture)
        return Node(str(number), "", float(position[0]), float(position[1]), float(wrap(robot)), circle)

    @pytest.mark.parametrize("kind", ["equirectangular", pytest.param("conical", marks=pytest.mark.slow)])
    def test_ima_names_node_and_heading(self, kind: str) -> None:
        places = [np.array([place.x, place.y]) for place in LabWorld().places]
        sensor = IMA()
        sensor.fit(TopoMap("unwrapped", self.MAP_CAMERA, tuple(self.node(p, k, kind) for k, p in enumerate(places))))
        for number, place in enumerate(places):
            for heading in (0.3, 2.4, -1.7):
                image = render_frame(lab_scene(3), np.array([*place, heading]), self.MAP_CAMERA)
                evidence = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": image}))
                best = int(evidence.match.argmax())
                assert evidence.nodes[best] == number
                assert abs(wrap(evidence.poses[best, 2] - heading)) < math.radians(1.5)


def test_the_example_of_the_docs_prints_what_it_says(capsys: pytest.CaptureFixture[str]) -> None:
    page = Path(__file__).parents[2] / "docs" / "omni.md"
    (code,) = re.findall(r"```python\n(.*?)```", page.read_text(), re.DOTALL)
    exec(compile(code, page.name, "exec"), {})
    (promised,) = re.findall(r"It prints `([^`]+)`", page.read_text())
    assert capsys.readouterr().out.strip() == promised
