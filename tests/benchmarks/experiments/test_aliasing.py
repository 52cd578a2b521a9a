"""Two places that look alike (thesis 5.2.5), and Tables 5.7 and 5.8 done again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments import aliasing
from benchmarks.experiments.aliasing import EXPERIMENT
from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from benchmarks.experiments.printed_steps import TABLE_5_7, TABLE_5_8, PrintedStep, node_of
from benchmarks.experiments.rivals import rivals, share_of
from benchmarks.experiments.tracking import Tracked
from benchmarks.worlds.lab import LabWorld
from estimators.activity import ActivityTracker


@pytest.mark.parametrize("table", [TABLE_5_7, TABLE_5_8])
def test_rebuilt_headings_give_the_printed_activities_to_the_last_digit(table: PrintedStep) -> None:
    step = table.done_by(ActivityTracker(), True)
    np.testing.assert_allclose(step.destinations.activity, list(table.activity.values()), atol=0.5001e-6)
    assert step.node == node_of("1")


@pytest.mark.parametrize(
    ("table", "expected", "digits"), [(TABLE_5_7, (0.40592, 0.26197, 0.33211), 5), (TABLE_5_8, (0.5176, 0.4824), 4)]
)
def test_without_headings(table: PrintedStep, expected: tuple[float, ...], digits: int) -> None:
    step = table.done_by(ActivityTracker(), False)
    np.testing.assert_allclose(step.destinations.activity, expected, atol=0.505 * 10.0**-digits)
    assert np.isnan(step.delta_phi).sum() >= len(table.match)


def test_a_tracker_keeps_nothing_from_one_printed_step_to_the_next() -> None:
    tracker = ActivityTracker()
    TABLE_5_8.done_by(tracker, True)
    again = TABLE_5_7.done_by(tracker, True)
    np.testing.assert_allclose(again.destinations.activity, list(TABLE_5_7.activity.values()), atol=0.5001e-6)


def test_rivals_by_hand(by_hand: Callable[..., Tracked]) -> None:
    seen = by_hand(
        ("normal", 0, 0, [(0, 0.61, False), (1, 0.65, False), (0, 0.5, True)]),  # Table 5.7
        ("virtual", 0, 0, [(0, 0.5, True), (1, 0.54, False)]),  # Table 5.8
        ("normal", 0, 0, [(0, 0.7, False), (1, 0.6, False)]),
        ("supposed", 0, 0, []),
    )
    found = rivals(seen, LabWorld().layout())
    np.testing.assert_allclose(found.right, [0.61, 0.0, 0.7, 0.0])
    np.testing.assert_allclose(found.wrong, [0.65, 0.54, 0.6, 0.0])
    assert found.aliased.tolist() == [True, False, False, False]
    assert found.misled.tolist() == [False, True, False, False]
    assert share_of(seen.kind == "virtual", found.misled) == 1.0
    assert np.isnan(share_of(found.misled, np.zeros(4, dtype=bool)))


def test_draws() -> None:
    row = {quantity.key: 0.5 for quantity in EXPERIMENT.quantities}
    figure = Figure(layout="constrained")
    EXPERIMENT.draw([{AS_PUBLISHED: row, IMPROVED: row}], figure)
    assert [len(axes.patches) for axes in figure.axes] == [6, 6]


@pytest.mark.slow
def test_the_claims_of_the_thesis_hold(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rounds of three seeds: a wrong node matches better now and then, and the tracker resolves most of these."""
    monkeypatch.setattr(aliasing, "LAPS", 2.0)
    ours = [EXPERIMENT.measure(seed)[AS_PUBLISHED] for seed in (10, 11, 12)]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours[0])
    assert ours[0]["1"] == pytest.approx(0.418523, abs=1e-6) and ours[0]["won"] == 1.0
    assert 0.01 < np.mean([one["aliased old"] for one in ours]) < 0.2
    resolved = [one[f"resolved {name}"] for one in ours for name in ("fresh", "old", "people")]
    assert np.nanmean(resolved) > 0.5
