"""A lens: how recorded pictures differ from a pinhole camera's, by OpenCV's models, and how they are straightened."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from topoloc.topo_map import Camera
from topoloc.types import Pixels

if TYPE_CHECKING:
    from topoloc.geometry import Floats

COUNTS = {"pinhole": (4, 5, 8, 12, 14), "fisheye": (4,)}
"""How many coefficients OpenCV takes, by model."""


@dataclass(frozen=True)
class Lens:
    """Intrinsics and distortion of the pictures as they were recorded.

    Attributes:
        model: ``pinhole``, OpenCV's standard model (k1, k2, p1, p2[, k3[, k4, k5, k6[, ...]]]; ROS: plumb_bob and
            rational_polynomial), or ``fisheye`` (k1 to k4; ROS: equidistant).
        fx: focal length along the rows, pixels.
        fy: focal length along the columns, pixels.
        cx: column of the optical axis, pixels.
        cy: row of the optical axis, pixels.
        coefficients: of the distortion; 4, 5, 8, 12 or 14 for ``pinhole``, 4 for ``fisheye``.
    """

    model: Literal["pinhole", "fisheye"]
    fx: float
    fy: float
    cx: float
    cy: float
    coefficients: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if not (self.fx > 0.0 and self.fy > 0.0):
            raise ValueError(f"fx is {self.fx} and fy {self.fy}; a focal length is above 0 pixels")
        counts = COUNTS[self.model]
        if len(self.coefficients) not in counts:
            wanted = " or ".join(map(str, counts))
            raise ValueError(f"{len(self.coefficients)} coefficients for the model {self.model}; it has {wanted}")

    def hfov_deg(self, width: int) -> float:
        """Field of view [degrees] of the pinhole camera with this focal length and so many columns."""
        return float(np.rad2deg(2.0 * np.arctan(0.5 * width / self.fx)))

    def straighten(self, picture: Pixels, camera: Camera) -> Pixels:
        """A picture as a pinhole camera would have taken it that looks along the same axis.

        Args:
            picture: (camera.height, camera.width[, 3]) as recorded; uint8 is interpolated, uint16 (depth) is not.
            camera: the pinhole camera: square pixels, its axis through the middle of the picture.

        Returns:
            Of the same shape; black where the lens saw nothing.

        Raises:
            ValueError: the picture is of another size than the camera's, for which the intrinsics do not hold.
        """
        import cv2

        if picture.shape[:2] != (camera.height, camera.width):
            rows, columns = picture.shape[:2]
            raise ValueError(f"is {columns}x{rows}, but its lens is told for {camera.width}x{camera.height}")
        how = cv2.INTER_LINEAR if picture.dtype == np.uint8 else cv2.INTER_NEAREST
        straight: Any = cv2.remap(picture, *_maps(self, camera), how, borderMode=cv2.BORDER_CONSTANT, borderValue=0)
        return np.asarray(straight)


def pinhole_matrix(camera: Camera) -> Floats:
    """(3, 3) intrinsics of a pinhole camera with square pixels, its axis through the middle of the picture [pixels]."""
    focal = 0.5 * camera.width / np.tan(np.deg2rad(0.5 * camera.hfov_deg))
    return np.array([[focal, 0.0, (camera.width - 1) / 2], [0.0, focal, (camera.height - 1) / 2], [0.0, 0.0, 1.0]])


@lru_cache(maxsize=4)
def _maps(lens: Lens, camera: Camera) -> tuple[Any, Any]:
    """For each pixel (rows, columns) of the pinhole camera, the column and the row of the recorded picture."""
    import cv2

    recorded = np.array([[lens.fx, 0.0, lens.cx], [0.0, lens.fy, lens.cy], [0.0, 0.0, 1.0]])
    rectify = cv2.fisheye.initUndistortRectifyMap if lens.model == "fisheye" else cv2.initUndistortRectifyMap
    bent, size = np.array(lens.coefficients), (camera.width, camera.height)
    columns, rows = rectify(recorded, bent, np.eye(3), pinhole_matrix(camera), size, cv2.CV_32FC1)
    return columns, rows
