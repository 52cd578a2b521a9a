"""Masses in a plane joined by springs with dampers, let go and followed until they rest (third seed, section 3)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from topoloc.geometry import Floats

TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True)
class Springs:
    """A spring and a damper between every two of N unit masses.

    The seed lost its formulas in conversion; these are rebuilt (EQUATIONS.md, 3). With l_ij = r_i - r_j and
    e_ij = l_ij / |l_ij|, what j does to i is -[k_ij (|l_ij| - d_ij) + b (v_i - v_j).e_ij] e_ij. All masses and all
    dampers are alike: an image weighs no more than another.

    Attributes:
        lengths: (N, N) natural lengths d_ij, symmetric.
        stiffness: (N, N) k_ij, symmetric, 0 on the diagonal.
        damping: b of every damper.
        time_step: T of a step; units of time and mass cancel in the picture at rest.
    """

    lengths: Floats
    stiffness: Floats
    damping: float
    time_step: float

    @classmethod
    def of(cls, lengths: Floats, stiffness: Floats, damping_share: float, step_share: float) -> Springs:
        """Springs with dampers and a time step that suit them.

        Args:
            lengths: (N, N).
            stiffness: (N, N).
            damping_share: of 2 sqrt(K) / N, K the mean over i of sum_j k_ij; about critical at 1.
            step_share: of 2 / sqrt(2 max_i sum_j k_ij), the limit without dampers; with them half of it is stable
                (ours; EQUATIONS.md, 3).
        """
        pull = stiffness.sum(axis=1)
        damping = damping_share * 2.0 * np.sqrt(pull.mean()) / len(lengths)
        time_step = step_share * 2.0 / np.sqrt(2.0 * max(float(pull.max()), TINY))
        return cls(lengths, stiffness, float(damping), float(time_step))

    def forces(self, positions: Floats, velocities: Floats) -> Floats:
        """(N, 2) forces on masses at positions (N, 2) with velocities (N, 2).

        Two masses on one spot have no direction between them, and do nothing to each other.
        """
        x, y = (axis[:, None] - axis for axis in positions.T)
        apart = np.sqrt(x * x + y * y)
        there = np.maximum(apart, TINY)
        away = ((velocities[:, :1] - velocities[:, 0]) * x + (velocities[:, 1:] - velocities[:, 1]) * y) / there
        pull = (self.stiffness * (apart - self.lengths) + self.damping * away) / there
        pull[apart == 0.0] = 0.0
        # sum_j pull_ij (r_j - r_i), by one product of matrices
        return np.asarray(pull @ positions - pull.sum(axis=1)[:, None] * positions)

    def energy(self, positions: Floats, velocities: Floats) -> float:
        """At positions (N, 2) with velocities (N, 2): half of sum over pairs k (|l| - d)^2, and half of sum |v|^2."""
        x, y = (axis[:, None] - axis for axis in positions.T)
        stretched = np.sqrt(x * x + y * y) - self.lengths
        return float(0.25 * (self.stiffness * stretched**2).sum() + 0.5 * (velocities**2).sum())

    def moves(self, start: Floats) -> Iterator[tuple[Floats, Floats]]:
        """Positions (N, 2) and velocities (N, 2) after each step from rest at ``start`` (N, 2), without end.

        v += a T, then r += v T with the new v.
        """
        positions, velocities = start, np.zeros_like(start)
        while True:
            velocities = velocities + self.forces(positions, velocities) * self.time_step
            positions = positions + velocities * self.time_step
            yield positions, velocities
