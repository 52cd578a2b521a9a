"""The activity tracker with our improvements, in one setting: ``activity-offset``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from estimators.activity import ActivityTracker, ActivityTrackerConfig, Deviation, Reset
from topoloc.estimate import EstimateRule


@dataclass(frozen=True)
class OffsetTrackerConfig(ActivityTrackerConfig):
    """Settings of the tracker that keeps offsets: those of the activity tracker with other defaults.

    They were chosen with ``ima-robust`` on calibration seeds 1000 to 1003, and are the same everywhere.

    Attributes:
        match_threshold: eps_M; a destination's match must exceed it, and the virtual destination has just this.
        head_threshold: eps_phi >= eps_M; the winner's match must exceed it for the heading to be corrected.
        sigma_m: of the distance in the action model [m].
        sigma_deg: of the heading there [deg].
        outlier_floor: share of the action model that any move has, for each update since a match last won.
        match_power: power of the match in the update.
    """

    match_threshold: float = 0.3
    head_threshold: float = 0.5
    deviation: Deviation = "fixed"
    sigma_m: float = 0.5
    sigma_deg: float = 25.0
    outlier_floor: float = 0.03
    match_power: float = 3.0
    reset: Reset = "offset"


class OffsetTracker(ActivityTracker):
    """The thesis's tracker with fixed sigmas, an outlier floor, and offsets kept inside the nodes (ours).

    Where the thesis resets the odometry to the node's centre, which its author found to make most of the errors
    (5.2.3), each hypothesis here is a small Kalman filter; sensors that tell the place off the node are used to the
    full. An outlier floor stands for being carried off.
    """

    Config: ClassVar[type[ActivityTrackerConfig]] = OffsetTrackerConfig
    estimate_rule = EstimateRule(bias=0.97, gain=0.08, agreement_gain=0.45)  # benchmarks/calibration.py

    def __init__(self, config: ActivityTrackerConfig | None = None) -> None:
        super().__init__(config or OffsetTrackerConfig())
