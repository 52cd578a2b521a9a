"""Looks of a sensor that were taken once, and are handed out again to every estimator that is tried."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import numpy as np

from topoloc import plugins
from topoloc.errors import InputError, UnreadableImage
from topoloc.interfaces import Sensor
from topoloc.topo_map import TopoMap
from topoloc.tuning.folds import Fold
from topoloc.types import Evidence, Frame

Look = Evidence | UnreadableImage
"""What a sensor says of the camera's pose, or what was wrong with the picture."""


@dataclass(frozen=True)
class Looks:
    """All looks of a sensor with certain settings.

    Attributes:
        of_folds: by fold, by frame.
        look_ms: one look in the median, without the reading of pictures [ms].
    """

    of_folds: tuple[tuple[Look, ...], ...]
    look_ms: float


class Remembered:
    """A sensor that says at each time what another said of the frame then."""

    needs: frozenset[str] = frozenset()

    def __init__(self, by_time: Mapping[float, Look]) -> None:
        self._by_time = by_time

    def fit(self, topo_map: TopoMap) -> None:
        """There is nothing left to prepare."""

    def observe(self, frame: Frame) -> Evidence:
        """What was said. Raises ``UnreadableImage`` where the picture did not decode."""
        said = self._by_time[frame.timestamp]
        if isinstance(said, UnreadableImage):
            raise said
        return said


def refuse_blindness(sensor: Sensor, name: str, folds: Sequence[Fold]) -> None:
    """Raise ``InputError`` where a recording has not the images that a sensor needs."""
    for fold in folds:
        missing = sensor.needs - frozenset(fold.recording.pictures)
        if missing:
            lists = ", ".join(f"{kind}.txt" for kind in sorted(missing))
            raise InputError(fold.recording.folder, f"{name} needs {lists}", "record it, or choose another --sensor")


def taken(topo_map: TopoMap, name: str, settings: Mapping[str, Any], folds: Sequence[Fold]) -> Looks:
    """Let a sensor look at every frame of the folds.

    Raises:
        InputError: not one picture can be used.
        UserError: settings that the sensor refuses, or a map that it cannot use.
    """
    sensor = plugins.make_sensor(name, settings)
    sensor.fit(_keeping_nothing(topo_map))
    clock = _Clock()
    of_folds = tuple(
        tuple(clock.look(sensor, fold.recording.frame(picture)) for picture in fold.pictures) for fold in folds
    )
    problems = [look for looks in of_folds for look in looks if isinstance(look, UnreadableImage)]
    if not clock.seconds:
        listed = folds[0].recording.folder / f"{folds[0].recording.kind}.txt"
        why = str(problems[0]) if problems else f"no frame has all of {', '.join(sorted(sensor.needs))}"
        raise InputError(listed, f"none of its pictures can be used: {why}", "correct the lists")
    return Looks(of_folds, 1000.0 * float(np.median(clock.seconds)))


def _keeping_nothing(topo_map: TopoMap) -> TopoMap:
    """The map with one of its pictures in memory, by which its folder keeps nothing of it (``topoloc.map_store``).

    Few results are kept of each sensor: those of all that is tried would push out what the user works with.
    """
    node, *nodes = topo_map.nodes
    if node.has_panorama:
        return replace(topo_map, nodes=(replace(node, panorama=node.panorama), *nodes))
    views = topo_map.views
    return replace(topo_map, views=tuple(replace(view, image=view.image) for view in views[:1]) + views[1:])


class _Clock:
    """Times looks; the pictures are read before."""

    def __init__(self) -> None:
        self.seconds: list[float] = []

    def look(self, sensor: Sensor, frame: Frame) -> Look:
        try:
            images = {kind: frame.images[kind] for kind in sensor.needs & frozenset(frame.images)}
            if sensor.needs - frozenset(images):
                return Evidence.blind()
            ready = Frame(frame.timestamp, frame.odometry, frame.camera, images)
            begun = perf_counter()
            evidence = sensor.observe(ready)
        except UnreadableImage as error:
            return error
        self.seconds.append(perf_counter() - begun)
        return evidence
