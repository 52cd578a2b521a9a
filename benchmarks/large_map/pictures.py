"""The pictures of a large map: panoramas rendered at half size and kept at IMA's scale, frames at full size.

IMA filters grey full-size pictures with CLAHE and then scales them to 72 columns a frame. For a panorama both are done
when it is made, so that 10,000 of them take 350 MB; such a map is ``filtered``. What half the size changes is measured
by ``python -m benchmarks.large_map check``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.light import tint_at
from benchmarks.worlds.renderer import Scene
from benchmarks.worlds.snapshots import Scan, panorama_of
from benchmarks.worlds.world import Shot, World, effects_at
from sensors.images import clahe, grey, resize
from topoloc.geometry import Floats, compose, nearest_on_segment
from topoloc.thesis import THESIS
from topoloc.topo_map import Camera
from topoloc.types import Image

RENDERED = Camera(Camera().hfov_deg, 192, 144)
"""What snapshots are rendered with."""
KEPT = Camera(Camera().hfov_deg, THESIS.scale_columns, 54)
"""What panoramas are scaled to: the scale that IMA matches at."""
CLEARANCE_M = 0.25
"""The middle of the robot keeps away from walls and furniture [m]."""
HEAD_M = 1.2
"""What begins above this height is not in the robot's way [m]."""
CANDIDATES = 64
"""Places drawn for a query, of which the first free one is taken."""
ON_NODE_M = 0.05
"""A robot on a node stands at most this far beside it [m]."""
QUERY_SEEDS = 5_000
"""The frames taken in a building have a seed this much above its own: other noise, shake and exposure than the map."""


def panorama(
    world: World, seed: int, place: int, camera: Camera = RENDERED, errors: np.random.Generator | None = None
) -> Image:
    """The filtered panorama of a place as the map keeps it, (54, 648) grey.

    Args:
        world: the building.
        seed: of the building.
        place: index of the place.
        camera: that the snapshots are rendered with; errors of the sensor that are given in pixels become smaller with
            its pictures, as if these were scaled-down full-size ones.
        errors: draws the turns of the robot and the errors of the sensor; None: the seed does.
    """
    scale, moment = camera.width / world.camera.width, world.mapped_at(place)
    taken = panorama_of(
        world.scene(seed, moment),
        world.positions[place],
        camera,
        errors or generator(seed, Stream.MAP, place),
        world.mount,
        replace(Scan(), shake_px=Scan().shake_px * scale),
        _scaled(effects_at(world.config.effects, moment), scale),
        tint_at(moment),
    )
    filtered = clahe(grey(taken), THESIS.clahe_clip_limit, THESIS.clahe_tiles, camera.hfov_deg)
    return resize(filtered, KEPT.panorama_columns(), KEPT.height)


def _scaled(effects: SensorEffects, scale: float) -> SensorEffects:
    """The errors of a full-size picture as they are left in one scaled down by averaging."""
    return replace(
        effects,
        noise_grey=effects.noise_grey * scale,
        blur_px=effects.blur_px * scale,
        motion_blur_px=effects.motion_blur_px * scale,
    )


def half_way(world: World, place: Floats) -> float:
    """Half the distance from a place (2,) of the building to the next one [m]."""
    away = np.linalg.norm(world.positions - place, axis=1)
    return float(np.min(away[away > 0.0])) / 2.0


def query_pose(scene: Scene, place: Floats, reach: float, rng: np.random.Generator) -> Floats:
    """Pose (3,) of the robot at a place or near it: any heading, and clear of what stands about.

    Args:
        scene: the building as it is now.
        place: (2,) in its own frame; where nothing around it is free, the robot stands on it [m].
        reach: how far from it the robot stands at most, equally likely anywhere in that circle [m].
        rng: draws place and heading.
    """
    turned, far = rng.uniform(-np.pi, np.pi, (2, CANDIDATES)), np.sqrt(rng.random(CANDIDATES))
    points = place + reach * far[:, None] * np.column_stack([np.cos(turned[0]), np.sin(turned[0])])
    free = np.flatnonzero(_clearance(scene, points, place, reach) >= CLEARANCE_M)
    position = points[free[0]] if len(free) else place
    return np.array([*position, turned[1, 0]])


def _clearance(scene: Scene, points: Floats, middle: Floats, reach: float) -> Floats:
    """Distance (P,) of points (P, 2), all within ``reach`` of ``middle`` (2,), to what stands about [m]."""
    standing = scene.faces.ends[scene.faces.heights[:, 0] < HEAD_M]
    foot = nearest_on_segment(middle, standing[:, :2], standing[:, 2:])
    near = standing[np.linalg.norm(foot - middle, axis=1) < reach + CLEARANCE_M]
    distances = [np.linalg.norm(nearest_on_segment(points, face[:2], face[2:]) - points, axis=1) for face in near]
    return np.asarray(np.min(distances, axis=0)) if distances else np.full(len(points), np.inf)


def frames(world: World, scene: Scene, seed: int, poses: Floats, numbers: Sequence[int]) -> NDArray[np.uint8]:
    """What the robot sees, (N, height, width) grey, with the usual errors of the sensor while it drives.

    Args:
        world: the building, with what has changed in it.
        scene: the same drawn.
        seed: of the building.
        poses: (N, 3) of the robot's axis, in the building's own frame [m, m, rad].
        numbers: N of the frames, which fix their chances.
    """
    shot = partial(Shot, scene, (), shake_px=world.config.shake_px, covered=False, still=False, seed=seed + QUERY_SEEDS)
    shots = [shot(pose=pose, number=number) for pose, number in zip(compose(poses, world.mount), numbers, strict=True)]
    pictures = [grey(world.readers(one)["rgb"]()) for one in shots]
    return np.array(pictures, dtype=np.uint8).reshape(-1, world.camera.height, world.camera.width)
