"""The robust IMA: against a literal loop, what light and covers do to it, and its scale."""

from __future__ import annotations

import math
from functools import partial
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from sensors.ima import IMA
from sensors.images import cut_views
from sensors.local_contrast import local_contrast
from sensors.robust_ima import RobustIMA, RobustIMAConfig
from sensors.slot_correlation import FEW, make_reference
from sensors.slot_matching import Matches, match_frames, sums_within
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame

FLAT = 1.0 / 12.0
SINGLE = 1e-5
"""What single precision leaves of agreement."""


def correlation(one: np.ndarray, other: np.ndarray) -> float:
    """(A.1), 0 for what is flat."""
    a, b = one - one.mean(), other - other.mean()
    if (a**2).sum() < FLAT * a.size or (b**2).sum() < FLAT * b.size:
        return 0.0
    return float((a * b).sum() / math.sqrt((a**2).sum() * (b**2).sum()))


def literal(frame: np.ndarray, circle: np.ndarray, slots: int, slack: int) -> list[float]:
    """The value at every column, slot by slot and shift by shift."""
    width, columns = frame.shape[1] // slots, circle.shape[1]
    values = []
    for column in range(columns):
        total = 0.0
        for n in range(slots):
            slot = frame[:, n * width : (n + 1) * width]
            best = 0.0
            for shift in range(-slack, slack + 1):
                at = [(column + n * width + shift + k) % columns for k in range(width)]
                best = max(best, correlation(slot, circle[:, at]))
            total += best
        values.append(total / slots)
    return values


def loosely(
    frame: np.ndarray, picture: np.ndarray, slots: int, slack: int, circular: bool = True, copies: int = 1
) -> Matches:
    """A frame on one reference, or several that are the same: with more than ``FEW``, Fourier transforms do it."""
    reference = make_reference(np.repeat(picture[None], copies, axis=0), frame.shape[1] // slots, FLAT, circular)
    return match_frames([frame], reference, slots, FLAT, partial(sums_within, slack=slack))[0]


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    slots=st.integers(1, 4),
    slack=st.integers(0, 2),
    copies=st.sampled_from([1, FEW + 1]),
)
def test_agrees_with_a_literal_loop(seed: int, slots: int, slack: int, copies: int) -> None:
    rng = np.random.default_rng(seed)
    circle, frame = rng.normal(100.0, 30.0, (4, 30)), rng.normal(100.0, 30.0, (4, 12))
    frame[:, :5] = circle[:, 7:12]
    found = loosely(frame, circle, slots, slack, copies=copies)
    values = literal(frame, circle, slots, slack)
    assert found.value[0] == pytest.approx(max(values), abs=SINGLE)
    assert values[found.column[0]] == pytest.approx(max(values), abs=SINGLE)


def test_plain_image_has_no_other_end() -> None:
    """A slot that would stick out of a single reference counts as nothing, and cannot come from its other end."""
    rng = np.random.default_rng(0)
    picture = rng.normal(100.0, 30.0, (6, 24))
    moved = np.roll(picture, -6, axis=1)  # the last of its four slots is the picture's first
    found = loosely(moved, picture, 4, 0, circular=False)
    assert found.column[0] == 6
    assert found.value[0] == pytest.approx(0.75)


def test_a_place_seen_again_matches_fully() -> None:
    rng = np.random.default_rng(1)
    circle = rng.normal(100.0, 30.0, (6, 60))
    found = loosely(circle[:, 20:44], circle, 4, 0)
    assert (found.value[0], found.column[0]) == (pytest.approx(1.0), 20)


def test_a_covered_slot_costs_its_share_and_no_more() -> None:
    rng = np.random.default_rng(2)
    circle = rng.normal(100.0, 30.0, (6, 60))
    frame = circle[:, 20:44].copy()
    frame[:, 6:12] = 255.0 - frame[:, 6:12]  # the very opposite
    found = loosely(frame, circle, 4, 0)
    assert (found.value[0], found.column[0]) == (pytest.approx(0.75), 20)


class TestLocalContrast:
    @settings(max_examples=20, deadline=None)
    @given(shift=st.integers(0, 59), seed=st.integers(0, 1000))
    def test_a_circle_has_no_seam(self, shift: int, seed: int) -> None:
        circle = np.random.default_rng(seed).normal(100.0, 30.0, (8, 60))
        turned = local_contrast(np.roll(circle, shift, axis=1), 3.0, 3.0, circular=True)
        np.testing.assert_allclose(turned, np.roll(local_contrast(circle, 3.0, 3.0, True), shift, axis=1), atol=1e-9)

    def test_light_and_shade_count_for_little(self) -> None:
        rng = np.random.default_rng(3)
        picture = rng.normal(100.0, 20.0, (54, 72))
        shaded = (picture - 100.0) * np.linspace(0.4, 1.6, 72) + 100.0 + np.linspace(-60.0, 60.0, 72)
        before, after = (local_contrast(one, 6.0, 3.0, circular=False) for one in (picture, shaded))
        assert correlation(before, after) > 0.97
        assert correlation(picture, shaded) < 0.7

    def test_a_flat_picture_stays_flat(self) -> None:
        assert np.abs(local_contrast(np.full((10, 20), 77.0), 6.0, 3.0, circular=False)).max() < 1e-9


