"""IMA's answer slot by slot: it adds up to the match, lies in order where the heading says, and is Code 2.1 and 2.2."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from oracles.ima_literal import ima_literal, ncc

from sensors.ima import IMA, IMAConfig
from sensors.images import crop_centre, cut_views, resize
from sensors.local_contrast import local_contrast
from sensors.robust_ima import RobustIMA, RobustIMAConfig
from topoloc.geometry import wrap
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame, Image

CAMERA = Camera(40.0, 96, 72)
NODES = [0, 1, 2]
FLAT = IMAConfig().flat_variance
SINGLE, HALF = 1e-6, 1e-3
"""What single precision, and local contrast kept in half precision, leave of agreement."""
CLOSER, FARTHER = 1.1, 1.0 / 1.1
SENSORS: dict[str, Callable[[], IMA]] = {"ima": IMA, "ima-robust": RobustIMA}


def circle(seed: int, rows: int = 9, columns: int = 108, scale: int = 8) -> Image:
    blocks = np.random.default_rng(seed).integers(0, 256, (rows, columns)).astype(np.uint8)
    return np.kron(blocks, np.ones((scale, scale), dtype=np.uint8))


@pytest.fixture(scope="module")
def noise() -> TopoMap:
    """Three nodes of coarse noise, their first columns towards different headings."""
    nodes = (Node(f"n{k}", f"node {k}", float(k), 0.0, 0.7 + 2.0 * k, circle(k)) for k in NODES)
    return TopoMap("noise", CAMERA, tuple(nodes))


@pytest.fixture(scope="module")
def fitted(noise: TopoMap) -> dict[str, IMA]:
    made = {name: make() for name, make in SENSORS.items()}
    for sensor in made.values():
        sensor.fit(noise)
    return made


def view(topo_map: TopoMap, node: int, number: int, nearness: float = 1.0) -> Image:
    """A view cut from a node's panorama, as from nearer to what is seen, or from farther off."""
    panorama = topo_map.nodes[node].panorama
    assert panorama is not None
    if nearness >= 1.0:
        window = cut_views(panorama, 0.0, CAMERA)[number][0]
        return resize(crop_centre(window, 1.0 / nearness, 1.0 / nearness), CAMERA.width, CAMERA.height)
    width, height = round(CAMERA.width / nearness), round(CAMERA.height / nearness)
    left = round(number * panorama.shape[1] / 24) - (width - CAMERA.width) // 2
    window = panorama[:, np.arange(left, left + width) % panorama.shape[1]]
    margin = (height - CAMERA.height) // 2
    return resize(np.pad(window, ((margin, margin), (0, 0)), mode="reflect"), CAMERA.width, CAMERA.height)


