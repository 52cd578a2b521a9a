"""The two interfaces: a sensor model turns a frame into evidence, an estimator evidence and motion into belief."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    import numpy as np

    from topoloc.topo_map import TopoMap
    from topoloc.types import Evidence, Frame, Motion, WeightedPoses


class Sensor(Protocol):
    """Image -> evidence. It owns the scale from match to log-likelihood, calibrated on the map in ``fit``."""

    @property
    def needs(self) -> frozenset[str]:
        """Kinds of image that ``observe`` reads: ``rgb``, ``right``, ``depth``, ``omni``."""

    def fit(self, topo_map: TopoMap) -> None:
        """Prepare for the map. Raises ``topoloc.errors.UserError`` where the map lacks what the sensor needs."""

    def observe(self, frame: Frame) -> Evidence:
        """Evidence about the camera's pose (heading = optical axis). Pure: the same frame gives the same evidence."""


class Estimator(Protocol):
    """Evidence + motion -> belief. It never sees an image."""

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Start afresh on a map; a prior of None says that the robot could be anywhere."""

    def predict(self, motion: Motion) -> None:
        """Take in a motion of the robot."""

    def update(self, evidence: Evidence) -> float | None:
        """Take in evidence about the robot's pose.

        Returns:
            log p(evidence | past), by which LOST is judged; None for a blind frame and where there is no such thing.
        """

    @property
    def belief(self) -> WeightedPoses:
        """Where the robot could be, after all that was taken in."""
