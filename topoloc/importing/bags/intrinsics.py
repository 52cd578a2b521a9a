"""``sensor_msgs/CameraInfo`` -> the pinhole camera and the lens of ``camera.toml``."""

from __future__ import annotations

from typing import Any

from topoloc.lens import Lens
from topoloc.topo_map import Camera

MODELS = {
    "": "pinhole",
    "plumb_bob": "pinhole",
    "rational_polynomial": "pinhole",
    "equidistant": "fisheye",
    "fisheye": "fisheye",
}
"""Lens of ``topoloc`` by the distortion model of ROS."""
CENTRED = 0.01
"""An optical axis that is off the middle by a smaller share of the picture needs no straightening."""


def intrinsics(message: Any, rectified: bool) -> tuple[Camera, Lens | None]:
    """The camera that a ``CameraInfo`` tells, and its lens, None where the pictures are straight.

    Args:
        message: of ROS 1 (K, D, P) or ROS 2 (k, d, p).
        rectified: the pictures are straightened already: P counts in place of K, and D is done with.

    Raises:
        ValueError: why nothing can be made of it.
    """
    fields = {name.lower(): value for name, value in vars(message).items()}
    matrix = [float(value) for value in fields["p" if rectified else "k"]]
    row = 4 if rectified else 3
    fx, cx, fy, cy = matrix[0], matrix[2], matrix[row + 1], matrix[row + 2]
    width, height = int(fields["width"]), int(fields["height"])
    if not (fx > 0.0 and fy > 0.0 and width and height):
        raise ValueError("it is not calibrated: its focal length or size is 0")
    bent = () if rectified else tuple(float(value) for value in fields["d"])
    model = MODELS.get(fields["distortion_model"]) if any(bent) else "pinhole"
    if model is None:
        raise ValueError(f"the distortion model {fields['distortion_model']!r} is not known")
    coefficients = bent if any(bent) else (0.0, 0.0, 0.0, 0.0)
    lens = Lens("fisheye" if model == "fisheye" else "pinhole", fx, fy, cx, cy, coefficients)
    camera = Camera(round(lens.hfov_deg(width), 6), width, height)
    return camera, None if not any(bent) and _is_centred(lens, camera) else lens


def _is_centred(lens: Lens, camera: Camera) -> bool:
    """Whether the axis goes through the middle and the pixels are square, to 1 %."""
    off_x, off_y = lens.cx - (camera.width - 1) / 2, lens.cy - (camera.height - 1) / 2
    return (
        abs(off_x) <= CENTRED * camera.width
        and abs(off_y) <= CENTRED * camera.height
        and (abs(lens.fx - lens.fy) <= CENTRED * lens.fx)
    )


def baseline_m(message: Any) -> float | None:
    """Distance of the right camera of a stereo pair from the left one [m], by the right one's P; None: not told."""
    fields = {name.lower(): value for name, value in vars(message).items()}
    focal, shift = float(fields["p"][0]), float(fields["p"][3])
    return -shift / focal if focal > 0.0 and shift < 0.0 else None
