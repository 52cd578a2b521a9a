"""The times of the sensors are of maps and frames that they can use."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks import sensor_speed
from sensors import PCAMap


def test_every_time_is_measured_on_a_map_of_that_many(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sensor_speed, "VIEWS", 80)
    monkeypatch.setattr(sensor_speed, "REPEATS", 1)
    assert len(sensor_speed.map_of_views(np.random.default_rng(0)).views) == 80
    assert len(sensor_speed.map_of_circles(np.random.default_rng(0)).nodes) == 80
    sensor_speed.main()
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == ["sensor", PCAMap.name, "histogram", "descriptor", "fourier"]
    assert all(float(word) >= 0.0 for line in lines[1:] for word in line.split()[1:])
