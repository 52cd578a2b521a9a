"""Local features: what turns and places they find, by arithmetic and in small made-up worlds."""

from __future__ import annotations

from functools import cache
from typing import Any

import cv2
import numpy as np
import pytest

from sensors.images import cut_views
from sensors.keypoints import Detector, Keypoints, Kind, References, agreed
from sensors.local import LocalFeatures, LocalFeaturesConfig
from topoloc.errors import UserError
from topoloc.geometry import Floats, compose, wrap
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Evidence, Frame, Image

CAMERA = Camera(60.0, 160, 120)


def scenery(seed: int, columns: int, rows: int = 120) -> Image:
    """Soft blots of all sizes, which have corners and blobs to find."""
    rng = np.random.default_rng(seed)
    levels = np.zeros((rows, columns))
    for size in (4, 8, 16, 32):
        coarse = rng.normal(size=(rows // size + 2, columns // size)).astype(np.float32)
        levels += cv2.resize(np.concatenate([coarse, coarse[:, :1]], axis=1), (columns, rows))
    grey = np.clip(128.0 + 35.0 * levels, 0, 255).astype(np.uint8)
    return np.repeat(grey[:, :, None], 3, axis=2)


def frame_of(image: Image, camera: Floats | None = None) -> Frame:
    return Frame(0.0, None, np.zeros(3) if camera is None else camera, {"rgb": image})


@cache
def circles() -> TopoMap:
    made = [Node(f"n{k}", f"n{k}", 2.0 * k, 0.0, 0.4, scenery(k, CAMERA.panorama_columns())) for k in range(3)]
    return TopoMap("circles", CAMERA, tuple(made))


@cache
def fitted(features: Kind = "sift", heading_votes: int = 4) -> LocalFeatures:
    """To the circles; observing changes nothing, so that tests share it."""
    sensor = LocalFeatures(LocalFeaturesConfig(features=features, heading_votes=heading_votes))
    sensor.fit(circles())
    return sensor


def pin_hole(panorama: Image, axis: float) -> Image:
    """A frame whose optical axis looks ``axis`` clockwise of the panorama's first column [rad]."""
    columns, focal = panorama.shape[1], CAMERA.width / 2.0 / np.tan(np.deg2rad(CAMERA.hfov_deg) / 2.0)
    right = np.arctan((np.arange(CAMERA.width) + 0.5 - CAMERA.width / 2.0) / focal)
    source = ((axis + right) / (2.0 * np.pi) * columns - 0.5) % columns
    wide = np.concatenate([panorama, panorama[:, :1]], axis=1)
    x, y = np.meshgrid(source, np.arange(CAMERA.height))
    return np.asarray(cv2.remap(wide, x.astype(np.float32), y.astype(np.float32), cv2.INTER_LINEAR), dtype=np.uint8)


def best(evidence: Evidence) -> int:
    return int(evidence.match.argmax())


@pytest.mark.parametrize("features", ["sift", "orb"])
@pytest.mark.parametrize("axis_deg", [75.0, 200.0, 359.0])
def test_place_and_heading_on_panoramas(features: Kind, axis_deg: float) -> None:
    """The third frame looks across the seam of the panorama."""
    sensor = fitted(features)
    for k, node in enumerate(circles().nodes):
        assert node.panorama is not None
        evidence = sensor.observe(frame_of(pin_hole(node.panorama, np.deg2rad(axis_deg))))
        assert evidence.nodes[best(evidence)] == k
        off = wrap(evidence.poses[best(evidence), 2] - (node.heading - np.deg2rad(axis_deg)))
        assert abs(np.rad2deg(off)) < 1.5
        assert evidence.kappa[best(evidence)] > 0.0
        assert (evidence.match[evidence.nodes != k] < 0.6).all()


def test_against_views_the_heading_is_that_of_the_frame() -> None:
    """The robot has turned by 10 degrees since the view was taken: place of the view, heading of its own."""
    wide = scenery(4, CAMERA.panorama_columns())
    views = tuple(View(np.array([float(k), 1.0, 0.2]), pin_hole(scenery(k, 960), 1.0)) for k in range(3))
    views += (View(np.array([3.0, 1.0, 0.2]), pin_hole(wide, 1.0)),)
    nodes = tuple(Node(str(k), str(k), float(k), 1.0) for k in range(4))
    sensor = LocalFeatures()
    sensor.fit(TopoMap("views", CAMERA, nodes, views=views))
    evidence = sensor.observe(frame_of(pin_hole(wide, 1.0 - np.deg2rad(10.0)), np.array([0.1, 0.0, 0.0])))
    np.testing.assert_allclose(evidence.poses[best(evidence), :2], [3.0, 1.0])
    assert np.rad2deg(evidence.poses[best(evidence), 2] - 0.2) == pytest.approx(10.0, abs=1.5)


def test_the_axis_of_the_robot_stands_on_the_node() -> None:
    the_map, mount, sensor = circles(), np.array([0.1, 0.02, 0.4]), fitted()
    panorama = the_map.nodes[1].panorama
    assert panorama is not None
    evidence = sensor.observe(frame_of(pin_hole(panorama, 2.0), mount))
    robot = evidence.of_robot(mount)
    np.testing.assert_allclose(robot.poses[best(robot), :2], [2.0, 0.0], atol=1e-12)
    np.testing.assert_allclose(compose(robot.poses[best(robot)], mount), evidence.poses[best(evidence)])


def test_a_frame_of_another_place_matches_less_than_half() -> None:
    sensor = fitted()
    wrong = [sensor.observe(frame_of(pin_hole(scenery(seed, 960), 1.0))).match.max() for seed in range(20, 30)]
    assert np.median(wrong) < 0.6
    assert max(wrong) < 0.8


def test_few_votes_know_no_heading() -> None:
    """A threshold above what wrong nodes reach leaves their headings open, and only theirs."""
    the_map, sensor = circles(), fitted(heading_votes=30)
    panorama = the_map.nodes[0].panorama
    assert panorama is not None
    evidence = sensor.observe(frame_of(pin_hole(panorama, 2.0)))
    np.testing.assert_array_equal(evidence.kappa > 0.0, evidence.nodes == 0)


def test_an_identical_view_matches_by_one() -> None:
    images = [pin_hole(scenery(k, 960), 1.0) for k in range(3)]
    views = tuple(View(np.array([float(k), 0.0, 0.0]), image) for k, image in enumerate(images))
    sensor = LocalFeatures()
    sensor.fit(TopoMap("views", CAMERA, tuple(Node(str(k), str(k), float(k), 0.0) for k in range(3)), views=views))
    for k, image in enumerate(images):
        evidence = sensor.observe(frame_of(image))
        assert evidence.nodes[best(evidence)] == k
        assert evidence.match.max() == pytest.approx(1.0, abs=0.02)


@pytest.mark.parametrize("level", [0, 90, 255])
def test_flat_covered_and_empty_frames_are_blind(level: int) -> None:
    sensor = fitted()
    rng = np.random.default_rng(0)
    covered = np.clip(rng.normal(level, 2, (120, 160, 3)), 0, 255).astype(np.uint8)
    half = np.repeat(np.where(np.arange(160) < 80, 40, 200).astype(np.uint8)[None], 120, axis=0)  # contrast, no corners
    for image in (covered, np.full((120, 160), level, np.uint8), half):
        assert sensor.observe(frame_of(image)).is_blind


def test_grey_frames_give_the_same_as_their_colours() -> None:
    the_map, sensor = circles(), fitted()
    panorama = the_map.nodes[2].panorama
    assert panorama is not None
    image = pin_hole(panorama, 1.0)
    coloured, grey = sensor.observe(frame_of(image)), sensor.observe(frame_of(np.ascontiguousarray(image[:, :, 0])))
    np.testing.assert_array_equal(coloured.match, grey.match)


def test_a_map_without_pictures_is_refused() -> None:
    with pytest.raises(UserError, match=r"'bare'.*views or panoramas"):
        LocalFeatures().fit(TopoMap("bare", CAMERA, (Node("a", "a", 0.0, 0.0),)))


@pytest.mark.parametrize("setting", [{"features": "surf"}, {"ratio": 0.0}, {"keypoints": 0}, {"vote_deg": 0.0}])
def test_settings_that_make_no_sense_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(setting))):
        LocalFeaturesConfig(**setting)


