"""Heading by (2.2) from real photographs, and the conventions of panorama columns and mounted cameras."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.shared_data import CAMERA, RING6_QUERIES, RING6_SNAPSHOTS, placed_panorama, yaws

from sensors.ima import IMA, IMAConfig
from sensors.images import clahe, cut_views, grey
from topoloc.errors import UserError
from topoloc.files import read_image
from topoloc.geometry import rotate, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame

needs_photographs = pytest.mark.skipif(
    not RING6_QUERIES.is_dir(), reason="the real photographs are not on this machine"
)


def frame_of(image: np.ndarray) -> Frame:
    return Frame(0.0, None, np.zeros(3), {"rgb": image})


def noise_map(nodes: int = 2, heading: float = 0.7) -> TopoMap:
    rng = np.random.default_rng(1)
    camera = Camera(40.0, 96, 72)
    made = []
    for k in range(nodes):
        coarse = rng.integers(0, 256, (9, 108)).astype(np.uint8)
        made.append(Node(f"n{k}", f"node {k}", float(k), 0.0, heading, np.kron(coarse, np.ones((8, 8), np.uint8))))
    return TopoMap("noise", camera, tuple(made))


@needs_photographs
@pytest.mark.parametrize("filtered", [False, True], ids=["sensor filters the circle", "snapshots filtered before"])
def test_heading_of_all_queries_within_one_degree(filtered: bool) -> None:
    """18 of 18 queries against the panorama of the 12 snapshots placed by their true yaws.

    Worst seen 0.5 degrees, whether the snapshots are filtered, as in the thesis, or the circle that they make.
    """
    panorama, heading = placed_panorama()
    if filtered:
        panorama = _placed_filtered(heading)
    node = Node("ring", "ring", 0.0, 0.0, float(np.deg2rad(heading)), panorama)
    sensor = IMA()
    sensor.fit(TopoMap("ring6", CAMERA, (node,), filtered=filtered))
    truth = yaws(RING6_QUERIES)
    errors, matches = [], []
    for name, yaw in truth.items():
        evidence = sensor.observe(frame_of(read_image(RING6_QUERIES / name)))
        errors.append(abs(float(np.rad2deg(wrap(evidence.poses[0, 2] - np.deg2rad(yaw))))))
        matches.append(float(evidence.match[0]))
    print(f"worst {max(errors):.2f} deg, mean match {np.mean(matches):.3f}")
    assert len(errors) == 18
    assert max(errors) < 1.0
    assert np.median(errors) < 0.3
    assert np.mean(matches) > 0.8


def _placed_filtered(heading: float) -> np.ndarray:
    columns = CAMERA.panorama_columns()
    panorama = np.zeros((CAMERA.height, columns), dtype=np.uint8)
    for name, yaw in yaws(RING6_SNAPSHOTS).items():
        left = round((heading - yaw) / 360.0 * columns - CAMERA.width / 2)
        snapshot = clahe(grey(read_image(RING6_SNAPSHOTS / name)), THESIS.clahe_clip_limit, THESIS.clahe_tiles)
        panorama[:, (left + np.arange(CAMERA.width)) % columns] = snapshot
    return panorama


def test_a_view_cut_from_a_panorama_is_found_with_its_heading() -> None:
    """Columns run clockwise from node.heading; a column of 648 is 0.56 degrees, and zoom may add half a column."""
    the_map = noise_map()
    sensor = IMA()
    sensor.fit(the_map)
    for k, node in enumerate(the_map.nodes):
        assert node.panorama is not None
        for image, heading in cut_views(node.panorama, node.heading, the_map.camera)[::5]:
            evidence = sensor.observe(frame_of(image))
            assert evidence.match.argmax() == k
            assert abs(float(wrap(evidence.poses[k, 2] - heading))) < np.deg2rad(0.6)


@pytest.mark.parametrize("mount", [(0.1, 0.0, 0.0), (0.1, 0.02, np.pi / 2)], ids=["ahead", "turned to the left"])
def test_the_node_is_where_the_axis_of_the_robot_stood(mount: tuple[float, float, float]) -> None:
    """The camera rides off the axis that turned on the node: it names its own pose, the robot's is the node."""
    the_map = noise_map(2)
    sensor = IMA()
    sensor.fit(the_map)
    panorama = the_map.nodes[1].panorama
    assert panorama is not None
    image, axis = cut_views(panorama, the_map.nodes[1].heading, the_map.camera)[7]
    evidence = sensor.observe(replace(frame_of(image), camera=np.array(mount)))
    heading = axis - mount[2]
    off = rotate(mount[:2], heading)
    np.testing.assert_allclose(evidence.poses[1, :2], [1.0 + off[0], off[1]], atol=2e-3)
    robot = evidence.of_robot(mount).poses[1]
    np.testing.assert_allclose(robot[:2], [1.0, 0.0], atol=1e-12)
    assert float(wrap(robot[2] - heading)) == pytest.approx(0.0, abs=0.02)


