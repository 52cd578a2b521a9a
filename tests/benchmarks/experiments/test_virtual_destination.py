"""The virtual destination wins where no look is right (thesis 5.2.6); the printed step is in test_aliasing.py."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments import virtual_destination
from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from benchmarks.experiments.tracking import Tracked
from benchmarks.experiments.virtual_destination import EXPERIMENT, _helped
from benchmarks.worlds.lab import LabWorld


def test_shares_by_hand(by_hand: Callable[..., Tracked]) -> None:
    seen = by_hand(
        ("virtual", 0, 0, [(0, 0.5, True), (1, 0.54, False)]),
        ("virtual", 7, 0, [(7, 0.5, True), (0, 0.52, False)]),
        ("normal", 2, 0, [(2, 0.6, False), (0, 0.5, True)]),
        ("normal", 0, 0, [(0, 0.8, False)]),
        ("supposed", 0, 0, []),
    )
    helped = _helped(seen, LabWorld().layout())
    assert helped == pytest.approx(
        {"virtual": 0.5, "virtual right": 0.5, "misled": 0.4, "virtual there": 0.5, "right there": 0.5}
    )


def test_draws() -> None:
    row = {quantity.key: 0.5 for quantity in EXPERIMENT.quantities}
    figure = Figure(layout="constrained")
    EXPERIMENT.draw([{AS_PUBLISHED: row, IMPROVED: row}], figure)
    assert [len(axes.patches) for axes in figure.axes] == [6, 6]


@pytest.mark.slow
def test_the_claims_of_the_thesis_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rounds of three seeds: a fifth of old destinations virtual, to 10 points; most of them right."""
    monkeypatch.setattr(virtual_destination, "LAPS", 2.0)
    ours = [EXPERIMENT.measure(seed)[AS_PUBLISHED] for seed in (10, 11, 12)]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours[0])
    assert ours[0]["1v"] == pytest.approx(0.558304, abs=1e-6) and ours[0]["won"] == 1.0
    assert np.mean([one["virtual old"] for one in ours]) == pytest.approx(40 / 193, abs=0.10)
    right = [one[f"virtual right {name}"] for one in ours for name in ("fresh", "old", "people")]
    assert np.nanmean(right) > 0.5
    assert np.nanmean([one["virtual there old"] for one in ours]) > 0.5
