"""How good a run was: a table of metrics, one entry a column of ``results.csv``.

All of them look at updates only: frames whose motion gate opened, blind ones included. Between updates the estimate
merely rides on the odometry, and a robot that stands still would count the same success many times.
A metric that has no value for a run (no update, no kidnapping, never localized) gives None, which is written as an
empty cell: never 0, which would be a result.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from topoloc.geometry import Floats, wrap
from topoloc.localizer import Step
from topoloc.topo_map import TopoMap
from topoloc.types import Estimate, Ints, Status

Bools = NDArray[np.bool_]
Better = Literal["higher", "lower", "near 3", "neither"]

RIGHT_WITHIN_M = 0.25
"""The named node is right if it is at most this much farther from the true position than the nearest one [m]."""
ADJACENT_WITHIN_M = 1.0
"""A node that is not right is adjacent if it lies within this of the true one [m], or if an edge joins the two."""
PRECISION = 0.99
"""Of the answers that ``recall_at_p99`` counts, at least this share is right."""
CALIBRATION_BINS = 10
"""Bins of equal width on [0, 1] in which ``calibration_error`` compares probability and success."""

SMALLEST_VARIANCE = 1e-6
"""A covariance with less than this in some direction (1 mm, 1 mrad) counts as singular [m^2, rad^2]."""


@dataclass(frozen=True)
class Costs:
    """What a run cost; None where it was not measured.

    Attributes:
        sensor_ms: one look of the sensor, in the mean [ms].
        estimator_ms: one update beside the look, in the mean [ms].
        peak_mb: the most memory that the process held so far [MB].
    """

    sensor_ms: float | None = None
    estimator_ms: float | None = None
    peak_mb: float | None = None


@dataclass(frozen=True)
class Run:
    """What one sensor and one estimator made of one recording, beside the truth.

    Attributes:
        topo_map: the map.
        estimates: one per frame.
        kinds: of each frame's step, as in ``topoloc.localizer.Step``: ``update``, ``blind``, ``unreadable``, ``gated``.
        truth: (N, 3) true poses of the robot.
        kidnapped_at: indices of the first frames after the robot was carried elsewhere.
        costs: what the run cost, where it was measured.
    """

    topo_map: TopoMap
    estimates: tuple[Estimate, ...]
    kinds: tuple[str, ...]
    truth: Floats
    kidnapped_at: tuple[int, ...] = ()
    costs: Costs = Costs()

    def __post_init__(self) -> None:
        if not len(self.estimates) == len(self.kinds) == len(self.truth):
            raise ValueError(
                f"a run needs as many estimates ({len(self.estimates)}) as kinds ({len(self.kinds)}) "
                f"and true poses ({len(self.truth)})"
            )

    @classmethod
    def of(
        cls,
        topo_map: TopoMap,
        steps: Sequence[Step],
        truth: Floats,
        kidnapped_at: Sequence[int] = (),
        costs: Costs | None = None,
    ) -> Run:
        """The record of a localizer's N steps beside the truth (N, 3). Raises ``ValueError`` for another N."""
        estimates, kinds = tuple(step.estimate for step in steps), tuple(step.kind for step in steps)
        pose = np.asarray(truth, dtype=np.float64)
        return cls(topo_map, estimates, kinds, pose, tuple(kidnapped_at), costs or Costs())

    @cached_property
    def updates(self) -> Ints:
        """(U,) indices of the frames whose gate opened."""
        return np.flatnonzero(np.array(self.kinds) != "gated")

    @cached_property
    def nodes(self) -> Ints:
        """(U,) named nodes; -1 where none was named."""
        return np.array([-1 if e.node is None else e.node for e in self._updated], dtype=np.int64)

    @cached_property
    def probabilities(self) -> Floats:
        """(U,) probabilities that the named node is right."""
        return np.array([e.probability for e in self._updated], dtype=np.float64)

    @cached_property
    def errors(self) -> Floats:
        """(U, 3) estimated minus true pose, the heading wrapped."""
        poses = np.array([e.pose for e in self._updated], dtype=np.float64).reshape(-1, 3)
        difference = poses - self.truth[self.updates]
        return np.column_stack([difference[:, :2], wrap(difference[:, 2])])

    @cached_property
    def covariances(self) -> Floats:
        """(U, 3, 3) covariances that the estimator claims."""
        return np.array([e.covariance for e in self._updated], dtype=np.float64).reshape(-1, 3, 3)

    @cached_property
    def true_nodes(self) -> Ints:
        """(U,) nodes nearest to the true positions."""
        return self.topo_map.nearest_node(self.truth[self.updates][:, :2])

    @cached_property
    def right(self) -> Bools:
        """(U,) whether the named node is right (``RIGHT_WITHIN_M``); naming none is not."""
        positions = self.truth[self.updates][:, :2]
        distance = np.linalg.norm(positions - self.topo_map.positions[self.nodes], axis=1)
        slack = RIGHT_WITHIN_M + 1e-9  # exactly 0.25 m is right, whatever the rounding
        return np.asarray((self.nodes >= 0) & (distance <= self.topo_map.distance_to_nearest(positions) + slack))

    @cached_property
    def adjacent(self) -> Bools:
        """(U,) whether the named node is not right, but next to the true one (``ADJACENT_WITHIN_M``)."""
        place = self.topo_map.positions
        near = np.linalg.norm(place[self.nodes] - place[self.true_nodes], axis=1) <= ADJACENT_WITHIN_M + 1e-9
        joined = [self.topo_map.adjacent(int(a), int(b)) for a, b in zip(self.nodes, self.true_nodes, strict=True)]
        return np.asarray((self.nodes >= 0) & ~self.right & (near | np.array(joined, dtype=bool)))

    def with_status(self, status: Status) -> Bools:
        """(U,) whether the estimate had this status."""
        return np.array([e.status is status for e in self._updated], dtype=bool)

    @cached_property
    def _updated(self) -> list[Estimate]:
        return [self.estimates[i] for i in self.updates]


