from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.stats import chi2

from estimators.kld import KLD


def cloud(sd: float, count: int = 20_000) -> np.ndarray:
    return np.random.default_rng(0).normal(size=(count, 3)) * [sd, sd, 0.01] + 0.1


@pytest.mark.parametrize("bins", [2, 3, 10, 100, 3000])
def test_bound_is_the_chi_square_quantile(bins: int) -> None:
    """Fox derives it from n = chi2_{k-1, 1-delta} / (2 error); Wilson and Hilferty's approximation is good to 1 %."""
    exact = chi2.ppf(0.99, bins - 1) / (2.0 * 0.05)
    assert KLD().bound(np.array(bins)) == pytest.approx(exact, rel=0.01)


def test_number_by_hand() -> None:
    poses = np.array([[0.1, 0.1, 0.1]] * 5 + [[1.1, 0.1, 0.1]] * 5000)
    free, z = 1.0, 2.3263478740408408
    needed = free / (2 * 0.05) * (1 - 2 / 9 + math.sqrt(2 / 9) * z) ** 3
    assert KLD(least=2).enough(poses[:5]) == 5
    assert KLD(least=2).enough(poses) == math.ceil(needed)


def test_wide_beliefs_need_more() -> None:
    numbers = [KLD().enough(cloud(sd)) for sd in (0.02, 0.2, 0.5, 1.0)]
    assert numbers[0] == 100  # never fewer than the least
    assert numbers == sorted(numbers)
    assert numbers[-1] > 10 * numbers[0]


def test_all_are_drawn_where_all_are_not_enough() -> None:
    assert KLD().enough(cloud(1.0, 300)) == 300


@pytest.mark.parametrize(
    "wrong", [{"least": 1}, {"error": 0.0}, {"bin_m": 0.0}, {"bin_deg": -1.0}, {"confidence": 1.0}]
)
def test_settings_that_cannot_work_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must"):
        KLD(**wrong)
