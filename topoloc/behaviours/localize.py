"""Localization as a behaviour (thesis 4.2.2): it keeps up with the robot in a thread, and answers at any time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from threading import Condition
from types import TracebackType

import numpy as np

from topoloc import plugins
from topoloc.behaviours.engine import Behaviour
from topoloc.behaviours.robot import Watcher
from topoloc.interfaces import Estimator, Sensor
from topoloc.localizer import Localizer
from topoloc.odometry import MotionGate, OdometryNoise
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Estimate, WeightedPoses


@dataclass(frozen=True)
class Position:
    """Where the robot was at one moment.

    Attributes:
        timestamp: of the frame that the estimate comes from [s].
        estimate: of pose, node, probability and status.
        node: the one that the estimate names, or None while there is none to name.
    """

    timestamp: float
    estimate: Estimate
    node: Node | None


class Localize(Behaviour):
    """Each action is one look and one step of a ``Localizer``; ``position`` never waits for either.

    Args:
        robot: looks.
        topo_map: the map, or the place that ``init`` loads it from: a folder or a text map.
        sensor, estimator: any that follow ``topoloc.interfaces``, or names that ``init`` makes them by.
        rng, prior, gate, noise: as for ``Localizer``.
    """

    def __init__(
        self,
        robot: Watcher,
        topo_map: TopoMap | Path | str,
        sensor: Sensor | str = "ima",
        estimator: Estimator | str = "activity",
        *,
        rng: np.random.Generator | int = 0,
        prior: WeightedPoses | None = None,
        gate: MotionGate | None = None,
        noise: OdometryNoise | None = None,
    ) -> None:
        self._robot, self._map, self._sensor, self._estimator = robot, topo_map, sensor, estimator
        self._rng, self._prior, self._gate, self._noise = rng, prior, gate, noise
        self._localizer: Localizer | None = None
        self._news = Condition()
        self._last: Position | None = None
        self._error: BaseException | None = None
        self._traceback: TracebackType | None = None

    def init(self) -> None:
        """Load the map, make sensor and estimator, and fit them to it."""
        topo_map = self._map if isinstance(self._map, TopoMap) else TopoMap.load(self._map)
        sensor = plugins.make_sensor(self._sensor) if isinstance(self._sensor, str) else self._sensor
        mind = plugins.make_estimator(self._estimator) if isinstance(self._estimator, str) else self._estimator
        self._localizer = Localizer(
            topo_map, sensor, mind, rng=self._rng, prior=self._prior, gate=self._gate, noise=self._noise
        )

    def action(self) -> bool:
        """One look, one step; there is always more to do."""
        assert self._localizer is not None  # the engine calls ``init`` first
        frame = self._robot.look()
        if self._last is not None and frame.timestamp == self._last.timestamp:
            return True  # a robot at rest gave the same frame again, which is no news
        estimate = self._localizer.step(frame)  # outside the lock: a slow sensor holds nobody up
        node = None if estimate.node is None else self._localizer.topo_map.nodes[estimate.node]
        with self._news:
            self._last, self._error = Position(frame.timestamp, estimate, node), None
            self._news.notify_all()
        return True

    def failed(self, error: BaseException) -> None:
        """From now on ``position`` and ``wait`` raise it: an old position must not pass for a new one."""
        with self._news:
            self._error, self._traceback = error, error.__traceback__
            self._news.notify_all()

    def position(self) -> Position | None:
        """The last position, at once, from any thread, also while a step is under way.

        Returns:
            None before the first step is done. Until a look has said something its estimate is LOST and names no node.
            After a stop, the last one there was: its timestamp tells how old it is.

        Raises:
            Exception: whatever ended the behaviour, if something did.
        """
        with self._news:
            self._raise_error()
            return self._last

    def wait(self, timeout_s: float | None = None, after: float = -np.inf) -> Position:
        """Wait for the first position, or for one later than a moment.

        Args:
            timeout_s: how long at most [s]; None: for ever.
            after: the position's timestamp is above this [s].

        Raises:
            TimeoutError: there was none in that time.
            Exception: whatever ended the behaviour, if something did.
        """
        with self._news:
            self._news.wait_for(lambda: self._error is not None or self._later_than(after) is not None, timeout_s)
            self._raise_error()
            position = self._later_than(after)
        if position is None:
            raise TimeoutError(f"no position within {timeout_s} s; is Localize started, and does the camera deliver?")
        return position

    def _later_than(self, moment: float) -> Position | None:
        return self._last if self._last is not None and self._last.timestamp > moment else None

    def _raise_error(self) -> None:
        if self._error is not None:
            raise self._error.with_traceback(self._traceback)  # or each raise would add to the same traceback
