"""A drawn room, and recordings of a robot that turns and drives in it (simulated)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from topoloc.camera.level import View
from topoloc.geometry import between, compose
from topoloc.recording import Recording
from topoloc.recording_folder import RecordingWriter
from topoloc.topo_map import Camera
from topoloc.types import Frame, Image

WALLS = np.array([[-3.0, -2.5, 0.0], [3.5, 2.5, 2.6]])
"""Two opposite corners of the room [m]."""
EYE_M = 1.1
TEXELS_PER_M = 100.0


class Room:
    """A box whose six sides are covered with spots of many sizes."""

    def __init__(self, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self._sides = np.stack([_spots(rng) for _ in range(6)])

    def picture(self, pose: np.ndarray, camera: Camera, pitch: float = 0.0) -> Image:
        """What a camera at a pose (3,) sees that looks down by pitch [rad]."""
        x, y = np.meshgrid(np.arange(camera.width) + 0.5, np.arange(camera.height) + 0.5)
        places = np.stack([x - camera.width / 2, y - camera.height / 2], axis=-1).reshape(-1, 2) / (camera.width / 2)
        right, down, ahead = View(View.of(camera.hfov_deg).focal, pitch).rays(places).T
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        rays = np.column_stack([cos * ahead + sin * right, sin * ahead - cos * right, -down])
        eye = np.array([pose[0], pose[1], EYE_M])
        reach = (np.where(rays > 0.0, WALLS[1], WALLS[0]) - eye) / rays
        axis = reach.argmin(axis=1)
        hit = eye + reach.min(axis=1)[:, None] * rays - WALLS[0]
        side = 2 * axis + (np.take_along_axis(rays, axis[:, None], axis=1)[:, 0] > 0.0)
        across = np.where(axis == 0, hit[:, 1], hit[:, 0]) * TEXELS_PER_M
        along = np.where(axis == 2, hit[:, 1], hit[:, 2]) * TEXELS_PER_M
        grey = self._sides[side, along.astype(int), across.astype(int)].reshape(camera.height, camera.width)
        return np.repeat(cv2.GaussianBlur(grey, (0, 0), 0.7)[:, :, None], 3, axis=2)


def _spots(rng: np.random.Generator) -> np.ndarray:
    """A grey picture (660, 660)."""
    layers = [cv2.resize(rng.normal(size=(n, n)), (660, 660), interpolation=cv2.INTER_CUBIC) for n in (12, 40, 100)]
    return np.asarray((128.0 + 50.0 * np.sum(layers, axis=0)).clip(0, 255).astype(np.uint8))


Film = Callable[..., Recording]


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Film:
    """Makes a recording of poses (N, 3) in the room."""

    def made(
        poses: np.ndarray,
        camera: Camera,
        mount: tuple[float, float, float] = (0.0, 0.0, 0.0),
        told: tuple[float, float, float] | None = None,
        scale: float = 1.0,
        pitch: float = 0.0,
        odometry: bool = True,
        seed: int = 300,
    ) -> Recording:
        folder, room = tmp_path_factory.mktemp("film") / "recording", Room(seed)
        writer = RecordingWriter(folder, camera)
        odometer = np.array([4.0, -1.0, 2.0])
        for number, pose in enumerate(poses):
            if number:
                odometer = compose(odometer, between(poses[number - 1], pose) * (1.0, 1.0, scale))
            picture = room.picture(compose(pose, mount), camera, pitch)
            place = np.array(mount if told is None else told)
            writer.add(Frame(0.5 * number, odometer if odometry else None, place, {"rgb": picture}), pose)
        writer.close()
        return Recording.load(folder)

    return made


def turn(start: float, step_deg: float, frames: int, place: tuple[float, float] = (0.3, 0.1)) -> np.ndarray:
    """Poses (frames, 3) of a turn on the spot."""
    headings = start + np.deg2rad(step_deg) * np.arange(frames)
    return np.column_stack([np.tile(place, (frames, 1)), headings])


@pytest.fixture(scope="session")
def circle(film: Film, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of a recording that turns by 370 degrees, its odometer 3 % short; the camera sees 62 degrees."""
    return film(turn(0.4, 18.5, 21), Camera(62.0, 256, 192), scale=0.97).folder


@pytest.fixture(scope="session")
def straight(film: Film) -> Path:
    """Folder of a recording that drives 2 m straight; the camera looks 35 degrees to the right and 8 down."""
    way = 0.2 * np.arange(11)
    poses = np.column_stack([-2.0 + way, np.full(11, -0.4), np.zeros(11)])
    mount = (0.1, 0.0, float(np.deg2rad(-35.0)))
    return film(poses, Camera(62.0, 256, 192), mount, told=(0.1, 0.0, 0.0), pitch=np.deg2rad(8.0)).folder
