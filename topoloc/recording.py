"""A recording: a folder in the TUM RGB-D layout -> frames, read one at a time as they are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from topoloc.errors import InputError
from topoloc.files import read_depth, read_image, read_text, write_text
from topoloc.geometry import Floats, compose, inverse, wrap
from topoloc.lens import Lens
from topoloc.rig_file import Mount, TruthOf, read_rig
from topoloc.topo_map import Camera
from topoloc.types import Frame, Image, Pixels

KINDS = ("rgb", "omni", "right", "depth")
MAX_OFFSET_S = 0.05
"""Pictures of different kinds belong to one frame when their times differ by at most this [s]."""
OPTICAL_DOWN = 0.7
"""Poses are of a camera's optical frame, not of a robot, where its y axis points down at least so far (cosine)."""


class LazyImages(Mapping[str, Pixels]):
    """Images by kind that are read, once, when they are asked for."""

    def __init__(self, readers: Mapping[str, Callable[[], Pixels]]) -> None:
        self._readers = dict(readers)
        self._images: dict[str, Pixels] = {}

    def __getitem__(self, kind: str) -> Pixels:
        if kind not in self._images:
            self._images[kind] = self._readers[kind]()
        return self._images[kind]

    def forget(self) -> None:
        """Let go of what was read; it is read again when asked for again."""
        self._images.clear()

    def __contains__(self, kind: object) -> bool:
        return kind in self._readers

    def __iter__(self) -> Iterator[str]:
        return iter(self._readers)

    def __len__(self) -> int:
        return len(self._readers)


@dataclass(frozen=True)
class Track:
    """Poses over time: times (N,) [s], increasing; poses (N, 3)."""

    times: Floats
    poses: Floats

    def at(self, time: float) -> Floats:
        """The pose (3,) at a time, interpolated; before the first and after the last reading it stands still."""
        x, y = (float(np.interp(time, self.times, self.poses[:, i])) for i in (0, 1))
        heading = float(np.interp(time, self.times, self._unwrapped))
        return np.array([x, y, float(wrap(heading))])

    @cached_property
    def _unwrapped(self) -> Floats:
        return np.asarray(np.unwrap(self.poses[:, 2]))


@dataclass(frozen=True)
class Picture:
    """One line of ``rgb.txt`` and the like: when, which file, and on which line it stands."""

    time: float
    path: Path
    line: int


