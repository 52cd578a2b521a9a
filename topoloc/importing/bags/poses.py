"""Poses in space as messages tell them, and in the plane as a recording has them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from topoloc.geometry import Floats
from topoloc.recording import OPTICAL_DOWN

LEVEL = 0.7
"""A robot's z axis points up at least so far (cosine); where it does not, the frame is another's."""


def _of_pose(pose: Any) -> tuple[float, ...]:
    place, turn = pose.position, pose.orientation
    return place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w


def of_transform(transform: Any) -> tuple[float, ...]:
    """x, y, z [m], qx, qy, qz, qw of a ``geometry_msgs/Transform``."""
    place, turn = transform.translation, transform.rotation
    return place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w


POSE_OF: Mapping[str, Callable[[Any], tuple[float, ...]]] = {
    "nav_msgs/Odometry": lambda message: _of_pose(message.pose.pose),
    "geometry_msgs/PoseStamped": lambda message: _of_pose(message.pose),
    "geometry_msgs/PoseWithCovarianceStamped": lambda message: _of_pose(message.pose.pose),
    "geometry_msgs/TransformStamped": lambda message: of_transform(message.transform),
}
"""How a type of message tells a pose: x, y, z [m], qx, qy, qz, qw."""


class PoseLog:
    """Poses over time, kept as they come.

    Attributes:
        unusable: how many were refused since a number was not finite or the quaternion zero.
    """

    def __init__(self) -> None:
        self._rows: list[tuple[float, ...]] = []
        self.unusable = 0

    def add(self, time: float, pose: tuple[float, ...]) -> None:
        """Keep x, y, z [m], qx, qy, qz, qw at a time [s]."""
        if np.isfinite(pose).all() and any(pose[3:]):
            self._rows.append((time, *pose))
        else:
            self.unusable += 1

    def __len__(self) -> int:
        return len(self._rows)

    def in_space(self) -> tuple[Floats, Floats, Rotation]:
        """Times (N,) [s], increasing, positions (N, 3) [m] and orientations (N); the first of equal times counts."""
        table = np.array(self._rows)
        times, first = np.unique(table[:, 0], return_index=True)
        return times, table[first, 1:4], Rotation.from_quat(table[first, 4:])


def flattened(positions: Floats, turns: Rotation, ahead: Literal[0, 2] = 0) -> Floats:
    """Poses (N, 3) in the plane, x [m], y [m], theta [rad]: the heading is that of the x axis, 0, or the z axis, 2."""
    axis = turns.as_matrix()[:, :, ahead]
    return np.column_stack([positions[:, :2], np.arctan2(axis[:, 1], axis[:, 0])])


def is_level(turns: Rotation) -> bool:
    """Whether the z axis of most of the orientations points up, as a robot's does."""
    return bool(np.median(turns.as_matrix()[:, 2, 2]) >= LEVEL)


def is_optical(turns: Rotation) -> bool:
    """Whether the y axis of most of the orientations points down, as that of a camera's optical frame does."""
    return bool(np.median(-turns.as_matrix()[:, 2, 1]) >= OPTICAL_DOWN)
