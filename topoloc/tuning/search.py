"""The search: one setting at a time, on all folds but one for each fold, and on all of them for the proposal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from topoloc.metrics import Metric
from topoloc.odometry import OdometryNoise
from topoloc.tuning.choice import Choice, Tunable
from topoloc.tuning.evaluator import Evaluator
from topoloc.tuning.trial import Outcome

PASSES = 2
"""Each setting is gone over so often: the best of one depends on the others."""
TIE_BREAKER = "position_median_m"
"""Of settings whose score is the same, that with the smaller median position error is chosen."""
STANDARD_ERRORS = 2.0
"""A setting is changed only for a gain of more than so many standard errors of its mean over the folds, each beside
itself: of a dozen values some look better by chance."""

LAST = (-np.inf, -np.inf)
"""The rank of what is not chosen."""

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Training:
    """What one search may look at.

    Attributes:
        folds: (F,) which folds.
        noises: what the words for the odometer's noise stand for, fitted on those folds.
    """

    folds: Mask
    noises: Mapping[str, OdometryNoise]


def trainings_of(count: int) -> list[Mask]:
    """(F + 1,) masks (F,): all folds but each one in turn, and last all of them."""
    return [*(~np.eye(count, dtype=bool)), np.ones(count, dtype=bool)]


def alone(tunables: Sequence[Tunable], training: Training) -> dict[tuple[str, str], Choice]:
    """By key and value: the defaults with that one setting changed."""
    return {
        (one.key, word): Choice().changed(one, word, training.noises)
        for one in tunables
        for word in (one.default, *one.others)
    }


def searched(
    evaluator: Evaluator, tunables: Sequence[Tunable], trainings: Sequence[Training], score: Metric
) -> list[Choice]:
    """For each training, the choice that is best on its folds, found from the defaults by coordinate descent.

    All trainings go side by side, so that what several of them ask for is tried once and several processes have work.
    """
    current = [Choice()] * len(trainings)
    for _ in range(PASSES):
        before = list(current)
        for one in tunables:
            rivals = [
                [choice.changed(one, word, training.noises) for word in (one.default, *one.others)]
                for choice, training in zip(current, trainings, strict=True)
            ]
            evaluator.try_all([choice for row in rivals for choice in row])
            current = [
                _best(evaluator, [choice, *row], training.folds, score)
                for choice, row, training in zip(current, rivals, trainings, strict=True)
            ]
        if current == before:
            break
    return current


def trials_of(tunables: Sequence[Tunable], trainings: int) -> int:
    """How many choices ``searched`` asks for at most, those asked for again included."""
    return PASSES * trainings * sum(1 + len(one.others) for one in tunables)


def _best(evaluator: Evaluator, choices: Sequence[Choice], folds: Mask, score: Metric) -> Choice:
    """The best on some folds of those that are clearly better than the first; the first, where none is."""
    first, *others = (evaluator.outcomes[choice] for choice in choices)
    ranks = [_rank(first, folds, score)]
    ranks += [_rank(other, folds, score) if _clearly(other, first, folds, score) else LAST for other in others]
    return choices[ranks.index(max(ranks))]


def _clearly(new: Outcome, old: Outcome, folds: Mask, score: Metric) -> bool:
    """Whether one is better than the other by ``STANDARD_ERRORS`` on some folds, two of them at least."""
    if new.refused or old.refused:
        return False
    gains = _sign(score) * (new.metrics[score.name] - old.metrics[score.name])[folds]
    error = gains.std(ddof=1) / np.sqrt(len(gains))
    return bool(gains.mean() > STANDARD_ERRORS * error)


def _rank(outcome: Outcome, folds: Mask, score: Metric) -> tuple[float, float]:
    """What is compared, larger is better: the mean score, then the tie-breaker. No value is worse than any."""
    if outcome.refused:
        return LAST
    means = _sign(score) * outcome.metrics[score.name][folds].mean(), -outcome.metrics[TIE_BREAKER][folds].mean()
    first, second = (round(float(mean), 9) if np.isfinite(mean) else -np.inf for mean in means)
    return first, second


def _sign(score: Metric) -> float:
    return 1.0 if score.better == "higher" else -1.0
