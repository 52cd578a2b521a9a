"""Layers of cells moved by whole cells and blurred, along x, y and the heading: the motion of ``MarkovGrid``."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from scipy.linalg.blas import daxpy

from estimators.free_area import FreeArea
from estimators.windows import Window, reachable
from topoloc.geometry import Floats
from topoloc.types import Ints

FEW_CELLS = 90
"""Grids without walls whose sides add up to less cells than this are moved by products of matrices: measured."""


class CellMotion:
    """How the motion of a robot moves the mass of cells, layer by layer of heading.

    Args:
        area: the free cells and the walls between them.
    """

    def __init__(self, area: FreeArea) -> None:
        self._area = area
        self._windows = reachable(area.free)
        self._lines: dict[tuple[int, int, int], _Line] = {}

    def move(self, mass: Floats, cells: Floats, variances: Floats, turn: float) -> None:
        """Shift and blur each layer of mass (H, X, Y), then blur the heading; in place.

        What leaves the free area or would cross a wall is lost.

        Args:
            mass: of layers of heading; none outside the free area.
            cells: (H, 2) whole cells that each layer moves along x and y.
            variances: (H, 2) of its blur along x and y, after that [cells^2].
            turn: variance of the blur of the heading [layers^2].
        """
        shape = np.array(self._area.free.shape)
        shifts = np.minimum(np.maximum(cells, -shape), shape).astype(np.int64)
        ring = _ring(turn, len(mass))
        if shape.sum() < FEW_CELLS and not self._area.has_walls:
            _move_by_products(mass, shifts, variances, ring, self._area.free)
        elif len(self._windows) == 1:
            _turn(self._moved(mass, shifts, variances, 0), mass, ring)
        else:
            arrived = [np.empty_like(mass[:, columns, rows]) for columns, rows in self._windows]
            for number, part in enumerate(arrived):
                _turn(self._moved(mass, shifts, variances, number), part, ring)
            for (columns, rows), part in zip(self._windows, arrived, strict=True):
                mass[:, columns, rows] = part

    def _line(self, window: int, gap_x: int, gap_y: int) -> _Line:
        """The line of a window for kernels of such length; some are remembered, for the length hardly changes."""
        key = window, gap_x, gap_y
        if key not in self._lines:
            while len(self._lines) >= 2 * len(self._windows):
                del self._lines[next(iter(self._lines))]
            self._lines[key] = _Line(self._area, self._windows[window], gap_x, gap_y)
        return self._lines[key]

    def _moved(self, mass: Floats, shifts: Ints, variances: Floats, window: int) -> Iterator[Floats]:
        """The layers of mass (H, X, Y) after shift and blur, in a window and flat, one after the other."""
        x, y = (_taps(variances[:, axis], self._area.free.shape[axis] - 1) for axis in (0, 1))
        line = self._line(window, x.shape[1] - 1, y.shape[1] - 1)
        for layer, shift, along_x, along_y in zip(mass, shifts.tolist(), x, y, strict=True):
            line.take(layer, *shift)
            line.blur(along_x, 0)
            line.blur(along_y, 1)
            yield line.layer()


def _move_by_products(mass: Floats, shifts: Ints, variances: Floats, ring: Floats, free: np.ndarray) -> None:
    """All layers at once: x, y and heading have a matrix each. Few calls; how wide a blur is makes no difference."""
    along_x, along_y = (_matrices(shifts[:, axis], variances[:, axis], free.shape[axis]) for axis in (0, 1))
    moved = along_x.mT @ mass @ along_y
    moved *= free
    layers = np.arange(len(mass))
    turned = ring[(layers[:, None] - layers) % len(mass)]
    np.matmul(turned, moved.reshape(len(mass), -1), out=mass.reshape(len(mass), -1))


def _matrices(shifts: Ints, variances: Floats, count: int) -> Floats:
    """(H, from, to) shares of a cell's mass that a shift (H,) and then a blur (H,) bring to each cell of a row."""
    taps = _taps(variances, count - 1)
    taps = np.concatenate([taps, np.zeros((len(taps), 1))], axis=1)
    cells, shift = np.arange(count), shifts[:, None]
    lags = np.abs(np.arange(1 - count, count) - shift)
    shares = taps[np.arange(len(taps))[:, None], np.minimum(lags, taps.shape[1] - 1)]  # by how far a cell lies ahead
    arrived = cells + shift
    inside = (arrived >= 0) & (arrived < count)  # what a shift takes out of the grid, no blur brings back
    return np.asarray(shares.take(cells - cells[:, None] + count - 1, axis=1) * inside[:, :, None])


def _turn(arrived: Iterable[Floats], mass: Floats, ring: Floats) -> None:
    """Share out layers (X * Y,) among those around them, into mass (H, X, Y), which may be where they come from.

    Each is written once all its neighbours have arrived, so that only a few of them are held beside the mass.
    """
    around = [(layers, share) for layers, share in enumerate(ring.tolist()) if share > 0.0]
    reach = max(min(layers, len(ring) - layers) for layers, _ in around)
    sums: dict[int, Floats] = {}
    for layer, cells in enumerate(arrived):
        for layers, share in around:
            to = (layer + layers) % len(ring)
            if to in sums:
                daxpy(cells, sums[to], a=share)
            else:
                sums[to] = share * cells
        if layer >= 2 * reach:
            mass[layer - reach] = sums.pop(layer - reach).reshape(mass.shape[1:])
    for to, cells in sums.items():
        mass[to] = cells.reshape(mass.shape[1:])


