"""Slots of a frame found, in order, on many reference images at once: Code 2.1 and 2.2 of the thesis (chapter 2)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from topoloc.geometry import Floats
from topoloc.types import Ints


@dataclass(frozen=True)
class Reference:
    """A reference image I_ref made ready for ``match_slots``.

    Attributes:
        pixels: (K, rows, columns) grey levels of K references of one size.
        norms: (K, columns), root of the summed squared deviations of each slot-wide region; 0 where it is flat.
        circular: the columns close a circle.
    """

    pixels: Floats
    norms: Floats
    circular: bool


@dataclass(frozen=True)
class Matches:
    """IMA's output for K references.

    Attributes:
        value: (K,) MAX of Code 2.2, in [0, 1].
        column: (K,) left edge of the view on the reference, 0-based (COL - 1 of Code 2.2).
        columns: (K,) columns of the reference that was searched.
        advance: (K,) how far ahead of the reference's place the camera stands, in distances of the scene: 1 - 1 / rho
            of (2.5), negative behind it.
    """

    value: Floats
    column: Ints
    columns: Ints
    advance: Floats


def make_reference(pixels: Floats, slot_width: int, flat_variance: float, circular: bool) -> Reference:
    """Precompute what depends on the references alone.

    Args:
        pixels: (K, rows, columns).
        slot_width: columns of a slot.
        flat_variance: below it a region has no correlation [grey level^2].
        circular: the columns close a circle.
    """
    rows, columns = pixels.shape[1:]
    starts = columns if circular else columns - slot_width + 1
    around = np.concatenate([pixels, pixels[:, :, : slot_width - 1]], axis=2) if circular else pixels
    first, second = (_window_sums(power.sum(axis=1), slot_width) for power in (around, around**2))
    count = rows * slot_width
    energy = second - first**2 / count
    norms = np.zeros((len(pixels), columns))
    norms[:, :starts] = np.sqrt(np.where(energy < flat_variance * count, 0.0, np.maximum(energy, 0.0)))
    return Reference(pixels, norms, circular)


def _window_sums(columns: Floats, width: int) -> Floats:
    """Sums over every run of ``width`` columns: (K, N) -> (K, N - width + 1)."""
    total = np.concatenate([np.zeros((len(columns), 1)), np.cumsum(columns, axis=1)], axis=1)
    return np.asarray(total[:, width:] - total[:, :-width])


def slot_values(frame: Floats, reference: Reference, slots: int, flat_variance: float) -> Floats:
    """VAL of Code 2.1 for every slot: c* of (A.4) at every column of every reference.

    Args:
        frame: (rows, columns) grey levels, as high as the references.
        reference: K references.
        slots: N_s.
        flat_variance: below it a slot has no correlation, c* = 0.5.

    Returns:
        (K, columns, N_s); -inf where a slot would stick out of a reference that is no circle.
    """
    rows = frame.shape[0]
    width = frame.shape[1] // slots
    template = frame[:, : slots * width].reshape(rows, slots, width)
    template = template - template.mean(axis=(0, 2), keepdims=True)
    energy = np.sum(template**2, axis=(0, 2))
    # Every column of the reference against every column of the frame in one product; a slot's correlation is then
    # the sum over its columns, each shifted to where the slot begins. The template's mean is 0: (A.3) drops out.
    products = np.swapaxes(reference.pixels, 1, 2) @ template.reshape(rows, slots * width)
    products = products.reshape(*products.shape[:2], slots, width)
    correlation = sum(np.roll(products[..., k], -k, axis=1) for k in range(width))
    norms = reference.norms[:, :, None] * np.where(energy < flat_variance * rows * width, 0.0, np.sqrt(energy))
    value = np.full(correlation.shape, 0.5)
    np.divide(correlation, norms, out=value, where=norms > 0.0)
    value[norms > 0.0] = (np.clip(value[norms > 0.0], -1.0, 1.0) + 1.0) / 2.0
    if not reference.circular:
        value[:, reference.pixels.shape[2] - width + 1 :] = -np.inf
    return value


def match_slots(frame: Floats, reference: Reference, slots: int, flat_variance: float) -> Matches:
    """IMA: Code 2.1 and 2.2 for K references at once.

    On a circle every index wraps. On a plain image (5.1.5) the slots that stick out add nothing.

    Args:
        frame: (rows, columns) grey levels; the columns that do not fill a slot are left out.
        reference: K references as high as the frame.
        slots: N_s.
        flat_variance: see ``slot_values``.
    """
    width = frame.shape[1] // slots
    value = slot_values(frame, reference, slots, flat_variance)
    best = value.argmax(axis=2)  # MATCH_SLOT: the first of equal slots, as ">" in Code 2.1 keeps it
    kept = np.where(np.arange(slots) == best[..., None], np.maximum(value, 0.0), 0.0)  # MATCH_VAL, by slot
    total = sum(shifted(kept[..., n], n * width, reference.circular) for n in range(slots))
    column = np.asarray(total).argmax(axis=1)
    value_there = np.take_along_axis(np.asarray(total), column[:, None], axis=1)[:, 0] / slots
    return Matches(value_there, column, np.full(len(column), reference.pixels.shape[2]), np.zeros(len(column)))


def shifted(values: Floats, columns: int, circular: bool) -> Floats:
    """Values (K, N, ...) moved left; what comes in from the right is the other end of the circle, or nothing."""
    moved = np.roll(values, -columns, axis=1)
    if not circular and columns > 0:
        moved[:, -columns:] = 0.0
    if not circular and columns < 0:
        moved[:, :-columns] = 0.0
    return moved
