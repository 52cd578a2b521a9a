"""Draws of poses: of a motion, of a belief."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimators.resampling import systematic
from topoloc.geometry import Floats, cos_sin, covariance_root, wrap
from topoloc.types import Motion, WeightedPoses

CACHED = 2**14
"""Poses that are worked on at a time."""


def sample_motion(poses: Floats, motion: Motion, rng: np.random.Generator) -> Floats:
    """Poses (N, 3) after a motion, each with its own draw of the noise, in the robot's frame before the step."""
    root = covariance_root(motion.covariance)
    moved = np.empty_like(poses)
    for first in range(0, len(poses), CACHED):  # by parts that stay in the cache
        before, after = poses[first : first + CACHED], moved[first : first + CACHED]
        along, across, turn = motion.delta[:, None] + root @ standard_normals(3, len(before), rng)
        cos, sin = cos_sin(before[:, 2])
        after[:, 0] = before[:, 0] + cos * along - sin * across
        after[:, 1] = before[:, 1] + sin * along + cos * across
        after[:, 2] = wrap(before[:, 2] + turn)
    return moved


def standard_normals(rows: int, columns: int, rng: np.random.Generator) -> NDArray[np.float32]:
    """(rows, columns) independent draws of mean 0 and variance 1, in single precision: three times as fast as numpy's.

    Box and Muller, A note on the generation of random normal deviates, 1958; cosine and sine from the tangent of half
    the angle, as ``cos_sin``. None is beyond 5.8 standard deviations, which one in 10^8 should be.
    """
    pairs = -(-rows * columns // 2)
    height, half_turns = rng.random((2, pairs), dtype=np.float32)
    radius = np.sqrt(np.float32(-2.0) * np.log(np.float32(1.0) - height))  # of (0, 1]
    tangent = np.tan(np.float32(np.pi) * half_turns)
    squared = tangent * tangent
    share = radius / (np.float32(1.0) + squared)
    drawn = np.concatenate([(np.float32(1.0) - squared) * share, np.float32(2.0) * tangent * share])
    return np.asarray(drawn[: rows * columns].reshape(rows, columns))


def sample_poses(distribution: WeightedPoses, n: int, rng: np.random.Generator) -> Floats:
    """Draw n poses (n, 3), by systematic resampling; the spread is taken as Gaussian."""
    poses = distribution.poses[systematic(distribution.weights, n, rng)]
    drawn = poses + rng.normal(size=poses.shape) * np.sqrt(distribution.spread)
    return np.column_stack([drawn[:, :2], wrap(drawn[:, 2])])
