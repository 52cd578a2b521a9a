"""Sequences of the TUM RGB-D benchmark: the published calibration of their Kinects, and pairs to localize on.

J. Sturm, N. Engelhard, F. Endres, W. Burgard, D. Cremers: A Benchmark for the Evaluation of RGB-D SLAM Systems, IROS
2012. A sequence is a recording as it is; what an import adds is the camera.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from topoloc.errors import InputError, UserError
from topoloc.files import read_image, read_text
from topoloc.geometry import wrap
from topoloc.importing.alongside import Alongside
from topoloc.importing.recording_sink import RecordingSink
from topoloc.importing.thinning import Thinning
from topoloc.lens import Lens
from topoloc.recording import Picture, Recording, Track
from topoloc.rig_file import Rig
from topoloc.topo_map import Camera

KinectName = Literal["freiburg1", "freiburg2", "freiburg3"]
SIZE = (640, 480)
"""Columns and rows of their pictures."""
KINECTS: dict[KinectName, Lens] = {
    "freiburg1": Lens("pinhole", 517.3, 516.5, 318.6, 255.3, (0.2624, -0.9531, -0.0054, 0.0026, 1.1633)),
    "freiburg2": Lens("pinhole", 520.9, 521.0, 325.1, 249.7, (0.2312, -0.7849, -0.0033, -0.0001, 0.9172)),
    "freiburg3": Lens("pinhole", 535.4, 539.2, 320.1, 247.6, (0.0, 0.0, 0.0, 0.0, 0.0)),
}
"""Colour cameras as the benchmark's page of file formats has them; ORB-SLAM2's TUM1.yaml to TUM3.yaml have the same
values, to more digits. The pictures of freiburg3 were straightened before they were published."""
JOIN_S = 0.02
"""A depth picture belongs to a colour picture within this, as in the benchmark's associate.py [s]."""


@dataclass(frozen=True)
class Pair:
    """Sequences, or stretches of one, of which one is the map and the other is localized on it.

    Attributes:
        map: name of the sequence.
        query: name of the sequence.
        source: who published it, and what came of it there.
    """

    map: str
    query: str
    source: str


PAIRS = (
    Pair(
        "freiburg2_xyz --end 30",
        "freiburg2_xyz --start 30",
        "Mur-Artal, Montiel, Tardos: ORB-SLAM, 2015, VIII.C, first experiment",
    ),
    Pair(
        "freiburg3_sitting_xyz",
        "freiburg3_walking_xyz",
        "Mur-Artal, Montiel, Tardos: ORB-SLAM, 2015, VIII.C, second experiment: "
        "ORB-SLAM relocalized 78 % of the frames, PTAM none",
    ),
)
"""Pairs that were published for localization, as far as they could be looked up. The benchmark itself has none: its
``_validation`` sequences come without ground truth, for its evaluation on line."""


def kinect_of(folder: Path, told: KinectName | None) -> KinectName:
    """Which Kinect took a sequence: the one told, or the one in the folder's name.

    Raises:
        UserError: neither tells.
    """
    if told is not None:
        return told
    named = re.search(r"(?:freiburg|fr)([123])(?!\d)", folder.resolve().name)
    for name in KINECTS:
        if named and name == f"freiburg{named[1]}":
            return name
    raise UserError(f"{folder}: its name does not tell the Kinect; add --set freiburg1, freiburg2 or freiburg3")


