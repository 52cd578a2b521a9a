"""Writing a recording in the TUM RGB-D layout, a frame at a time; ``Recording.load`` reads it back."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from topoloc.files import write_image, write_text
from topoloc.geometry import Floats, wrap
from topoloc.recording import KINDS, write_track
from topoloc.rig_file import Mount, Rig, write_rig
from topoloc.topo_map import Camera
from topoloc.types import Frame, Pixels

STILL = 1e-6
"""A camera that moved less on the robot has not moved [m, rad]."""


class RecordingWriter:
    """Writes frames as they come, keeping none of their pictures; the lists are written by ``close``.

    The mount in ``camera.toml`` is the first frame's camera pose. Where later frames look another way, the camera is
    on a pan head, and ``pan.txt`` tells how far it turned since the first frame.

    Args:
        folder: to write into; made where it does not exist.
        camera: of the frames' main pictures; where these are panoramas, the camera that gives their scale.
        baseline_m: distance of the right camera from the main one, to its right [m]; None: not told.
        panorama: the ``omni`` pictures are unwrapped, see ``Recording``.
    """

    def __init__(self, folder: Path, camera: Camera, baseline_m: float | None = None, panorama: bool = False) -> None:
        if baseline_m is not None and not baseline_m > 0.0:
            raise ValueError(f"baseline_m is {baseline_m}; it must be above 0")
        self._folder, self._camera = folder, camera
        self._baseline_m, self._panorama = baseline_m, panorama
        self._kinds: tuple[str, ...] = ()
        self._times: list[float] = []
        self._cameras: list[Floats] = []
        self._odometry: list[Floats] = []
        self._truth: list[Floats] = []

    def add(self, frame: Frame, truth: Floats | None = None) -> None:
        """Write a frame's pictures, and keep its odometry and true pose (3,) for the lists.

        Raises:
            ValueError: the pictures are not of the first frame's kinds, the camera moved on the robot, or the time
                does not follow that of the frame before.
        """
        if not self._times:
            self._kinds = _kinds_of(frame)
        elif set(frame.images) != set(self._kinds):
            raise ValueError(f"a frame has {sorted(frame.images)}, the first {sorted(self._kinds)}; give all the same")
        elif np.abs(frame.camera[:2] - self._cameras[0][:2]).max() > STILL:
            raise ValueError("the camera moved on the robot; a pan head turns it about its own axis")
        elif round(frame.timestamp, 6) <= round(self._times[-1], 6):
            raise ValueError(f"time {frame.timestamp:.6f} does not follow {self._times[-1]:.6f}; add frames in time")
        images = {kind: frame.images[kind] for kind in self._kinds}
        for kind, image in images.items():
            _check_pixels(image, kind)
        for kind, image in images.items():
            write_image(self._folder / _picture_name(kind, len(self._times)), image)
        self._times.append(frame.timestamp)
        self._cameras.append(frame.camera)
        if frame.odometry is not None:
            self._odometry.append(frame.odometry)
        if truth is not None:
            self._truth.append(truth)

    def close(self) -> None:
        """Write the lists of pictures and poses, ``camera.toml`` and, for a camera that turned, ``pan.txt``.

        Raises:
            ValueError: no frame was added, or only some of them had odometry or a true pose.
        """
        if not self._times:
            raise ValueError("a recording needs a frame; add one before closing")
        for kind in self._kinds:
            names = [_picture_name(kind, i) for i in range(len(self._times))]
            self._write_list(f"{kind}.txt", "path", names)
        for name, poses in (("odometry.txt", self._odometry), ("groundtruth.txt", self._truth)):
            if len(poses) not in (0, len(self._times)):
                raise ValueError(
                    f"{name}: {len(poses)} poses for {len(self._times)} frames; give each frame one, or none"
                )
            if poses:
                write_track(self._folder / name, self._times, np.array(poses))
        pan = wrap(np.array(self._cameras)[:, 2] - self._cameras[0][2])
        if np.abs(pan).max() > STILL:
            self._write_list("pan.txt", "degrees", [f"{degrees:.9f}" for degrees in np.rad2deg(pan)])
        self._write_camera()

    def _write_list(self, name: str, column: str, values: list[str]) -> None:
        """Write a file of 'timestamp value' lines, one a frame."""
        lines = [f"{time:.6f} {value}" for time, value in zip(self._times, values, strict=True)]
        write_text(self._folder / name, "\n".join([f"# timestamp {column}", *lines, ""]))

    def _write_camera(self) -> None:
        x, y, yaw = (float(value) for value in self._cameras[0])
        mount = Mount(x, y, float(np.rad2deg(yaw)))
        write_rig(self._folder / "camera.toml", Rig(self._camera, mount, self._baseline_m, self._panorama))


def _kinds_of(frame: Frame) -> tuple[str, ...]:
    """The kinds of pictures in a frame; one of them is a main one."""
    kinds = tuple(frame.images)
    if not set(kinds) <= set(KINDS) or not {"rgb", "omni"} & set(kinds):
        raise ValueError(f"a frame has pictures of {sorted(kinds)}; give rgb or omni, and beside it right or depth")
    return kinds


def _picture_name(kind: str, index: int) -> str:
    return f"{kind}/{index:06d}.png"


def _check_pixels(image: Pixels, kind: str) -> None:
    """Raise ``ValueError`` for pixels that would not be read back as they are."""
    wanted = np.uint16 if kind == "depth" else np.uint8
    if image.dtype != wanted or (kind == "depth" and image.ndim != 2):
        shape = "(rows, cols)" if kind == "depth" else "(rows, cols[, 3])"
        raise ValueError(f"a picture of {kind} is {image.dtype} {image.shape}; it must be {wanted.__name__} {shape}")
