"""Single photographs of a scene, and what IMA makes of one at every node."""

from __future__ import annotations

import numpy as np

from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.renderer import EYE_M, Scene, Shake, render_frame
from sensors.ima import IMA
from topoloc.geometry import Floats
from topoloc.recording import LazyImages
from topoloc.topo_map import Camera
from topoloc.types import Frame, Image


def photograph(
    scene: Scene,
    pose: Floats,
    effects: SensorEffects,
    rng: np.random.Generator,
    shake_px: float = 0.0,
    still: bool = False,
) -> Image:
    """A simulated picture by the thesis's camera.

    Args:
        scene: what there is to see.
        pose: (3,) of the camera [m, m, rad].
        effects: errors of the sensor.
        rng: draws them, and the shake.
        shake_px: standard deviation of the horizon, rows; sideways and in roll it is 0.7 of that.
        still: the camera stands: no motion blur.

    Returns:
        uint8 (rows, cols, 3) RGB.
    """
    down, aside, roll = rng.normal(0.0, shake_px, 3) * (1.0, 0.7, 0.7)
    frame = render_frame(scene, pose, Camera(), EYE_M, Shake(down, aside, roll))
    return sense(frame, effects, rng, still=still)


def node_matches(sensor: IMA, image: Image, mount: Floats) -> tuple[Floats, Floats]:
    """Match (K,) with every node, and the robot's heading (K,) there [rad]."""
    evidence = sensor.observe(Frame(0.0, None, mount, LazyImages({"rgb": lambda: image})))
    order = np.argsort(evidence.nodes)
    return evidence.match[order], evidence.poses[order, 2]
