"""The saved belief: moved where the odometer went on, widened where it did not, refused where it is none."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from topoloc.errors import InputError
from topoloc.live.saved_belief import MOST_POSES, MOVED_BY_HAND_M, SavedBelief, load, map_digest, save
from topoloc.odometry import OdometryNoise
from topoloc.testing import toy_map
from topoloc.topo_map import Camera
from topoloc.types import WeightedPoses

THE_MAP = toy_map()
THERE = np.array([1.0, 2.0, np.pi / 2])
SAVED = SavedBelief(WeightedPoses.uniform(THERE[None]), np.array([5.0, 0.0, 0.0]), 100.0)
NOISE = OdometryNoise()


class TestPrior:
    def test_moved_by_the_odometry_and_widened_by_its_noise(self) -> None:
        prior, how = SAVED.prior(np.array([8.0, 0.0, 0.0]), 110.0, NOISE)
        assert prior.poses[0] == pytest.approx([1.0, 5.0, np.pi / 2])
        motion = np.diag(NOISE.motion(SAVED.odometry, (8.0, 0.0, 0.0)).covariance)  # type: ignore[arg-type]
        assert prior.spread == pytest.approx(motion) and how == "moved by the odometry since"

    @pytest.mark.parametrize(
        ("odometry", "time"),
        [
            (None, 110.0),
            ((0.01, 0.0, 0.02), 110.0),  # its count began again
            ((500.0, 0.0, 0.0), 110.0),  # no robot is so fast
            ((8.0, 0.0, 0.0), 10.0),  # its clock began again
        ],
    )
    def test_stays_and_is_widened_where_the_odometer_did_not_go_on(
        self, odometry: tuple[float, float, float] | None, time: float
    ) -> None:
        prior, how = SAVED.prior(None if odometry is None else np.array(odometry), time, NOISE)
        assert prior.poses[0].tolist() == THERE.tolist() and how == "widened"
        assert prior.spread[0] == pytest.approx(MOVED_BY_HAND_M**2)

    def test_one_saved_without_odometry(self) -> None:
        assert replace(SAVED, odometry=None).prior(np.zeros(3), 110.0, NOISE)[1] == "widened"

    def test_an_odometer_that_was_and_is_at_its_origin_went_on(self) -> None:
        saved = replace(SAVED, odometry=np.zeros(3))
        assert saved.prior(np.array([0.05, 0.0, 0.0]), 110.0, NOISE)[1] == "moved by the odometry since"


class TestFile:
    def test_there_is_none(self, tmp_path: Path) -> None:
        assert load(tmp_path / "belief", THE_MAP) is None

    def test_of_a_huge_belief_the_heaviest_poses_are_kept(self, tmp_path: Path) -> None:
        count = MOST_POSES + 5
        poses, log_weights = np.zeros((count, 3)), np.linspace(0.0, 5.0, count)
        poses[:, 0] = range(count)
        save(tmp_path / "b", replace(SAVED, belief=WeightedPoses(poses, log_weights)), THE_MAP)
        back = load(tmp_path / "b", THE_MAP)
        assert back is not None and back.belief.poses[:, 0].min() == 5 and len(back.belief.poses) == MOST_POSES

    def test_another_map_is_refused_and_other_pictures_are_not(self, tmp_path: Path) -> None:
        save(tmp_path / "b", SAVED, THE_MAP)
        with pytest.raises(InputError, match="is a belief on another map than 'toy'; name another file"):
            load(tmp_path / "b", toy_map(4))
        assert load(tmp_path / "b", replace(THE_MAP, camera=Camera(60.0, 32, 24))) is not None
        assert map_digest(replace(THE_MAP, name="other")) != map_digest(THE_MAP)

    @pytest.mark.parametrize(
        "spoil",
        [
            lambda data: b"",
            lambda data: b"hello",
            lambda data: data[: len(data) // 2],
            lambda data: data.replace(np.float64(2.0).tobytes(), np.float64(2.5).tobytes()),
            lambda data: pickle.dumps({"format": 1}),
        ],
        ids=["empty", "a text", "cut off", "another number", "a pickle"],
    )
    def test_what_is_damaged_is_told_in_one_line(self, spoil: Callable[[bytes], bytes], tmp_path: Path) -> None:
        path = tmp_path / "b"
        save(path, SAVED, THE_MAP)
        path.write_bytes(spoil(path.read_bytes()))
        with pytest.raises(InputError, match="is no belief that topoloc saved; delete it"):
            load(path, THE_MAP)

    @pytest.mark.parametrize("variance", [np.nan, np.inf, -0.01])
    def test_a_spread_that_is_none_is_refused(self, variance: float, tmp_path: Path) -> None:
        save(tmp_path / "b", SAVED, THE_MAP)
        with np.load(tmp_path / "b") as table:
            parts = dict(table)
        parts["spread"] = np.array([0.1, variance, 0.1])
        with (tmp_path / "b").open("wb") as file:
            np.savez(file, **parts)
        with pytest.raises(InputError, match="is no belief that topoloc saved; delete it"):
            load(tmp_path / "b", THE_MAP)

    def test_a_folder_is_told_too(self, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="cannot be read"):
            load(tmp_path, THE_MAP)
