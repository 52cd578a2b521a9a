"""Layouts of one set of distances by several methods, and how good and how quick each is."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from sklearn.manifold import smacof as sklearn_smacof

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.image_grid import GRIDS, Grid, GridName, ImageGridSettings, ImageGridWorld
from topoloc.geometry import Floats
from topoloc.mapping import LayoutConfig, chained, laid_out, shape_error
from topoloc.types import Image, Ints

INCREMENTAL, BATCH, CLASSICAL, SMACOF = "incremental", "batch", "classical MDS", "SMACOF"
"""Columns of the table."""
STARTS: Mapping[str, int] = {INCREMENTAL: 1, BATCH: 3, CLASSICAL: 1, SMACOF: 3}
"""Layouts of each, from other random places; the mean counts. An incremental one hardly depends on its start."""
SMACOF_ITERATIONS, SMACOF_TOLERANCE = 1000, 1e-6
"""At 1e-4 it stops early: exact distances left mu at 0.002."""


@dataclass(frozen=True)
class Walk:
    """A grid as the robot drives over it: row by row, back and forth.

    Attributes:
        images: N panoramas, in this order.
        positions: (N, 2) where they were taken [m].
        cells: (N, 2) row and column of the grid.
    """

    images: list[Image]
    positions: Floats
    cells: Ints


def walked(name: GridName, seed: int) -> Walk:
    """One of the published grids, simulated."""
    topo_map = ImageGridWorld(ImageGridSettings(grid=name)).topo_map(seed)
    order = back_and_forth(GRIDS[name])
    images = [panorama for number in order if (panorama := topo_map.nodes[number].panorama) is not None]
    return Walk(images, topo_map.positions[order], np.column_stack(np.divmod(order, GRIDS[name].columns)))


def back_and_forth(grid: Grid) -> Ints:
    """Numbers of a grid's points, every other row backwards."""
    number = np.arange(grid.rows * grid.columns).reshape(grid.rows, grid.columns)
    number[1::2] = number[1::2, ::-1].copy()
    return number.ravel()


@dataclass(frozen=True)
class Made:
    """What a method made of one set of distances, mean over its starts.

    Attributes:
        error: Procrustes mu.
        seconds: of computing time.
    """

    error: float
    seconds: float


def made_by(method: str, distances: Floats, truth: Floats, config: LayoutConfig, seed: int) -> Made:
    """Lay images out and compare with the truth.

    Args:
        method: a column of the table; all of them take the distances along chains where the settings say so.
        distances: (N, N) between images.
        truth: (N, 2) [m].
        config: settings of the springs.
        seed: of the starts.
    """
    errors, seconds = [], []
    for number in range(STARTS[method]):
        rng = generator(seed, Stream.MEASUREMENT, 30, number)
        begun = time.process_time()
        layout = _LAYOUTS[method](distances, config, rng)
        seconds.append(time.process_time() - begun)
        errors.append(shape_error(truth, layout))
    return Made(float(np.mean(errors)), float(np.mean(seconds)))


def classical_mds(distances: Floats) -> Floats:
    """(N, 2) coordinates whose products are nearest to those that the distances (N, N) imply (Torgerson, 1952)."""
    squared = distances**2
    products = -0.5 * (squared - squared.mean(axis=0) - squared.mean(axis=1)[:, None] + squared.mean())
    values, vectors = np.linalg.eigh(products)
    return np.asarray(vectors[:, -2:] * np.sqrt(np.maximum(values[-2:], 0.0)))


def smacof(distances: Floats, rng: np.random.Generator) -> Floats:
    """(N, 2) by scikit-learn's SMACOF, metric, from one random start, as the springs have one."""
    start = rng.uniform(-1.0, 1.0, (len(distances), 2)) * np.median(distances)
    with warnings.catch_warnings():  # its defaults are to change, and are all given here
        warnings.simplefilter("ignore", FutureWarning)
        layout, _ = sklearn_smacof(
            distances,
            n_components=2,
            init=start,
            n_init=1,
            max_iter=SMACOF_ITERATIONS,
            eps=SMACOF_TOLERANCE,
            normalized_stress=False,
        )
    return np.asarray(layout, dtype=np.float64)


_LAYOUTS: Mapping[str, Callable[[Floats, LayoutConfig, np.random.Generator], Floats]] = {
    INCREMENTAL: lambda distances, config, rng: laid_out("incremental", distances, config, rng).positions,
    BATCH: lambda distances, config, rng: laid_out("batch", distances, config, rng).positions,
    CLASSICAL: lambda distances, config, rng: classical_mds(chained(distances, config.neighbours)),
    SMACOF: lambda distances, config, rng: smacof(chained(distances, config.neighbours), rng),
}

AS_THEY_ARE = LayoutConfig(neighbours=0)
"""The image distances themselves, constant springs: the seed's way."""
CHAINED = replace(AS_THEY_ARE, neighbours=LayoutConfig().neighbours)
"""Ours: distances along chains of near images."""
LENGTHS: Mapping[str, LayoutConfig] = {"image distances": AS_THEY_ARE, "chains": CHAINED}