@pytest.fixture(scope="module")
def laboratory() -> LabWorld:
    return LabWorld(WorldSettings(laps=1.0))


def test_half_a_match_is_what_most_wrong_places_stay_below(laboratory: LabWorld) -> None:
    """DESIGN.md, "Values"; measured on other views than those that the scale was made from."""
    topo_map = laboratory.topo_map(5)
    sensor = RobustIMA()
    sensor.fit(topo_map)
    wrong = []
    for own, node in enumerate(topo_map.nodes):
        assert node.panorama is not None
        far = np.linalg.norm(topo_map.positions - topo_map.positions[own], axis=1) > 1.05
        for view, _ in cut_views(node.panorama, node.heading, topo_map.camera)[2::4]:
            evidence = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": view}))
            assert evidence.match[own] > 0.9
            wrong += evidence.match[far].tolist()
    assert 0.90 <= np.mean(np.array(wrong) < 0.5) <= 0.99


def test_twins_and_blank_walls_do_not_decide_on_a_small_map() -> None:
    """Two look-alike nodes of four are more than 5 % of all pairs; blank ones give no correlation at all."""
    rng = np.random.default_rng(4)
    circles = [np.kron(rng.integers(0, 256, (9, 108)), np.ones((8, 8))).astype(np.uint8) for _ in range(3)]
    twins = [*circles, circles[0]]
    blank = [np.full_like(circles[0], 90)] * 4
    matches = {}
    for name, panoramas in (("twins", twins), ("blank", blank)):
        nodes = tuple(Node(f"n{k}", "", 2.0 * k, 0.0, 0.0, one) for k, one in enumerate(panoramas))
        sensor = RobustIMA()
        sensor.fit(TopoMap(name, Camera(40.0, 96, 72), nodes))
        view = circles[1][:, 100:196]
        matches[name] = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": view})).match
    assert matches["twins"][1] > 0.9
    assert matches["blank"].max() < 0.1


def test_a_map_of_one_node_after_another_map() -> None:
    circle = np.kron(np.random.default_rng(5).integers(0, 256, (9, 108)), np.ones((8, 8))).astype(np.uint8)
    one = TopoMap("one", Camera(40.0, 96, 72), (Node("a", "", 0.0, 0.0, 0.0, circle),))
    two = TopoMap("two", one.camera, (*one.nodes, Node("b", "", 2.0, 0.0, 0.0, np.flipud(circle).copy())))
    fresh, used = RobustIMA(), RobustIMA()
    used.fit(two)
    fresh.fit(one)
    used.fit(one)
    frame = Frame(0.0, None, np.zeros(3), {"rgb": np.roll(circle, 3, axis=0)[:, 100:196]})
    np.testing.assert_array_equal(fresh.observe(frame).match, used.observe(frame).match)


@pytest.mark.slow
def test_single_images_name_the_node_more_often_than_the_published_ima() -> None:
    """Same zoom, two days old, with people, seeds 10 to 12 (78 frames): the matching alone makes the difference."""
    names = {"IMA": 0.0, "RobustIMA": 0.0}
    for seed in (10, 11, 12):
        drive = LabWorld(WorldSettings(laps=1.0, age=1.0, people=0.35)).simulate(seed)
        for sensor in (IMA(), RobustIMA(RobustIMAConfig(zoom=1.1, zoom_steps=1, scene_m=0.0))):
            sensor.fit(drive.topo_map)
            for frame, pose in zip(drive.frames, drive.truth, strict=True):
                match = sensor.observe(frame).match
                distance = np.linalg.norm(drive.topo_map.positions - pose[:2], axis=1)
                right = len(match) > 0 and distance[match.argmax()] <= distance.min() + 0.25
                names[type(sensor).__name__] += right / len(drive.frames) / 3.0
    assert names["RobustIMA"] > names["IMA"] + 0.05


@pytest.mark.parametrize(
    "bad",
    [{"slack_columns": -1}, {"slack_columns": 9}, {"contrast_columns": 0.0}, {"contrast_grey": 0.0}, {"zoom_steps": 0}],
)
def test_bad_settings(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        RobustIMAConfig(**bad)
