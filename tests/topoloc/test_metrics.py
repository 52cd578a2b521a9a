from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from topoloc.localizer import Step
from topoloc.metrics import METRICS, Costs, Run, evaluate
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Estimate, Status

# A at 0 m, B at 1 m, C at 3 m, D at 7 m along x; only B and C are joined.
PLACES = TopoMap(
    "four places",
    Camera(),
    tuple(Node(name, name, x, 0.0) for name, x in zip("ABCD", (0.0, 1.0, 3.0, 7.0), strict=True)),
    edges=np.array([[1, 2]]),
)
A, B, C, D = range(4)


def guess(
    node: int | None,
    pose: Sequence[float] = (0.0, 0.0, 0.0),
    probability: float = 0.9,
    status: Status = Status.LOCALIZED,
    variance: Sequence[float] = (1.0, 1.0, 1.0),
) -> Estimate:
    return Estimate(np.array(pose, dtype=float), np.diag(variance), node, probability, status)


def run_of(
    guesses: Sequence[Estimate],
    truth: Sequence[Sequence[float]],
    kinds: Sequence[str] | None = None,
    kidnapped_at: Sequence[int] = (),
) -> Run:
    kinds = kinds or ["update"] * len(guesses)
    return Run(PLACES, tuple(guesses), tuple(kinds), np.array(truth, dtype=float), tuple(kidnapped_at))


def at(x: float, heading: float = 0.0) -> tuple[float, float, float]:
    return (x, 0.0, heading)


def test_every_metric_is_described_and_undefined_without_updates() -> None:
    assert len({metric.name for metric in METRICS}) == len(METRICS)
    assert all(metric.definition for metric in METRICS)
    values = evaluate(run_of([guess(A)], [at(0.0)], kinds=["gated"]))
    assert values.pop("steps") == 0
    assert set(values.values()) == {None}


def test_truth_of_a_node() -> None:
    # At 0.6 m: B is 0.4 m away, A 0.6 m: 0.2 m farther, still right. At 0.65 m: 0.3 m farther, adjacent (1 m from B).
    # At 2.9 m: C is nearest; B is joined to it, A is 3 m from it, and no node is wrong too.
    run = run_of(
        [guess(A), guess(A), guess(B), guess(A), guess(None), guess(C)],
        [at(0.6), at(0.65), at(2.9), at(2.9), at(2.9), at(2.9)],
    )
    values = evaluate(run)
    assert values["steps"] == 6
    assert values["node_accuracy"] == pytest.approx(2 / 6)
    assert values["strict_accuracy"] == pytest.approx(1 / 6)
    assert values["adjacent_rate"] == pytest.approx(2 / 6)
    assert values["wrong_rate"] == pytest.approx(2 / 6)


def test_a_quarter_of_a_metre_farther_is_still_right() -> None:
    assert evaluate(run_of([guess(A), guess(A)], [at(0.625), at(0.6251)]))["node_accuracy"] == 0.5


def test_gated_frames_do_not_count_and_blind_ones_do() -> None:
    run = run_of([guess(A), guess(D), guess(B), guess(B)], [at(0.0)] * 4, ["update", "gated", "blind", "unreadable"])
    assert evaluate(run)["steps"] == 3
    assert evaluate(run)["node_accuracy"] == pytest.approx(1 / 3)


def test_position_and_heading_errors() -> None:
    run = run_of(
        [guess(A, (3.0, 4.0, math.pi - 0.1)), guess(A, (1.0, 0.0, 0.2)), guess(A, (0.0, 2.0, -0.5))],
        [at(0.0, -math.pi + 0.1), at(0.0, 0.0), at(0.0, 0.0)],
    )  # distances 5, 1, 2; headings 0.2 (across the seam), 0.2, 0.5
    values = evaluate(run)
    assert values["position_median_m"] == pytest.approx(2.0)
    assert values["position_rmse_m"] == pytest.approx(math.sqrt((25 + 1 + 4) / 3))
    assert values["heading_median_deg"] == pytest.approx(math.degrees(0.2))


def test_steps_to_localize_wants_both_localized_and_right() -> None:
    right_but_unsure, sure_but_wrong = guess(A, status=Status.AMBIGUOUS), guess(D)
    truth = [at(0.0)] * 4
    guesses = [right_but_unsure, sure_but_wrong, guess(A), guess(A)]
    assert evaluate(run_of(guesses, truth))["steps_to_localize"] == 3
    assert evaluate(run_of(guesses, truth, ["update", "gated", "update", "update"]))["steps_to_localize"] == 2
    assert evaluate(run_of(guesses[:2], truth[:2]))["steps_to_localize"] is None


def test_recall_at_p99() -> None:
    truth = [at(0.0)] * 5
    guesses = [guess(A, probability=p) for p in (0.9, 0.8, 0.6)] + [guess(D, probability=0.7), guess(None)]
    assert evaluate(run_of(guesses, truth))["recall_at_p99"] == pytest.approx(2 / 5)  # down to 0.8; then a wrong one
    tied = [guess(A, probability=0.9), guess(A, probability=0.8), guess(D, probability=0.8)]
    assert evaluate(run_of(tied, truth[:3]))["recall_at_p99"] == pytest.approx(1 / 3)  # 0.8 answers both or none
    assert evaluate(run_of([guess(D), guess(A, probability=0.1)], truth[:2]))["recall_at_p99"] == 0.0
    assert evaluate(run_of([guess(None, probability=0.0)], truth[:1]))["recall_at_p99"] == 0.0


