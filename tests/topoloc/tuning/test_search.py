"""The search takes what is clearly better, by itself or together with another setting, and looks only where it may."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from topoloc.metrics import METRICS
from topoloc.odometry import OdometryNoise
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.tuning.choice import Choice, Tunable
from topoloc.tuning.evaluator import Evaluator
from topoloc.tuning.search import Training, alone, searched, trainings_of
from topoloc.tuning.trial import Outcome

FOLDS = 5
ACCURACY = next(metric for metric in METRICS if metric.name == "node_accuracy")
SLOTS = Tunable("sensor.slots", "8", ("6", "12"))
ZOOM = Tunable("sensor.zoom", "1.1", ("1", "1.2"))
ODOMETRY = Tunable("odometry", "default", ("estimated",))
Score = Callable[[Choice], np.ndarray]


class Made(Evaluator):
    """Knows what comes of a choice by a formula; counts what was asked for."""

    def __init__(self, score: Score, median: Score = lambda _: np.ones(FOLDS)) -> None:
        super().__init__(TopoMap("m", Camera(40.0, 4, 3), (Node("a", "a", 0.0, 0.0),)), (), "ima", "activity")
        self.score, self.median, self.asked = score, median, 0

    def try_all(self, choices: Sequence[Choice]) -> None:
        self.asked += len(choices)
        for choice in choices:
            values = self.score(choice)
            refused = "no" if np.isnan(values).all() else ""
            self.outcomes[choice] = Outcome(
                {"node_accuracy": values, "position_median_m": self.median(choice)}, refused=refused
            )


def trainings(noise: OdometryNoise | None = None) -> list[Training]:
    noises = {"default": OdometryNoise(), "estimated": noise or OdometryNoise(0.3)}
    return [Training(mask, noises) for mask in trainings_of(FOLDS)]


def found(score: Score, tunables: Sequence[Tunable] = (SLOTS, ZOOM), **more: Score) -> list[str]:
    return [str(choice) for choice in searched(Made(score, **more), tunables, trainings(), ACCURACY)]


def by_words(gains: dict[str, float]) -> Score:
    """0.5 on every fold, and each of these words adds its gain, a little more or less from fold to fold."""
    spread = np.array([0.01, -0.01, 0.0, 0.01, -0.01])
    return lambda choice: (
        0.5 + sum((gains.get(f"{key}={word}", 0.0) * (1.0 + spread) for key, word in choice.words), np.zeros(FOLDS))
    )


def test_the_best_value_of_each() -> None:
    score = by_words({"sensor.slots=6": 0.1, "sensor.slots=12": 0.2, "sensor.zoom=1": -0.1, "sensor.zoom=1.2": 0.05})
    assert found(score) == ["sensor.slots=12 sensor.zoom=1.2"] * (FOLDS + 1)


def test_the_defaults_where_nothing_is_better() -> None:
    assert found(by_words({"sensor.slots=6": -0.1})) == ["defaults"] * (FOLDS + 1)


def test_what_is_better_on_one_fold_only_is_chance() -> None:
    lucky = np.array([0.3, 0.0, 0.0, -0.02, 0.01])
    assert found(lambda choice: 0.5 + lucky * bool(choice.words))[-1] == "defaults"


def test_a_second_pass_finds_what_only_helps_together() -> None:
    """Slots of 6 are worth something only at a zoom of 1.2, which is gone over after them."""

    def score(choice: Choice) -> np.ndarray:
        words = dict(choice.words)
        wide, few = words.get("sensor.zoom") == "1.2", words.get("sensor.slots") == "6"
        return 0.5 + (0.1 * wide + 0.2 * (wide and few)) * (1.0 + 0.01 * np.arange(FOLDS))

    assert found(score)[-1] == "sensor.slots=6 sensor.zoom=1.2"


def test_equal_scores_are_told_apart_by_the_position() -> None:
    score = by_words({"sensor.slots=6": 0.1, "sensor.slots=12": 0.1})
    assert found(score, median=lambda choice: np.full(FOLDS, 0.2 if "sensor.slots=12" in str(choice) else 0.4))[-1] == (
        "sensor.slots=12"
    )


def test_a_better_position_alone_changes_nothing() -> None:
    assert found(by_words({}), median=lambda choice: np.full(FOLDS, 0.2 if choice.words else 0.4))[-1] == "defaults"


def test_a_fold_that_is_held_out_is_not_looked_at() -> None:
    """On the first fold alone 6 slots are bad; who may not see it chooses them."""
    bad = np.array([-0.9, 0.1, 0.11, 0.1, 0.12])
    chosen = found(lambda choice: 0.5 + bad * ("sensor.slots=6" in str(choice)))
    assert chosen == ["sensor.slots=6"] + ["defaults"] * FOLDS


def test_what_was_refused_is_never_chosen() -> None:
    gains = by_words({"sensor.slots=6": 0.1})
    score: Score = lambda choice: np.full(FOLDS, np.nan) if "sensor.slots=12" in str(choice) else gains(choice)  # noqa: E731
    assert found(score)[-1] == "sensor.slots=6"


def test_less_may_be_better() -> None:
    wrong = next(metric for metric in METRICS if metric.name == "wrong_rate")

    class Wrong(Made):
        def try_all(self, choices: Sequence[Choice]) -> None:
            super().try_all(choices)
            for choice in choices:
                values = self.outcomes[choice].metrics
                self.outcomes[choice] = Outcome({**values, "wrong_rate": 1.0 - values["node_accuracy"]})

    made = Wrong(by_words({"sensor.slots=6": 0.1}))
    assert str(searched(made, [SLOTS], trainings(), wrong)[-1]) == "sensor.slots=6"


def test_the_noise_is_that_of_the_training() -> None:
    masks = trainings_of(FOLDS)
    fitted = [OdometryNoise(0.01 * (number + 1)) for number in range(len(masks))]
    sides = [
        Training(mask, {"default": OdometryNoise(), "estimated": noise})
        for mask, noise in zip(masks, fitted, strict=True)
    ]
    chosen = searched(Made(by_words({"odometry=estimated": 0.1})), [ODOMETRY], sides, ACCURACY)
    assert [choice.noise for choice in chosen] == fitted


def test_each_alone_is_the_defaults_but_for_one() -> None:
    singles = alone([SLOTS, ZOOM], trainings()[-1])
    assert {str(choice) for choice in singles.values()} == {
        "defaults",
        *("sensor.slots=6", "sensor.slots=12", "sensor.zoom=1", "sensor.zoom=1.2"),
    }
    assert singles["sensor.slots", "8"] == Choice() == singles["sensor.zoom", "1.1"]


@pytest.mark.parametrize("count", [3, 5])
def test_each_fold_is_held_out_once(count: int) -> None:
    masks = np.array(trainings_of(count))
    assert (masks[:-1].sum(axis=0) == count - 1).all() and masks[-1].all()
