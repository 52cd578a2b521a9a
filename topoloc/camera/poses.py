"""Where the robot and its camera were, by the odometer, when pictures were taken."""

from __future__ import annotations

import numpy as np

from topoloc.errors import InputError
from topoloc.geometry import Floats
from topoloc.recording import Recording


def poses_at_frames(recording: Recording) -> tuple[Floats, Floats]:
    """Poses (N, 3) of the robot in the odometer's frame, and of the camera on the robot, pan included.

    Raises:
        InputError: there is no odometry.
    """
    frames = [recording.frame(picture) for picture in recording.pictures[recording.kind]]
    robot = [frame.odometry for frame in frames if frame.odometry is not None]
    if len(robot) < len(frames):
        raise InputError(recording.folder, "has no odometry.txt", "record the odometer's poses with the pictures")
    return np.array(robot), np.array([frame.camera for frame in frames])


def refuse_panoramas(recording: Recording) -> None:
    """Raise ``InputError`` for a recording of panoramas: they have no field of view and no single direction."""
    if recording.kind != "rgb":
        problem = "holds pictures that show all around, not those of a camera that looks one way"
        raise InputError(recording.folder, problem, "name a recording with rgb.txt")
