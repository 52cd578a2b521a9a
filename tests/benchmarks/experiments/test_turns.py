"""Turns for a panorama with their truth."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.experiments.turns import Turn, placement_errors, reconstructed, shown, turn_at
from benchmarks.worlds import LabWorld, Scan
from sensors.panorama import Panorama
from topoloc.types import Image


def panorama(headings_deg: list[float]) -> Panorama:
    image: Image = np.zeros((8, 72), dtype=np.uint8)
    return Panorama(image, np.zeros(3, dtype=np.int64), np.deg2rad(headings_deg), 0.0, 1.0)


def test_errors_are_beside_the_first_snapshot_and_wrap() -> None:
    turn = Turn((), np.deg2rad([0.0, 30.0, 350.0]))
    np.testing.assert_allclose(placement_errors(panorama([90.0, 62.0, 97.0]), turn), [2.0, 3.0])


def test_snapshots_that_leave_a_gap_give_a_panorama_all_the_same() -> None:
    turn = turn_at(LabWorld(), 2, 1000, Scan(snapshots=12), 99)
    wide = Turn([*turn.snapshots[:3], *turn.snapshots[9:]], np.concatenate([turn.turned[:3], turn.turned[9:]]))
    made = reconstructed("circle", {"step_deg": 30.0}, wide)
    assert made.image.shape[0] == 288
    assert placement_errors(made, wide).shape == (5,)


def test_a_turn_is_the_same_for_the_same_seed_and_another_for_another_experiment() -> None:
    first, again, other = (turn_at(LabWorld(), 2, 1000, Scan(), stream) for stream in (98, 98, 99))
    np.testing.assert_array_equal(first.turned, again.turned)
    np.testing.assert_array_equal(first.snapshots[1], again.snapshots[1])
    assert (first.turned[1:] != other.turned[1:]).all()


def test_a_picture_is_small_and_grey() -> None:
    picture = np.array(shown(np.full((288, 3456, 3), 90, dtype=np.uint8)))
    assert picture.shape == (30, 360)
    assert picture.min() == picture.max() == pytest.approx(90)
