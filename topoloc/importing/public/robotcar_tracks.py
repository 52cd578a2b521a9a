"""Where the RobotCar was: its inertial navigation, and its visual odometry.

W. Maddern, G. Pascoe, C. Linegar, P. Newman: 1 Year, 1000 km: The Oxford RobotCar Dataset, International Journal of
Robotics Research 36(1), 2017. Columns and the composition of relative poses as in the set's own software
(robotcar-dataset-sdk, ``interpolate_poses.py``); the frame is north-east-down.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from topoloc.errors import InputError
from topoloc.geometry import Floats, wrap
from topoloc.importing.csv_table import Column, CsvTable, read_table
from topoloc.importing.public.origin import Origin, poses_from_utm
from topoloc.recording import Track

INS_FILES = ("gps/rtk.csv", "rtk.csv", "gps/ins.csv")
"""Looked for in this order: the reference by post-processed satellite signals, published in 2020, comes first."""
GOOD = "INS_SOLUTION_GOOD"
INS_EXAMPLE = "timestamp,ins_status,latitude,...,northing,easting,down,...,roll,pitch,yaw"
VO_FILE = "vo/vo.csv"
VO_EXAMPLE = "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw"
US = 1e-6
"""Timestamps are microseconds [s]."""


def read_ins(traversal: Path, origin: Origin | None) -> tuple[Track, Origin, str]:
    """Poses of the navigation unit, x east, y north [m], its origin, and what was read.

    Args:
        traversal: the folder.
        origin: None: where the car was first.

    Raises:
        InputError: there is no file, or it lacks columns or good rows.
    """
    path = next((traversal / name for name in INS_FILES if (traversal / name).exists()), None)
    if path is None:
        raise InputError(
            traversal / INS_FILES[-1], "no such file", "unpack the traversal's gps archive beside the pictures"
        )
    table = read_table(path, INS_EXAMPLE)
    columns = [_column(table, name, INS_EXAMPLE) for name in ("timestamp", "easting", "northing", "yaw")]
    values = np.column_stack([table.numbers(column) for column in columns])
    status = next((column for column in table.columns if column.name == "ins_status"), None)
    good = np.ones(len(values), dtype=bool)
    if status is not None:
        good = np.array([word == GOOD for word in table.words(status)])
    if not good.any():
        raise InputError(path, f"no row has the status {GOOD}", "this traversal has no usable truth; take another")
    values = values[good]
    times, first = np.unique(values[:, 0], return_index=True)
    _, easting, northing, yaw = values[first].T
    start = origin or Origin(float(easting[0]), float(northing[0]))
    poses = poses_from_utm(easting, northing, yaw, start)
    lost = f", without {np.count_nonzero(~good)} rows of another status" if not good.all() else ""
    return Track(times * US, poses), start, f"truth: {path.relative_to(traversal)}{lost}"


def read_vo(traversal: Path) -> Track | None:
    """Visual odometry as an odometer's track from the origin on; None where there is none.

    Each row has the pose of the newer picture in the frame of the older one, x ahead, y right, z down; what is turned
    about other axes than the vertical one is left out.
    """
    path = traversal / VO_FILE
    if not path.exists():
        return None
    table = read_table(path, VO_EXAMPLE)
    names = ("source_timestamp", "destination_timestamp", "x", "y", "yaw")
    source, destination, ahead, right, clockwise = (table.numbers(_column(table, name, VO_EXAMPLE)) for name in names)
    times, order = np.unique(np.maximum(source, destination), return_index=True)
    ahead, left, turn = ahead[order], -right[order], -clockwise[order]
    headings = np.concatenate([[0.0], np.cumsum(turn)])
    before = headings[:-1]
    steps = np.column_stack(
        [ahead * np.cos(before) - left * np.sin(before), ahead * np.sin(before) + left * np.cos(before)]
    )
    positions = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    start = min(source[order[0]], destination[order[0]])
    return Track(np.concatenate([[start], times]) * US, np.column_stack([positions, wrap(headings)]))


def poses_at(track: Track, times: Floats) -> Floats:
    """(N, 3) poses of a track at times (N,) [s], interpolated."""
    x, y, heading = (
        np.interp(times, track.times, values)
        for values in (track.poses[:, 0], track.poses[:, 1], np.unwrap(track.poses[:, 2]))
    )
    return np.column_stack([x, y, wrap(heading)])


def _column(table: CsvTable, name: str, example: str) -> Column:
    found = next((column for column in table.columns if column.name == name), None)
    if found is None:
        raise InputError(table.path, f"has no column {name}", f"its first line reads {example}; unpack it again")
    return found
