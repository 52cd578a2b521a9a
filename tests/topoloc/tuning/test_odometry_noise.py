"""The noise of an odometer comes back from what it said and what was true, whatever happens now and then."""

from __future__ import annotations

from dataclasses import asdict

import numpy as np
import pytest
from oracles.made_drives import fold_of, poses_on_a_circle, recording_of

from benchmarks.worlds.odometer import Drift, odometer
from topoloc.geometry import between
from topoloc.odometry import OdometryNoise
from topoloc.tuning import Fold, fit_noise, folds_of
from topoloc.tuning.odometry_noise import LEAST, log_likelihood, motions_of, scaled

KNOWN = OdometryNoise(0.2, 0.08, 0.15, 0.03, 0.03)


def driven(count: int, seed: int, noise: OdometryNoise = KNOWN) -> Fold:
    """Steps of 0 to 1 m and up to 60 degrees under the law of ``OdometryNoise``."""
    rng = np.random.default_rng(seed)
    steps = np.column_stack([rng.uniform(0.0, 1.0, count), np.zeros(count), rng.uniform(-1.0, 1.0, count)])
    variances = np.array([np.diag(noise.motion(np.zeros(3), step).covariance) for step in steps])
    return fold_of(steps, rng.normal(size=(count, 3)) * np.sqrt(variances))


def fitted_to_steps(fold: Fold) -> OdometryNoise:
    return fit_noise([fold], strides=(1,)).noise


class TestFit:
    def test_the_law_comes_back(self) -> None:
        """Within 10 %, bases within 25 %: from 4,000 steps."""
        found, known = asdict(fitted_to_steps(driven(4000, 1))), asdict(KNOWN)
        for name in ("distance_per_metre", "heading_per_metre", "heading_per_turn"):
            assert found[name] == pytest.approx(known[name], rel=0.10), name
        for name in ("base_distance", "base_heading"):
            assert found[name] == pytest.approx(known[name], rel=0.25), name

    def test_a_robot_that_was_carried_off_changes_little(self) -> None:
        fold = driven(1000, 2)
        carried = fold.truth.copy()
        carried[300:, :2] += 5.0
        carried[700:, 0] -= 8.0
        found = fit_noise([Fold("made", fold.recording, fold.pictures, carried)], strides=(1,))
        assert found.left_out in range(2, 6)
        assert found.noise.distance_per_metre == pytest.approx(KNOWN.distance_per_metre, rel=0.2)

    def test_a_simulated_odometer(self) -> None:
        """Steps of 0.63 m whose length errs by 4 %, and whose heading by 1 degree: no systematic errors."""
        truth = poses_on_a_circle(600)
        drift = Drift(*[0.0] * 12)
        drift = Drift(**{**asdict(drift), "distance_sd": 0.04, "heading_sd_deg": 1.0})
        raw = odometer(between(truth[:-1], truth[1:]), np.zeros(3), drift, np.random.default_rng(3))
        folds = folds_of([recording_of(truth, raw)])
        noise = fit_noise(folds, strides=(1,)).noise
        variances = np.diag(noise.motion(np.zeros(3), np.array([0.626, 0.0, np.deg2rad(18.0)])).covariance)
        assert np.rad2deg(np.sqrt(variances[2])) == pytest.approx(1.0, rel=0.1)
        along_and_across = (0.04 * 0.626) ** 2 + (0.626 * np.deg2rad(0.5)) ** 2
        assert variances[0] == pytest.approx(along_and_across / 2.0, rel=0.15)

    def test_a_truth_made_from_the_odometer_is_not_believed_without_end(self) -> None:
        steps = np.tile([0.5, 0.0, 0.1], (60, 1))
        assert fit_noise([fold_of(steps, np.zeros((60, 3)))]).noise == LEAST_WITH_UNKNOWN

    @pytest.mark.parametrize(("factor", "worse"), [(0.5, False), (1.0, False), (3.0, True)])
    def test_an_odometer_that_is_worse_than_the_defaults_is_told(self, factor: float, worse: bool) -> None:
        fit = fit_noise([driven(500, 6, scaled(OdometryNoise(), factor))], strides=(1,))
        assert fit.beside_default == pytest.approx(factor, rel=0.1) and fit.worse == worse

    def test_without_odometer_there_is_nothing_to_fit(self) -> None:
        fit = fit_noise(folds_of([recording_of(poses_on_a_circle(100))]))
        assert (fit.told, fit.noise) == (False, OdometryNoise())


LEAST_WITH_UNKNOWN = OdometryNoise(**{k: v for k, v in asdict(LEAST).items() if not k.startswith("unknown")})


class TestLikelihood:
    def test_on_another_drive_the_fit_is_likelier_than_the_defaults_or_a_multiple(self) -> None:
        found, other = fitted_to_steps(driven(500, 4)), motions_of([driven(500, 5)], (1,))
        best = log_likelihood(found, other)
        assert best > max(
            log_likelihood(noise, other) for noise in (OdometryNoise(), scaled(found, 2.0), scaled(found, 0.5))
        )

    def test_a_motion_is_as_likely_as_its_gaussians_say(self) -> None:
        from scipy.stats import norm

        motions = motions_of([fold_of(np.array([[0.5, 0.0, 0.2]]), np.array([[0.03, -0.01, 0.02]]))], (1,))
        spread = np.sqrt(np.diag(KNOWN.motion(np.zeros(3), np.array([0.5, 0.0, 0.2])).covariance))
        assert log_likelihood(KNOWN, motions) == pytest.approx(norm.logpdf([0.03, -0.01, 0.02], scale=spread).sum())
