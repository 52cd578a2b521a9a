"""The sensor with its zoom, but without filter, against the literal transcription run three times a node (4.1.5)."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from oracles.ima_literal import Literal, ima_literal

from sensors.ima import IMA, IMAConfig
from topoloc.geometry import wrap
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Frame

CAMERA = Camera(40.0, 96, 72)
CONFIG = IMAConfig(scale_columns=24, slots=4, clahe=False)
HEADING = 0.4


def smooth_noise(seed: int, rows: int, columns: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return cv2.resize(rng.integers(0, 256, (rows // 6, columns // 6)).astype(np.uint8), (columns, rows))


def circles() -> list[np.ndarray]:
    return [smooth_noise(seed, 72, CAMERA.panorama_columns()) for seed in (1, 2)]


def frames() -> dict[str, np.ndarray]:
    first, second = circles()
    window = first[:, 200:296].copy()
    nearer = cv2.resize(second[4:68, 305:391], (96, 72))  # the middle of a view, as from a place further ahead
    occluded = window.copy()
    occluded[:, 30:60] = 128
    return {
        "as it stands": window,
        "nearer": nearer,
        "occluded": occluded,
        "noise": smooth_noise(9, 72, 96),
        "black half": np.where(np.arange(96) < 48, 0, window).astype(np.uint8),
    }


def literal_of_three(frame: np.ndarray, circle: np.ndarray) -> list[tuple[Literal, int]]:
    """Frame on panorama, zoomed frame on panorama, frame on zoomed panorama: result and columns of the circle."""
    rho = CONFIG.zoom
    out = rho / (2.0 * rho - 1.0)  # (2.8)
    rows, columns, around = 18, 24, CAMERA.panorama_columns(24)
    area = cv2.INTER_AREA
    plain = cv2.resize(frame, (columns, rows), interpolation=area)
    x, y = round(96 * (1 - 1 / rho) / 2), round(72 * (1 - 1 / rho) / 2)
    zoomed = cv2.resize(frame[y : 72 - y, x : 96 - x], (columns, rows), interpolation=area)
    top = round(72 * (1 - out) / 2)
    wide = round(around / out)
    panorama = cv2.resize(circle, (around, rows), interpolation=area)
    closer = cv2.resize(circle[top : 72 - top], (wide, rows), interpolation=area)
    pairs = [(plain, panorama), (zoomed, panorama), (plain, closer)]
    found = [ima_literal(a.astype(float), b.astype(float), CONFIG.slots, CONFIG.flat_variance) for a, b in pairs]
    return list(zip(found, (around, around, wide), strict=True))


@pytest.mark.parametrize("case", frames())
def test_sensor_agrees_with_three_literal_runs_a_node(case: str) -> None:
    nodes = tuple(Node(str(k), str(k), float(k), 0.0, HEADING, circle) for k, circle in enumerate(circles()))
    sensor = IMA(CONFIG)
    sensor.fit(TopoMap("noise", CAMERA, nodes))
    frame = frames()[case]
    evidence = sensor.observe(Frame(0.0, None, np.zeros(3), {"rgb": frame}))
    for k, circle in enumerate(circles()):
        runs = literal_of_three(frame, circle)
        best, around = max(runs, key=lambda run: run[0].max)
        assert evidence.match[k] == pytest.approx(best.max, abs=1e-4)
        sums = np.sort(np.concatenate([run.sums[1:] for run, _ in runs]))
        if sums[-1] - sums[-2] > 1e-4:
            heading = HEADING - (best.col - 1 + 24 / 2) * 2 * np.pi / around
            assert float(wrap(evidence.poses[k, 2] - heading)) == pytest.approx(0.0, abs=1e-9)


def test_zoom_wins_where_it_should() -> None:
    """The frame cut from nearer is found by the zoomed panorama, so the test above does exercise that branch."""
    runs = literal_of_three(frames()["nearer"], circles()[1])
    assert runs[2][0].max > max(runs[0][0].max, runs[1][0].max)
