"""Small made samples of public sets, in their documented layouts: straight on, to the left, straight on."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np

from topoloc.files import write_image
from topoloc.geometry import Floats
from topoloc.types import Image

STEPS = 12
STEP_M = 0.25
BEGIN_S = 1152886490.040076
"""As the times of COLD's sequences look."""
SECONDS = 0.2


def way(step_m: float = STEP_M, steps: int = STEPS) -> Floats:
    """(2 * steps, 3) poses [m, m, rad]: ahead along x, then along y; each heads where it drives."""
    first = np.array([[i * step_m, 0.0, 0.0] for i in range(steps)])
    second = np.array([[steps * step_m, i * step_m, 0.5 * np.pi] for i in range(steps)])
    return np.vstack([first, second])


def view(place: int, size: tuple[int, int], brightness: float = 1.0) -> Image:
    """The picture at a place of the way: coloured noise, the same at each visit but for the light."""
    blocks = np.random.default_rng(place).integers(0, 256, (6, 8, 3))
    picture = cv2.resize(blocks.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST)
    return np.asarray(picture * brightness, dtype=np.uint8)


def times_of(count: int, begin: float = BEGIN_S) -> Floats:
    """(N,) [s]."""
    return begin + SECONDS * np.arange(count, dtype=np.float64)


def make_cold(folder: Path, begin: float = BEGIN_S, brightness: float = 1.0, omni: bool = False) -> Path:
    """A sequence of COLD: names, ``places.lst``, ``odom.tdf`` with an odometer that began elsewhere."""
    poses, labels, rows = way(), [], []
    for i, (time, (x, y, angle)) in enumerate(zip(times_of(len(poses), begin), poses, strict=True)):
        name = f"t{time:.6f}_x{x:.6f}_y{y:.6f}_a{angle:.6f}.jpeg"
        write_image(folder / "std_cam" / name, view(i, (64, 48), brightness))
        labels.append(f"{name} {'CR-A' if i < STEPS else '2PO1-A'}")
        seconds = int(time)
        clock = f"{seconds} {round(1e6 * (time - seconds))}"
        rows.append(f"0 0 0 {clock} 2 0 6 {x + 5.0:.6f} {y - 3.0:.6f} 0.0 {angle:.6f} 0 0")
        if omni:
            write_image(folder / "omni_cam" / name, view(i, (48, 48), brightness))
    for path, lines in (("localization/places.lst", labels), ("odom_scans/odom.tdf", rows)):
        (folder / path).parent.mkdir(parents=True)
        (folder / path).write_text("\n".join(lines) + "\n")
    return folder


def make_idol2(folder: Path, begin: float = BEGIN_S, brightness: float = 1.0, degrees: bool = False) -> Path:
    """A sequence of KTH-IDOL2; ``degrees`` writes the angles so."""
    poses = way()
    for i, (time, (x, y, angle)) in enumerate(zip(times_of(len(poses), begin), poses, strict=True)):
        told = np.rad2deg(angle) if degrees else angle
        room = "CR" if i < STEPS else "KT"
        write_image(
            folder / "png" / f"t{time:.6f}_r{room}_x{x:.4f}_y{y:.4f}_a{told:.4f}.png", view(i, (64, 48), brightness)
        )
    return folder


EASTING, NORTHING = 620000.0, 5735000.0
CAR_STEP_M, CAR_STEPS = 5.0, 6
"""The car's pictures are large: there are fewer."""
INS_HEAD = (
    "timestamp,ins_status,latitude,longitude,altitude,northing,easting,down,utm_zone,velocity_north,velocity_east,"
    "velocity_down,roll,pitch,yaw"
)


def car_way() -> Floats:
    """(2 * CAR_STEPS, 3) poses of the car."""
    return way(CAR_STEP_M, CAR_STEPS)


def make_robotcar(
    folder: Path, begin: float, size: tuple[int, int] = (1280, 960), shift: tuple[float, float] = (0.0, 0.0)
) -> Path:
    """A traversal of the RobotCar: mosaics, ``ins.csv`` twice as often as pictures, ``vo.csv``.

    Args:
        folder: to make.
        begin: of the drive [s].
        size: of the pictures.
        shift: of the whole drive, east and north [m].
    """
    poses = car_way()
    stamps = [round(1e6 * time) for time in times_of(len(poses), begin)]
    for i, stamp in enumerate(stamps):
        write_image(folder / "stereo" / "centre" / f"{stamp}.png", mosaic(view(i, size)))
    rows = [INS_HEAD]
    for stamp, (x, y, angle) in zip(stamps, poses, strict=True):
        place = f"{NORTHING + shift[1] + y:.3f},{EASTING + shift[0] + x:.3f},-100.0,30U,0,0,0"
        rows.append(f"{stamp},INS_SOLUTION_GOOD,51.7,-1.2,110.0,{place},0.0,0.0,{0.5 * np.pi - angle:.6f}")
    rows.append(f"{stamps[-1] + 10_000_000},INS_BAD_GPS,51.7,-1.2,110.0,0.0,0.0,0.0,30U,0,0,0,0.0,0.0,0.0")
    (folder / "gps").mkdir(parents=True)
    (folder / "gps" / "ins.csv").write_text("\n".join(rows) + "\n")
    odometry = ["source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw"]
    for i in range(1, len(poses)):
        step = poses[i, :2] - poses[i - 1, :2]
        cos, sin = np.cos(poses[i - 1, 2]), np.sin(poses[i - 1, 2])
        ahead, left = cos * step[0] + sin * step[1], cos * step[1] - sin * step[0]
        turn = poses[i, 2] - poses[i - 1, 2]
        odometry.append(f"{stamps[i]},{stamps[i - 1]},{ahead:.6f},{-left:.6f},0.0,0.0,0.0,{-turn:.6f}")
    (folder / "vo").mkdir()
    (folder / "vo" / "vo.csv").write_text("\n".join(odometry) + "\n")
    return folder


def mosaic(picture: Image) -> Image:
    """One level a pixel, below colour filters: green blue, red green."""
    grey = picture[..., 1].copy()
    grey[0::2, 1::2] = picture[0::2, 1::2, 2]
    grey[1::2, 0::2] = picture[1::2, 0::2, 0]
    return grey
