"""The least that a part of an update must do: bytes that must be moved, operations that must be made.

A sensor reads once what it compares a picture with, an estimator reads and writes once what it keeps. Exponentials,
logarithms and sorting are left out, and so are filtering and scaling of the picture: the bound lies low. It tells how
much the machine would allow at best, not what could be reached.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.speed.machine import Limits
from estimators.particle import ParticleFilterConfig
from sensors.ima import IMAConfig
from topoloc.topo_map import TopoMap


@dataclass(frozen=True)
class Work:
    """Bytes and operations.

    Attributes:
        read, written: of memory [bytes].
        flops32, flops64: multiplications and additions in float32 and in float64.
    """

    read: float
    written: float = 0.0
    flops32: float = 0.0
    flops64: float = 0.0

    def __str__(self) -> str:
        moved = [
            f"{1e-6 * count:.1f} MB {how}" for how, count in (("read", self.read), ("written", self.written)) if count
        ]
        made = [
            f"{1e-6 * count:.1f} Mflop of {kind}"
            for kind, count in (("float32", self.flops32), ("float64", self.flops64))
            if count
        ]
        return ", ".join([*moved, *made])

    def ms(self, limits: Limits) -> float:
        """How long it takes at the machine's limits [ms]."""
        return 1e3 * limits.seconds(self.read, self.written, self.flops32, self.flops64)


def look_work(name: str, topo_map: TopoMap, compared: int) -> Work:
    """Of a sensor's look.

    Args:
        name: of the sensor, with its default settings.
        topo_map: that it works on.
        compared: bytes of what a picture is compared with.
    """
    return Work(compared, flops32=FLOPS.get((name, "look"), _none)(topo_map, compared))


def step_work(name: str, part: str, topo_map: TopoMap, kept: int) -> Work:
    """Of an estimator's ``predict`` or ``update``.

    Args:
        name: of the estimator, with its default settings.
        part: ``predict`` or ``update``.
        topo_map: that it works on.
        kept: bytes that the estimator keeps.
    """
    return Work(kept, kept, flops64=FLOPS.get((name, part), _none)(topo_map, kept))


def _none(topo_map: TopoMap, kept: int) -> float:
    """Of work that is not multiplication and addition in the main."""
    return 0.0


def _correlations(topo_map: TopoMap, kept: int) -> float:
    """Of IMA by Fourier transforms: of each row, slot and frequency a complex product and sum, 8 operations.

    A zoom each way is matched beside the plain frame (4.1.5). The transforms themselves are left out.
    """
    config = IMAConfig()
    rows = config.scale_columns * topo_map.camera.height / topo_map.camera.width
    frequencies = topo_map.camera.panorama_columns(config.scale_columns) / 2.0
    return 8.0 * len(topo_map.nodes) * rows * frequencies * config.slots * (1 + 2 * config.zoom_steps)


def _taps(topo_map: TopoMap, kept: int) -> float:
    """Of the grid's blur: three taps along each of three axes, less one multiplication by symmetry, in every cell."""
    return 3.0 * 4.0 * kept / 8.0


def _cells_by_hypotheses(topo_map: TopoMap, kept: int) -> float:
    """Of the grid's likelihood: a multiplication and a sum for each hypothesis in every cell."""
    return 2.0 * kept / 8.0 * len(topo_map.nodes)


def _particles_by_hypotheses(topo_map: TopoMap, kept: int) -> float:
    """Of the particles' likelihood: squared distance and cosine, about 12 for each hypothesis and particle."""
    return 12.0 * ParticleFilterConfig().particles * len(topo_map.nodes)


FLOPS: dict[tuple[str, str], Callable[[TopoMap, int], float]] = {
    ("ima", "look"): _correlations,
    ("grid", "predict"): _taps,
    ("grid", "update"): _cells_by_hypotheses,
    ("particle", "update"): _particles_by_hypotheses,
}