@dataclass(frozen=True)
class Metric:
    """One column of ``results.csv``.

    Attributes:
        name: of the column.
        label: for people, where there is little room.
        unit: of the value; empty for a share or a pure number.
        definition: what it says, in one sentence.
        better: which way is better.
        value: computes it; None where it is undefined.
        of_machine: it tells of the machine, too: another run of the same settings may have another value.
    """

    name: str
    label: str
    unit: str
    definition: str
    better: Better
    value: Callable[[Run], float | None]
    of_machine: bool = False


def _mean(values: Bools | Floats) -> float | None:
    return float(np.mean(values)) if len(values) else None


def _median(values: Floats) -> float | None:
    return float(np.median(values)) if len(values) else None


def _steps(run: Run) -> float | None:
    return float(len(run.updates))


def _node_accuracy(run: Run) -> float | None:
    return _mean(run.right)


def _strict_accuracy(run: Run) -> float | None:
    return _mean(run.nodes == run.true_nodes)


def _adjacent_rate(run: Run) -> float | None:
    return _mean(run.adjacent)


def _wrong_rate(run: Run) -> float | None:
    return _mean(~(run.right | run.adjacent))


def _position_median(run: Run) -> float | None:
    return _median(np.linalg.norm(run.errors[:, :2], axis=1))


def _position_rmse(run: Run) -> float | None:
    square = _mean(np.sum(run.errors[:, :2] ** 2, axis=1))
    return None if square is None else float(np.sqrt(square))


def _heading_median(run: Run) -> float | None:
    return _median(np.rad2deg(np.abs(run.errors[:, 2])))


def _first(hits: Bools) -> int | None:
    """1-based place of the first hit, or None."""
    return int(np.argmax(hits)) + 1 if hits.any() else None


def _steps_to_localize(run: Run) -> float | None:
    return _first(run.right & run.with_status(Status.LOCALIZED))


def _recall_at_p99(run: Run) -> float | None:
    """Answers are given from a threshold on the probability upwards; equal probabilities are answered together."""
    if not len(run.updates):
        return None
    named = run.nodes >= 0
    probability, right = run.probabilities[named], run.right[named]
    order = np.argsort(-probability, kind="stable")
    correct = np.cumsum(right[order])
    answered = np.arange(1, len(order) + 1)
    last_of_its_kind = np.append(np.diff(probability[order]) != 0.0, True)[: len(order)]
    allowed = last_of_its_kind & (correct >= PRECISION * answered - 1e-9)
    return float(correct[allowed].max(initial=0)) / len(run.updates)


def _recovery_steps(run: Run) -> float | None:
    """One kidnapping that the run never recovers from leaves the whole run without a value."""
    counts = []
    ends = [*run.kidnapped_at[1:], len(run.kinds)]
    for start, end in zip(run.kidnapped_at, ends, strict=False):
        counts.append(_first(run.right[(run.updates >= start) & (run.updates < end)]))
    known = [count for count in counts if count is not None]
    return float(np.mean(known)) if counts and len(known) == len(counts) else None


def _lost_rate(run: Run) -> float | None:
    return _mean(run.with_status(Status.LOST))


def calibration_error(probability: Floats, right: Bools) -> float:
    """Expected calibration error of stated probabilities (U,), U >= 1, of answers that were right or not (U,)."""
    bins = np.minimum((probability * CALIBRATION_BINS).astype(int), CALIBRATION_BINS - 1)
    claimed = np.bincount(bins, weights=probability, minlength=CALIBRATION_BINS)
    achieved = np.bincount(bins, weights=right.astype(float), minlength=CALIBRATION_BINS)
    return float(np.abs(claimed - achieved).sum() / len(probability))