def test_zoom_finds_a_view_from_nearer_and_from_farther() -> None:
    """2.4.2: a frame taken 10 % nearer or farther matches better with the three combinations than with one."""
    node = noise_map(1).nodes[0]
    assert node.panorama is not None
    big = np.kron(np.random.default_rng(2).integers(0, 256, (12, 16)), np.ones((24, 24))).astype(np.uint8)
    reference = big[24:-24, 32:-32]
    nearer = big[36:-36, 48:-48]
    with_zoom, without = IMA(IMAConfig(clahe=False)), IMA(IMAConfig(clahe=False, zoom=1.0))
    for image, other in ((nearer, reference), (reference, nearer)):
        assert with_zoom.compare(image, other)[0] > without.compare(image, other)[0] + 0.05
    assert with_zoom.compare(reference, reference)[0] == pytest.approx(1.0)


def test_flat_and_covered_frames_are_blind() -> None:
    the_map = noise_map(1)
    sensor = IMA()
    sensor.fit(the_map)
    rng = np.random.default_rng(0)
    covered = np.clip(rng.normal(8, 2, (72, 96, 3)), 0, 255).astype(np.uint8)
    for image in (np.zeros((72, 96, 3), np.uint8), np.full((72, 96), 200, np.uint8), covered):
        assert sensor.observe(frame_of(image)).is_blind


def test_a_map_without_panoramas_is_refused_by_name() -> None:
    bare = TopoMap("bare", Camera(), (Node("7", "seven", 0.0, 0.0),))
    with pytest.raises(UserError, match=r"'bare'.*panorama.*7"):
        IMA().fit(bare)


def test_clahe_of_a_circle_has_no_seam() -> None:
    """Turning the circle before or after the filter gives the same picture, to the rounding of tile borders."""
    panorama = np.random.default_rng(5).integers(0, 256, (72, 864)).astype(np.uint8)
    turned = np.roll(clahe(panorama, 2.0, 8, 40.0), 432, axis=1)
    assert np.abs(turned.astype(int) - clahe(np.roll(panorama, 432, axis=1), 2.0, 8, 40.0)).mean() < 2.0


def test_a_place_photographed_twice_changes_nothing() -> None:
    """EQUATIONS.md, 4: a node of the map and its copy 1 cm away weigh as much as the node alone."""
    once = noise_map(3)
    copy = replace(once.nodes[1], id="again", x=once.nodes[1].x + 0.01)
    twice = replace(once, nodes=(*once.nodes, copy), edges=None)
    places, headings = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.4, 0.2]]), np.linspace(-3.0, 3.0, 9)[None]
    seen = []
    for the_map in (once, twice):
        sensor = IMA()
        sensor.fit(the_map)
        panorama = once.nodes[1].panorama
        assert panorama is not None
        seen.append(sensor.observe(frame_of(panorama[:, 300:396])).log_likelihood(places, headings))
    assert np.abs(seen[1] - seen[0]).max() < 0.05  # the copy stands 1 cm off, of 40 that a match holds
    assert seen[0].max() > 1.0