def read_sequence(folder: Path) -> Recording:
    """A sequence, with its truth [m, rad] of the camera: position, and heading of the optical axis.

    The truth is that of the optical frame whatever way the camera is held; ``Recording.load`` alone takes a camera
    that looks at the floor for a robot.

    Raises:
        InputError: no sequence, a list that cannot be read, or pictures that are not of a Kinect.
    """
    if not (folder / "rgb.txt").exists():
        inside = sorted(path.parent.name for path in folder.glob("*/rgb.txt"))
        remedy = f"name one of: {', '.join(inside)}" if inside else "name the folder that was in the .tgz file"
        raise InputError(folder, "holds no rgb.txt", remedy)
    sequence = Recording.load(folder)
    first = next((image for image in map(_size, sequence.pictures["rgb"]) if image is not None), None)
    if first != SIZE:
        found = "no picture decodes" if first is None else f"the pictures are {first[0]}x{first[1]}"
        remedy = "unpack it again" if first is None else "'topoloc localize' runs on it as it is; it needs no import"
        raise InputError(folder, f"{found}, those of a Kinect {SIZE[0]}x{SIZE[1]}", remedy)
    return replace(sequence, truth=_truth(folder / "groundtruth.txt"))


def _size(picture: Picture) -> tuple[int, int] | None:
    try:
        rows, columns = read_image(picture.path).shape[:2]
    except InputError:
        return None
    return columns, rows


def _truth(path: Path) -> Track | None:
    """Poses of the optical frame, z ahead, flattened to the plane; None where there are none."""
    from scipy.spatial.transform import Rotation

    if not path.exists():
        return None
    text = read_text(path, "restore it").replace(",", " ")  # commas separate, too, as Recording.load has it
    table = np.loadtxt(text.splitlines(), comments="#", ndmin=2)
    ahead = Rotation.from_quat(table[:, 4:8]).apply([0.0, 0.0, 1.0])
    return Track(table[:, 0], np.column_stack([table[:, 1:3], wrap(np.arctan2(ahead[:, 1], ahead[:, 0]))]))


def import_sequence(
    sequence: Recording, sink: RecordingSink, thinning: Thinning, progress: Callable[[], object] = lambda: None
) -> None:
    """Put colour pictures and the depth pictures that belong to them into a recording, to the byte, and the truth.

    Args:
        sequence: of ``read_sequence``.
        sink: pictures that the motion capture does not reach, and those that cannot be read, are noted there.
        thinning: which colour pictures are taken.
        progress: called for each colour picture.
    """
    alongside = Alongside(truth=sequence.truth)
    depth = sequence.pictures.get("depth", ())
    depth_times = np.array([picture.time for picture in depth])
    first = sequence.pictures["rgb"][0].time
    taken, joined = None, set[int]()
    for picture in sequence.pictures["rgb"]:
        progress()
        if not thinning.takes(picture.time - first, taken):
            continue
        taken = picture.time - first
        why = alongside.lack(picture.time) or _copy(picture, "rgb", sink)
        if why is not None:
            sink.drop("frame", why)
        elif depth:
            nearest = int(np.abs(depth_times - picture.time).argmin())
            if abs(depth_times[nearest] - picture.time) <= JOIN_S:
                joined.add(nearest)
    for index in sorted(joined):
        why = _copy(depth[index], "depth", sink)
        if why is not None:
            sink.drop("depth picture", why)
    alongside.write(sink)


def _copy(picture: Picture, kind: str, sink: RecordingSink) -> str | None:
    """Copy a picture; returns why it cannot be."""
    try:
        data = picture.path.read_bytes()
    except OSError as error:
        return f"cannot be read ({error.strerror})"
    sink.picture(kind, picture.time, data, picture.path.suffix.lower())
    return None


def rig_of(kinect: KinectName) -> Rig:
    """The camera of a Kinect; the truth that ``import_sequence`` writes is that of a robot whose axis is the camera."""
    lens = KINECTS[kinect]
    return Rig(Camera(lens.hfov_deg(SIZE[0]), *SIZE), lens=lens, groundtruth_of="robot")


def pairs_with(folder: Path) -> list[Pair]:
    """The published pairs that a sequence is of."""
    name = folder.resolve().name.removeprefix("rgbd_dataset_")
    return [pair for pair in PAIRS if name in (pair.map.split()[0], pair.query.split()[0])]
