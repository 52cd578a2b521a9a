"""Times of the sensors that compare with views, on a map of 4000: ``python -m benchmarks.sensor_speed``.

Processor time of one thread, medians: of a picture's descriptor, of its distances to those of all views, of a whole
look, and of one of many that are taken together. Pictures are noise, blurred: for ``histogram`` all views are then
about as far, so that it compares more of them exactly than on a real map.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import process_time
from typing import Any

import cv2
import numpy as np
from threadpoolctl import threadpool_limits

from sensors import ColorHistogram, Descriptor, FourierSignature, PCAMap
from sensors.view_sensor import ViewSensor
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Frame, Image

VIEWS, REPEATS, TOGETHER = 4000, 50, 50
"""Of the map, of each measurement, and looks that are taken together."""
FRAME, CIRCLE = (288, 384), (56, 256)
"""Rows and columns of a frame, and of a full circle as in the third seed."""


def picture(rng: np.random.Generator, shape: tuple[int, int]) -> Image:
    """Blurred noise (rows, columns, 3)."""
    noise = rng.integers(0, 256, (shape[0] // 8, shape[1] // 8, 3)).astype(np.uint8)
    return np.asarray(cv2.resize(noise, shape[::-1], interpolation=cv2.INTER_CUBIC), dtype=np.uint8)


def map_of_views(rng: np.random.Generator) -> TopoMap:
    """Views of a quarter of a frame's size, ten headings a place."""
    small = (FRAME[0] // 4, FRAME[1] // 4)
    places = [(float(number % 20), float(number // 20)) for number in range(VIEWS // 10)]
    views = tuple(
        View(np.array([x, y, 0.6 * turn - 3.0]), picture(rng, small)) for x, y in places for turn in range(10)
    )
    nodes = tuple(Node(str(number), str(number), x, y) for number, (x, y) in enumerate(places))
    return TopoMap("views", Camera(60.0, FRAME[1], FRAME[0]), nodes, views=views)


def map_of_circles(rng: np.random.Generator) -> TopoMap:
    """Panoramas a metre apart."""
    nodes = tuple(
        Node(str(number), str(number), float(number % 80), float(number // 80), 0.0, picture(rng, CIRCLE))
        for number in range(VIEWS)
    )
    return TopoMap("circles", Camera(45.0, 32, CIRCLE[0]), nodes)


def median_ms(what: Callable[[], Any]) -> float:
    """Processor time of a call [ms]."""
    what()
    times = []
    for _ in range(REPEATS):
        begun = process_time()
        what()
        times.append(1e3 * (process_time() - begun))
    return float(np.median(times))


def times_of(sensor: ViewSensor, topo_map: TopoMap, frame: Frame) -> tuple[float, ...]:
    """Of a descriptor, of its distances to all views', and of a whole look, alone and of many together [ms]."""
    sensor.fit(topo_map)
    known = np.stack([sensor.describe({"rgb": view.image}) for view in topo_map.views])
    made = sensor.describe(frame.images)[None]
    return (
        median_ms(partial(sensor.describe, frame.images)),
        median_ms(partial(sensor.distances, made, known)),
        *looks_ms(sensor, frame),
    )


def looks_ms(sensor: ViewSensor | FourierSignature, frame: Frame) -> tuple[float, float]:
    """Of a look, alone and of many together [ms]."""
    together = median_ms(partial(sensor.observe_many, [frame] * TOGETHER)) / TOGETHER
    return median_ms(partial(sensor.observe, frame)), together


def main() -> None:
    """Print a table."""
    rng = np.random.default_rng(0)
    views, circles = map_of_views(rng), map_of_circles(rng)
    frame = Frame(0.0, None, np.zeros(3), {"rgb": picture(rng, FRAME), "omni": picture(rng, CIRCLE)})
    heads = "".join(f"{head:>12}" for head in ("descriptor", "distances", "look", "of many"))
    print(f"{'sensor':12}{heads}  (ms; {VIEWS} views, one thread)")
    cv2.setNumThreads(1)
    with threadpool_limits(1):
        for sensor in (PCAMap(), ColorHistogram(), Descriptor()):
            print(f"{sensor.name:12}" + "".join(f"{value:12.2f}" for value in times_of(sensor, views, frame)))
        fourier = FourierSignature()
        fourier.fit(circles)
        print(f"{'fourier':12}{'':24}" + "".join(f"{value:12.2f}" for value in looks_ms(fourier, frame)))


if __name__ == "__main__":
    main()
