"""The two methods that the experiments compare: the thesis's, with its settings, and ours, in one setting."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from benchmarks.experiments.experiment import AS_PUBLISHED, IMPROVED
from estimators.activity import ActivityTracker, ActivityTrackerConfig
from estimators.offset_tracker import OffsetTracker, OffsetTrackerConfig
from sensors.ima import IMA, IMAConfig
from sensors.robust_ima import RobustIMA, RobustIMAConfig


@dataclass(frozen=True)
class Method:
    """Settings of a sensor and of a tracker.

    Attributes:
        sensor: of IMA, the published or the robust one.
        tracker: of the activity tracker.
    """

    sensor: IMAConfig = field(default_factory=IMAConfig)
    tracker: ActivityTrackerConfig = field(default_factory=ActivityTrackerConfig)

    def make(self) -> tuple[IMA, ActivityTracker]:
        """A sensor and a tracker that know no map yet."""
        sensor = RobustIMA(self.sensor) if isinstance(self.sensor, RobustIMAConfig) else IMA(self.sensor)
        keeps = isinstance(self.tracker, OffsetTrackerConfig)
        return sensor, OffsetTracker(self.tracker) if keeps else ActivityTracker(self.tracker)


THESIS = Method()
"""Section 5.2: 72 columns, 8 slots, CLAHE, zoom 1.1, thresholds 0.5 and 0.6, odometry reset to the node."""
OURS = Method(RobustIMAConfig(), OffsetTrackerConfig())
"""``ima-robust`` and ``activity-offset`` as they come."""
METHODS: Mapping[str, Method] = {AS_PUBLISHED: THESIS, IMPROVED: OURS}
"""By column of the tables."""
