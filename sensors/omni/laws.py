"""Radial laws: at which distance from the centre of an omnidirectional picture an elevation is seen.

All are for a camera on the axis of what is round: a mirror or a lens. Elevations [rad] are counted from the plane
square to the axis, positive the way the camera looks; a camera that looks up at a mirror sees the floor at negative
ones. A radius is in pixels from the picture's centre. The camera in front of a mirror is a pin-hole: take the lens's
distortion out of the pictures first.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from topoloc.geometry import Floats

RIGHT_ANGLE = math.pi / 2.0
ROUNDING = 1e-9
"""An angle below 0 by no more than this is 0 [rad]."""
SAMPLES = 4096
"""Of a law that is tabulated: the radius is off by less than 0.001 pixels."""
BEYOND = 1.02
"""A rim so many times larger than its mirror can be is a mistake, not an error of measurement."""


class RadialLaw(Protocol):
    """What a mirror or a lens does to elevations; a class with this method is all that ``RadialPicture`` needs."""

    def radius(self, elevation: Floats) -> Floats:
        """Distances (any shape) from the picture's centre [pixels]; nan for an elevation [rad] that is not seen."""


@dataclass(frozen=True, kw_only=True)
class _Mirror:
    """A mirror in front of a pin-hole camera that looks along its axis.

    Attributes:
        focal_px: focal length of the camera [pixels].
        rim_px: radius of the mirror's rim in the picture [pixels]; nothing is seen beyond.
    """

    focal_px: float
    rim_px: float

    def __post_init__(self) -> None:
        _refuse_below(self, 0.0, "focal_px", "rim_px")

    def _seen(self, radius: Floats) -> Floats:
        return np.asarray(np.where(radius <= self.rim_px, radius, np.nan))

    def _refuse_rim_beyond(self, largest_px: float) -> None:
        if self.rim_px > BEYOND * largest_px:
            raise ValueError(
                f"rim_px is {self.rim_px:g}, but with this focal_px such a mirror ends at {largest_px:.1f} pixels"
            )


def _refuse_below(settings: Any, bound: float, *names: str) -> None:
    for name in names:
        if not getattr(settings, name) > bound:
            raise ValueError(f"{name} is {getattr(settings, name)}; it must be above {bound:g}")


@dataclass(frozen=True, kw_only=True)
class Conical(_Mirror):
    """A cone, its tip towards the camera (thesis appendix C; the law itself is derived here).

    A ray of the camera that lies alpha off the axis leaves the cone at elevation 2 gamma + alpha - 90 deg: the same
    reflection that (C.1) and (C.2) rest on. A cone has no single viewpoint: the rays of one meridian meet behind the
    axis, in the camera's mirror image. So what is near is seen at another elevation than what is far; which of the two
    is right, ``scene_m`` says. The headings are right for all.

    Attributes:
        gamma_deg: angle between the cone's surface and its base, degrees; below 45, so that the tip shows the floor.
        tip_m: distance l from the camera to the tip [m]; it matters where the scene is near only.
        scene_m: horizontal distance of the scene from the axis [m]; elevations are those seen from the tip. Without
            it, the scene is far away.
    """

    gamma_deg: float
    tip_m: float = 0.0
    scene_m: float = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_below(self, 0.0, "scene_m")
        if not 0.0 < self.gamma_deg < 45.0:
            raise ValueError(f"gamma_deg is {self.gamma_deg}; it must lie between 0 and 45")
        if self.tip_m < 0.0 or (self.tip_m == 0.0 and math.isfinite(self.scene_m)):
            raise ValueError(f"tip_m is {self.tip_m}; with scene_m it must be above 0, and never below")

    def elevation(self, radius: Floats) -> Floats:
        """Elevations [rad] that are seen at radii [pixels]; nan beyond the rim."""
        leaving = 2.0 * self._gamma + np.arctan(self._seen(radius) / self.focal_px) - RIGHT_ANGLE
        if math.isinf(self.scene_m):
            return np.asarray(leaving)
        behind, above = self._viewpoint
        return np.asarray(np.arctan((above + (self.scene_m + behind) * np.tan(leaving)) / self.scene_m))

    def radius(self, elevation: Floats) -> Floats:
        """See ``RadialLaw``."""
        leaving = elevation
        if math.isfinite(self.scene_m):
            behind, above = self._viewpoint
            leaving = np.arctan((self.scene_m * np.tan(elevation) - above) / (self.scene_m + behind))
        alpha = leaving + RIGHT_ANGLE - 2.0 * self._gamma
        seen = (alpha >= -ROUNDING) & (alpha < RIGHT_ANGLE)
        return self._seen(self.focal_px * np.tan(np.where(seen, np.maximum(alpha, 0.0), np.nan)))

    @property
    def _gamma(self) -> float:
        return math.radians(self.gamma_deg)

    @property
    def _viewpoint(self) -> tuple[float, float]:
        """Where a meridian's rays meet, the camera mirrored: how far behind the axis, and above the tip [m]."""
        return self.tip_m * math.sin(2.0 * self._gamma), self.tip_m * math.cos(2.0 * self._gamma)


