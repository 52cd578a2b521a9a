"""The searches of view sensors beside peers: small, on whether they agree alone."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from benchmarks.speed import view_sensors
from benchmarks.speed.case import Case
from benchmarks.speed.view_sensors import (
    CASES,
    faiss_euclid,
    nearest_by_features,
    nearest_by_histograms,
    numpy_jeffrey,
    scipy_euclid,
    scipy_jeffrey,
    sklearn_euclid,
)
from topoloc.geometry import Floats

PEERS = {"scipy": scipy_euclid, "faiss": faiss_euclid, "sklearn": sklearn_euclid}


def agrees(case: Case) -> bool:
    return case.prepare().agree()


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("frames", [1, 8])
def test_searches_by_features_agree(name: str, frames: int) -> None:
    pytest.importorskip(name)
    assert agrees(nearest_by_features(frames, 700, name, PEERS[name]))


@pytest.mark.parametrize("search", [numpy_jeffrey, scipy_jeffrey])
def test_searches_by_histograms_agree(search: Any) -> None:
    assert agrees(nearest_by_histograms(4, 400, "peer", search))


def test_a_wrong_peer_is_told() -> None:
    def by_the_first_half(seen: Floats, known: Floats) -> Any:
        return scipy_euclid(seen[:, :10], known[:, :10])

    def by_another_mean(seen: Floats, known: Floats) -> Any:
        return numpy_jeffrey(seen, np.sqrt(known))

    assert not agrees(nearest_by_features(4, 700, "wrong", by_the_first_half))
    assert not agrees(nearest_by_histograms(4, 400, "wrong", by_another_mean))


def test_every_comparison_is_in_the_list_once() -> None:
    rows = [(case.what, case.size, case.peer) for case in CASES]
    assert len(set(rows)) == len(rows)
    assert {case.what for case in CASES} == {"nearest-pca", "nearest-histogram"}


def test_views_along_the_way_change_little_by_little() -> None:
    landmarks = np.array([[0.0], [1.0], [3.0]])
    made = view_sensors.along_a_way(landmarks, 30)[:, 0]
    assert made[0] == 0.0
    assert made[20] == 1.0
    np.testing.assert_allclose(np.diff(made), [0.05] * 20 + [0.1] * 9)
