"""Incremental zoom (thesis 2.4.3, 6.2): the zoom that matches best tells the distance from the node."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.renderer import EYE_M, render_frame
from benchmarks.worlds.settings import WorldSettings
from sensors.digital_zoom import best_of
from sensors.ima import IMA, IMAConfig
from sensors.slot_matching import Matches
from topoloc.geometry import compose, wrap
from topoloc.types import Frame


@given(peak=st.floats(-0.1, 0.1), height=st.floats(0.5, 1.0), steps=st.integers(1, 4))
def test_a_parabola_is_found_between_the_zooms(peak: float, height: float, steps: int) -> None:
    each_way = 0.24 * np.arange(1, steps + 1) / steps
    advances = np.concatenate([[0.0], np.column_stack([-each_way, each_way]).ravel()])
    found = [
        Matches(np.array([height - (a - peak) ** 2]), np.array([n]), np.array([60]), np.zeros(1))
        for n, a in enumerate(advances)
    ]
    best = best_of(found, advances)
    nearest = int(np.argmin(np.abs(advances - peak)))
    assert best.advance[0] == pytest.approx(peak, abs=1e-9)
    assert best.value[0] == pytest.approx(height - (advances[nearest] - peak) ** 2)


def test_at_the_end_of_the_range_nothing_is_guessed() -> None:
    advances = np.array([0.0, -0.2, 0.2])
    found = [Matches(np.array([v]), np.zeros(1, int), np.array([60]), np.zeros(1)) for v in (0.5, 0.4, 0.9)]
    assert best_of(found, advances).advance[0] == 0.2


def test_zooms_stand_for_equal_displacements() -> None:
    """(2.5) forward, (2.8) for the panorama zoomed in instead: 1 / rho_out = 2 - 1 / rho_in."""
    sensor = IMA(IMAConfig(zoom=1.3, zoom_steps=3))
    references = sensor.reference_zooms()
    assert references[0] == 1.0
    assert references[-1] == pytest.approx(2.0 - 1.0 / 1.3)
    assert np.diff(references) == pytest.approx(np.full(3, (1.0 - 1.0 / 1.3) / 3.0))


@pytest.mark.parametrize("seed", [10, 11])
def test_the_place_off_the_node_is_told_along_the_heading(seed: int) -> None:
    """Sharp frames 0.3 to 0.6 m before and behind the nodes of the simulated laboratory."""
    world = LabWorld(WorldSettings())
    topo_map, scene = world.topo_map(seed), world.scene(seed, WorldSettings().now())
    sensor = IMA(IMAConfig(zoom=1.3, zoom_steps=3, scene_m=2.7))
    sensor.fit(topo_map)
    told, true = [], []
    for number, node in enumerate(topo_map.nodes):
        for heading, ahead in zip(np.linspace(-3.0, 3.0, 6), (-0.6, -0.45, -0.3, 0.3, 0.45, 0.6), strict=True):
            robot = np.array([node.x + ahead * np.cos(heading), node.y + ahead * np.sin(heading), heading])
            picture = render_frame(scene, compose(robot, world.mount), topo_map.camera, EYE_M)
            seen = sensor.observe(Frame(0.0, None, world.mount, {"rgb": picture})).of_robot(world.mount)
            if abs(wrap(seen.poses[number, 2] - heading)) < 0.2:
                told.append((seen.poses[number, :2] - topo_map.positions[number]) @ [np.cos(heading), np.sin(heading)])
                true.append(ahead)
    assert len(told) >= 40
    off = np.array(told) - np.array(true)
    assert np.corrcoef(told, true)[0, 1] > 0.85
    assert np.median(np.abs(off)) < 0.2


def test_without_a_scene_the_hypotheses_stay_on_the_nodes() -> None:
    world = LabWorld(WorldSettings(laps=1.0))
    topo_map = world.topo_map(10)
    sensor = IMA()
    sensor.fit(topo_map)
    frame = world.film(10)[0][3]
    seen = sensor.observe(frame).of_robot(frame.camera)
    np.testing.assert_allclose(seen.poses[:, :2], topo_map.positions[seen.nodes], atol=1e-12)


@pytest.mark.parametrize("bad", [{"zoom_steps": 0}, {"scene_m": -1.0}])
def test_bad_settings(bad: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(bad))):
        IMAConfig(**bad)
