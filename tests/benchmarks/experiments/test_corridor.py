"""Laboratory and corridor, there and back (thesis 5.2.8)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.corridor import EXPERIMENT, _turned_back
from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.passes import identified, passed_unnamed, visits
from benchmarks.experiments.tracking import Tracked


def test_visits_cover_a_drive() -> None:
    assert visits(np.array([0, 0, 1, 0])) == [slice(0, 2), slice(2, 3), slice(3, 4)]


def test_passes_by_hand(by_hand: Callable[..., Tracked]) -> None:
    look = [(1, 0.7, False)]
    seen = by_hand(
        ("normal", 0, 0, look),
        ("supposed", 0, 1, []),
        ("normal", 1, 1, look),
        ("supposed", 1, 2, []),
        ("normal", 3, 2, look),
        ("supposed", 3, 3, []),
    )
    assert passed_unnamed(seen) == [(2, 3)]
    assert identified(seen) == 0.5  # 0 and 1; 3 was only supposed


def test_the_way_back_starts_at_the_last_update_at_the_end() -> None:
    assert _turned_back(np.array([0, 13, 14, 14, 13, 0])) == 3


def test_draws() -> None:
    row = {"truth": [[0, 0], [1, 1]], "odometer": [[0, 0], [2, 1]], "wrong at": []}
    figure = Figure()
    EXPERIMENT.draw([{AS_PUBLISHED: row}], figure)
    assert len(figure.axes[0].lines) == 4


@pytest.mark.slow
def test_the_claims_of_the_thesis_hold() -> None:
    """Updates as published to 3, the odometer several metres and almost 90 degrees off (to 20), the match to 0.08."""
    ours = [EXPERIMENT.measure(seed)[AS_PUBLISHED] for seed in (10, 11, 12)]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(ours[0])
    mean = {quantity.key: np.mean([one[quantity.key] for one in ours]) for quantity in EXPERIMENT.quantities}
    for key, published in {"updates": 51, "inside": 30, "outside": 21}.items():
        assert mean[key] == pytest.approx(published, abs=3), key
    assert mean["mean match"] == pytest.approx(0.6642, abs=0.08)
    assert 3.0 <= mean["off"] <= 10.0
    assert mean["off turned"] == pytest.approx(90.0, abs=20.0)
    assert mean["10 on the way back"] > 0.5
    assert mean["errors outside"] > mean["errors inside"]
    assert mean["error rate"] < 0.45  # the thesis: 0.02
