"""Draws of poses: of a motion, of a belief."""

from __future__ import annotations

import numpy as np

from estimators.resampling import systematic
from topoloc.geometry import Floats, compose, covariance_root, wrap
from topoloc.types import Motion, WeightedPoses


def sample_motion(poses: Floats, motion: Motion, rng: np.random.Generator) -> Floats:
    """Poses (N, 3) after a motion, each with its own draw of the noise, in the robot's frame before the step."""
    noise = rng.normal(size=poses.shape) @ covariance_root(motion.covariance).T
    return compose(poses, motion.delta + noise)


def sample_poses(distribution: WeightedPoses, n: int, rng: np.random.Generator) -> Floats:
    """Draw n poses (n, 3), by systematic resampling; the spread is taken as Gaussian."""
    poses = distribution.poses[systematic(distribution.weights, n, rng)]
    drawn = poses + rng.normal(size=poses.shape) * np.sqrt(distribution.spread)
    return np.column_stack([drawn[:, :2], wrap(drawn[:, 2])])