def test_recall_at_p99_allows_one_wrong_answer_in_a_hundred() -> None:
    guesses = [guess(A)] * 99 + [guess(D)]
    assert evaluate(run_of(guesses, [at(0.0)] * 100))["recall_at_p99"] == pytest.approx(0.99)
    assert evaluate(run_of(guesses[1:], [at(0.0)] * 99))["recall_at_p99"] == 0.0  # 98 of 99 are too few


def test_recovery_counts_updates_from_the_kidnapping_on() -> None:
    truth = [at(0.0)] * 2 + [at(7.0)] * 4
    guesses = [guess(A), guess(A), guess(A), guess(A), guess(D), guess(D)]
    assert evaluate(run_of(guesses, truth))["recovery_steps"] is None
    assert evaluate(run_of(guesses, truth, kidnapped_at=[2]))["recovery_steps"] == 3
    gated = ["update", "update", "gated", "update", "update", "update"]
    assert evaluate(run_of(guesses, truth, gated, kidnapped_at=[2]))["recovery_steps"] == 2
    assert evaluate(run_of(guesses[:4], truth[:4], kidnapped_at=[2]))["recovery_steps"] is None


def test_recovery_is_the_mean_over_kidnappings_unless_one_never_ends() -> None:
    truth = [at(7.0)] * 2 + [at(0.0)] * 2
    guesses = [guess(A), guess(D), guess(A), guess(A)]  # right again at the second, then at the first update
    assert evaluate(run_of(guesses, truth, kidnapped_at=[0, 2]))["recovery_steps"] == pytest.approx(1.5)
    never = [guess(A), guess(A), guess(A), guess(A)]
    assert evaluate(run_of(never, truth, kidnapped_at=[0, 2]))["recovery_steps"] is None


def test_lost_rate() -> None:
    guesses = [guess(A, status=status) for status in (Status.LOST, Status.AMBIGUOUS, Status.LOCALIZED, Status.LOST)]
    assert evaluate(run_of(guesses, [at(0.0)] * 4))["lost_rate"] == 0.5


def test_calibration_error() -> None:
    # Bin [0.8, 0.9): 0.8 and 0.86, one of two right: |1.66 - 1| = 0.66. Bin [0.9, 1]: 1.0, right: 0. Over three: 0.22.
    guesses = [guess(A, probability=0.8), guess(D, probability=0.86), guess(A, probability=1.0), guess(None)]
    assert evaluate(run_of(guesses, [at(0.0)] * 4))["calibration_error"] == pytest.approx(0.22)
    assert evaluate(run_of([guess(None)], [at(0.0)]))["calibration_error"] is None


def test_nees() -> None:
    # 2^2/4 + 1^2/1 + 0.5^2/0.25 = 3, and 0; the bare point has no covariance to hold its error against.
    guesses = [
        guess(A, (2.0, 1.0, 0.5), variance=(4.0, 1.0, 0.25)),
        guess(A, (0.0, 0.0, 0.0)),
        guess(A, (9.0, 0.0, 0.0), variance=(0.0, 0.0, 0.0)),
    ]
    assert evaluate(run_of(guesses, [at(0.0)] * 3))["nees"] == pytest.approx(1.5)
    assert evaluate(run_of(guesses[2:], [at(0.0)]))["nees"] is None


def test_nees_uses_the_whole_covariance() -> None:
    covariance = np.array([[2.0, 1.0, 0.0], [1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    estimate = Estimate(np.array([1.0, 1.0, 0.0]), covariance, A, 0.9, Status.LOCALIZED)
    assert evaluate(run_of([estimate], [at(0.0)]))["nees"] == pytest.approx(2 / 3)


def test_a_run_is_made_of_a_localizers_steps() -> None:
    steps = [Step(0.0, "update", guess(A)), Step(1.0, "gated", guess(A))]
    run = Run.of(PLACES, steps, np.zeros((2, 3)), [1])
    assert run.kinds == ("update", "gated") and run.kidnapped_at == (1,)
    assert evaluate(run)["node_accuracy"] == 1.0


def test_a_run_of_unequal_lengths_is_refused() -> None:
    with pytest.raises(ValueError, match="as many estimates"):
        run_of([guess(A)], [at(0.0), at(1.0)])


def test_costs_are_metrics_like_the_others() -> None:
    run = replace(run_of([guess(A)], [at(0.0)]), costs=Costs(9.5, 1.25, 300.0))
    values = evaluate(run)
    assert (values["sensor_ms"], values["estimator_ms"], values["peak_mb"]) == (9.5, 1.25, 300.0)
    assert {metric.name for metric in METRICS if metric.of_machine} == {"sensor_ms", "estimator_ms", "peak_mb"}