@dataclass(frozen=True)
class Recording:
    """What a robot recorded; iterating gives its frames in time.

    Attributes:
        folder: where it lies.
        kind: of its main pictures, ``rgb`` or ``omni``.
        pictures: by kind; the first entry of each frame is the main kind's.
        camera: of the main pictures, or None where ``camera.toml`` does not tell.
        mount: pose of the camera on the robot without pan.
        baseline_m: distance of the right camera from the main one, to its right [m], or None where it is not told.
        panorama: the ``omni`` pictures are unwrapped: a full circle, columns clockwise and linear in angle; the left
            edge of the first column looks along the camera's heading.
        omni: the table ``[omni]`` of ``camera.toml`` as it stands there, or None: how the ``omni`` pictures, not
            unwrapped, see around; ``topoloc unwrap`` reads it.
        lens: how the ``rgb`` and ``depth`` pictures are bent; they are straightened when they are read. None: not at
            all.
        odometry, truth: raw odometer and ground truth, where recorded.
        pan: times and angles of the pan head, as a track whose heading is the pan.
        expected: camera whose aspect ratio the ``rgb`` and ``right`` pictures must have, and whose panoramas'
            unwrapped ``omni`` pictures; None: any.
    """

    folder: Path
    kind: str
    pictures: Mapping[str, Sequence[Picture]]
    camera: Camera | None = None
    mount: Mount = field(default_factory=Mount)
    baseline_m: float | None = None
    panorama: bool = False
    omni: Mapping[str, Any] | None = None
    lens: Lens | None = None
    odometry: Track | None = None
    truth: Track | None = None
    pan: Track | None = None
    expected: Camera | None = None

    @classmethod
    def load(cls, folder: Path | str) -> Recording:
        """Read the lists of a recording; the pictures are read as frames are asked for.

        Raises:
            InputError: naming file, line and remedy.
        """
        path = Path(folder)
        if not path.is_dir():
            raise InputError(path, "no such folder", "name the folder that holds rgb.txt or omni.txt")
        present = [kind for kind in KINDS if (path / f"{kind}.txt").exists()]
        main = next((kind for kind in ("rgb", "omni") if kind in present), None)
        if main is None:
            raise InputError(path, "holds neither rgb.txt nor omni.txt", "list the pictures as 'timestamp path' lines")
        pictures = {kind: _read_list(path / f"{kind}.txt") for kind in present}
        if not pictures[main]:
            raise InputError(path / f"{main}.txt", "lists no pictures", "add a line 'timestamp path' for each")
        rig = read_rig(path / "camera.toml")
        pan = _read_pan(path / "pan.txt")
        return cls(
            folder=path,
            kind=main,
            pictures=pictures,
            camera=rig.camera,
            mount=rig.mount,
            baseline_m=rig.baseline_m,
            panorama=rig.panorama,
            omni=rig.omni,
            lens=rig.lens,
            odometry=_read_track(path / "odometry.txt"),
            truth=_read_truth(path / "groundtruth.txt", rig.groundtruth_of, rig.mount, pan),
            pan=pan,
        )

    def on(self, camera: Camera) -> Recording:
        """The same recording, held against the camera of a map.

        Raises:
            InputError: ``camera.toml`` tells another field of view; later, a picture of another aspect ratio.
        """
        if self.camera is not None and abs(self.camera.hfov_deg - camera.hfov_deg) > 0.02 * camera.hfov_deg:
            raise InputError(
                self.folder / "camera.toml",
                f"hfov_deg is {self.camera.hfov_deg:g}, but the map was made with {camera.hfov_deg:g}",
                "correct it, or use a map made with this camera",
            )
        return replace(self, expected=camera)

    def __len__(self) -> int:
        return len(self.pictures[self.kind])

    def __iter__(self) -> Iterator[Frame]:
        for picture in self.pictures[self.kind]:
            yield self.frame(picture)

    def frame(self, picture: Picture) -> Frame:
        """The frame around one picture of the main kind; its images are read when asked for."""
        time = picture.time
        chosen = {self.kind: picture}
        for kind, times in self._other_times.items():
            after = int(np.searchsorted(times, time))
            near = [i for i in (after - 1, after) if 0 <= i < len(times) and abs(times[i] - time) <= MAX_OFFSET_S]
            if near:
                chosen[kind] = min((self.pictures[kind][i] for i in near), key=lambda other: abs(other.time - time))
        pan = 0.0 if self.pan is None else float(self.pan.at(time)[2])
        mount = np.array([self.mount.x, self.mount.y, float(wrap(np.deg2rad(self.mount.yaw_deg) + pan))])
        odometry = None if self.odometry is None else self.odometry.at(time)
        return Frame(time, odometry, mount, LazyImages({kind: self._reader(one, kind) for kind, one in chosen.items()}))

    @cached_property
    def _other_times(self) -> dict[str, Floats]:
        """Times [s] of the pictures that are not of the main kind."""
        kinds = [kind for kind in self.pictures if kind != self.kind]
        return {kind: np.array([picture.time for picture in self.pictures[kind]]) for kind in kinds}

    def _reader(self, picture: Picture, kind: str) -> Callable[[], Pixels]:
        def read() -> Pixels:
            if kind == "depth":
                return self._straight(read_depth(picture.path), picture, kind)
            image = read_image(picture.path)
            if kind == "rgb":
                image = self._straight(image, picture, kind)
            if self.expected is not None:
                self._refuse_misfit(image, picture, kind, self.expected)
            return image

        return read

    def _straight(self, image: Pixels, picture: Picture, kind: str) -> Pixels:
        """The picture as the pinhole camera of ``camera.toml`` would have taken it."""
        if self.lens is None or self.camera is None:
            return image
        try:
            return self.lens.straighten(image, self.camera)
        except ValueError as error:
            remedy = "correct width and height in camera.toml, with fx, fy, cx, cy for that size"
            listed = self.folder / f"{kind}.txt"
            raise InputError(listed, f"{picture.path.name} {error}", remedy, line=picture.line) from None

    def _refuse_misfit(self, image: Image, picture: Picture, kind: str, camera: Camera) -> None:
        """Raise ``InputError`` for a picture of another aspect ratio than a camera's frames or panoramas."""
        if kind in ("rgb", "right") and not camera.fits(image):
            wanted = f"the map's camera has {camera.width}x{camera.height}"
        elif kind == "omni" and self.panorama and not camera.fits_panorama(image):
            wanted = f"a panorama of the map's camera has {camera.panorama_columns()}x{camera.height}"
        else:
            return
        rows, columns = image.shape[:2]
        raise InputError(
            self.folder / f"{kind}.txt",
            f"{picture.path.name} is {columns}x{rows}, but {wanted}, another aspect ratio",
            "crop the pictures, or correct [camera] in the map's map.toml",
            line=picture.line,
        )


def write_track(path: Path, times: Sequence[float], poses: Floats) -> None:
    """Write a trajectory (N, 3) as a TUM file, whole: ``timestamp tx ty tz qx qy qz qw``."""
    lines = ["# timestamp tx ty tz qx qy qz qw"]
    for time, (x, y, theta) in zip(times, poses, strict=True):
        lines.append(f"{time:.6f} {x:.6f} {y:.6f} 0 0 0 {np.sin(theta / 2):.9f} {np.cos(theta / 2):.9f}")
    write_text(path, "\n".join(lines) + "\n")


