"""Points of pictures of a camera that may be tilted -> rays in a level frame, and back.

The level frame has the camera's heading and middle: x to the right, y straight down, z ahead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topoloc.geometry import Floats

LEAST_AHEAD = 0.05
"""What comes to lie beside or behind the camera is drawn as if it lay so far ahead: far outside of the picture."""


@dataclass(frozen=True)
class View:
    """How a camera sees.

    Attributes:
        focal: focal length, half-widths of the picture: 1 / tan(half the field of view).
        pitch: how far the optical axis points below the horizon [rad].
        roll: how far the picture's right side hangs down [rad].
    """

    focal: float
    pitch: float = 0.0
    roll: float = 0.0

    @property
    def hfov_deg(self) -> float:
        """Horizontal field of view [degrees]."""
        return float(np.rad2deg(2.0 * np.arctan(1.0 / self.focal)))

    @classmethod
    def of(cls, hfov_deg: float) -> View:
        """A level camera with this horizontal field of view."""
        return cls(1.0 / float(np.tan(np.deg2rad(0.5 * hfov_deg))))

    @property
    def _tilt(self) -> Floats:
        """(3, 3) rotation from the camera's frame to the level one."""
        (p, r), (sp, sr) = np.cos([self.pitch, self.roll]), np.sin([self.pitch, self.roll])
        down = np.array([[1.0, 0.0, 0.0], [0.0, p, sp], [0.0, -sp, p]])
        return np.asarray(down @ np.array([[r, -sr, 0.0], [sr, r, 0.0], [0.0, 0.0, 1.0]]))

    def rays(self, points: Floats) -> Floats:
        """Rays (M, 3) in the level frame to points (M, 2) of the picture, of length 1 along the ground."""
        rays = np.column_stack([points, np.full(len(points), self.focal)]) @ self._tilt.T
        return np.asarray(rays / np.hypot(rays[:, 0], rays[:, 2])[:, None])

    def points(self, rays: Floats) -> Floats:
        """Where rays (M, 3) of the level frame meet the picture (M, 2)."""
        seen = rays @ self._tilt
        return np.asarray(self.focal * seen[:, :2] / np.maximum(seen[:, 2:], LEAST_AHEAD))


def turned(rays: Floats, turn: Floats) -> Floats:
    """Rays (M, 3) as a camera sees them that has turned counter-clockwise by turn (M,) [rad]: they go to the right."""
    cos, sin = np.cos(turn), np.sin(turn)
    x, y, z = rays.T
    return np.column_stack([cos * x + sin * z, y, cos * z - sin * x])
