"""Panoramas from snapshots of a turning robot: steps, places, gaps."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from benchmarks.worlds import Scan, SensorEffects, lab_scene, panorama_of, render_frame
from benchmarks.worlds.lab import LAB_PLACES
from benchmarks.worlds.snapshots import first_column_heading, snapshot_turns, snapshots_of
from topoloc.topo_map import Camera

CAMERA = Camera()
LOOP = np.array([(place.x, place.y) for place in LAB_PLACES])
SEEDS = range(30)
EXACT = Scan(placement_noise_columns=0.0, shake_px=0.0)


def test_snapshot_steps_close_the_circle_without_a_gap() -> None:
    for seed in SEEDS:
        turns = snapshot_turns(np.random.default_rng(seed))
        steps = np.rad2deg(np.diff(np.concatenate([turns, [2.0 * np.pi]])))
        assert len(turns) == 12
        assert steps.max() <= 38.0
        assert steps.min() > 0.0


@pytest.mark.parametrize("short", [10.0, 20.0])
def test_a_turn_that_ends_short_leaves_the_rest_black(short: float) -> None:
    rng = np.random.default_rng(1)
    scan = Scan(step_sd_deg=0.0, short_deg=short, placement_noise_columns=0.0, shake_px=0.0)
    turned = [float(np.rad2deg(angle)) for angle, _ in snapshots_of(lab_scene(1), LOOP[0], CAMERA, rng, scan=scan)]
    step = (360.0 - short) / 12.0
    assert turned == pytest.approx(step * np.arange(12))
    panorama = panorama_of(lab_scene(1), LOOP[0], CAMERA, rng, scan=scan)
    gap = 360.0 - turned[-1] - CAMERA.hfov_deg
    assert (panorama.max(axis=(0, 2)) == 0).mean() * 360.0 == pytest.approx(max(gap, 0.0), abs=0.5)


@pytest.mark.parametrize("node", [0, 3, 6])
def test_a_frame_is_found_in_the_panorama_at_the_column_that_its_heading_gives(node: int) -> None:
    scene, columns = lab_scene(1), CAMERA.panorama_columns()
    none = SensorEffects.none()
    panorama = panorama_of(scene, LOOP[node], CAMERA, np.random.default_rng(2), None, EXACT, none)
    around = cv2.cvtColor(np.concatenate([panorama, panorama[:, : CAMERA.width]], axis=1), cv2.COLOR_RGB2GRAY)
    for heading in np.deg2rad([10.0, 130.0, -160.0]):
        frame = cv2.cvtColor(render_frame(scene, np.array([*LOOP[node], heading]), CAMERA), cv2.COLOR_RGB2GRAY)
        match = cv2.matchTemplate(around, frame, cv2.TM_CCOEFF_NORMED)[0]
        expected = (first_column_heading(CAMERA) - heading) / (2.0 * np.pi) * columns - CAMERA.width / 2.0
        error = (match.argmax() - expected + columns / 2.0) % columns - columns / 2.0
        assert match.max() > 0.8
        assert abs(error) < 12.0  # 1.25 degrees: frames are pasted unwarped


def test_panoramas_have_no_hole_and_placement_noise_moves_snapshots() -> None:
    scene = lab_scene(1)
    one = panorama_of(scene, LOOP[0], CAMERA, np.random.default_rng(2), scan=Scan(placement_noise_columns=0.0))
    other = panorama_of(scene, LOOP[0], CAMERA, np.random.default_rng(2), scan=Scan(placement_noise_columns=0.7))
    assert one.max(axis=(0, 2)).min() > 10
    assert (one != other).any(axis=(0, 2)).mean() > 0.5
    assert (one[:, 150:230] == other[:, 150:230]).all()  # the first snapshot is where it says


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"snapshots": 1}, "snapshots"),
        ({"short_deg": 200.0}, "short_deg"),
        ({"longest_step_deg": 20.0}, "longest_step_deg"),
        ({"step_sd_deg": 200.0}, "step_sd_deg"),
        ({"placement_noise_columns": -1.0}, "placement_noise_columns"),
    ],
)
def test_scans_that_cannot_be_are_refused_by_name(wrong: dict[str, float], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        Scan(**wrong)  # type: ignore[arg-type]
