"""Correlation (A.4) of slots of a frame with every place of many reference images: Code 2.1's inner loops, in batch.

Two ways, of one answer. Few references: every column of them against every column of the slots in one matrix product,
then sums over the columns of each slot, shifted to where it begins. More: the rows' Fourier transforms, which belong
to the references and are kept; a frame then takes one small product a frequency and one transform back.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import fft

from topoloc.geometry import Floats
from topoloc.types import Ints

Singles = NDArray[np.float32]
FEW = 4
"""Up to so many references the product of columns is faster: 0.08 ms each against 0.03 and 0.2 for the frame."""
BLOCK = 32
"""Panoramas of the default size that are transformed back together: what they give stays in the cache of a core."""
TRANSFORMED = 8
"""That are transformed together, likewise."""
PRODUCT = 8
"""Frequencies of slots in one product: so few that BLAS keeps to one thread. With several it waits for cores that are
busy otherwise: 23 ms instead of 0.2."""
KEPT_MB = 1024.0
"""That a reference's transforms may take, unless told otherwise [MB]."""


@dataclass(eq=False)
class Reference:
    """K reference images I_ref of one size, made ready for slots of one width.

    A panorama of 648 x 54 takes 0.14 MB for its transforms, kept while they fit into ``kept_mb`` and made anew at each
    use above that, a block at a time; that takes three times as long.

    Attributes:
        pixels: (K, rows, columns) grey levels.
        scales: (K, columns), 1 / root of the summed squared deviations of each slot-wide region; 0 where it is flat.
        slot_width: columns of a slot.
        circular: the columns close a circle.
        kept_mb: memory for transforms [MB].
        block: references that are matched together.
    """

    pixels: NDArray[np.generic]
    scales: Singles
    slot_width: int
    circular: bool
    kept_mb: float = KEPT_MB
    block: int = BLOCK
    _kept: dict[int, Singles] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __len__(self) -> int:
        return len(self.pixels)

    def __getstate__(self) -> dict[str, object]:
        """What another process gets: transforms are made anew there."""
        return {**self.__dict__, "_kept": {}}

    @property
    def columns(self) -> int:
        """Of each reference."""
        return int(self.pixels.shape[2])

    @property
    def kept_bytes(self) -> int:
        """That transforms take now."""
        return sum(transforms.nbytes for transforms in self._kept.values())

    def chosen(self, which: Ints, kept_mb: float = 0.0) -> Reference:
        """Some of the references, by index."""
        return Reference(self.pixels[which], self.scales[which], self.slot_width, self.circular, kept_mb, self.block)

    def put(self, index: int, other: Reference) -> None:
        """Let the only reference of ``other`` take the place of one of these."""
        if not (self.pixels.flags.writeable and self.scales.flags.writeable):  # mapped from a map's folder
            self.pixels, self.scales = self.pixels.copy(), self.scales.copy()
        self.pixels[index], self.scales[index] = other.pixels[0], other.scales[0]
        self._kept.pop(index // self.block, None)

    def correlations(self, slots: Singles) -> Iterator[tuple[slice, Singles]]:
        """Normalised correlations, some references at a time.

        Args:
            slots: (S, rows, slot_width), as ``slots_of`` makes them.

        Yields:
            Which references, and (S, columns, B): of each slot with what begins at each column of each of them, in
            [-1, 1] but for rounding. 0 where either is flat, -1 where the slot would stick out.
        """
        spectrum = _SlotSpectrum(slots, self._length) if len(self) > FEW else None
        for first in range(0, len(self), self.block):
            block = slice(first, min(first + self.block, len(self)))
            sums = (
                _sums_of_columns(self._deviations(block), slots, self.circular)
                if spectrum is None
                else spectrum.correlated(self._transforms(first // self.block), self.columns)
            )
            correlation = np.empty(sums.shape, dtype=np.float32)
            np.multiply(sums, self.scales[block].T, out=correlation)
            if not self.circular:
                correlation[:, self.columns - self.slot_width + 1 :] = -1.0
            yield block, correlation

    def _deviations(self, block: slice) -> Singles:
        """(B, rows, columns) from each reference's mean, which no slot sees: less is lost to rounding."""
        pixels = self.pixels[block].astype(np.float32)
        pixels -= pixels.mean(axis=(1, 2), keepdims=True)
        return pixels

    def _transforms(self, number: int) -> Singles:
        """(F, B, 2 rows) Fourier transforms of a block's rows: real parts, then imaginary parts."""
        if number in self._kept:
            return self._kept[number]
        first, last = number * self.block, min((number + 1) * self.block, len(self))
        rows = self.pixels.shape[1]
        transforms = np.empty((self._length // 2 + 1, last - first, 2 * rows), dtype=np.float32)
        for begin in range(first, last, TRANSFORMED):
            part = slice(begin, min(begin + TRANSFORMED, last))
            pixels = self._deviations(part)
            if self.circular and self._length > self.columns:
                pixels = np.concatenate([pixels, pixels[:, :, : self.slot_width - 1]], axis=2)
            spectra = fft.rfft(pixels, self._length, axis=2).transpose(2, 0, 1)
            into = transforms[:, part.start - first : part.stop - first]
            into[..., :rows], into[..., rows:] = spectra.real, spectra.imag
        if self.kept_bytes + transforms.nbytes <= self.kept_mb * 1e6:
            self._kept[number] = transforms
        return transforms

    @cached_property
    def _length(self) -> int:
        """Of the transforms: the circle itself where its length has small factors, else room for its beginning."""
        if self.circular and fft.next_fast_len(self.columns, real=True) == self.columns:
            return self.columns
        return int(fft.next_fast_len(self.columns + self.slot_width - 1, real=True))


def make_reference(
    pixels: NDArray[np.generic], slot_width: int, flat_variance: float, circular: bool, kept_mb: float = KEPT_MB
) -> Reference:
    """Precompute what depends on the references alone.

    Args:
        pixels: (K, rows, columns) grey levels.
        slot_width: columns of a slot.
        flat_variance: below it a region has no correlation [grey level^2].
        circular: the columns close a circle.
        kept_mb: see ``Reference``.
    """
    scales = np.empty((len(pixels), pixels.shape[2]), dtype=np.float32)
    for first in range(0, len(pixels), BLOCK):
        block = slice(first, first + BLOCK)
        scales[block] = _scales(pixels[block].astype(np.float64), slot_width, flat_variance, circular)
    return Reference(pixels, scales, slot_width, circular, kept_mb)


def _scales(pixels: Floats, width: int, flat_variance: float, circular: bool) -> Floats:
    """(K, columns) 1 / root of summed squared deviations of the regions that begin at each column; 0 where flat."""
    rows, columns = pixels.shape[1:]
    starts = columns if circular else columns - width + 1
    around = np.concatenate([pixels, pixels[:, :, : width - 1]], axis=2) if circular else pixels
    first, second = (_window_sums(power.sum(axis=1), width) for power in (around, around**2))
    energy = second - first**2 / (rows * width)
    scales = np.zeros((len(pixels), columns))
    uneven = energy >= max(flat_variance * rows * width, np.finfo(np.float64).tiny)
    np.divide(1.0, np.sqrt(energy, where=uneven, out=np.ones_like(energy)), out=scales[:, :starts], where=uneven)
    return scales


def _window_sums(columns: Floats, width: int) -> Floats:
    """Sums over every run of ``width`` columns: (K, N) -> (K, N - width + 1)."""
    total = np.concatenate([np.zeros((len(columns), 1)), np.cumsum(columns, axis=1)], axis=1)
    return np.asarray(total[:, width:] - total[:, :-width])


def slots_of(frame: NDArray[np.generic], slots: int, flat_variance: float) -> Singles:
    """The slots of a frame (rows, columns), each less its mean and of length one: (N_s, rows, width); flat ones are 0.

    With means taken out here, the means of what they are compared with drop out of (A.3).
    """
    rows, columns = frame.shape
    width = columns // slots
    cut = frame[:, : slots * width].astype(np.float64).reshape(rows, slots, width).swapaxes(0, 1)
    deviations = cut - cut.mean(axis=(1, 2), keepdims=True)
    energy = np.sum(deviations**2, axis=(1, 2), keepdims=True)
    uneven = energy >= max(flat_variance * rows * width, np.finfo(np.float64).tiny)
    length = np.sqrt(energy, where=uneven, out=np.ones_like(energy))
    return np.where(uneven, deviations / length, 0.0).astype(np.float32)


def _sums_of_columns(pixels: Singles, slots: Singles, circular: bool) -> Singles:
    """(S, columns, K): products of slots with references (K, rows, columns), summed over rows and columns."""
    count, rows, columns = pixels.shape
    number, _, width = slots.shape
    side_by_side = pixels.transpose(1, 2, 0).reshape(rows, columns * count)
    products = slots.transpose(2, 0, 1).reshape(width * number, rows) @ side_by_side
    by_column = products.reshape(width, number, columns, count)
    sums: Singles = by_column[0].copy()
    for column in range(1, width):
        add_moved(sums, by_column[column], column, circular)
    return sums


def add_moved(sums: Singles, values: Singles, columns: int, circular: bool) -> None:
    """Add values (..., N, K) to sums of that shape, moved left by columns < N; from the right comes the circle's start.

    Without a circle nothing comes in.
    """
    kept = values.shape[-2] - columns
    sums[..., :kept, :] += values[..., columns:, :]
    if circular and columns:
        sums[..., kept:, :] += values[..., :columns, :]


def moved(values: Singles, columns: int, circular: bool) -> Singles:
    """Values (..., N, K) moved left; what comes in from the right is the other end of the circle, or nothing."""
    result: Singles = np.roll(values, -columns, axis=-2)
    if not circular and columns > 0:
        result[..., -columns:, :] = 0.0
    if not circular and columns < 0:
        result[..., :-columns, :] = 0.0
    return result


class _SlotSpectrum:
    """The slots' Fourier transforms, as matrices that turn references' transforms into those of the correlations.

    Args:
        slots: (S, rows, width).
        length: of the transform.
    """

    def __init__(self, slots: Singles, length: int) -> None:
        self._length = length
        number, rows, width = slots.shape
        frequencies = length // 2 + 1
        padded = -(-frequencies // PRODUCT) * PRODUCT
        angles = 2.0 * np.pi / length * np.outer(np.arange(padded), np.arange(width))
        waves = np.concatenate([np.cos(angles), np.sin(angles)], axis=1).astype(np.float32)
        # (real, imaginary) of the reference times the conjugate (cos, sin) of the slot is (real, imaginary) again.
        by_column = slots.transpose(2, 1, 0)
        parts = np.zeros((2, width, 2, rows, number, 2), dtype=np.float32)
        parts[0, :, 0, :, :, 0] = parts[0, :, 1, :, :, 1] = by_column
        parts[1, :, 0, :, :, 1], parts[1, :, 1, :, :, 0] = by_column, -by_column
        products = waves.reshape(-1, PRODUCT, 2 * width) @ parts.reshape(2 * width, 4 * rows * number)
        self._matrices = products.reshape(padded, 2 * rows, 2 * number)[:frequencies]

    def correlated(self, transforms: Singles, columns: int) -> Singles:
        """(S, columns, B) sums of products at every column, of transforms (F, B, 2 rows) of references."""
        spectra = np.matmul(transforms, self._matrices).view(np.complex64)
        return np.asarray(fft.irfft(spectra, self._length, axis=0)[:columns].transpose(2, 0, 1))
