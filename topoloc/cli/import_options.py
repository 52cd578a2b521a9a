"""Options that several importers of pictures have, what they make of them, and what they say of what they read."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

if TYPE_CHECKING:
    from topoloc.importing.alongside import Alongside
    from topoloc.importing.odometry_csv import CsvTrack
    from topoloc.rig_file import Rig

Output = Annotated[Path, Parameter(name=["--output", "-o"], help="Recording folder to make.")]
OdometryCsv = Annotated[
    Path | None, Parameter(help="CSV whose columns are named with units, such as time_s,x_m,y_m,heading_deg.")
]
TruthCsv = Annotated[Path | None, Parameter(help="CSV of the robot's true poses, named alike.")]
WheelBase = Annotated[
    float | None, Parameter(name="--wheel-base-m", help="Between the wheels, where the CSV tells of wheels, metres.")
]
Ticks = Annotated[
    float | None, Parameter(name="--ticks-per-metre", help="Of the encoders, where the CSV counts ticks.")
]
HfovDeg = Annotated[
    float | None,
    Parameter(
        help="Horizontal field of view, degrees; 'topoloc camera turn' finds it.", validator=Number(gt=0, lt=180)
    ),
]
MountYawDeg = Annotated[
    float, Parameter(help="Where the camera looks on the robot, degrees counter-clockwise from ahead.")
]
Overwrite = Annotated[bool, Parameter(help="Replace an earlier recording.", negative="")]


def read_alongside(
    odometry: Path | None, truth: Path | None, wheel_base_m: float | None, ticks_per_metre: float | None
) -> Alongside:
    """The tracks of CSV files; says how they were read, so that a wrong unit shows."""
    from topoloc.importing.alongside import Alongside
    from topoloc.importing.odometry_csv import Wheels, read_poses_csv

    wheels = Wheels(wheel_base_m, ticks_per_metre)
    tracks = [None if path is None else read_poses_csv(path, wheels) for path in (odometry, truth)]
    for path, track in zip((odometry, truth), tracks, strict=True):
        if track is not None:
            _tell_track(path, track)
    return Alongside(*tracks)


def _tell_track(path: Path | None, track: CsvTrack) -> None:
    import numpy as np

    steps = np.linalg.norm(np.diff(track.poses[:, :2], axis=0), axis=1)
    turned = np.rad2deg(np.abs(np.diff(np.unwrap(track.poses[:, 2]))).sum())
    seconds = float(track.times[-1] - track.times[0])
    driven = f"{steps.sum():.2f} m driven, {turned:.0f} degrees turned in {seconds:.1f} s"
    print(f"{path}: {driven}; if not so, a unit is wrong")
    print(f"  read: {', '.join(track.columns.values())}; the clock counts {track.clock}")
    if track.ignored:
        more = f" and {len(track.ignored) - 5} more" if len(track.ignored) > 5 else ""
        print(f"  ignored: {', '.join(track.ignored[:5])}{more}")
    if track.repeated:
        print(f"  left out: {track.repeated} rows of the same time as the one before")


def rig_of(hfov_deg: float | None, mount_yaw_deg: float, width: int, height: int) -> Rig:
    """What is known of the camera: its field of view, where that is given, and where it looks."""
    from topoloc.rig_file import Mount, Rig
    from topoloc.topo_map import Camera

    camera = Camera(hfov_deg, width, height) if hfov_deg is not None and width else None
    return Rig(camera, Mount(yaw_deg=mount_yaw_deg))


def tell_missing_view(output: Path, hfov_deg: float | None) -> None:
    """Say what to do where the field of view is not known: a map cannot be built without."""
    if hfov_deg is None:
        print(
            f"field of view: not told; 'topoloc camera turn {output}' finds it where the robot turned on the spot, "
            "or give --hfov-deg"
        )
