"""Slots of a frame found, in order, on many reference images at once: Code 2.1 and 2.2 of the thesis (chapter 2)."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sensors.slot_correlation import Reference, Singles, add_moved, moved, slots_of
from topoloc.geometry import Floats
from topoloc.types import Ints


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


Sums = Callable[[Singles, int, bool], Singles]
"""What slots whose correlations (N_s, columns, B) with B references are known add up to at every column (columns, B),
times N_s; with the width of a slot, and whether the columns close a circle."""


def sums_of_winners(correlation: Singles, width: int, circular: bool) -> Singles:
    """SUM of Code 2.2: each slot adds at its place in the row, if it beats the others there (MATCH_SLOT of Code 2.1).

    On a circle every index wraps. On a plain image (5.1.5) the slots that stick out add nothing.
    """
    best = correlation.max(axis=0)
    value = np.clip(0.5 * best + 0.5, 0.0, 1.0)  # c* of (A.4): MATCH_VAL
    total: Singles = np.zeros_like(best)
    for slot, own in enumerate(correlation):
        won = value * (own == best)
        add_moved(total, won, slot * width, circular)
        value -= won  # of equal slots the first wins, as ">" in Code 2.1 has it
    return total


def sums_within(correlation: Singles, width: int, circular: bool, slack: int) -> Singles:
    """Each slot adds its correlation at its place in the row, or up to ``slack`` columns beside it if it is more there.

    Args:
        correlation: (N_s, columns, B) with B references; below zero it counts as zero.
        width: columns of a slot.
        circular: the columns close a circle.
        slack: columns.
    """
    correlation = np.maximum(correlation, 0.0)
    near = correlation.copy()
    for columns in range(1, slack + 1):
        for beside in (columns, -columns):
            np.maximum(near, moved(correlation, beside, circular), out=near)
    total: Singles = near[0].copy()
    for slot in range(1, len(near)):
        add_moved(total, near[slot], slot * width, circular)
    return total


def match_frames(
    frames: Sequence[NDArray[np.generic]], reference: Reference, slots: int, flat_variance: float, sums: Sums
) -> list[Matches]:
    """Several frames against the same K references, which are read from memory once.

    Args:
        frames: each (rows, columns) grey levels, as high as the references.
        reference: K references.
        slots: N_s; columns that do not fill a slot are left out.
        flat_variance: a slot whose grey levels vary less has no correlation [grey level^2].
        sums: how slots add up.
    """
    templates = np.concatenate([slots_of(frame, slots, flat_variance) for frame in frames])
    value = np.empty((len(frames), len(reference)))
    column = np.empty((len(frames), len(reference)), dtype=np.int64)
    for block, correlation in reference.correlations(templates):
        for number in range(len(frames)):
            own = correlation[number * slots : (number + 1) * slots]
            total = sums(own, reference.slot_width, reference.circular)
            column[number, block] = best = total.argmax(axis=0)
            value[number, block] = total[best, np.arange(total.shape[1])] / slots
    columns, none = np.full(len(reference), reference.columns), np.zeros(len(reference))
    return [Matches(*found, columns, none) for found in zip(value, column, strict=True)]


def match_slots(frame: NDArray[np.generic], reference: Reference, slots: int, flat_variance: float) -> Matches:
    """IMA: Code 2.1 and 2.2 for K references at once; see ``match_frames``."""
    return match_frames([frame], reference, slots, flat_variance, sums_of_winners)[0]


def slot_values(frame: NDArray[np.generic], reference: Reference, slots: int, flat_variance: float) -> Singles:
    """VAL of Code 2.1 for every slot: c* of (A.4) at every column of every reference.

    Args:
        frame: (rows, columns) grey levels, as high as the references.
        reference: K references.
        slots: N_s.
        flat_variance: below it a slot has no correlation, c* = 0.5.

    Returns:
        (K, columns, N_s); -inf where a slot would stick out of a reference that is no circle.
    """
    found = reference.correlations(slots_of(frame, slots, flat_variance))
    correlation = np.concatenate([part for _, part in found], axis=2)
    value: Singles = np.clip(0.5 * correlation + 0.5, 0.0, 1.0, dtype=np.float32).transpose(2, 1, 0)
    if not reference.circular:
        value[:, reference.columns - reference.slot_width + 1 :] = -np.inf
    return value
