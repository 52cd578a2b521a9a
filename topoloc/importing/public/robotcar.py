"""Oxford RobotCar: one street circuit, driven a hundred times in a year and a half.

W. Maddern, G. Pascoe, C. Linegar, P. Newman, International Journal of Robotics Research 36(1), 2017. A traversal is a
folder such as ``2014-06-26-08-53-56`` with ``stereo/centre/<microseconds>.png``, ``gps/ins.csv`` and ``vo/vo.csv``.

unverified: where the camera sits on the car. The truth is the navigation unit's; map and query share the offset.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.files import pictures_in
from topoloc.importing.alongside import Alongside
from topoloc.importing.public.heading_check import heading_note
from topoloc.importing.public.levels import refuse_level
from topoloc.importing.public.origin import Origin
from topoloc.importing.public.robotcar_pictures import SIZE, PictureMaker, StereoCamera, read_lut, rig_of
from topoloc.importing.public.robotcar_tracks import US, poses_at, read_ins, read_vo
from topoloc.importing.public.sequence import Drive, Shot, camera_of

INSIDE = ("stereo",)
LOOKS = "stereo/centre/, gps/, vo/"
STEP_M = 0.3
HALF_TURN_DEG = 90.0


@dataclass(frozen=True)
class RobotCarConfig:
    """What is read of a traversal.

    Attributes:
        camera: of the stereo head.
        width: columns that pictures are made narrower to.
        models: folder of the set's camera models, for its tables against distortion; None: left as recorded.
    """

    camera: StereoCamera = "centre"
    width: int = 640
    models: Path | None = None


def read_robotcar(folder: Path, config: RobotCarConfig, origin: Origin | None = None) -> tuple[Drive, Origin]:
    """A traversal, and the origin of its positions.

    Args:
        folder: of the traversal.
        config: which camera, and how its pictures are made.
        origin: None: where the car was first.

    Raises:
        InputError: no traversal, no pictures, no truth, or pictures of another camera.
    """
    pictures = folder / "stereo" / config.camera
    if not pictures.is_dir():
        if (folder / "stereo").is_dir():
            raise InputError(pictures, "no such folder", "unpack it, or choose another with --camera")
        refuse_level(folder, INSIDE, LOOKS)
    truth, start, told = read_ins(folder, origin)
    shots, dropped = _shots(pictures, Alongside(truth=truth))
    notes = [told]
    odometry = read_vo(folder)
    notes.append("odometry: visual, vo/vo.csv" if odometry is not None else "no vo/vo.csv: no odometry")
    notes += filter(None, [heading_note(shots, STEP_M)])
    table = None if config.models is None else read_lut(config.models, config.camera)
    if table is None:
        notes.append("distortion is left as recorded; --models FOLDER takes the set's tables")
    _refuse_size(shots, pictures)
    maker = PictureMaker(config.width, table)
    drive = Drive(folder.resolve().name, "rgb", shots, rig_of(config.width), odometry, tuple(notes), dropped, maker)
    return drive, start


def _shots(pictures: Path, alongside: Alongside) -> tuple[list[Shot], dict[str, int]]:
    """Pictures that the truth covers, in time, and how many others there are, by reason."""
    lost: Counter[str] = Counter()
    kept: list[tuple[float, Path]] = []
    paths = pictures_in(pictures)
    for path in paths:
        why = alongside.lack(int(path.stem) * US) if path.stem.isdecimal() else "its name is no time in microseconds"
        if why is None:
            kept.append((int(path.stem) * US, path))
        else:
            lost[why] += 1
    if not kept:
        reasons = "; ".join(f"{count} pictures: {why}" for why, count in lost.items()) or "holds no pictures"
        raise InputError(pictures, reasons, "names are <microseconds>.png, in the time of gps/ins.csv")
    kept.sort()
    assert alongside.truth is not None  # a traversal without is refused before
    poses = poses_at(alongside.truth, np.array([time for time, _ in kept]))
    return [Shot(time, path, pose) for (time, path), pose in zip(kept, poses, strict=True)], dict(lost)


def _refuse_size(shots: list[Shot], pictures: Path) -> None:
    """Raise ``InputError`` where pictures are not of the camera whose focal length is known."""
    camera = camera_of(HALF_TURN_DEG, shots)
    if camera is not None and (camera.width, camera.height) != SIZE:
        found = f"pictures are {camera.width}x{camera.height}, those of the camera {SIZE[0]}x{SIZE[1]}"
        raise InputError(pictures, found, "unpack the original ones, as the focal length is for these")
