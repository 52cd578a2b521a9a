"""People who walk about and stand before the camera (thesis 5.2.4)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter
from scipy.special import ndtri

from benchmarks.worlds.builders import world_atlas
from benchmarks.worlds.renderer import Faces, Scene
from topoloc.geometry import Floats, compose

LINGER = 0.7
"""Correlation of people's presence from one frame to the next."""
WHOLE_VIEW, COMPANY = 0.1, 0.2
"""Share of the stays that cover the whole view, and of those that two people share."""
STANDS = 0.5
"""Share of the stays in which the person stands where he is; the others walk along."""
NEAR_M, FAR_M, COVERING_M = 1.3, 2.5, 0.45
"""Distances of people from the camera [m]."""
ROOM_M = 0.35
"""From the middle of a person to the nearest thing behind [m]."""


def person(seed: int, at: Floats, facing: float, variant: int) -> Faces:
    """Someone 1.75 m tall and 0.45 m wide who stands at ``at`` (2,) [m], turned to ``facing`` [rad]."""
    _, index = world_atlas(seed)
    parts = ((0.36, 0.0, 0.85, "trousers"), (0.45, 0.85, 1.45, "shirt"), (0.19, 1.45, 1.75, "head"))
    angles = facing + np.arange(9) * np.pi / 4.0
    ring = np.column_stack([np.cos(angles), np.sin(angles)]) / 2.0
    circles = [np.asarray(at) + width * ring for width, *_ in parts]
    heights = [np.tile((low, high), (8, 1)) for _, low, high, _ in parts]
    texture = [np.full(8, index[kind][variant % len(index[kind])]) for *_, kind in parts]
    shade = np.tile(0.85 + 0.25 * np.cos(angles[:-1] - np.deg2rad(50.0)), len(parts))
    count = len(shade)
    return Faces(
        np.concatenate([np.concatenate([circle[:-1], circle[1:]], axis=1) for circle in circles]),
        np.concatenate(heights),
        np.concatenate(texture),
        np.full(count, 1.0 / 8.0),
        np.tile(np.arange(8) / 8.0, len(parts)),
        np.repeat(shade[:, None], 4, axis=1),
    )


def present(share: float, frames: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """In which frames (N,) something is there: a share that is exact in the mean, in stays of some frames."""
    draws = rng.standard_normal(frames)
    fresh = np.sqrt(1.0 - LINGER**2) * draws
    fresh[0] = draws[0]
    wish = lfilter([1.0], [1.0, -LINGER], fresh)  # a standard normal at every frame
    return np.asarray(wish < ndtri(share))


class Passer:
    """Somebody during one stay: stands, or walks along with the robot.

    Args:
        seed: of the textures.
        half_view: half the field of view [rad]; pi for a full circle.
        rng: draws who it is and how he behaves.
    """

    def __init__(self, seed: int, half_view: float, rng: np.random.Generator) -> None:
        self._seed, self._half_view, self._rng = seed, half_view, rng
        self._variant = int(rng.integers(8))
        self._covers = bool(rng.random() < WHOLE_VIEW)
        self._stands = not self._covers and bool(rng.random() < STANDS)
        self._distance = COVERING_M if self._covers else float(rng.uniform(NEAR_M, FAR_M))
        self._at: Floats | None = None

    def seen_from(self, camera: Floats, faces: Faces) -> Faces:
        """Where he is at the next frame, in view of the camera's pose (3,), before the things that stand about."""
        if self._at is None or not (self._stands and self._in_view(camera)):
            reach = 0.3 if self._covers else 0.85
            bearing = float(self._rng.uniform(-reach, reach)) * self._half_view
            free = clear_distance(faces, camera[:2], camera[2] + bearing) - ROOM_M
            distance = max(min(self._distance, free), COVERING_M)
            self._at = np.asarray(compose(camera, (distance * np.cos(bearing), distance * np.sin(bearing), 0.0))[:2])
        return person(self._seed, self._at, float(self._rng.uniform(-np.pi, np.pi)), self._variant)

    def _in_view(self, camera: Floats) -> bool:
        assert self._at is not None
        ahead = self._at - camera[:2]
        bearing = np.arctan2(ahead[1], ahead[0]) - camera[2]
        off = abs((bearing + np.pi) % (2.0 * np.pi) - np.pi)
        return bool(off < 0.9 * self._half_view and np.hypot(*ahead) > COVERING_M)


def crowd(
    share: float, cameras: Floats, scene: Scene, half_view: float, seed: int, rng: np.random.Generator
) -> list[Sequence[Faces]]:
    """Who is before the camera in each frame.

    Args:
        share: of the frames with someone in view, 0 to 1.
        cameras: (N, 3) poses of the camera [m, m, rad].
        scene: what stands about.
        half_view: half the field of view [rad]; pi for a full circle.
        seed: of the textures.
        rng: draws the stays and the people.
    """
    frames: list[Sequence[Faces]] = []
    passers: list[Passer] = []
    presence, manners = rng.spawn(2)
    for there, camera in zip(present(share, len(cameras), presence), cameras, strict=True):
        leaves = manners.random() > LINGER  # others take over, or a crowd would be one man all day
        if there and (leaves or not passers):
            passers = [Passer(seed, half_view, manners) for _ in range(1 + int(manners.random() < COMPANY))]
        elif not there:
            passers = []
        frames.append([passer.seen_from(camera, scene.faces) for passer in passers])
    return frames


def clear_distance(faces: Faces, position: Floats, direction: float) -> float:
    """How far one sees from ``position`` (2,) in a direction [rad] before something between knee and eye [m]."""
    ray = np.array([np.cos(direction), np.sin(direction)])
    standing = (faces.heights[:, 0] < 1.1) & (faces.heights[:, 1] > 0.3)
    start, along = faces.ends[standing, :2] - position, faces.ends[standing, 2:] - faces.ends[standing, :2]
    cross = ray[0] * along[:, 1] - ray[1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # a face along the ray is never met: infinity is meant
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / cross
        share = (start[:, 0] * ray[1] - start[:, 1] * ray[0]) / cross
    met = (distance > 0.0) & (share >= 0.0) & (share <= 1.0)
    return float(distance[met].min(initial=np.inf))