def _lines(path: Path) -> Iterator[tuple[int, str]]:
    """The lines of a TUM file that are neither empty nor comments, stripped, with their 1-based numbers."""
    for line, text in enumerate(read_text(path, "restore it").splitlines(), start=1):
        stripped = text.strip()
        if stripped and not stripped.startswith("#"):
            yield line, stripped


def _numbers(words: Sequence[str], path: Path, line: int) -> list[float]:
    """Finite numbers, or an ``InputError`` that names the word that is none."""
    values = []
    for word in words:
        try:
            value = float(word)
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise InputError(path, f"{word!r} is not a finite number", "correct or delete the line", line=line)
        values.append(value)
    return values


def _check_time(time: float, before: float, path: Path, line: int) -> None:
    if time <= before:
        raise InputError(path, f"time {time:.6f} does not follow {before:.6f}", "sort the lines by time", line=line)


def _read_list(path: Path) -> list[Picture]:
    pictures: list[Picture] = []
    for line, text in _lines(path):
        words = text.split(maxsplit=1)  # a name may have blanks and commas in it
        if len(words) != 2:
            raise InputError(path, f"{text!r} is a single word", "write 'timestamp path'", line=line)
        time = _numbers(words[:1], path, line)[0]
        _check_time(time, pictures[-1].time if pictures else -np.inf, path, line)
        pictures.append(Picture(time, path.parent / words[1], line))
    return pictures


def _read_table(path: Path, columns: str) -> tuple[list[int], Floats] | None:
    """Line numbers (N,) and numbers (N, C) of a file of numbers, its times increasing; None where it does not exist.

    Args:
        path: the file.
        columns: their names, the first of them ``timestamp``, as an error names them.
    """
    if not path.exists():
        return None
    lines: list[int] = []
    rows: list[list[float]] = []
    for line, text in _lines(path):
        words = text.replace(",", " ").split()
        if len(words) != len(columns.split()):
            raise InputError(path, f"{len(words)} values", f"write '{columns}'", line=line)
        rows.append(_numbers(words, path, line))
        lines.append(line)
        _check_time(rows[-1][0], rows[-2][0] if len(rows) > 1 else -np.inf, path, line)
    if not rows:
        raise InputError(path, "holds no lines of numbers", "add some, or delete the file")
    return lines, np.array(rows)


def _read_track(path: Path) -> Track | None:
    """A TUM trajectory of the robot, flattened to the plane; None where the file does not exist."""
    read = _read_poses(path)
    if read is None:
        return None
    times, positions, turns = read
    return Track(times, _flat(positions, turns[:, :, 0]))


def _read_truth(path: Path, truth_of: TruthOf | None, mount: Mount, pan: Track | None) -> Track | None:
    """Ground truth of the robot's axis, whether the file has its poses or those of the camera's optical frame.

    Args:
        path: a TUM trajectory; None is returned where it does not exist.
        truth_of: whose poses they are; None: recognised, since a level camera's y axis points down.
        mount: of the camera on the robot.
        pan: of its head.
    """
    read = _read_poses(path)
    if read is None:
        return None
    times, positions, turns = read
    down = -turns[:, 2, 1]
    if truth_of == "robot" or (truth_of is None and np.median(down) < OPTICAL_DOWN):
        return Track(times, _flat(positions, turns[:, :, 0]))
    camera = np.tile([mount.x, mount.y, np.deg2rad(mount.yaw_deg)], (len(times), 1))
    if pan is not None:
        camera[:, 2] += [pan.at(time)[2] for time in times]
    return Track(times, compose(_flat(positions, turns[:, :, 2]), inverse(camera)))


def _flat(positions: Floats, ahead: Floats) -> Floats:
    """Poses (N, 3) in the plane, of positions (N, 3) and the directions (N, 3) that point ahead."""
    return np.column_stack([positions[:, :2], wrap(np.arctan2(ahead[:, 1], ahead[:, 0]))])


def _read_poses(path: Path) -> tuple[Floats, Floats, Floats] | None:
    """Times (N,), positions (N, 3) and rotation matrices (N, 3, 3) of a TUM trajectory; None where there is none."""
    from scipy.spatial.transform import Rotation

    read = _read_table(path, "timestamp tx ty tz qx qy qz qw")
    if read is None:
        return None
    lines, table = read
    for line, quaternion in zip(lines, table[:, 4:], strict=True):
        if not quaternion.any():
            raise InputError(path, "the quaternion is zero", "write 0 0 0 1 for no rotation", line=line)
    return table[:, 0], table[:, 1:4], Rotation.from_quat(table[:, 4:]).as_matrix()


def _read_pan(path: Path) -> Track | None:
    """Angles of the pan head (degrees, counter-clockwise) as a track; None where the file does not exist."""
    read = _read_table(path, "timestamp degrees")
    if read is None:
        return None
    _, table = read
    return Track(table[:, 0], np.column_stack([np.zeros((len(table), 2)), np.deg2rad(table[:, 1])]))
