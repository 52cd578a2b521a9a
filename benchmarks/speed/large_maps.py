"""Large maps: a look of IMA with a coarse stage beside exact IMA, and opening a map again beside the first time.

The pictures are blurred noise, and so the coarse stage has an easy task: each place looks like no other, and a frame
shows the node's own panorama, a little nearer or farther. That the answers agree says that nothing is broken. How often
they agree in simulated buildings, where corridors look alike and the robot stands off the nodes, is measured by
``python -m benchmarks.large_map``.
"""

from __future__ import annotations

import os
import shutil
import sys
import tempfile
import weakref
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property, partial
from itertools import cycle
from math import isqrt
from pathlib import Path

import cv2
import numpy as np

from benchmarks.speed.case import Case, Pair
from benchmarks.speed.pictures import noise_pictures
from sensors.ima import IMA, IMAConfig
from topoloc.interfaces import Sensor
from topoloc.picture_index import STORE_FOLDER
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Frame, Image

CAMERA = Camera(40.0, 72, 54)
"""As small as IMA scales its pictures."""
ZOOM = 1.05
"""Queries are zoomed by this at most, and by one through this at least."""
CANDIDATES = 100
"""That the coarse stage leaves to IMA."""
NODES, MANY_NODES = 1_000, 10_000
QUERIES, FEW_QUERIES = 200, 50
"""On whose answers both must agree: on a map of ``NODES``, and of ``MANY_NODES``, where an exact look takes long."""
SAME_NODE = 0.99
"""Share of the queries that must have the same best node: of the few all."""
SAME_MATCH = 1e-5
"""Matches that differ by less are the same."""
MB_A_NODE = 0.35
"""That exact IMA may keep, so that it makes nothing anew [MB]."""
NEEDED_GB = 7.5
"""Memory of a machine that ``MANY_NODES`` are measured on [GB]: the map and both sensors take 5.5 of it."""
LOOKS = 5
"""Queries that time is taken of, by turns, and that the answers of an opened map are compared on."""


