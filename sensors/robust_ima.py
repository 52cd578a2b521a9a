"""A robust IMA beside the published one: less sensitive to light and to what stands in the way (thesis 6.1; ours)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from sensors.calibration import WRONG_QUANTILE
from sensors.ima import IMA, IMAConfig
from sensors.local_contrast import local_contrast
from sensors.slot_correlation import Reference
from sensors.slot_matching import Sums, slot_values, sums_within
from topoloc.geometry import Floats
from topoloc.types import Image, Ints, Pixels

NEAR_M = 1.05
"""A node within this is not far off (DESIGN.md: adjacent within 1 m): with zoom, its views are found where they are."""
DOUBTFUL, DOUBTFUL_RANGE = 0.45, (0.3, 0.6)
"""Value that 95 % of views of wrong nodes stay below in the simulated laboratory, for a map of one node; and how far it
may differ on others: two places that look alike, or blank walls, would else decide on a small map."""


@dataclass(frozen=True)
class RobustIMAConfig(IMAConfig):
    """Settings of the robust IMA: those of IMA, some with other defaults, and three of its own.

    Attributes:
        zoom: digital zoom rho_in, the largest that is tried.
        zoom_steps: zooms tried each way (2.4.3, 6.2).
        scene_m: distance of what is seen in (2.5) [m]; from ``benchmarks/calibration.py``.
        contrast_columns: standard deviation of the Gaussian window that contrast is measured in, columns of the scaled
            frame.
        contrast_grey: contrast that stays as it is [grey levels]; where there is much more, all are made alike.
        slack_columns: how far a slot may lie from its place in the row of slots, columns: near things shift against
            far ones when the robot stands beside the node.
        slope: log-likelihood ratio per unit of match; this and the next from ``benchmarks/calibration.py``.
        margin: match above the mean of wrong nodes at which the ratio is 1.
        sigma_m: how far around a hypothesis a match holds [m].
        kappa_fall: how fast the log of the heading's concentration falls with the match, per unit.
        sure_margin: match above the mean of wrong nodes from which on a match is sure.
        memory_mb: as for IMA; with these defaults 0.64 MB a node [MB].
    """

    zoom: float = 1.3
    zoom_steps: int = 3
    scene_m: float = 2.9
    contrast_columns: float = 6.0
    contrast_grey: float = 3.0
    slack_columns: int = 1
    slope: float = 15.4
    margin: float = 0.085
    sigma_m: float = 0.25
    kappa_fall: float = 23.7
    sure_margin: float = 0.091

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.contrast_columns <= 0.0 or self.contrast_grey <= 0.0:
            raise ValueError("contrast_columns and contrast_grey must be positive")
        if not 0 <= self.slack_columns < self.scale_columns // self.slots:
            raise ValueError(f"slack_columns is {self.slack_columns}; it must lie between 0 and the width of a slot")


class RobustIMA(IMA):
    """IMA with local contrast, slots that may give way, and no contest between them.

    Three departures from chapter 2. Contrast is made alike all over the picture before slots are compared, so that
    light and shade count for little. Every slot counts with its own correlation at its own place, give or take
    ``slack_columns``, not only where it beats the other slots (Code 2.1): at a right place a slot that looks like its
    neighbour is lost there. And correlations below zero count as zero: what covers a slot cannot speak against the
    others. The value is the mean of these correlations over the slots, in [0, 1].
    """

    Config: ClassVar[type[IMAConfig]] = RobustIMAConfig
    store: ClassVar[str] = "ima-robust"
    config: RobustIMAConfig
    unrelated_match: ClassVar[float] = 0.33
    """Mean match of wrong nodes in the simulated laboratory."""

    def __init__(self, config: RobustIMAConfig | None = None) -> None:
        super().__init__(config or RobustIMAConfig())
        self._doubtful = DOUBTFUL

    def _prepared(self, picture: Image, circular: bool = False) -> Pixels:
        contrast = local_contrast(picture, self.config.contrast_columns, self.config.contrast_grey, circular)
        return contrast.astype(
            np.float16
        )  # to a 2000th, which moves no match by a 10,000th, in a quarter of the memory

    @property
    def _sums(self) -> Sums:
        return partial(sums_within, slack=self.config.slack_columns)

    def _by_slot(self, frame: Pixels, reference: Reference, place: Ints) -> tuple[Ints, Floats, NDArray[np.bool_]]:
        """Every slot counts that correlates at all, where it correlates best within the slack."""
        values = slot_values(frame, reference, self.config.slots, self.config.flat_variance)[0]
        shifts = np.arange(-self.config.slack_columns, self.config.slack_columns + 1)
        near = values[np.mod(place[:, None] + shifts, len(values)), np.arange(len(place))[:, None]]
        best = near.argmax(axis=1)
        value = near[np.arange(len(place)), best]
        return (
            shifts[best],
            value.astype(np.float64),
            value > 0.5,
        )  # below, the correlation is negative: it counts as zero

    def _likeness(self, value: Floats) -> Floats:
        """1 for an identical image, 0.5 for ``_doubtful``, linear between (DESIGN.md, "Values")."""
        return np.asarray(np.interp(value, [0.0, self._doubtful, 1.0], [0.0, 0.5, 1.0]))

    def _scale_by(self, wrong: Floats, weights: Floats, distances: Floats) -> None:
        self._doubtful, far = DOUBTFUL, distances > NEAR_M
        if far.any():
            wrong, weights, distances = wrong[far], weights[far], distances[far]
        if len(wrong):
            most = float(np.quantile(wrong, 1.0 - WRONG_QUANTILE, weights=weights, method="inverted_cdf"))
            self._doubtful = float(np.clip(most, *DOUBTFUL_RANGE))
        super()._scale_by(wrong, weights, distances)
