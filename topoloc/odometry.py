"""Raw odometer readings -> Motion, its noise, and the gate that decides when an update is worth its time."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import ArrayLike

from topoloc.geometry import between, compose
from topoloc.thesis import THESIS
from topoloc.types import Motion


@dataclass(frozen=True)
class OdometryNoise:
    """How far a relative reading of the odometer can be trusted (standard deviations; they add in quadrature).

    Attributes:
        distance_per_metre: along and across, per metre travelled [m/m].
        heading_per_metre: per metre travelled [rad/m].
        heading_per_turn: per radian turned [rad/rad].
        base_distance: of any step, however short [m].
        base_heading: of any step, however short [rad].
        unknown_distance: of a step without an odometer [m].
        unknown_heading: of a step without an odometer [rad].
    """

    distance_per_metre: float = 0.10
    heading_per_metre: float = 0.06
    heading_per_turn: float = 0.05
    base_distance: float = 0.02
    base_heading: float = 0.01
    unknown_distance: float = 0.30
    unknown_heading: float = 0.50

    def __post_init__(self) -> None:
        for name, value in asdict(self).items():
            if not value >= 0.0:
                raise ValueError(f"{name} is {value}; a standard deviation is not negative")

    def motion(self, before: ArrayLike, after: ArrayLike) -> Motion:
        """Motion between two raw odometer poses (3,)."""
        delta = between(before, after)
        travelled, turned = float(np.hypot(delta[0], delta[1])), abs(float(delta[2]))
        distance = self.base_distance**2 + (self.distance_per_metre * travelled) ** 2
        heading = (
            self.base_heading**2 + (self.heading_per_metre * travelled) ** 2 + (self.heading_per_turn * turned) ** 2
        )
        return Motion(delta, np.diag([distance, distance, heading]))

    def unknown(self) -> Motion:
        """The motion of a step without an odometer: zero, with a covariance that says so."""
        distance, heading = self.unknown_distance**2, self.unknown_heading**2
        return Motion(np.zeros(3), np.diag([distance, distance, heading]))


@dataclass(frozen=True)
class MotionGate:
    """Opens once the camera has turned or moved far enough (thesis 3.8; 5.2: 10 degrees or 0.3 m).

    Attributes:
        min_rotation_deg: degrees; a turn of the pan head counts too.
        min_translation_m: metres.
    """

    min_rotation_deg: float = THESIS.min_rotation_deg
    min_translation_m: float = THESIS.min_translation_m

    def opens(
        self,
        last_odometry: ArrayLike,
        last_camera: ArrayLike,
        odometry: ArrayLike,
        camera: ArrayLike,
    ) -> bool:
        """Whether the camera moved enough between two raw odometer poses (3,) with camera mounts (3,)."""
        moved = between(compose(last_odometry, last_camera), compose(odometry, camera))
        tolerance = 1e-9  # a turn of exactly ten degrees opens it, whatever the rounding
        return bool(
            np.hypot(moved[0], moved[1]) >= self.min_translation_m - tolerance
            or abs(moved[2]) >= np.deg2rad(self.min_rotation_deg) - tolerance
        )