def _calibration_error(run: Run) -> float | None:
    named = run.nodes >= 0
    return calibration_error(run.probabilities[named], run.right[named]) if named.any() else None


def _nees(run: Run) -> float | None:
    """A belief of a few bare points has no spread in some direction: nothing to hold its error against."""
    eigenvalues = np.linalg.eigvalsh(run.covariances)
    usable = eigenvalues[:, 0] > SMALLEST_VARIANCE
    if not usable.any():
        return None
    errors, covariances = run.errors[usable], run.covariances[usable]
    weighted = np.linalg.solve(covariances, errors[:, :, None])[:, :, 0]
    return _mean(np.sum(errors * weighted, axis=1))


def _sensor_ms(run: Run) -> float | None:
    return run.costs.sensor_ms


def _estimator_ms(run: Run) -> float | None:
    return run.costs.estimator_ms


def _peak_mb(run: Run) -> float | None:
    return run.costs.peak_mb


METRICS: tuple[Metric, ...] = (
    Metric(
        "steps",
        "updates",
        "",
        "updates: frames whose motion gate opened; all else is counted over them",
        "neither",
        _steps,
    ),
    Metric(
        "node_accuracy",
        "node accuracy",
        "",
        "share of updates whose named node is at most 0.25 m farther from the true position than the nearest node",
        "higher",
        _node_accuracy,
    ),
    Metric(
        "strict_accuracy",
        "strict accuracy",
        "",
        "share of updates that name the very node nearest to the truth",
        "higher",
        _strict_accuracy,
    ),
    Metric(
        "adjacent_rate",
        "adjacent",
        "",
        "share of updates whose named node is not right, but within 1 m or one edge of the node nearest to the truth",
        "lower",
        _adjacent_rate,
    ),
    Metric(
        "wrong_rate",
        "wrong",
        "",
        "share of updates that name a node farther away than that, or none",
        "lower",
        _wrong_rate,
    ),
    Metric(
        "position_median_m",
        "median position error",
        "m",
        "median distance from estimated to true position",
        "lower",
        _position_median,
    ),
    Metric("position_rmse_m", "RMS position error", "m", "root mean square of that distance", "lower", _position_rmse),
    Metric(
        "heading_median_deg",
        "median heading error",
        "deg",
        "median absolute error of the heading",
        "lower",
        _heading_median,
    ),
    Metric(
        "steps_to_localize",
        "updates to first fix",
        "updates",
        "updates up to the first that is LOCALIZED and right; 1 is the first one, empty if there is none",
        "lower",
        _steps_to_localize,
    ),
    Metric(
        "recall_at_p99",
        "recall at 99 % precision",
        "",
        "largest share of updates answered rightly when only answers above some probability count and 99 % of these "
        "must be right",
        "higher",
        _recall_at_p99,
    ),
    Metric(
        "recovery_steps",
        "updates to recover",
        "updates",
        "updates after a kidnapping up to the first right one, mean over kidnappings; empty without a kidnapping, or "
        "if one was never recovered from",
        "lower",
        _recovery_steps,
    ),
    Metric("lost_rate", "lost", "", "share of updates with status LOST", "lower", _lost_rate),
    Metric(
        "calibration_error",
        "calibration error",
        "",
        "expected calibration error: mean gap between stated probability and share of right nodes, in 10 bins, over "
        "the updates that name a node",
        "lower",
        _calibration_error,
    ),
    Metric(
        "nees",
        "NEES",
        "",
        "mean normalized squared error of the pose, over updates whose covariance is not singular (1 mm, 1 mrad); "
        "3 for an honest covariance, more for a boastful one",
        "near 3",
        _nees,
    ),
    Metric(
        "sensor_ms",
        "sensor",
        "ms",
        "mean time of one look of the sensor, in one thread; waiting for the picture is left out",
        "lower",
        _sensor_ms,
        of_machine=True,
    ),
    Metric(
        "estimator_ms",
        "estimator",
        "ms",
        "mean time of one update without the look: motion, evidence, estimate",
        "lower",
        _estimator_ms,
        of_machine=True,
    ),
    Metric(
        "peak_mb",
        "memory",
        "MB",
        "most memory that the process held so far, whatever it ran before",
        "lower",
        _peak_mb,
        of_machine=True,
    ),
)
"""Every metric, in the order of the columns of ``results.csv``."""


def evaluate(run: Run) -> dict[str, float | None]:
    """All metrics of a run, by name."""
    return {metric.name: metric.value(run) for metric in METRICS}
