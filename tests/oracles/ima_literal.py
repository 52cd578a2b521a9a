"""Code 2.1, 2.2 and appendix A of the thesis, transcribed loop by loop: slow, 1-based as printed, nothing shared."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np


@dataclass
class Literal:
    max: float
    col: int  # 1-based
    match_slot: list[int]  # 1-based, [0] unused
    match_val: list[float]
    sums: list[float]  # SUM for each c, 1-based
    slot_lead: float  # smallest gap between the best two slots of a column


def ncc(ref: np.ndarray, slot: np.ndarray, flat_variance: float, circular: bool) -> list[float]:
    """VAL[c], c = 1..Wref (A.1)-(A.4); index 0 unused. Outside a plain reference: 0, which never wins in Code 2.1."""
    h, w = slot.shape
    w_ref = ref.shape[1]
    val = [0.0] * (w_ref + 1)
    t_m = 0.0
    for a in range(h):
        for b in range(w):
            t_m += slot[a, b]
    t_m /= w * h
    t_energy = 0.0
    for a in range(h):
        for b in range(w):
            t_energy += (slot[a, b] - t_m) ** 2
    for c in range(1, w_ref + 1):
        if not circular and c + w - 1 > w_ref:
            continue
        i_m = 0.0
        for a in range(h):
            for b in range(w):
                i_m += ref[a, (c - 1 + b) % w_ref]
        i_m /= w * h
        cross = i_energy = 0.0
        for a in range(h):
            for b in range(w):
                i_dev = ref[a, (c - 1 + b) % w_ref] - i_m
                cross += (slot[a, b] - t_m) * i_dev
                i_energy += i_dev**2
        if t_energy < flat_variance * w * h or i_energy < flat_variance * w * h:
            val[c] = 0.5
        else:
            val[c] = (cross / math.sqrt(t_energy * i_energy) + 1.0) / 2.0
    return val


def ima_literal(new: np.ndarray, ref: np.ndarray, n_s: int, flat_variance: float, circular: bool = True) -> Literal:
    w_ref = ref.shape[1]
    w_slot = new.shape[1] // n_s
    values = []
    # Code 2.1
    match_slot = [0] * (w_ref + 1)
    match_val = [0.0] * (w_ref + 1)
    for n in range(1, n_s + 1):
        val = ncc(ref, new[:, (n - 1) * w_slot : n * w_slot], flat_variance, circular)
        values.append(val[1:])
        for c in range(1, w_ref + 1):
            if val[c] > match_val[c]:
                match_slot[c] = n
                match_val[c] = val[c]
    # Code 2.2
    best, col = 0.0, 1
    sums = [0.0] * (w_ref + 1)
    for c in range(1, w_ref + 1):
        total = 0.0
        for n in range(1, n_s + 1):
            i = c + (n - 1) * w_slot
            if i > w_ref:
                if not circular:
                    continue
                i -= w_ref
            if match_slot[i] == n:
                total += match_val[i]
        sums[c] = total
        if total > best:
            best = total
            col = c
    lead = math.inf
    if n_s > 1:
        ordered = np.sort(np.array(values), axis=0)
        lead = float((ordered[-1] - ordered[-2]).min())
    return Literal(best / n_s, col, match_slot, match_val, sums, lead)