def test_matches_are_those_of_opencv_with_the_ratio_test() -> None:
    """One product of matrices over all pictures, beside a brute-force match a picture."""
    detector = Detector("sift", 200)
    seen = detector.of_frame(pin_hole(scenery(0, 960), 1.0), 60.0)
    pictures = [detector.of_frame(pin_hole(scenery(k, 960), 1.1), 60.0) for k in range(4)]
    _, passed = References(pictures, np.zeros(4), "sift", 0.8).matches(seen)
    matcher = cv2.BFMatcher(cv2.NORM_L2)
    for picture, ours in zip(pictures, passed, strict=True):
        pairs = matcher.knnMatch(seen.descriptors, picture.descriptors, k=2)
        theirs = [first.distance < 0.8 * second.distance for first, second in pairs]
        assert np.mean(ours != theirs) <= 0.01  # rounding decides a tie
    assert passed[0].sum() > 10 * passed[1:].sum(axis=1).max()


def test_products_of_orb_descriptors_tell_the_hamming_distance() -> None:
    detector = Detector("orb", 100)
    image = pin_hole(scenery(0, 960), 1.0)
    found = detector.of_frame(image, 60.0).descriptors
    raw = cv2.ORB.create(100).detectAndCompute(np.ascontiguousarray(image[:, :, 0]), None)[1]
    hamming = np.unpackbits(raw[0] ^ raw[1]).sum()
    assert found[0] @ found[1] == pytest.approx(1.0 - 2.0 * hamming / 256.0, abs=1e-6)


