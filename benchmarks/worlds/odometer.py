"""What a differential drive's odometer says of a drive (thesis 5.1.4, 5.2.1)."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from topoloc.geometry import Floats, compose, rotate

GRILLE_ORIGIN_M = 0.5
"""One of the heating grilles crosses x at this place [m]."""


@dataclass(frozen=True)
class Drift:
    """The odometer's errors: systematic ones, their size drawn once a run, and random ones.

    Attributes:
        rotation_scale: error of a turn, as a share of it.
        rotation_scale_sd: its standard deviation over runs, as a share.
        curvature_deg: false turn, degrees counter-clockwise per metre driven.
        curvature_sd_deg: its standard deviation over runs, degrees per metre.
        distance_scale_sd: standard deviation over runs of the error of a distance, as a share of it.
        distance_sd: standard deviation of the distance of a step, as a share of it.
        heading_sd_deg: standard deviation of the heading of a step, degrees.
        slip_share: share of the steps in which a wheel slips on the carpet, 0 to 1.
        slip_loss: share of a step that wheels turn in vain when they slip, 0 to 1.
        slip_deg: standard deviation of the unseen turn when they slip, degrees.
        grille_spacing_m: distance of the heating grilles in the floor, metres; 0: none.
        grille_jolt_deg: standard deviation of the unseen turn on a grille, degrees.
    """

    rotation_scale: float = -0.018
    rotation_scale_sd: float = 0.001
    curvature_deg: float = -2.2
    curvature_sd_deg: float = 0.2
    distance_scale_sd: float = 0.005
    distance_sd: float = 0.02
    heading_sd_deg: float = 0.2
    slip_share: float = 0.03
    slip_loss: float = 0.1
    slip_deg: float = 1.0
    grille_spacing_m: float = 2.0
    grille_jolt_deg: float = 0.7

    def __post_init__(self) -> None:
        for name in ("slip_share", "slip_loss"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must lie between 0 and 1")
        spreads = [item.name for item in fields(self) if item.name.endswith("_sd") or "_sd_" in item.name]
        for name in (*spreads, "slip_deg", "grille_spacing_m", "grille_jolt_deg"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} is {getattr(self, name)}; it must not be negative")

    @classmethod
    def none(cls) -> Drift:
        """An odometer without errors."""
        return cls(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def on_grille(truth: Floats, spacing_m: float) -> NDArray[np.bool_]:
    """Which steps (N - 1,) between true poses (N, 3) cross a grille; the grilles run across x."""
    if spacing_m == 0.0:
        return np.zeros(len(truth) - 1, dtype=bool)
    strip = np.floor((truth[:, 0] - GRILLE_ORIGIN_M) / spacing_m)
    return np.asarray(strip[1:] != strip[:-1])


def odometer(
    steps: Floats,
    start: Floats,
    drift: Drift,
    rng: np.random.Generator,
    grille: NDArray[np.bool_] | None = None,
) -> Floats:
    """What the odometer says.

    Args:
        steps: (N - 1, 3) true motions, each in the robot's frame before it [m, m, rad].
        start: (3,) first reading, in the odometer's own frame.
        drift: its errors.
        rng: draws them.
        grille: (N - 1,) which steps cross a heating grille; None: none does.

    Returns:
        (N, 3) raw odometer poses.
    """
    count = len(steps)
    crossed = np.zeros(count, dtype=bool) if grille is None else grille
    scale = rng.normal(drift.rotation_scale, drift.rotation_scale_sd)
    curvature = np.deg2rad(rng.normal(drift.curvature_deg, drift.curvature_sd_deg))
    length_scale = rng.normal(0.0, drift.distance_scale_sd)
    heading, slipping, slip_turn, jolt, length = rng.standard_normal((count, 5)).T  # by rows: a longer drive goes on
    distance = np.linalg.norm(steps[:, :2], axis=1)
    moving = (distance > 0.0) | (steps[:, 2] != 0.0)  # a robot that is carried turns no wheel
    slips = (slipping < ndtri(drift.slip_share)) & moving
    unseen = drift.heading_sd_deg * heading * moving
    unseen += drift.slip_deg * slip_turn * slips
    unseen += drift.grille_jolt_deg * jolt * (crossed & moving)
    false_turn = scale * steps[:, 2] + curvature * distance + np.deg2rad(unseen)
    stretch = 1.0 + length_scale + drift.distance_sd * length + drift.slip_loss * slips
    stretched = steps[:, :2] * stretch[:, None]
    shifted = rotate(stretched, false_turn / 2.0)  # the error grows along the step: half of it bends the chord
    readings = [np.asarray(start, dtype=np.float64)]
    for move in np.column_stack([shifted, steps[:, 2] + false_turn]):
        readings.append(compose(readings[-1], move))
    return np.stack(readings)
