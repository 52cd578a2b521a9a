"""How far one snapshot lies beside another of the same place: what tells a scan that its circle is closed (ours)."""

from __future__ import annotations

import numpy as np

from topoloc.geometry import Floats
from topoloc.types import Image

COLUMNS, ROWS = 192, 24
"""Size that pictures are reduced to: rows few, since a robot that has just braked nods."""
LEAST_OVERLAP = 0.2
"""Pictures are compared where they share this part of their columns or more."""


def edges_of(image: Image) -> Floats:
    """Horizontal differences (rows, columns) of grey levels, at most ``ROWS`` x ``COLUMNS``: light fades from them."""
    grey = image.reshape(*image.shape[:2], -1).mean(axis=2)
    down, across = max(1, grey.shape[0] // ROWS), max(1, grey.shape[1] // COLUMNS)
    cut = grey[: grey.shape[0] // down * down, : grey.shape[1] // across * across]
    small = cut.reshape(cut.shape[0] // down, down, cut.shape[1] // across, across).mean(axis=(1, 3))
    return np.asarray(np.diff(small, axis=1))


def likeness(first: Floats, second: Floats) -> tuple[Floats, Floats]:
    """How alike two views are for each shift between them: correlation of their edges where both see.

    Args:
        first: (R, C) as ``edges_of`` makes it.
        second: alike.

    Returns:
        Shifts (S,) as shares of a view, positive where ``second`` was taken farther clockwise; likeness (S,) in
        [-1, 1], 0 where one of them is flat.
    """
    columns = first.shape[1]
    size = 2 * columns
    spectra = np.fft.rfft(first, size, axis=1), np.fft.rfft(second, size, axis=1)
    shared = np.fft.irfft((spectra[0] * spectra[1].conj()).sum(axis=0), size)  # at shift s: first[c + s] second[c]
    reach = int(columns * (1.0 - LEAST_OVERLAP))
    shifts = np.arange(-reach, reach + 1)
    energy = _energy_at(first, shifts) * _energy_at(second, -shifts)
    value = shared[shifts] / np.sqrt(np.maximum(energy, 1e-12))
    return shifts / columns, np.where(energy > 1e-6, value, 0.0)


def _energy_at(edges: Floats, shifts: np.ndarray) -> Floats:
    """Sum (S,) of squares of the columns that lie within the other picture, moved by each shift."""
    summed = np.concatenate([[0.0], np.cumsum((edges**2).sum(axis=0))])
    columns = edges.shape[1]
    return np.asarray(summed[np.minimum(columns, columns + shifts)] - summed[np.maximum(0, shifts)])