def test_the_vote_is_that_of_most_within_the_window_across_the_turn_of_pi() -> None:
    headings = np.deg2rad([[178.0, -179.0, 179.0, 40.0, 41.0, 20.0], [10.0, 11.0, 9.0, 100.0, 100.0, 101.0]])
    counts = np.ones((2, 6), dtype=np.bool_)
    counts[1, :3] = False
    mean, votes = agreed(headings, counts, np.deg2rad(10.0))
    np.testing.assert_allclose(votes, [3.0, 3.0])
    np.testing.assert_allclose(np.rad2deg(wrap(mean - np.deg2rad([179.33, 100.33]))), 0.0, atol=0.01)


def test_no_matches_have_no_votes() -> None:
    none = Keypoints(np.zeros((0, 128), np.float32), np.zeros(0))
    full = Keypoints(np.eye(3, 128, dtype=np.float32), np.zeros(3))
    references = References([none, full], np.zeros(2), "sift", 0.8)
    np.testing.assert_array_equal(agreed(*references.matches(full), 0.2)[1], [0.0, 3.0])
    np.testing.assert_array_equal(agreed(*references.matches(none), 0.2)[1], [0.0, 0.0])


def test_keypoints_of_a_circle_are_found_on_its_seam() -> None:
    """A circle that begins elsewhere has the same keypoints, turned, but for few."""
    circle, shift = scenery(1, 960), 300
    detector = Detector("sift", 5000)
    plain, rolled = (detector.of_circle(one, 60.0) for one in (circle, np.roll(circle, shift, axis=1)))
    moved = np.sort(np.mod(rolled.angles + shift * 2.0 * np.pi / 960, 2.0 * np.pi))
    angles = np.sort(np.mod(plain.angles, 2.0 * np.pi))
    gaps = np.abs(wrap(angles[:, None] - moved[None])).min(axis=1)
    assert np.mean(gaps < 1e-3) > 0.95
    cuts = cut_views(circle, 0.0, CAMERA)
    assert len(plain) > 0.5 * sum(len(detector.of_frame(image, 60.0)) for image, _ in cuts[::4])
