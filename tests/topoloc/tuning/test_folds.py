"""Recordings become folds: which frames are in, how many there are, and what is refused."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from oracles.made_drives import poses_on_a_circle, recording_of

from topoloc.errors import UserError
from topoloc.recording import Track
from topoloc.tuning import folds_of


def test_a_fold_is_a_lap_where_there_are_enough() -> None:
    folds = folds_of([recording_of(poses_on_a_circle(100))])
    assert [fold.name for fold in folds] == [f"lap {number}" for number in range(1, 6)]
    assert sum(len(fold.pictures) for fold in folds) == 100
    assert folds[1].metres == pytest.approx(19 * 0.626, abs=0.7)


def test_few_laps_are_cut_further() -> None:
    folds = folds_of([recording_of(poses_on_a_circle(40))])
    assert [fold.name for fold in folds] == [f"lap {lap} stretch {part}" for lap in (1, 2) for part in (1, 2)]


def test_a_drive_without_laps_is_cut_too() -> None:
    ahead = np.column_stack([np.arange(60.0), np.zeros(60), np.zeros(60)])
    assert [len(fold.pictures) for fold in folds_of([recording_of(ahead)])] == pytest.approx([15] * 4, abs=1)


def test_each_of_several_recordings_has_its_name() -> None:
    ahead = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
    folds = folds_of([recording_of(ahead, name=name) for name in ("mon", "tue", "wed", "thu")])
    assert [fold.name for fold in folds] == ["mon", "tue", "wed", "thu"]


def test_recordings_of_one_name_have_their_path() -> None:
    ahead = np.column_stack([np.arange(40.0), np.zeros(40), np.zeros(40)])
    folds = folds_of([recording_of(ahead, name=name) for name in ("mon/drive", "tue/drive")])
    assert [fold.name for fold in folds] == [f"{day}/drive stretch {part}" for day in ("mon", "tue") for part in (1, 2)]


def test_as_many_stretches_as_asked_for() -> None:
    assert len(folds_of([recording_of(poses_on_a_circle(100))], count=3)) == 3


def test_only_frames_that_open_the_gate() -> None:
    poses = np.repeat(poses_on_a_circle(80), 3, axis=0)  # each pose three times
    folds = folds_of([recording_of(poses, poses)])
    assert sum(len(fold.pictures) for fold in folds) == 80
    assert all(picture.time % 3 == 0 for fold in folds for picture in fold.pictures)


def test_frames_without_a_known_truth_are_left_out() -> None:
    whole = recording_of(poses_on_a_circle(100))
    assert whole.truth is not None
    kept = np.r_[10:40, 50:100]
    partly = replace(whole, truth=Track(whole.truth.times[kept], whole.truth.poses[kept]))
    times = [picture.time for fold in folds_of([partly]) for picture in fold.pictures]
    assert times == [*range(9, 41), *range(49, 100)]


class TestMistakes:
    def test_no_truth(self) -> None:
        with pytest.raises(UserError, match=r"drive: has no groundtruth.txt.*record the true pose"):
            folds_of([replace(recording_of(poses_on_a_circle(100)), truth=None)])

    def test_too_short(self) -> None:
        with pytest.raises(UserError, match=r"drive: 20 frames .* record more laps"):
            folds_of([recording_of(poses_on_a_circle(20))])

    def test_too_many_folds(self) -> None:
        with pytest.raises(UserError, match=r"in 50 parts.*--folds"):
            folds_of([recording_of(poses_on_a_circle(100))], count=50)

    @pytest.mark.parametrize("count", [1, 2])
    def test_too_few_folds(self, count: int) -> None:
        with pytest.raises(UserError, match=rf"in {count} parts.*--folds"):
            folds_of([recording_of(poses_on_a_circle(100))], count=count)

    def test_a_truth_of_another_time(self) -> None:
        drive = recording_of(poses_on_a_circle(100))
        assert drive.truth is not None
        with pytest.raises(UserError, match="0 frames with known truth"):
            folds_of([replace(drive, truth=Track(drive.truth.times + 1e6, drive.truth.poses))])

    def test_a_recording_named_twice(self) -> None:
        with pytest.raises(UserError, match=r"drive: is named twice"):
            folds_of([recording_of(poses_on_a_circle(100), name=name) for name in ("drive", "./drive")])
