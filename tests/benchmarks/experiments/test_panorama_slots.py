"""Panoramas with 4, 8 and 15 slots (thesis 5.1.2)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from benchmarks.experiments.panorama_slots import CIRCLE, EXPERIMENT, THESIS_SETTINGS, counts


def test_errors_are_counted_in_and_beyond_the_laboratory() -> None:
    errors = np.full((15, 11), 1.0)
    errors[0, 0], errors[1] = 6.0, 40.0
    errors[8:11] = 5.1
    found = counts("x", errors)
    assert found["x: lab"] == pytest.approx(1.0 - 12.0 / 88.0)
    assert found["x: whole"] == pytest.approx(6.0 / 8.0)
    assert found["x: worst"] == 40.0
    assert found["x: beyond"] == pytest.approx(4.0 / 7.0)


def test_a_strip_for_each_setting_is_drawn() -> None:
    picture = np.zeros((30, 360), dtype=int).tolist()
    measured = {
        AS_PUBLISHED: {"pictures": dict.fromkeys(THESIS_SETTINGS, picture)},
        IMPROVED: {"pictures": {CIRCLE: picture}},
    }
    figure = Figure()
    EXPERIMENT.draw([measured], figure)
    assert len(figure.axes) == len(THESIS_SETTINGS) + 1


@pytest.mark.slow
def test_more_slots_place_better() -> None:
    """4 slots fail, 8 are better but err, 15 are safer; over three seeds together."""
    measured = [EXPERIMENT.measure(seed) for seed in (10, 11, 12)]
    keys = {key for column in measured[0].values() for key in column}
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= keys
    share = {name: np.mean([one[AS_PUBLISHED][f"{name}: lab"] for one in measured]) for name in THESIS_SETTINGS}
    worst = {name: np.mean([one[AS_PUBLISHED][f"{name}: worst"] for one in measured]) for name in THESIS_SETTINGS}
    assert share["4 slots"] < 0.3
    assert share["4 slots"] + 0.2 < share["8 slots"] < 0.95
    assert share["15 slots, CLAHE"] > 0.5
    assert worst["15 slots, CLAHE"] < worst["8 slots, CLAHE"]
    assert np.mean([one[IMPROVED][f"{CIRCLE}: worst"] for one in measured]) < worst["15 slots, CLAHE"]
    for one in measured:  # without parallax our method has nothing to err by
        assert one[IMPROVED]["on axis: worst"] < 5.0
