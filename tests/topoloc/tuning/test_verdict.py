"""A gain is told from chance, or it is not; and the words say which."""

from __future__ import annotations

import numpy as np
import pytest

from topoloc.tuning.verdict import verdict_of

DEFAULT = np.full(4, 0.5)


def test_better_on_every_fold_of_four_is_told() -> None:
    verdict = verdict_of(DEFAULT + np.array([0.1, 0.05, 0.2, 0.1]), DEFAULT, higher_is_better=True)
    assert verdict.chance == pytest.approx(1 / 16)
    assert verdict.better and "take the proposal" in verdict.words


def test_of_three_folds_nothing_is() -> None:
    verdict = verdict_of(np.full(3, 0.9), np.full(3, 0.5), higher_is_better=True)
    assert not verdict.better and verdict.gain == pytest.approx(0.4)
    assert "3 folds cannot tell" in verdict.words


def test_one_large_gain_is_chance() -> None:
    verdict = verdict_of(DEFAULT + np.array([0.4, -0.05, -0.05, 0.0]), DEFAULT, higher_is_better=True)
    assert verdict.gain > 0.0 and not verdict.better
    assert "cannot be told from chance" in verdict.words


@pytest.mark.parametrize("change", [0.0, -0.1])
def test_no_gain_keeps_the_defaults(change: float) -> None:
    verdict = verdict_of(DEFAULT + change, DEFAULT, higher_is_better=True)
    assert not verdict.better and verdict.words.startswith("keep the defaults")


def test_less_may_be_better() -> None:
    assert verdict_of(DEFAULT - 0.1, DEFAULT, higher_is_better=False).better


def test_a_fold_without_a_score() -> None:
    nothing = np.array([np.nan, 0.5, 0.5, 0.5])
    assert verdict_of(nothing, nothing, True).gain == 0.0
    assert not verdict_of(np.full(4, 0.9), nothing, True).better


def test_by_chance_alone_few_are_told() -> None:
    """Of 200 comparisons without a difference at most one in ten and a little, whatever the number of folds."""
    rng = np.random.default_rng(0)
    for count in (4, 6, 14):
        gains = rng.normal(size=(200, count))
        told = np.mean([verdict_of(gain, np.zeros(count), True).better for gain in gains])
        assert told < 0.16
