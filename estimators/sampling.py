"""Draws of poses: of a motion, of a belief."""

from __future__ import annotations

import numpy as np

from estimators.resampling import systematic
from topoloc.geometry import Floats, cos_sin, covariance_root, wrap
from topoloc.types import Motion, WeightedPoses

CACHED = 2**13
"""Poses that are worked on at a time."""


def sample_motion(poses: Floats, motion: Motion, rng: np.random.Generator) -> Floats:
    """Poses (N, 3) after a motion, each with its own draw of the noise, in the robot's frame before the step."""
    root = covariance_root(motion.covariance)
    moved = np.empty_like(poses)
    for first in range(0, len(poses), CACHED):  # by parts that stay in the cache
        before, after = poses[first : first + CACHED], moved[first : first + CACHED]
        along, across, turn = motion.delta[:, None] + root @ rng.standard_normal(before.shape).T
        cos, sin = cos_sin(before[:, 2])
        after[:, 0] = before[:, 0] + cos * along - sin * across
        after[:, 1] = before[:, 1] + sin * along + cos * across
        after[:, 2] = wrap(before[:, 2] + turn)
    return moved


def sample_poses(distribution: WeightedPoses, n: int, rng: np.random.Generator) -> Floats:
    """Draw n poses (n, 3), by systematic resampling; the spread is taken as Gaussian."""
    poses = distribution.poses[systematic(distribution.weights, n, rng)]
    drawn = poses + rng.normal(size=poses.shape) * np.sqrt(distribution.spread)
    return np.column_stack([drawn[:, :2], wrap(drawn[:, 2])])