@dataclass(frozen=True)
class NoiseMap:
    """A map of pictures that are noise, on a grid of nodes a metre apart.

    Attributes:
        count: K, nodes; also the seed.
    """

    count: int

    @cached_property
    def circles(self) -> Image:
        """(K, rows, columns) of full circles, somewhat higher than the map's panoramas: seen from farther."""
        rng, rows = np.random.default_rng(self.count), CAMERA.height + 2 * self.margin
        return noise_pictures(rng, self.count, rows, CAMERA.panorama_columns())

    @property
    def margin(self) -> int:
        """Rows above and below that only the queries show."""
        return int(np.ceil((ZOOM - 1.0) * CAMERA.height / 2.0))

    @cached_property
    def topo_map(self) -> TopoMap:
        """The map, in memory."""
        side, inner = isqrt(self.count - 1) + 1, slice(self.margin, self.margin + CAMERA.height)
        nodes = (Node(str(k), str(k), k % side, k // side, 0.0, self.circles[k, inner]) for k in range(self.count))
        return TopoMap("noise", CAMERA, tuple(nodes))

    def queries(self, count: int) -> list[Frame]:
        """What a camera sees on nodes drawn at random: the first of them are the same however many are asked for."""
        return [self._query(number) for number in range(count)]

    def _query(self, number: int) -> Frame:
        """A view nearer or farther, brighter or darker, with another contrast, and noisy."""
        rng = np.random.default_rng([self.count, number])
        node, left = rng.integers(self.count), rng.integers(CAMERA.panorama_columns())
        zoom, contrast = ZOOM ** rng.uniform(-1.0, 1.0), rng.uniform(0.6, 1.1)
        seen = zoomed_view(self.circles[node], int(left), zoom).astype(np.float64)
        changed = 127.0 + rng.uniform(-20.0, 20.0) + contrast * (seen - 127.0) + rng.normal(0.0, 5.0, seen.shape)
        picture = np.clip(np.rint(changed), 0, 255).astype(np.uint8)
        return Frame(float(number), None, np.zeros(3), {"rgb": picture})


def zoomed_view(circle: Image, left: int, zoom: float) -> Image:
    """A frame of ``CAMERA`` cut from the middle of a circle, zoomed in if ``zoom`` is above 1, out if below.

    Args:
        circle: (rows, columns), higher than a frame by as much as zooming out needs.
        left: column that the frame's left edge has without zoom; the columns close a circle.
        zoom: of the frame about its middle.
    """
    size = np.array([CAMERA.width, CAMERA.height])
    margin = int(np.ceil((ZOOM - 1.0) * CAMERA.width / 2.0))
    window = circle.take(np.arange(left - margin, left + CAMERA.width + margin), axis=1, mode="wrap")
    middle = np.array(window.shape[::-1]) / 2.0 - 0.5
    corner = middle - (size - 1.0) / 2.0 / zoom
    to_window = np.column_stack([np.eye(2) / zoom, corner])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    view = cv2.warpAffine(window, to_window, size.tolist(), flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(view, dtype=np.uint8)


def ima_candidates(count: int, queries: int, candidates: int = CANDIDATES) -> Case:
    """A look with a coarse stage beside an exact one.

    Args:
        count: nodes of the map.
        queries: on whose answers both must agree.
        candidates: that the coarse stage leaves to IMA.
    """
    prepare = partial(_looks, NoiseMap(count), queries, candidates)
    return Case("sensors", "ima-candidates", f"{candidates} of {count:,} nodes", "exact IMA", (), prepare)


def _looks(noise: NoiseMap, queries: int, candidates: int) -> Pair:
    exact = IMA(IMAConfig(memory_mb=MB_A_NODE * noise.count))
    coarse = IMA(IMAConfig(candidates=candidates))
    for sensor in (exact, coarse):
        sensor.fit(noise.topo_map)
    frames = noise.queries(queries)
    return Pair(_looking(coarse, frames), _looking(exact, frames), lambda: same_answers(coarse, exact, frames))


def _looking(sensor: Sensor, frames: Sequence[Frame]) -> Callable[[], Evidence]:
    again = cycle(frames[:LOOKS])
    return lambda: sensor.observe(next(again))


def same_answers(coarse: Sensor, exact: Sensor, frames: Sequence[Frame]) -> bool:
    """Whether both nearly always name the same best node, and nodes that both match have the same match.

    Exact IMA has a hypothesis for every node, in the order of the nodes.
    """
    pairs = [(coarse.observe(frame), exact.observe(frame)) for frame in frames]
    alike = all(np.abs(few.match - every.match[few.nodes]).max() < SAME_MATCH for few, every in pairs)
    same = [few.nodes[few.match.argmax()] == every.match.argmax() for few, every in pairs]
    return alike and bool(np.mean(same) >= SAME_NODE)


def map_open(count: int, candidates: int = CANDIDATES) -> Case:
    """Reading a map's folder and fitting IMA, when it was done before, beside the first time.

    Without waiting for the disk, since processor time is taken, and without what a first look makes and keeps.

    Args:
        count: nodes of the map.
        candidates: that the coarse stage leaves to IMA.
    """
    size = f"{count:,} nodes, {candidates} candidates"
    return Case("sensors", "map-open", size, "the first time", (), lambda: _openings(NoiseMap(count), candidates))


class MapOnDisk:
    """A map's folder, removed with this object, and a sensor that gets to know the map from it."""

    def __init__(self, topo_map: TopoMap, config: IMAConfig) -> None:
        self._config = config
        around = Path(tempfile.mkdtemp(prefix="topoloc-speed-"))
        weakref.finalize(self, shutil.rmtree, around, ignore_errors=True)
        self.folder = around / "map"
        topo_map.save(self.folder)

    def open(self) -> IMA:
        """A sensor that knows the map, which was opened before, or was not."""
        sensor = IMA(self._config)
        sensor.fit(TopoMap.load(self.folder))
        return sensor

    def open_as_new(self) -> IMA:
        """The same without what is kept of the map."""
        shutil.rmtree(self.folder / STORE_FOLDER, ignore_errors=True)
        return self.open()


def _openings(noise: NoiseMap, candidates: int) -> Pair:
    held = MapOnDisk(noise.topo_map, IMAConfig(candidates=candidates))
    frames = noise.queries(LOOKS)

    def agree() -> bool:
        first = held.open_as_new()
        return same_looks(held.open(), first, frames)

    return Pair(held.open, held.open_as_new, agree)


def same_looks(again: Sensor, first: Sensor, frames: Sequence[Frame]) -> bool:
    """Whether two sensors say exactly the same of each frame."""
    pairs = ((again.observe(frame), first.observe(frame)) for frame in frames)
    return all(
        np.array_equal(one.nodes, other.nodes)
        and np.array_equal(one.match, other.match)
        and np.array_equal(one.log_likelihoods, other.log_likelihoods)
        for one, other in pairs
    )


def cases(memory_gb: float) -> tuple[Case, ...]:
    """The comparisons of a machine with so much memory [GB]; where it is too little, one says what is left out."""
    usual, many = ima_candidates(NODES, QUERIES), ima_candidates(MANY_NODES, FEW_QUERIES)
    looks = (usual, many) if memory_gb >= NEEDED_GB else (replace(usual, prepare=partial(_telling, usual, memory_gb)),)
    return (*looks, map_open(NODES))


def _telling(usual: Case, memory_gb: float) -> Pair:
    """Prepare, with a line beside the output."""
    has = f"this machine has {memory_gb:.1f}"
    print(f"{usual.what}: {MANY_NODES:,} nodes left out: they need {NEEDED_GB} GB of memory, {has}", file=sys.stderr)
    return usual.prepare()


def machines_memory_gb() -> float:
    """Memory of this machine [GB]; endless where it does not tell."""
    with suppress(AttributeError, ValueError, OSError):  # elsewhere than on Linux and macOS
        return os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES") / 1e9
    return float("inf")


CASES: tuple[Case, ...] = cases(machines_memory_gb())
