"""The coarse stage before IMA: it leaves the right panoramas, and what is left is matched as if all were."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

from sensors.coarse_stage import CoarseStage, circle_stamp, frame_stamp
from sensors.ima import IMA, IMAConfig
from sensors.images import crop_centre, cut_views, grey
from sensors.robust_ima import RobustIMA, RobustIMAConfig
from sensors.slot_correlation import BLOCK
from topoloc.plugins import SENSORS, make
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 96, 72)
NODES = BLOCK + 8
KINDS = [(IMA, IMAConfig), (RobustIMA, RobustIMAConfig)]


def circle(seed: int) -> Image:
    noise = np.random.default_rng(seed).integers(0, 256, (9, 108)).astype(np.uint8)
    return np.asarray(cv2.resize(np.tile(noise, 3), (3 * 864, 72), interpolation=cv2.INTER_CUBIC)[:, 864:1728])


@pytest.fixture(scope="module")
def the_map() -> TopoMap:
    """Places that look like no other, on a line."""
    return TopoMap("m", CAMERA, tuple(Node(str(k), str(k), float(k), 0.0, 0.3 * k, circle(k)) for k in range(NODES)))


@pytest.fixture(scope="module", params=KINDS, ids=["ima", "ima-robust"])
def pair(request: pytest.FixtureRequest, the_map: TopoMap) -> tuple[IMA, IMA]:
    """The same sensor without and with a coarse stage."""
    kind, config = request.param
    exact, coarse = kind(config()), kind(config(candidates=5))
    for sensor in (exact, coarse):
        sensor.fit(the_map)
    return exact, coarse


def view(topo_map: TopoMap, node: int, number: int, nearness: float = 1.0, seed: int = 0) -> Frame:
    """What the camera sees from a node, or from somewhat ahead of it, in other light and with noise."""
    panorama = topo_map.nodes[node].panorama
    assert panorama is not None
    window = cut_views(panorama, 0.0, CAMERA)[number][0]
    near = cv2.resize(crop_centre(window, 1.0 / nearness, 1.0 / nearness), (96, 72), interpolation=cv2.INTER_AREA)
    noisy = 20.0 + 0.8 * near + np.random.default_rng(seed).normal(0.0, 8.0, near.shape)
    return Frame(0.0, None, np.zeros(3), {"rgb": np.clip(noisy, 0.0, 255.0).astype(np.uint8)})


@pytest.mark.parametrize("nearness", [1.0, 1.08])
@pytest.mark.parametrize("number", [0, 7, 22, 23])  # the last two lie over the seam
def test_the_best_node_is_among_the_candidates(
    pair: tuple[IMA, IMA], the_map: TopoMap, number: int, nearness: float
) -> None:
    for node in range(0, NODES, 7):
        exact, coarse = (sensor.observe(view(the_map, node, number, nearness, node)) for sensor in pair)
        assert len(coarse.nodes) == 5
        assert coarse.nodes[coarse.match.argmax()] == exact.match.argmax() == node


def test_candidates_are_matched_as_if_all_were(pair: tuple[IMA, IMA], the_map: TopoMap) -> None:
    exact, coarse = (sensor.observe(view(the_map, 11, 3)) for sensor in pair)
    assert (np.diff(coarse.nodes) > 0).all()
    for name in ("match", "distance", "log_likelihoods", "sigma", "kappa"):
        np.testing.assert_allclose(getattr(coarse, name), getattr(exact, name)[coarse.nodes], atol=1e-4)
    np.testing.assert_allclose(coarse.poses, exact.poses[coarse.nodes], atol=1e-6)
    assert coarse.log_floor == exact.log_floor


@pytest.mark.parametrize(("kind", "config"), KINDS)
@pytest.mark.parametrize(("nodes", "matched"), [(6, 6), (11, 11), (12, 3)])
def test_where_candidates_do_not_pay_all_nodes_are_matched(
    kind: Any, config: Any, the_map: TopoMap, nodes: int, matched: int
) -> None:
    few = replace(the_map, nodes=the_map.nodes[:nodes], edges=None)
    frame = view(the_map, 2, 5)
    every, exact = kind(config(candidates=3)), kind(config())
    for sensor in (every, exact):
        sensor.fit(few)
    seen = every.observe(frame)
    assert len(seen.nodes) == matched
    np.testing.assert_allclose(seen.match, exact.observe(frame).match[seen.nodes], atol=1e-5)


def test_a_panorama_that_was_exchanged_is_found(the_map: TopoMap) -> None:
    sensor, new = IMA(IMAConfig(candidates=3)), circle(1000)
    sensor.fit(the_map)
    changed = replace(the_map, nodes=(replace(the_map.nodes[0], panorama=new), *the_map.nodes[1:]))
    frame = view(changed, 0, 4)
    sensor.replace_panorama(0, new)
    evidence = sensor.observe(frame)
    assert evidence.nodes[evidence.match.argmax()] == 0
    assert evidence.match.max() > 0.8


def test_covered_frames_are_blind(the_map: TopoMap) -> None:
    sensor = IMA(IMAConfig(candidates=3))
    sensor.fit(the_map)
    assert sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": np.zeros((72, 96), np.uint8)})).is_blind


def test_stamps_of_a_view_and_of_its_panorama_are_alike() -> None:
    panorama = circle(3)
    window = grey(cut_views(panorama, 0.0, CAMERA)[6][0])  # 90 degrees on: 54 of 216 columns
    frame, around = frame_stamp(window, CAMERA, 1.0), circle_stamp(panorama, CAMERA, 1.0)
    assert frame.shape == (18, 24) and around.shape == (18, 216)
    place = around[:, 54:78]
    assert np.corrcoef(frame.ravel(), place.ravel())[0, 1] > 0.9


def test_without_zoom_one_set_of_stamps_is_enough(the_map: TopoMap) -> None:
    sensor = IMA(IMAConfig(candidates=3, zoom=1.0))
    sensor.fit(the_map)
    stage = sensor._coarse
    assert isinstance(stage, CoarseStage) and len(stage.references) == 1
    evidence = sensor.observe(view(the_map, 9, 2))
    assert evidence.nodes[evidence.match.argmax()] == 9


def test_a_negative_number_of_candidates_is_refused() -> None:
    with pytest.raises(ValueError, match="candidates is -1; it must be at least 1, or 0 for all nodes"):
        IMAConfig(candidates=-1)


def test_the_setting_is_reached_by_name(the_map: TopoMap) -> None:
    sensor = make(SENSORS, "ima", {"candidates": 4})
    sensor.fit(the_map)
    assert len(sensor.observe(view(the_map, 1, 1)).nodes) == 4
