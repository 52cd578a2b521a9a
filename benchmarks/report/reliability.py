"""Reliability curves: where an estimator states a probability, how often is it right?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np
from numpy.typing import NDArray

from benchmarks.report.answers import Answers
from benchmarks.report.markup import number, pair_name, plural, select
from benchmarks.report.run_read import RunRead
from benchmarks.spread import Pair
from topoloc.geometry import Floats
from topoloc.metrics import CALIBRATION_BINS, calibration_error

SIDE, LEAST_RADIUS, LARGEST_RADIUS = 100.0, 1.6, 7.0
"""Of a panel's square, and of its points, in units of the drawing."""


@dataclass(frozen=True)
class Reliability:
    """A pair's updates that name a node, in bins of equal width of the stated probability.

    Attributes:
        count: (B,) updates.
        stated: (B,) their mean probability; NaN in an empty bin.
        right: (B,) share of them that named the right node; NaN in an empty bin.
        error: expected calibration error; None without an update.
    """

    count: NDArray[np.int64]
    stated: Floats
    right: Floats
    error: float | None

    @classmethod
    def of(cls, answers: Sequence[Answers]) -> Reliability:
        """Of a pair's runs, pooled: each update counts the same."""
        probability = np.concatenate([np.zeros(0), *(one.probability for one in answers)])
        right = np.concatenate([np.zeros(0, dtype=bool), *(one.right for one in answers)])
        bins = np.minimum((probability * CALIBRATION_BINS).astype(int), CALIBRATION_BINS - 1)
        count = np.bincount(bins, minlength=CALIBRATION_BINS)
        sums = (np.bincount(bins, weights, CALIBRATION_BINS) for weights in (probability, right.astype(float)))
        stated, share = (np.divide(total, count, out=np.full(len(count), np.nan), where=count > 0) for total in sums)
        return cls(count, stated, share, calibration_error(probability, right) if len(right) else None)


def reliability_section(run: RunRead) -> str:
    """A panel for each estimator; a select chooses the sensor."""
    pooled: dict[Pair, list[Answers]] = {}
    for (_, sensor, estimator), answers in run.answers.items():
        pooled.setdefault((sensor, estimator), []).extend(answers)
    sensors = [sensor for sensor in run.sensors if any(pair[0] == sensor for pair in pooled)]
    if not sensors:
        return "<p>No answers of a run that came to an end can be read.</p>"
    groups = []
    for index, sensor in enumerate(sensors):
        pairs = [(sensor, name) for name in run.estimators if (sensor, name) in pooled]
        panels = "".join(_panel(pair, Reliability.of(pooled[pair])) for pair in pairs)
        groups.append(f'<div class="panels" data-choice="{index}"{" hidden" * (index > 0)}>{panels}</div>')
    chooser = f'<p class="controls">{select("Sensor", sensors, "choose")}</p>'
    return f'<div data-role="chooser">{chooser}{"".join(groups)}</div>'


def _panel(pair: Pair, curve: Reliability) -> str:
    """One estimator's square; what it shows stands in its text alternative as numbers."""
    updates = int(curve.count.sum())
    bins = [index for index in range(CALIBRATION_BINS) if curve.count[index]]
    told = "; ".join(
        f"stated {curve.stated[i]:.2f}, right {curve.right[i]:.2f} ({plural(int(curve.count[i]), 'update')})"
        for i in bins
    )
    label = f"Reliability of {pair_name(pair)}: {told or 'no update names a node'}."
    error = "no update names a node" if curve.error is None else f"calibration error {number(curve.error)}"
    return (
        f'<figure><svg viewBox="-16 -6 124 122" role="img" aria-label="{escape(label)}">'
        f"{_square()}{_points(curve, bins)}</svg>"
        f"<figcaption><b>{escape(pair[1])}</b><br>{error}<br>{plural(updates, 'update')}</figcaption></figure>"
    )


def _square() -> str:
    ticks = "".join(
        f'<text x="{SIDE * at:.0f}" y="{SIDE + 11}" text-anchor="middle">{text}</text>'
        f'<text x="-4" y="{SIDE - SIDE * at + 3:.0f}" text-anchor="end">{text}</text>'
        for at, text in ((0.0, "0"), (0.5, ".5"), (1.0, "1"))
    )
    return (
        f'<rect class="frame" width="{SIDE:.0f}" height="{SIDE:.0f}"/>'
        f'<path class="diagonal" d="M0 {SIDE:.0f}L{SIDE:.0f} 0"/>{ticks}'
    )


def _points(curve: Reliability, bins: Sequence[int]) -> str:
    """The curve, with points whose area tells of how many updates they are made."""
    if not bins:
        return ""
    places = [(SIDE * curve.stated[i], SIDE - SIDE * curve.right[i]) for i in bins]
    radii = np.maximum(LARGEST_RADIUS * np.sqrt(curve.count / curve.count.max()), LEAST_RADIUS)
    line = "L".join(f"{x:.1f} {y:.1f}" for x, y in places)
    dots = "".join(
        f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radii[i]:.1f}"/>' for i, (x, y) in zip(bins, places, strict=True)
    )
    return f'<path class="curve" d="M{line}"/>{dots}'
