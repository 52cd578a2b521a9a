"""Fits the sensors' scale from match to log-likelihood on calibration worlds: ``python -m benchmarks.calibration``.

The seeds are used for nothing else. What is printed stands as defaults in the sensors' settings. A hypothesis is
counted as right when the robot's true pose lies near it; a logistic regression of that on the match, with the share
of right ones taken out, gives the log-likelihood ratio. Simulated worlds: a real building will differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize
from scipy.special import expit

from benchmarks.worlds.simulate import LabSettings, simulate
from topoloc import plugins
from topoloc.geometry import Floats, wrap
from topoloc.localizer import look

SEEDS = (1000, 1001, 1002, 1003)
"""Far from the benchmark's, which count from 0."""
NEAR_M, NEAR_DEG = 0.5, 25.0
"""A hypothesis is right within this distance [m] and this turn [degrees] of the truth."""
WORLDS = (LabSettings(laps=2.0), LabSettings(laps=2.0, people=0.35), LabSettings(laps=2.0, age=1.0))


@dataclass(frozen=True)
class Scale:
    """log-likelihood ratio = slope * (match - base - margin); ``base`` is the sensor's own zero."""

    slope: float
    margin: float
    right_share: float
    heading_sd_deg: float


def observations(name: str, seeds: Sequence[int] = SEEDS) -> tuple[Floats, np.ndarray, Floats]:
    """All hypotheses of a sensor over the calibration worlds.

    Returns:
        match above the sensor's base (N,), whether it was right (N,), heading errors of the right ones [deg].
    """
    above, right, headings = [], [], []
    for world in WORLDS:
        for seed in seeds:
            drive = simulate(world, seed)
            sensor = plugins.make(plugins.SENSORS, name)
            sensor.fit(drive.topo_map)
            for frame, pose in zip(drive.frames, drive.truth, strict=True):
                evidence, _ = look(sensor, frame)
                distance = np.linalg.norm(evidence.poses[:, :2] - pose[:2], axis=1)
                turn = np.rad2deg(wrap(evidence.poses[:, 2] - pose[2]))
                near = (distance <= NEAR_M) & (np.abs(turn) <= NEAR_DEG)
                above.append(evidence.match - sensor.base_match)
                right.append(near)
                headings.append(turn[near])
    return np.concatenate(above), np.concatenate(right), np.concatenate(headings)


def fit_scale(above: Floats, right: np.ndarray, headings: Floats) -> Scale:
    """Logistic regression with the share of right hypotheses taken out."""

    def loss(parameters: Floats) -> float:
        logits = parameters[0] * above + parameters[1]
        return float(np.mean(np.logaddexp(0.0, np.where(right, -logits, logits))))

    slope, intercept = minimize(loss, np.array([10.0, -2.0]), method="BFGS").x
    share = float(right.mean())
    prior = np.log(share / (1.0 - share))
    check = float(expit(slope * above + intercept).mean())
    assert abs(check - share) < 1e-3  # a logistic regression that has converged reproduces the mean
    return Scale(float(slope), float((prior - intercept) / slope), share, float(np.std(headings)))


def main() -> None:
    """Print the scale of each sensor."""
    for name in ("ima", "histogram"):
        scale = fit_scale(*observations(name))
        print(
            f"{name}: slope {scale.slope:.1f}, margin {scale.margin:.3f} "
            f"({scale.right_share:.1%} of the hypotheses right, heading sd {scale.heading_sd_deg:.1f} degrees)"
        )


if __name__ == "__main__":
    main()