def covered(image: Image) -> Image:
    """With a person before its right third."""
    spoilt = image.copy()
    spoilt[:, 2 * image.shape[1] // 3 :] = circle(99)[: image.shape[0], : image.shape[1] - 2 * image.shape[1] // 3]
    return spoilt


def pictures(topo_map: TopoMap) -> list[Image]:
    """Plain, across the ends of the panorama, from nearer, from farther off, partly covered, and of nowhere."""
    return [
        view(topo_map, 0, 3),
        view(topo_map, 1, 23),
        view(topo_map, 2, 7, CLOSER),
        view(topo_map, 0, 12, FARTHER),
        covered(view(topo_map, 1, 5)),
        circle(7)[:72, :96],
    ]


def total(sensor: IMA, value: np.ndarray, counted: np.ndarray) -> float:
    """What the slots that count add up to, as each sensor has it, over all slots."""
    if isinstance(sensor, RobustIMA):
        assert np.array_equal(counted, value > 0.5)
        return float(np.maximum(2.0 * value - 1.0, 0.0).sum() / len(value))
    return float((value * counted).sum() / len(value))


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("picture", range(6))
def test_the_slots_that_count_give_the_match(name: str, picture: int, noise: TopoMap, fitted: dict[str, IMA]) -> None:
    sensor, image = fitted[name], pictures(noise)[picture]
    match = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": image})).match
    for node, slots in zip(NODES, sensor.slots(image, NODES), strict=True):
        value = total(sensor, slots.value, slots.counted)
        assert slots.match == pytest.approx(match[node], abs=SINGLE)
        assert float(sensor._likeness(np.array([value]))[0]) == pytest.approx(match[node], abs=SINGLE)
        assert len(slots.value) == len(slots.left) == len(slots.counted) == 8


@pytest.mark.parametrize("name", SENSORS)
@pytest.mark.parametrize("picture", range(6))
def test_they_lie_in_order_from_where_the_heading_says(
    name: str, picture: int, noise: TopoMap, fitted: dict[str, IMA]
) -> None:
    """(2.2), of the middle of the window; slots of the robust sensor may give way by a column each."""
    sensor, image = fitted[name], pictures(noise)[picture]
    evidence = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": image}))
    slack = sensor.config.slack_columns if isinstance(sensor.config, RobustIMAConfig) else 0
    for node, slots in zip(NODES, sensor.slots(image, NODES), strict=True):
        column = slots.width / (sensor.config.scale_columns // sensor.config.slots)
        steps = np.mod(np.diff(slots.left) + 0.5, 1.0) - 0.5
        assert np.abs(steps - slots.width).max() <= 2 * slack * column + 1e-12
        middle = slots.left[0] + sensor.config.scale_columns / 2.0 * column
        turned = wrap(noise.nodes[node].heading - 2.0 * np.pi * middle - evidence.poses[node, 2])
        assert abs(turned) <= 2.0 * np.pi * slack * column + 1e-9
        assert ((slots.left >= 0.0) & (slots.left < 1.0)).all()


def test_both_ways_of_zooming_are_met(noise: TopoMap, fitted: dict[str, IMA]) -> None:
    """Or the laws above would not hold for them: from nearer the panorama is zoomed in, from farther off the frame."""
    plain, ima = IMA(IMAConfig(zoom=1.0)), fitted["ima"]
    plain.fit(noise)
    for number, node, wider in ((2, 2, True), (3, 0, False)):
        image = pictures(noise)[number]
        with_zoom, without = ima.slots(image, [node])[0], plain.slots(image, [node])[0]
        assert with_zoom.match > without.match
        assert (with_zoom.width < without.width) == wider


def test_what_is_covered_counts_less(noise: TopoMap, fitted: dict[str, IMA]) -> None:
    image = view(noise, 1, 5)
    for sensor in fitted.values():
        whole, partly = (sensor.slots(picture, [1])[0] for picture in (image, covered(image)))
        assert whole.value.min() > 0.99
        assert partly.value[:5].min() > 0.8
        assert partly.value[6:].max() < 0.7


def test_nodes_come_in_the_order_asked_for(noise: TopoMap, fitted: dict[str, IMA]) -> None:
    image = view(noise, 0, 3)
    for sensor in fitted.values():
        forwards, backwards = sensor.slots(image, [0, 2]), sensor.slots(image, [2, 0])
        assert [one.match for one in forwards] == [one.match for one in reversed(backwards)]
        assert forwards[0].match > 0.9 > forwards[1].match
        assert sensor.slots(image, []) == []


def small_case(seed: int) -> tuple[Image, Image]:
    """A panorama, and a noisy view of it, of sizes that are matched as they stand."""
    rng = np.random.default_rng(seed)
    panorama = rng.integers(0, 256, (18, 96)).astype(np.uint8)
    window = panorama[:, (int(rng.integers(0, 96)) + np.arange(24)) % 96]
    return panorama, np.clip(window + rng.normal(0.0, 60.0, (18, 24)), 0, 255).astype(np.uint8)


def small_map(panorama: Image) -> TopoMap:
    return TopoMap("small", Camera(90.0, 24, 18), (Node("a", "a", 0.0, 0.0, 0.0, panorama),))


@pytest.mark.parametrize("seed", range(4))
def test_they_are_those_of_code_2_1_and_2_2(seed: int) -> None:
    """Against the literal transcription, for pictures that are neither scaled, filtered nor zoomed."""
    sensor = IMA(IMAConfig(scale_columns=24, slots=4, zoom=1.0, clahe=False))
    panorama, image = small_case(seed)
    sensor.fit(small_map(panorama))
    found, literal = sensor.slots(image, [0])[0], ima_literal(image, panorama, 4, FLAT)
    places = [(literal.col - 1 + 6 * n) % 96 for n in range(4)]
    assert np.rint(found.left * 96).astype(int).tolist() == places
    assert found.width == pytest.approx(6 / 96)
    assert found.match == pytest.approx(literal.max, abs=SINGLE)
    for n, place in enumerate(places):
        alone = ncc(panorama, image[:, 6 * n : 6 * (n + 1)], FLAT, True)
        assert found.value[n] == pytest.approx(alone[place + 1], abs=SINGLE)
        assert bool(found.counted[n]) == (literal.match_slot[place + 1] == n + 1)


@pytest.mark.parametrize("seed", range(4))
def test_a_slot_that_gives_way_has_its_value_where_it_went(seed: int) -> None:
    """And nowhere within the slack a better one."""
    config = RobustIMAConfig(scale_columns=24, slots=4, zoom=1.0, clahe=False, slack_columns=2)
    sensor = RobustIMA(config)
    panorama, image = small_case(seed)
    sensor.fit(small_map(panorama))
    found = sensor.slots(image, [0])[0]
    frame = local_contrast(image.astype(np.float64), config.contrast_columns, config.contrast_grey, False)
    values = [ncc(sensor.prepared(0)[0].pixels[0], frame[:, 6 * n : 6 * (n + 1)], FLAT, True)[1:] for n in range(4)]
    places = np.rint(found.left * 96).astype(int)
    np.testing.assert_allclose(found.value, [values[n][place] for n, place in enumerate(places)], atol=HALF)
    column = int(sensor.find(image, sensor.prepared(0)).column[0])
    for n, place in enumerate(places):
        reach = [(column + 6 * n + shift) % 96 for shift in range(-2, 3)]
        assert place in reach
        assert found.value[n] == pytest.approx(max(values[n][one] for one in reach), abs=HALF)
