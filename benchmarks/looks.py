"""A sensor that looks at each frame once: what it saw is shared by all estimators."""

from __future__ import annotations

from time import perf_counter

from topoloc.interfaces import Sensor
from topoloc.recording import LazyImages
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame

CRASHES = (Exception, SystemExit)
"""What a sensor or an estimator may do wrong without taking the others with it."""


class SharedLooks:
    """A fitted sensor that looks at each frame once and remembers what it saw, or what went wrong.

    Args:
        sensor: any sensor.
        topo_map: to fit it to; None where it was fitted already.
        keep_pictures: of the frames, for another sensor; a long drive's do not fit into memory.

    Attributes:
        sensor: the sensor.
        looks: how often the sensor really looked.
        seconds: that these looks took.
        waited: the same, with the time until the pictures were there [s].
    """

    def __init__(self, sensor: Sensor, topo_map: TopoMap | None, keep_pictures: bool = True) -> None:
        self.sensor, self._seen = sensor, dict[float, Evidence | BaseException]()
        self._keep_pictures = keep_pictures
        self.looks, self.seconds, self.waited = 0, 0.0, 0.0
        if topo_map is not None:
            sensor.fit(topo_map)

    @property
    def needs(self) -> frozenset[str]:
        """Kinds of image that the sensor reads."""
        return self.sensor.needs

    def fit(self, topo_map: TopoMap) -> None:
        """Nothing to do: the sensor is fitted already."""

    def observe(self, frame: Frame) -> Evidence:
        """What the sensor sees in the frame, the first time by looking."""
        if frame.timestamp not in self._seen:
            self._seen[frame.timestamp] = self._look(frame)
        seen = self._seen[frame.timestamp]
        if isinstance(seen, BaseException):
            raise seen.with_traceback(None)  # it would grow with every estimator, and hold all of them
        return seen

    def let_go(self, frame: Frame) -> None:
        """Forget a frame's pictures, unless they are kept for another sensor."""
        if not self._keep_pictures and isinstance(frame.images, LazyImages):
            frame.images.forget()

    def _look(self, frame: Frame) -> Evidence | BaseException:
        """What the sensor sees, or what the next estimator must meet as well without another look."""
        asked = started = perf_counter()
        try:
            for kind in self.needs & frozenset(frame.images):
                frame.images[kind]  # rendered or read from disk now: that is no work of the sensor's
            started = perf_counter()
            return self.sensor.observe(frame)
        except CRASHES as error:
            return error
        finally:
            ended = perf_counter()
            self.looks += 1
            self.seconds += ended - started
            self.waited += ended - asked
            self.let_go(frame)
