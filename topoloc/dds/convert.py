"""ROS 2 messages -> our values, and back: times, planar poses, pictures, beliefs."""

from __future__ import annotations

import numpy as np

from topoloc.dds import messages as ros
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.types import Estimate, Image, WeightedPoses

FRAME = "map"
"""Frame of all that is published (REP 105)."""
MAX_PARTICLES = 500
"""A belief of more poses is thinned out to so many: cyclonedds needs 10 us in Python for each."""
NO_ROTATION = 1e-6
"""A quaternion shorter than this was never filled in."""
ENCODINGS: dict[str, tuple[int, str]] = {
    "rgb8": (3, ""),
    "bgr8": (3, "COLOR_BGR2RGB"),
    "8UC3": (3, "COLOR_BGR2RGB"),
    "rgba8": (4, "COLOR_RGBA2RGB"),
    "bgra8": (4, "COLOR_BGRA2RGB"),
    "mono8": (1, "COLOR_GRAY2RGB"),
    "8UC1": (1, "COLOR_GRAY2RGB"),
    "bayer_rggb8": (1, "COLOR_BayerRGGB2RGB"),
    "bayer_bggr8": (1, "COLOR_BayerBGGR2RGB"),
    "bayer_gbrg8": (1, "COLOR_BayerGBRG2RGB"),
    "bayer_grbg8": (1, "COLOR_BayerGRBG2RGB"),
    "yuv422": (2, "COLOR_YUV2RGB_UYVY"),
    "uyvy": (2, "COLOR_YUV2RGB_UYVY"),
    "yuv422_yuy2": (2, "COLOR_YUV2RGB_YUY2"),
    "yuyv": (2, "COLOR_YUV2RGB_YUY2"),
}
"""Encodings of sensor_msgs/Image that are read: bytes a pixel, and OpenCV's conversion to RGB."""


def seconds(time: ros.Time) -> float:
    """A stamp as seconds; good to a quarter of a microsecond for a clock that counts from 1970."""
    return time.sec + 1e-9 * time.nanosec


def stamp(time: float) -> ros.Time:
    """Seconds as a stamp; a clock beyond 2038 does not fit ROS 2's 32 bits and stays at their end."""
    whole = int(np.clip(np.floor(time), -(2**31), 2**31 - 1))
    return ros.Time(whole, int(np.clip(round((time - whole) * 1e9), 0, 999_999_999)))


def planar_pose(message: ros.Odometry) -> Floats:
    """The odometer's pose (3,) in the plane [m, m, rad]; NaN where its quaternion was never filled in."""
    at, turned = message.pose.pose.position, message.pose.pose.orientation
    x, y, z, w = turned.x, turned.y, turned.z, turned.w
    if not x * x + y * y + z * z + w * w > NO_ROTATION**2:
        return np.full(3, np.nan)
    return np.array([at.x, at.y, np.arctan2(2.0 * (w * z + x * y), w * w + x * x - y * y - z * z)])


def pixels(message: ros.Image) -> Image:
    """The picture (rows, cols, 3), RGB.

    Raises:
        UserError: an encoding that is not in ``ENCODINGS``, fewer bytes than the size asks for, or a size that the
            encoding cannot have.
    """
    import cv2

    if message.encoding not in ENCODINGS:
        known = ", ".join(ENCODINGS)
        raise UserError(f"images are encoded as {message.encoding!r}; publish one of {known}, or compressed images")
    depth, conversion = ENCODINGS[message.encoding]
    rows, row, size = message.height, message.width * depth, message.height * message.step
    halved = conversion.startswith("COLOR_YUV") and message.width % 2  # YUV 4:2:2: a colour for two columns
    if row == 0 or rows == 0 or message.step < row or len(message.data) < size or halved:
        told = f"{message.width}x{message.height} with {message.step} bytes a row, and {len(message.data)} bytes"
        raise UserError(f"an image is told to be {told}, in {message.encoding}; mend its publisher")
    table = np.frombuffer(message.data, dtype=np.uint8, count=size).reshape(rows, message.step)[:, :row]
    shaped = np.ascontiguousarray(table).reshape(rows, message.width, depth)
    return shaped if not conversion else np.asarray(cv2.cvtColor(shaped, getattr(cv2, conversion)), dtype=np.uint8)


def stamped_pose(estimate: Estimate, time: ros.Time) -> ros.PoseWithCovarianceStamped:
    """An estimate as ROS 2's localizers publish it: x, y and the turn about z in place, nothing about the others."""
    covariance = np.zeros((6, 6))
    covariance[np.ix_([0, 1, 5], [0, 1, 5])] = estimate.covariance
    pose = ros.PoseWithCovariance(_pose(*map(float, estimate.pose)), covariance.reshape(-1).tolist())
    return ros.PoseWithCovarianceStamped(ros.Header(time, FRAME), pose)


def cloud(belief: WeightedPoses, time: ros.Time) -> ros.ParticleCloud:
    """A belief as weighted poses whose weights sum to 1; the size of a grid's cells is not told."""
    poses, weights = thinned(belief)
    particles = [
        ros.Particle(_pose(*pose), weight) for pose, weight in zip(poses.tolist(), weights.tolist(), strict=True)
    ]
    return ros.ParticleCloud(ros.Header(time, FRAME), particles)


def thinned(belief: WeightedPoses, most: int = MAX_PARTICLES) -> tuple[Floats, Floats]:
    """At most so many poses (N, 3) of a belief, and weights (N,) that sum to 1.

    Poses without weight go; where too many remain, a systematic sample of them (Kitagawa 1996, its offset one half so
    that no random numbers are needed) speaks for all, each pose weighing by how often it was drawn.
    """
    weights = belief.weights
    if np.count_nonzero(weights) > most:
        drawn = np.searchsorted(np.cumsum(weights), (np.arange(most) + 0.5) / most)
        weights = np.bincount(np.minimum(drawn, len(weights) - 1), minlength=len(weights)) / most
    kept = weights > 0.0
    return belief.poses[kept], weights[kept]


def _pose(x: float, y: float, heading: float) -> ros.Pose:
    return ros.Pose(ros.Point(x, y), ros.Quaternion(z=float(np.sin(heading / 2)), w=float(np.cos(heading / 2))))
