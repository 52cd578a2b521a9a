"""What the zoom is worth (thesis 5.2.9)."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments import no_zoom
from benchmarks.experiments.experiment import AS_PUBLISHED
from benchmarks.experiments.methods import THESIS
from benchmarks.experiments.no_zoom import COMPARED, EXPERIMENT, WITHOUT


def test_nothing_but_the_zoom_differs() -> None:
    assert COMPARED[AS_PUBLISHED] == THESIS
    assert COMPARED[WITHOUT].sensor.zoom == 1.0 < THESIS.sensor.zoom
    assert COMPARED[WITHOUT].tracker == THESIS.tracker
    assert COMPARED[WITHOUT].sensor.slots == THESIS.sensor.slots


def test_draws() -> None:
    row = {quantity.key: 0.5 for quantity in EXPERIMENT.quantities}
    figure = Figure(layout="constrained")
    EXPERIMENT.draw([dict.fromkeys(COMPARED, row)], figure)
    assert [len(axes.patches) for axes in figure.axes] == [6, 6]


@pytest.mark.slow
def test_the_zoom_identifies_more(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two rounds of three seeds: without it, a tenth or more of the updates lose their destination."""
    monkeypatch.setattr(no_zoom, "LAPS", 2.0)
    measured = [EXPERIMENT.measure(seed) for seed in (10, 11, 12)]
    assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(measured[0][AS_PUBLISHED])
    for name in ("fresh", "old"):
        on, off = ([one[column] for one in measured] for column in (AS_PUBLISHED, WITHOUT))
        for key, gain in {"normal": 0.1, "supposed": -0.1, "best match": 0.03, "identified": -0.02}.items():
            more = np.mean([a[f"{key} {name}"] - b[f"{key} {name}"] for a, b in zip(on, off, strict=True)])
            assert more >= gain if key != "supposed" else more <= gain, (key, name, more)
