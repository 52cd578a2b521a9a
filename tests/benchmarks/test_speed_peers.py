"""IMA beside template matching, and filters beside Stone Soup: they agree, and would not if a peer were wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from oracles.ima_literal import ima_literal

from benchmarks.speed import image_matching, stone_soup_step
from benchmarks.speed.case import Case
from benchmarks.speed.image_matching import (
    FLAT_VARIANCE,
    SAME_VALUE,
    SLOT_COLUMNS,
    SLOTS,
    Found,
    Scene,
    TemplateMatching,
    ima_match,
    opencv_correlation,
    same_matches,
    skimage_correlation,
)
from benchmarks.speed.likelihood import log_likelihood, plain_log_likelihood
from benchmarks.speed.pictures import noise_pictures
from benchmarks.speed.stone_soup_step import stone_soup_gaussian, stone_soup_particles
from topoloc.types import Evidence


def agrees(case: Case) -> bool:
    return case.prepare().agree()


# --- IMA ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("count", [2, 40])
def test_ima_agrees_with_opencv(count: int) -> None:
    assert agrees(ima_match(count, "cv2.matchTemplate", opencv_correlation))


def test_ima_agrees_with_skimage() -> None:
    pytest.importorskip("skimage")
    assert agrees(ima_match(5, "skimage", skimage_correlation, ("skimage",)))


def test_ima_tells_a_wrong_peer() -> None:
    def vignetted(picture: np.ndarray, slot: np.ndarray) -> np.ndarray:
        return opencv_correlation(picture * np.linspace(1.0, 0.7, len(picture), dtype=np.float32)[:, None], slot)

    def turned(picture: np.ndarray, slot: np.ndarray) -> np.ndarray:
        return np.roll(opencv_correlation(picture, slot), 1)

    for wrong in (vignetted, turned):
        assert not agrees(ima_match(5, "a wrong one", wrong))


def test_the_peer_does_what_the_thesis_says(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(image_matching, "ROWS", 4)
    scene = Scene(2)
    value, column = TemplateMatching(scene, opencv_correlation).find()
    for k, panorama in enumerate(scene.panoramas.astype(np.float64)):
        literal = ima_literal(scene.frame.astype(np.float64), panorama, SLOTS, FLAT_VARIANCE)
        assert value[k] == pytest.approx(literal.max, abs=1e-5)
        assert column[k] == literal.col - 1


def test_the_frame_is_found_where_it_was_cut() -> None:
    scene = Scene(6)
    value, column = TemplateMatching(scene, opencv_correlation).find()
    assert value.argmax() == 5
    assert column[5] == image_matching.TURNED


def test_no_picture_has_a_flat_region() -> None:
    for picture in noise_pictures(np.random.default_rng(0), 50, 54, 648):
        around = np.concatenate([picture, picture[:, : SLOT_COLUMNS - 1]], axis=1)
        windows = np.lib.stride_tricks.sliding_window_view(around, SLOT_COLUMNS, axis=1)
        assert windows.var(axis=(0, 2)).min() > 100.0 * FLAT_VARIANCE


def test_pictures_close_a_circle_and_come_from_the_seed() -> None:
    first, again = (noise_pictures(np.random.default_rng(3), 4, 30, 90, channels=3) for _ in range(2))
    assert np.array_equal(first, again)
    assert first.shape == (4, 30, 90, 3)
    ends = np.abs(first[:, :, 0].astype(float) - first[:, :, -1]).mean()
    inside = np.abs(np.diff(first.astype(float), axis=2)).mean()
    assert ends < 2.0 * inside


def test_matches_are_the_same_only_where_values_and_columns_are() -> None:
    sums = np.array([[0.2, 0.9, 0.5], [0.7, 0.1, 0.7 - 0.5 * SAME_VALUE]])
    clear = Found(sums, np.array([1.0, 1.0]))
    value, column = np.array([0.9, 0.7]), np.array([1, 0])
    assert same_matches(value, column, clear)
    assert same_matches(value, np.array([1, 2]), clear)  # two columns are as good
    assert not same_matches(value, np.array([2, 0]), clear)
    assert not same_matches(value + 2.0 * SAME_VALUE, column, clear)
    drawn = Found(sums, np.array([1.0, 0.0]))  # rounding draws a slot of the second
    assert not same_matches(value, column, drawn)  # half are left out: too many to be called the same
    many = Found(np.repeat(sums, [9, 1], axis=0), np.repeat([1.0, 0.0], [9, 1]))
    assert same_matches(np.append(np.full(9, 0.9), 0.0), np.append(np.full(9, 1), 1), many)


# --- Stone Soup -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("likelihood", [log_likelihood, plain_log_likelihood])
def test_particle_step_agrees_with_stone_soup(likelihood: Callable[[Evidence, np.ndarray], np.ndarray]) -> None:
    pytest.importorskip("stonesoup")
    assert agrees(stone_soup_particles(1000, likelihood, "Stone Soup"))


def wider(evidence: Evidence, poses: np.ndarray) -> np.ndarray:
    return log_likelihood(replace(evidence, sigma=1.3 * evidence.sigma), poses)


def turned_by_a_little(evidence: Evidence, poses: np.ndarray) -> np.ndarray:
    return log_likelihood(replace(evidence, poses=evidence.poses + np.array([0.0, 0.0, 0.1])), poses)


@pytest.mark.parametrize("wrong", [wider, turned_by_a_little])
def test_particle_step_tells_a_wrong_stone_soup(wrong: Callable[[Evidence, np.ndarray], np.ndarray]) -> None:
    pytest.importorskip("stonesoup")
    assert not agrees(stone_soup_particles(1000, wrong, "a wrong one"))


def test_stone_soups_steps_never_end() -> None:
    pytest.importorskip("stonesoup")
    pair = stone_soup_particles(50, log_likelihood, "Stone Soup").prepare()
    for _ in range(45):
        pair.ours()
        pair.peers()


def test_gaussians_agree() -> None:
    pytest.importorskip("stonesoup")
    assert agrees(stone_soup_gaussian())


def test_gaussians_tell_a_wrong_peer(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stonesoup")
    pair = stone_soup_gaussian().prepare()
    right = stone_soup_step._peer_gaussian

    def wrong() -> object:
        monkeypatch.setattr(stone_soup_step, "NOISE", 1.1 * stone_soup_step.NOISE)
        return right()

    monkeypatch.setattr(stone_soup_step, "_peer_gaussian", wrong)
    assert not pair.agree()
