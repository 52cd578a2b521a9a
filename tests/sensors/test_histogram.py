"""The colour histogram and the calibration that it shares with other view sensors."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from sensors.histogram import (
    BANDS,
    BATCH,
    ColorHistogram,
    ColorHistogramConfig,
    Votes,
    band_divergences,
    described,
    divergences,
    votes_of,
)
from sensors.images import cut_views, views_of
from topoloc.errors import UserError
from topoloc.geometry import Floats, wrap
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Frame

CAMERA = Camera(40.0, 48, 36)


def coloured_map(nodes: int = 3) -> TopoMap:
    """Panoramas whose colour turns with the direction and differs from node to node."""
    made = []
    for k in range(nodes):
        rng = np.random.default_rng(k)
        base = rng.integers(0, 256, (6, 18, 3)).astype(np.uint8)
        panorama = base.repeat(6, axis=0).repeat(24, axis=1)
        made.append(Node(f"n{k}", f"n{k}", float(k), 0.0, 0.3, panorama))
    return TopoMap("coloured", CAMERA, tuple(made))


def frame_of(image: np.ndarray) -> Frame:
    return Frame(0.0, None, np.zeros(3), {"rgb": image})


def test_a_view_of_the_map_is_recognized_with_place_and_heading() -> None:
    the_map = coloured_map()
    sensor = ColorHistogram()
    sensor.fit(the_map)
    views = views_of(the_map)
    poses, images = views.poses, views.images
    assert views.on_nodes
    for i in range(0, len(images), 7):
        evidence = sensor.observe(frame_of(images[i]))
        assert evidence.match[0] == pytest.approx(1.0)
        np.testing.assert_allclose(evidence.poses[0], poses[i])
        assert len(evidence.poses) == ColorHistogramConfig().neighbours
        assert (np.diff(evidence.match) <= 0).all()


def test_views_are_cut_every_fifteen_degrees_with_their_optical_axes() -> None:
    the_map = coloured_map(1)
    node = the_map.nodes[0]
    assert node.panorama is not None
    cuts = cut_views(node.panorama, node.heading, CAMERA)
    assert len(cuts) == 24
    np.testing.assert_allclose(np.rad2deg(wrap(np.diff([axis for _, axis in cuts]))), -15.0)
    assert cuts[0][1] == pytest.approx(0.3 - np.deg2rad(20.0))
    np.testing.assert_array_equal(cuts[1][0], node.panorama[:, 18:66])


def test_training_views_of_the_map_come_first() -> None:
    the_map = coloured_map(1)
    view = View(np.array([1.0, 2.0, 0.5]), np.zeros((36, 48, 3), np.uint8))
    views = views_of(TopoMap("v", CAMERA, the_map.nodes, views=(view,)))
    np.testing.assert_array_equal(views.poses, [view.pose])
    assert len(views.images) == 1
    np.testing.assert_array_equal(views.camera_poses(np.array([0]), np.array([0.1, 0.0, 0.0])), [view.pose])


def test_views_cut_from_panoramas_put_the_axis_of_the_robot_on_the_node() -> None:
    """The robot turned on its axis for the panoramas, its camera ahead of it: the evidence must give that back."""
    the_map = coloured_map()
    sensor = ColorHistogram()
    sensor.fit(the_map)
    mount = np.array([0.1, 0.02, 0.4])
    evidence = sensor.observe(replace(frame_of(views_of(the_map).images[5]), camera=mount))
    robot = evidence.of_robot(mount).poses
    np.testing.assert_allclose(robot[:, :2], the_map.positions[evidence.nodes], atol=1e-12)
    assert np.linalg.norm(evidence.poses[0, :2] - the_map.positions[0]) == pytest.approx(np.hypot(0.1, 0.02))


def test_filtered_panoramas_have_no_colour_to_compare() -> None:
    with pytest.raises(UserError, match="filtered"):
        ColorHistogram().fit(replace(coloured_map(), filtered=True))


def by_hand(one: Floats, others: Floats) -> Floats:
    """Jeffrey divergences (V, BANDS) of histograms (BANDS, bins) and (V, BANDS, bins), as the formula has it."""
    mean = (one + others) / 2.0
    return np.asarray((one * np.log(one / mean) + others * np.log(others / mean)).sum(axis=2))


def test_jeffrey_divergence() -> None:
    """To 1e-5 of the formula in double precision, over more views than are compared at a time; 0 for the same one."""
    rng = np.random.default_rng(3)
    histograms = 0.95 * rng.dirichlet(np.full(24, 0.2), (BATCH + 5, BANDS)) + 0.05 / 24
    made = np.stack([described(one) for one in histograms])
    expected = by_hand(histograms[7], histograms)
    np.testing.assert_allclose(divergences(made[7], made), expected.mean(axis=1), atol=1e-5)
    np.testing.assert_allclose(band_divergences(made[7], made), expected, atol=1e-5)
    assert divergences(made[7], made)[7] == pytest.approx(0.0, abs=1e-6)


def test_each_band_of_a_picture_is_a_histogram() -> None:
    """A red: hue 0, lightness 100 of 256, full saturation, all of the colour red."""
    red = np.zeros((36, 48, 3), np.uint8)
    red[..., 0] = 200
    bins = ColorHistogramConfig().bins
    made = ColorHistogram().describe({"rgb": red})
    histograms = made[: BANDS * bins].reshape(BANDS, bins)
    np.testing.assert_allclose(histograms.sum(axis=1), 1.0, atol=1e-5)
    np.testing.assert_array_equal(histograms.argmax(axis=1), [0, bins * 100 // 256, bins - 1, bins - 1, 0, 0])


@pytest.mark.parametrize("bins", [2, 24, 300])
def test_bins_are_those_of_each_pixels_shares(bins: int) -> None:
    """Pixel by pixel; hue 180, as OpenCV rounds it for some reds, is hue 0."""
    image = np.random.default_rng(bins).integers(0, 256, (36, 96, 3)).astype(np.uint8)
    image[0, :3] = (255, 0, 1)
    hls = cv2.cvtColor(image, cv2.COLOR_RGB2HLS)
    assert (hls[0, :3, 0] == 180).all()
    expected = np.zeros((BANDS, bins))
    for rgb, (hue, light, saturation) in zip(image.reshape(-1, 3).tolist(), hls.reshape(-1, 3).tolist(), strict=True):
        levels = [level / (sum(rgb) + 1.0) for level in rgb]
        for band, share in enumerate([hue % 180 / 180.0, light / 256.0, saturation / 256.0, *levels]):
            expected[band, int(share * bins)] += 0.95 / (36 * 96)
    made = ColorHistogram(ColorHistogramConfig(bins=bins)).describe({"rgb": image})[: BANDS * bins]
    np.testing.assert_allclose(made.reshape(BANDS, bins), expected + 0.05 / bins, rtol=1e-6)


def test_every_band_votes_for_the_node_of_its_nearest_view_by_the_ratio_to_the_next_node() -> None:
    nodes = np.array([0, 0, 1, 2])
    distances = np.array([[0.1, 0.5], [0.2, 0.4], [0.4, 0.2], [0.8, 0.25]])
    votes = votes_of(distances, nodes)
    np.testing.assert_array_equal(votes.nodes, [0, 1])
    np.testing.assert_allclose(votes.confidence, [1.0 - 0.1 / 0.4, 1.0 - 0.2 / 0.25])
    assert votes.leader() == 0


@pytest.mark.parametrize(
    ("least", "verdict"), [(0.0, "confused"), (0.25, "confused"), (0.4, "confident"), (0.95, "uncertain")]
)
def test_votes_that_count_are_unanimous_or_not(least: float, verdict: str) -> None:
    votes = Votes(np.array([2, 2, 0, 2, 1, 2]), np.array([0.9, 0.5, 0.3, 0.6, 0.1, 0.4]))
    assert votes.verdict(least) == verdict


def test_votes_of_a_map_with_one_node_are_sure() -> None:
    votes = votes_of(np.full((3, BANDS), 0.5), np.zeros(3, dtype=np.int64))
    np.testing.assert_allclose(votes.confidence, 1.0)


def test_unanimous_bands_speak_for_their_node_alone_and_others_make_a_frame_blind() -> None:
    the_map = coloured_map()
    views = views_of(the_map)
    sensor = ColorHistogram(ColorHistogramConfig(voting="unanimous"))
    sensor.fit(the_map)
    seen = sensor.votes(views.images[30])
    np.testing.assert_array_equal(seen.nodes, np.full(BANDS, 1))
    evidence = sensor.observe(frame_of(views.images[30]))
    assert set(evidence.nodes) == {1}
    np.testing.assert_allclose(evidence.poses[0], views.poses[30])
    halves = np.concatenate([views.images[0][:, :24], views.images[30][:, 24:]], axis=1)
    strict = ColorHistogram(ColorHistogramConfig(voting="unanimous", least_confidence=0.999))
    strict.fit(the_map)
    assert strict.votes(halves).verdict(0.999) == "uncertain"
    assert strict.observe(frame_of(halves)).is_blind
    assert not sensor_without_votes(the_map).observe(frame_of(halves)).is_blind


def sensor_without_votes(the_map: TopoMap) -> ColorHistogram:
    sensor = ColorHistogram()
    sensor.fit(the_map)
    return sensor


@pytest.mark.parametrize("setting", [{"bins": 1}, {"smoothing": 0.0}, {"voting": "most"}, {"least_confidence": 1.5}])
def test_settings_that_make_no_sense_are_refused(setting: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(setting))):
        ColorHistogramConfig(**setting)


def test_covered_and_flat_frames_are_blind() -> None:
    sensor = ColorHistogram()
    sensor.fit(coloured_map())
    rng = np.random.default_rng(0)
    covered = np.clip(rng.normal(8, 2, (36, 48, 3)), 0, 255).astype(np.uint8)
    tinted = np.full((36, 48, 3), (200, 60, 40), np.uint8)
    for image in (np.zeros((36, 48, 3), np.uint8), np.full((36, 48), 90, np.uint8), covered, tinted):
        assert sensor.observe(frame_of(image)).is_blind


def test_a_map_without_pictures_is_refused() -> None:
    with pytest.raises(UserError, match=r"'bare'.*views or panoramas"):
        ColorHistogram().fit(TopoMap("bare", CAMERA, (Node("a", "a", 0.0, 0.0),)))