class _Line:
    """A window of a layer (X, Y), and what reaches it, as a line that takes part in a sum as a whole.

    Empty cells follow each row, and empty rows stand at both ends, so that nothing runs over into the next row or off
    the line. A blur along y ends in the cells after the rows, so it comes last. A step along y is one cell of the line,
    a step along x a row with what follows it.

    Args:
        area: whose walls count.
        window: of the layers.
        gap_x, gap_y: the longest steps along x and y that a blur takes [cells].
    """

    def __init__(self, area: FreeArea, window: Window, gap_x: int, gap_y: int) -> None:
        self._area = area
        shape = area.free.shape
        self._around = tuple(
            slice(max(part.start - gap, 0), min(part.stop + gap, count))
            for part, gap, count in zip(window, (gap_x, gap_y), shape, strict=True)
        )
        self._window = tuple(
            slice(part.start - around.start, part.stop - around.start)
            for part, around in zip(window, self._around, strict=True)
        )
        self._columns, self._rows = (around.stop - around.start for around in self._around)
        self._width = self._rows + gap_y
        self._margin = gap_x * self._width + gap_y
        self._inner = slice(self._margin, self._margin + self._columns * self._width)
        self._cells, self._before = np.zeros((2, self._inner.stop + self._margin))
        self._free = self._with_gaps(area.free)
        self._passages: dict[tuple[int, int], Floats] = {}

    def take(self, layer: Floats, columns: int, rows: int) -> None:
        """Take a layer (X, Y), moved by whole cells, not through walls; what leaves the grid is lost."""
        self._cells.fill(0.0)
        moved = self._cells[self._inner].reshape(self._columns, -1)[:, : self._rows]
        (from_x, to_x), (from_y, to_y) = (
            _path(around, cells, count)
            for around, cells, count in zip(self._around, (columns, rows), layer.shape, strict=True)
        )
        moved[to_x, to_y] = layer[from_x, from_y]
        if self._area.has_walls and (columns or rows):
            moved *= self._area.passage(columns, rows)[self._around]

    def blur(self, taps: Floats, axis: int) -> None:
        """Blur along x (0) or y (1), not through walls, by half a symmetric kernel (R + 1,), its middle first."""
        self._cells, self._before = self._before, self._cells
        blurred = np.multiply(self._before, taps[0], out=self._cells)[self._inner]
        for lag in (np.flatnonzero(taps[1:]) + 1).tolist():
            for way in (lag, -lag):
                step = way * (self._width if axis == 0 else 1)
                arriving = self._before[self._margin - step :][: len(blurred)]
                if self._area.has_walls:
                    arriving = arriving * self._passage(way, axis)
                daxpy(arriving, blurred, a=taps[lag])

    def layer(self) -> Floats:
        """A flat copy of what has arrived in the window's part of the free area."""
        line = self._cells[self._inner]
        line *= self._free
        return np.asarray(line.reshape(self._columns, -1)[self._window].reshape(-1))

    def _passage(self, lag: int, axis: int) -> Floats:
        """1 for each cell that a step along an axis can reach; remembered."""
        if (lag, axis) not in self._passages:
            step = (lag, 0) if axis == 0 else (0, lag)
            self._passages[lag, axis] = self._with_gaps(self._area.passage(*step))
        return self._passages[lag, axis]

    def _with_gaps(self, cells: np.ndarray) -> Floats:
        """Cells (X, Y), yes or no, as numbers along the line."""
        return np.pad(cells[self._around].astype(np.float64), ((0, 0), (0, self._width - self._rows))).reshape(-1)


def _path(window: slice, cells: int, count: int) -> tuple[slice, slice]:
    """From where on an axis of so many cells to where in a window a move by whole cells leads."""
    first = max(window.start, cells)
    end = max(min(window.stop, count + cells), first)
    return slice(first - cells, end - cells), slice(first - window.start, end - window.start)


def _taps(variances: Floats, longest: int) -> Floats:
    """Halves (H, R + 1), the middle first, of symmetric kernels with variances (H,) in cells^2; R <= longest.

    Sampled Gaussians; below half a cell^2, where sampling would miss the variance, the three taps that have it.
    """
    three = np.stack([1.0 - variances, variances / 2.0], axis=1)
    widest = float(variances.max())
    if widest < 0.5:
        return three
    lags = np.arange(min(int(np.ceil(4.0 * np.sqrt(widest))), longest) + 1)
    gauss = np.exp(-(lags**2) / (2.0 * np.maximum(variances, 0.5)[:, None]))
    taps = gauss / (2.0 * gauss.sum(axis=1, keepdims=True) - 1.0)
    narrow = variances < 0.5
    taps[narrow] = np.pad(three[narrow], ((0, 0), (0, len(lags) - 2)))
    return np.asarray(taps)


def _ring(variance: float, count: int) -> Floats:
    """Share (count,) of a layer's mass that a blur of the heading takes so many layers on; variance in layers^2."""
    taps = _taps(np.array([min(variance, float(count) ** 2)]), 4 * count)[0]  # at a full circle all is even anyway
    lags = np.arange(len(taps))
    ahead = np.bincount(lags % count, weights=taps, minlength=count)
    return np.asarray(ahead + np.bincount(-lags[1:] % count, weights=taps[1:], minlength=count))
