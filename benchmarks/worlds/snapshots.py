"""Panoramas made as the thesis made them (2.2, 5.1.2): snapshots of a turning robot, pasted side by side."""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.renderer import EYE_M, Scene, Shake, render_frame
from topoloc.geometry import Floats, compose
from topoloc.topo_map import Camera
from topoloc.types import Image

SNAPSHOTS = 12
STEP_DEG, STEP_SD_DEG, LONGEST_STEP_DEG = 30.0, 4.0, 38.0
THESIS_COLUMNS = 72
"""Placement noise is given in columns of the thesis's scaled frame."""


def first_column_heading(camera: Camera) -> float:
    """Heading of the left edge of a panorama's column 0 [rad]: the first snapshot looks up the map."""
    return float(np.pi / 2.0 + np.deg2rad(camera.hfov_deg) / 2.0)


def snapshot_turns(rng: np.random.Generator) -> Floats:
    """Angles (12,) that the robot has turned clockwise at each snapshot [rad]: uneven steps that close the circle."""
    while True:
        steps = rng.normal(STEP_DEG, STEP_SD_DEG, SNAPSHOTS)
        steps *= 360.0 / steps.sum()
        if steps.max() <= LONGEST_STEP_DEG:
            return np.asarray(np.deg2rad(np.concatenate([[0.0], np.cumsum(steps[:-1])])))


def panorama_of(
    scene: Scene,
    position: Floats,
    camera: Camera,
    rng: np.random.Generator,
    mount: Floats | None = None,
    placement_noise_columns: float = 0.7,
    effects: SensorEffects | None = None,
    shake_px: float = 0.0,
) -> Image:
    """A full circle of 12 pin-hole snapshots, none warped, each pasted over those before it.

    Args:
        scene: what there is to see.
        position: (2,) of the robot's axis, which stays on the spot [m].
        camera: of the snapshots.
        rng: varies steps, placement and the sensor's errors.
        mount: (3,) pose of the camera on the robot; None is right on the axis [m, m, rad].
        placement_noise_columns: standard deviation of a snapshot's place, in columns of 72 a frame; the first has none.
        effects: errors of the sensor; None are the default ones.
        shake_px: standard deviation of the rows that the horizon moves from snapshot to snapshot, pixels.

    Returns:
        uint8 (rows, camera.panorama_columns(), 3) RGB, columns clockwise, linear in angle; the left edge of column 0
        has heading ``first_column_heading(camera)``.
    """
    columns = camera.panorama_columns()
    noise = placement_noise_columns * camera.width / THESIS_COLUMNS
    panorama = np.zeros((camera.height, columns, 3), dtype=np.uint8)
    for number, turned in enumerate(snapshot_turns(rng)):
        axis = np.array([position[0], position[1], np.pi / 2.0 - turned])
        pose = axis if mount is None else compose(axis, mount)
        shake = Shake(down=rng.normal(0.0, shake_px))
        frame = sense(render_frame(scene, pose, camera, EYE_M, shake), effects or SensorEffects(), rng)
        left = turned / (2.0 * np.pi) * columns + (rng.normal(0.0, noise) if number else 0.0)
        panorama[:, (round(left) + np.arange(camera.width)) % columns] = frame
    return panorama
