"""What the replay shows is what was there: beliefs summed up, long drives thinned out, the tracker's own table."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.replay import account_of, as_json, cells_of, drive_of, look_of
from benchmarks.replay.record import FINEST_M, LEAST_SHARE, MOST_FRAMES, SHOWN_HYPOTHESES, SHOWN_PLACES
from benchmarks.scenarios import Case
from estimators import ActivityTracker, ParticleFilter
from topoloc.localizer import Localizer
from topoloc.recording import LazyImages
from topoloc.testing import evidence_for, toy_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame, Image, WeightedPoses


def frames(count: int, read: list[int]) -> list[Frame]:
    def reader(number: int) -> Image:
        read.append(number)
        return np.full((6, 8, 3), 100, dtype=np.uint8)

    return [
        Frame(float(n), np.array([float(n), 0.0, 0.0]), np.zeros(3), LazyImages({"rgb": partial(reader, n)}))
        for n in range(count)
    ]


@given(
    st.integers(1, 3000),
    st.floats(0.01, 30.0),
    st.integers(0, 2**16),
)
def test_a_belief_is_summed_up_in_few_cells_about_its_mean(count: int, spread: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.normal(3.0, spread, (count, 2)), rng.uniform(-np.pi, np.pi, count)])
    belief = WeightedPoses(poses, rng.normal(0.0, 2.0, count), np.zeros(3))
    x, y, share = np.array(cells_of(belief)).T
    assert len(share) <= SHOWN_PLACES
    assert 0.5 < share.sum() <= 1.0 + 1e-4 * len(share)
    assert (np.diff(share) <= 0.0).all() and share.min() >= LEAST_SHARE - 1e-4
    low, high = poses[:, :2].min(axis=0), poses[:, :2].max(axis=0)
    assert (np.column_stack([x, y]) >= low - 1e-3).all() and (np.column_stack([x, y]) <= high + 1e-3).all()


def test_cells_of_few_places_are_these_places() -> None:
    poses = np.array([[0.0, 0.0, 1.0], [0.02, 0.0, -1.0], [5.0, 1.0, 0.0]])
    belief = WeightedPoses(poses, np.log([0.3, 0.3, 0.4]), np.zeros(3))
    assert FINEST_M > 0.02
    assert cells_of(belief) == [(0.01, 0.0, 0.6), (5.0, 1.0, 0.4)]


@pytest.mark.parametrize("keep", [True, False])
def test_a_long_drive_is_thinned_out_and_does_not_fill_memory(keep: bool) -> None:
    read: list[int] = []
    count = 2 * MOST_FRAMES + 1
    case = Case(toy_map(), frames(count, read), np.zeros((count, 3)))
    shown = drive_of("long", 0, case, keep)
    assert [n for n, frame in enumerate(shown.frames) if frame] == read == list(range(0, count, 3))
    assert len(shown.truth) == len(shown.times) == len(shown.reckoned) == count
    case.frames[0].images["rgb"]
    assert len(read) == len(range(0, count, 3)) + (not keep)


class Seer:
    """Sees where the toy robot stands."""

    needs = frozenset({"rgb"})

    def fit(self, topo_map: TopoMap) -> None:
        self.topo_map = topo_map

    def observe(self, frame: Frame) -> Evidence:
        return evidence_for(self.topo_map, (float(frame.timestamp), 0.0, 0.0))


def test_a_look_keeps_the_best_hypotheses_and_a_tracker_its_table() -> None:
    the_map, sensor, tracker = toy_map(), Seer(), ActivityTracker()
    localizer = Localizer(the_map, sensor, tracker)
    for frame in frames(3, []):
        localizer.step(frame)
    step = localizer.last
    assert step is not None and step.evidence is not None and tracker.last is not None
    look = look_of(2, frame, step, sensor)
    matches = [hypothesis.match for hypothesis in look.hypotheses]
    assert matches == sorted(matches, reverse=True) and len(matches) <= SHOWN_HYPOTHESES
    assert matches[0] == round(float(step.evidence.match.max()), 4)
    assert look.slots == []
    account = account_of(tracker)
    assert account is not None and account.winner == tracker.last.winner
    assert [line.node for line in account.destinations] == tracker.last.destinations.nodes.tolist()
    assert sum(line.activity for line in account.destinations) == pytest.approx(1.0, abs=1e-3)
    assert np.array(account.delta_l) == pytest.approx(tracker.last.delta_l, abs=1e-3)
    assert json.loads(as_json(account))["kind"] == tracker.last.kind
    assert account_of(ParticleFilter()) is None


def test_a_frame_without_a_picture_is_empty() -> None:
    (frame,) = frames(1, [])
    case = Case(toy_map(), [replace(frame, images={})], np.zeros((1, 3)))
    assert drive_of("dark", 0, case).frames == [""]


def test_a_belief_that_reaches_far_takes_no_more_memory() -> None:
    poses = np.array([[0.0, 0.0, 0.0], [3e6, -3e6, 0.0], [3e6, 3e6, 0.0]])
    cells = cells_of(WeightedPoses(poses, np.log([0.5, 0.25, 0.25]), np.zeros(3)))
    assert sorted(cells) == [(0.0, 0.0, 0.5), (3e6, -3e6, 0.25), (3e6, 3e6, 0.25)]
