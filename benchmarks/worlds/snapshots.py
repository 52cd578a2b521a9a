"""Panoramas made as the thesis made them (2.2, 5.1.2): snapshots of a turning robot, pasted side by side."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.light import WHITE_LIGHT, Tint
from benchmarks.worlds.renderer import EYE_M, Scene, Shake, render_frame
from topoloc.geometry import Floats, compose
from topoloc.topo_map import Camera
from topoloc.types import Image

MOST_SNAPSHOTS = 72
THESIS_COLUMNS = 72
"""Placement noise is given in columns of the thesis's scaled frame."""


@dataclass(frozen=True)
class Scan:
    """How the robot turns on the spot for a panorama.

    Attributes:
        snapshots: number of them.
        step_sd_deg: standard deviation of the turn between two snapshots, degrees.
        longest_step_deg: no turn is longer, degrees.
        short_deg: how much the whole turn falls short of a circle, degrees; the thesis saw 10 to 20.
        placement_noise_columns: standard deviation of a snapshot's place in the panorama, columns of 72 a frame.
        shake_px: standard deviation of the horizon from snapshot to snapshot, rows: the robot has just braked.
    """

    snapshots: int = 12
    step_sd_deg: float = 4.0
    longest_step_deg: float = 38.0
    short_deg: float = 0.0
    placement_noise_columns: float = 0.7
    shake_px: float = 2.0

    def __post_init__(self) -> None:
        for name in ("step_sd_deg", "placement_noise_columns", "shake_px"):
            if getattr(self, name) < 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative")
        if not 2 <= self.snapshots <= MOST_SNAPSHOTS:
            raise ValueError(f"snapshots is {self.snapshots}; it must lie between 2 and {MOST_SNAPSHOTS}")
        if not 0.0 <= self.short_deg < 180.0:
            raise ValueError(f"short_deg is {self.short_deg}; it must lie between 0 and 180")
        step = (360.0 - self.short_deg) / self.snapshots
        most = min(step, self.longest_step_deg - step) / 2.0
        if self.step_sd_deg > most:
            raise ValueError(
                f"step_sd_deg is {self.step_sd_deg}; {self.snapshots} steps of about {step:.0f} degrees and at most "
                f"longest_step_deg, {self.longest_step_deg:g}, allow {max(most, 0.0):.1f}"
            )


def first_column_heading(camera: Camera) -> float:
    """Heading of the left edge of a panorama's column 0 [rad]: the first snapshot looks up the map."""
    return float(np.pi / 2.0 + np.deg2rad(camera.hfov_deg) / 2.0)


def snapshot_turns(rng: np.random.Generator, scan: Scan | None = None) -> Floats:
    """Angles (snapshots,) that the robot has turned clockwise at each of them [rad].

    Steps are uneven and add up to what the whole turn comes to.
    """
    scan = scan or Scan()
    whole = 360.0 - scan.short_deg
    while True:  # most draws fit: ``Scan`` sees to that
        steps = rng.normal(whole / scan.snapshots, scan.step_sd_deg, scan.snapshots)
        steps *= whole / steps.sum()
        if steps.min() > 0.0 and steps.max() <= scan.longest_step_deg:
            return np.asarray(np.deg2rad(np.concatenate([[0.0], np.cumsum(steps[:-1])])))


def snapshots_of(
    scene: Scene,
    position: Floats,
    camera: Camera,
    rng: np.random.Generator,
    mount: Floats | None = None,
    scan: Scan | None = None,
    effects: SensorEffects | None = None,
    tint: Tint = WHITE_LIGHT,
) -> Iterator[tuple[float, Image]]:
    """The snapshots of one turn on the spot, in their order.

    Args:
        scene: what there is to see.
        position: (2,) of the robot's axis, which stays on the spot [m].
        camera: of the snapshots.
        rng: varies steps, shake and the sensor's errors.
        mount: (3,) pose of the camera on the robot; None is right on the axis [m, m, rad].
        scan: how the robot turns.
        effects: errors of the sensor; None are the default ones.
        tint: red, green and blue of the light.

    Yields:
        How far the robot has turned clockwise since the first [rad], and the picture (height, width, 3) RGB.
    """
    scan = scan or Scan()
    for turned in snapshot_turns(rng, scan):
        axis = np.array([position[0], position[1], np.pi / 2.0 - turned])
        pose = axis if mount is None else compose(axis, mount)
        frame = render_frame(scene, pose, camera, EYE_M, Shake(down=rng.normal(0.0, scan.shake_px)))
        yield float(turned), sense(frame, effects or SensorEffects(), rng, tint, still=True)


def panorama_of(
    scene: Scene,
    position: Floats,
    camera: Camera,
    rng: np.random.Generator,
    mount: Floats | None = None,
    scan: Scan | None = None,
    effects: SensorEffects | None = None,
    tint: Tint = WHITE_LIGHT,
) -> Image:
    """A full circle of the snapshots of one turn, none warped, each pasted over those before it.

    Args:
        scene: what there is to see.
        position: (2,) of the robot's axis [m].
        camera: of the snapshots.
        rng: varies steps, places, shake and the sensor's errors.
        mount: (3,) pose of the camera on the robot [m, m, rad].
        scan: how the robot turns, and how exactly snapshots are placed.
        effects: errors of the sensor.
        tint: red, green and blue of the light.

    Returns:
        uint8 (rows, camera.panorama_columns(), 3) RGB, columns clockwise, linear in angle; the left edge of column 0
        has heading ``first_column_heading(camera)``. What no snapshot shows, after a turn too short, is black.
    """
    scan = scan or Scan()
    columns = camera.panorama_columns()
    noise = scan.placement_noise_columns * camera.width / THESIS_COLUMNS
    panorama = np.zeros((camera.height, columns, 3), dtype=np.uint8)
    taken = snapshots_of(scene, position, camera, rng, mount, scan, effects, tint)
    for number, (turned, frame) in enumerate(taken):
        left = turned / (2.0 * np.pi) * columns + (rng.normal(0.0, noise) if number else 0.0)
        panorama[:, (round(left) + np.arange(camera.width)) % columns] = frame
    return panorama