@dataclass(frozen=True, kw_only=True)
class Hyperbolic(_Mirror):
    """A sheet of the hyperboloid z^2 / a^2 - r^2 / b^2 = 1, the camera's pin-hole in the other sheet's focus.

    All rays meet in the sheet's own focus: a single viewpoint (Baker and Nayar 1999; the law is derived here from a
    point's distances to the two foci, which differ by 2 a). Only the ratio of a and b matters.

    Attributes:
        a_m: half the distance between the two sheets, along the axis [m].
        b_m: the other half axis [m].
    """

    a_m: float
    b_m: float

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_below(self, 0.0, "a_m", "b_m")
        self._refuse_rim_beyond(self.focal_px * self.b_m / self.a_m)

    def elevation(self, radius: Floats) -> Floats:
        """Elevations [rad] that are seen at radii [pixels]; nan beyond the rim."""
        a, b, e = self.a_m, self.b_m, math.hypot(self.a_m, self.b_m)
        alpha = np.arctan(self._seen(radius) / self.focal_px)
        cos, reach = np.cos(alpha), e * np.cos(alpha) - a  # b^2 / reach: how far from the camera the mirror is
        return np.asarray(np.where(reach > 0.0, np.arctan2(b**2 * cos - 2.0 * e * reach, b**2 * np.sin(alpha)), np.nan))

    def radius(self, elevation: Floats) -> Floats:
        """See ``RadialLaw``."""
        a, b, e = self.a_m, self.b_m, math.hypot(self.a_m, self.b_m)
        sine = np.where(np.sin(elevation) < a / e, np.sin(elevation), np.nan)  # steeper ones pass the mirror by
        return self._seen(self.focal_px * b**2 * np.cos(elevation) / (2.0 * a * e - (a**2 + e**2) * sine))


@dataclass(frozen=True, kw_only=True)
class Spherical(_Mirror):
    """A mirror ball, or a cap of one, bulging towards the camera.

    A sphere has no single viewpoint; see ``Conical`` for what that means and what ``scene_m`` does. The law is
    tabulated over the point of reflection and read backwards.

    Attributes:
        ball_m: radius of the sphere [m].
        center_m: distance from the camera to the sphere's centre [m].
        scene_m: horizontal distance of the scene from the axis [m]; elevations are those seen from the ball's point
            nearest to the camera. Without it, the scene is far away.
    """

    ball_m: float
    center_m: float
    scene_m: float = math.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        _refuse_below(self, 0.0, "ball_m")
        _refuse_below(self, self.ball_m, "center_m", "scene_m")
        self._refuse_rim_beyond(float(self._table[1][-1]))

    def elevation(self, radius: Floats) -> Floats:
        """Elevations [rad] that are seen at radii [pixels]; nan beyond the rim."""
        elevations, radii = self._table
        return np.asarray(np.interp(self._seen(radius), radii, elevations, right=np.nan))

    def radius(self, elevation: Floats) -> Floats:
        """See ``RadialLaw``."""
        elevations, radii = self._table
        return self._seen(np.interp(elevation, elevations, radii, left=np.nan, right=np.nan))

    @cached_property
    def _table(self) -> tuple[Floats, Floats]:
        """Elevations (S,) [rad] and radii (S,) [pixels], both growing, from the middle of the ball to its outline."""
        from_middle = np.linspace(0.0, math.acos(self.ball_m / self.center_m), SAMPLES)  # as seen from its centre
        out, up = self.ball_m * np.sin(from_middle), self.center_m - self.ball_m * np.cos(from_middle)
        elevation = 2.0 * from_middle + np.arctan2(out, up) - RIGHT_ANGLE  # a cone whose gamma is from_middle
        if math.isfinite(self.scene_m):
            above = up - (self.center_m - self.ball_m) + (self.scene_m - out) * np.tan(elevation)
            elevation = np.arctan(above / self.scene_m)
        return elevation, self.focal_px * out / up


@dataclass(frozen=True, kw_only=True)
class Polynomial:
    """A calibrated law, as omnidirectional calibrations give it (Scaramuzza 2006): for a mirror or a fish-eye lens.

    tan(elevation) = (c0 + c1 r + c2 r^2 + ...) / r. The sign is that of the elevation: c0 < 0 for a mirror, which shows
    in its middle what lies behind the camera's back, c0 > 0 for a lens.

    Attributes:
        coefficients: c0, c1, c2, ... for r in pixels.
        rim_px: radius up to which the polynomial holds [pixels].
    """

    coefficients: tuple[float, ...]
    rim_px: float

    def __post_init__(self) -> None:
        _refuse_below(self, 0.0, "rim_px")
        steps = np.diff(self.elevation(self._radii))
        if not self.coefficients or not ((steps > 0.0).all() or (steps < 0.0).all()):
            raise ValueError("coefficients must make the elevation grow, or fall, all the way to rim_px")

    def elevation(self, radius: Floats) -> Floats:
        """Elevations [rad] that are seen at radii [pixels]; nan beyond the rim."""
        inside = np.where(radius <= self.rim_px, radius, np.nan)
        return np.asarray(np.arctan2(np.polynomial.Polynomial(self.coefficients or (0.0,))(inside), inside))

    def radius(self, elevation: Floats) -> Floats:
        """See ``RadialLaw``."""
        radii = self._radii
        elevations = self.elevation(radii)
        if elevations[0] > elevations[-1]:
            elevations, radii = elevations[::-1], radii[::-1]
        return np.asarray(np.interp(elevation, elevations, radii, left=np.nan, right=np.nan))

    @property
    def _radii(self) -> Floats:
        return np.linspace(0.0, self.rim_px, SAMPLES)
