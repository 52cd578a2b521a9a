"""The interfaces: a sensor makes a frame evidence, an estimator evidence and motion belief; an upkeep may look on."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    import numpy as np
    from numpy.typing import NDArray

    from topoloc.geometry import Floats
    from topoloc.topo_map import TopoMap
    from topoloc.types import Estimate, Evidence, Frame, Image, Motion, WeightedPoses


class Sensor(Protocol):
    """Image -> evidence. It owns the scale from match to log-likelihood, calibrated on the map in ``fit``."""

    @property
    def needs(self) -> frozenset[str]:
        """Kinds of image that ``observe`` reads: ``rgb``, ``right``, ``depth``, ``omni``."""

    def fit(self, topo_map: TopoMap) -> None:
        """Prepare for the map. Raises ``topoloc.errors.UserError`` where the map lacks what the sensor needs."""

    def observe(self, frame: Frame) -> Evidence:
        """Evidence about the camera's pose (heading = optical axis). Pure: the same frame gives the same evidence."""


@runtime_checkable
class ImageComparison(Protocol):
    """A sensor that can tell how alike two images are, without a map; ``topoloc map layout`` asks for one."""

    def distances_between(self, images: Sequence[Image]) -> Floats:
        """Distances (N, N) of images among each other, symmetric, 0 between equal ones."""


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


class Upkeep(Protocol):
    """Looks on and keeps up to date what the sensor knows of the map."""

    def after(self, frame: Frame, estimate: Estimate, evidence: Evidence) -> None:
        """Look at an update, after it was made, whose frame was readable and not blind.

        Args:
            frame: its pictures are read already.
            estimate: after the update.
            evidence: of the frame, about the robot.
        """

    @property
    def topo_map(self) -> TopoMap:
        """The map as it is kept now."""

    @property
    def before(self) -> Mapping[int, Image]:
        """The panoramas that are not the map's own any more, by index of their nodes, as they were."""


class Unwrapper(Protocol):
    """Makes panoramas of the map's camera from the pictures of one omnidirectional camera."""

    seen: NDArray[np.bool_]
    """(rows, columns), where the panorama has a picture; it is black elsewhere."""

    @property
    def seen_share(self) -> float:
        """Share of the panorama that has a picture."""

    def unwrap(self, image: Image) -> Image:
        """The panorama (rows, columns[, 3]) of a picture. Raises ``ValueError`` for one of another size."""
