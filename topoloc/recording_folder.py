"""Writing a recording in the TUM RGB-D layout, a frame at a time; ``Recording.load`` reads it back."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import numpy as np

from topoloc.files import write_image, write_text
from topoloc.geometry import Floats
from topoloc.recording import Mount, write_track
from topoloc.topo_map import Camera
from topoloc.types import Frame


class RecordingWriter:
    """Writes frames as they come; the lists are written by ``close``.

    The camera's mount is written once: a recording with a pan head has a ``pan.txt``, which this does not write.

    Args:
        folder: to write into; made where it does not exist.
        camera: of the frames' main pictures.
    """

    def __init__(self, folder: Path, camera: Camera) -> None:
        self._folder, self._camera = folder, camera
        self._times: list[float] = []
        self._names: list[str] = []
        self._odometry: list[Floats] = []
        self._truth: list[Floats] = []
        self._mount = Mount()

    def add(self, frame: Frame, truth: Floats | None = None) -> None:
        """Write a frame's picture, and keep its odometry and true pose (3,) for the lists."""
        name = f"rgb/{len(self._names):06d}.png"
        write_image(self._folder / name, frame.images["rgb"])
        self._times.append(frame.timestamp)
        self._names.append(name)
        if frame.odometry is not None:
            self._odometry.append(frame.odometry)
        if truth is not None:
            self._truth.append(truth)
        x, y, yaw = (float(value) for value in frame.camera)
        self._mount = Mount(x, y, float(np.rad2deg(yaw)))

    def close(self) -> None:
        """Write ``rgb.txt``, ``odometry.txt``, ``groundtruth.txt`` and ``camera.toml``."""
        import tomli_w

        lines = [f"{time:.6f} {name}" for time, name in zip(self._times, self._names, strict=True)]
        write_text(self._folder / "rgb.txt", "# timestamp path\n" + "\n".join(lines) + "\n")
        for name, poses in (("odometry.txt", self._odometry), ("groundtruth.txt", self._truth)):
            if len(poses) not in (0, len(self._times)):
                raise ValueError(
                    f"{name}: {len(poses)} poses for {len(self._times)} frames; give each frame one, or none"
                )
            if poses:
                write_track(self._folder / name, self._times, np.array(poses))
        table = {**asdict(self._camera), "mount": asdict(self._mount)}
        write_text(self._folder / "camera.toml", tomli_w.dumps(table))
