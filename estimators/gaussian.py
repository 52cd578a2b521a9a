"""A belief that is one Gaussian: how it starts at a hypothesis, moves, and is handed out."""

from __future__ import annotations

import numpy as np

from topoloc.geometry import Floats, compose, rotate, wrap
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

ANY_HEADING = np.pi**2 / 3.0
"""Variance of a heading of which nothing is known [rad^2]."""


def anywhere(topo_map: TopoMap) -> WeightedPoses:
    """Every node with four headings, all equally likely."""
    count = len(topo_map.nodes)
    headings = np.tile(wrap(np.arange(4) * np.pi / 2.0), count)
    return WeightedPoses.uniform(np.column_stack([np.repeat(topo_map.positions, 4, axis=0), headings]))


def best_hypothesis(evidence: Evidence) -> int:
    """Index of the highest match; of equal ones the lowest node, then the lowest pose: their order does not matter."""
    x, y, heading = evidence.poses.T
    return int(np.lexsort((heading, y, x, evidence.nodes, -evidence.match))[0])


def hypothesis_variances(evidence: Evidence, index: int) -> Floats:
    """(3,) [m^2, m^2, rad^2] around a hypothesis; 1 / kappa, but no heading is less known than any heading."""
    position = evidence.sigma[index] ** 2
    return np.array([position, position, 1.0 / max(evidence.kappa[index], 1.0 / ANY_HEADING)])


def carried(mean: Floats, covariance: Floats, motion: Motion) -> tuple[Floats, Floats]:
    """Mean (3,) and covariance (3, 3) after a motion, to first order: F P F' + G Q G'."""
    x, y = rotate(motion.delta[:2], mean[2])
    by_pose = np.array([[1.0, 0.0, -y], [0.0, 1.0, x], [0.0, 0.0, 1.0]])
    cos, sin = np.cos(mean[2]), np.sin(mean[2])
    by_motion = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    spread = by_pose @ covariance @ by_pose.T + by_motion @ motion.covariance @ by_motion.T
    return compose(mean, motion.delta), spread


def cubature_points(mean: Floats, covariance: Floats) -> WeightedPoses:
    """Six equal weights with exactly this mean (3,) and covariance (3, 3) (ours; DESIGN.md, "Values").

    A heading less known than any heading cannot be told on the circle: its deviation is shrunk to just below that.
    """
    return WeightedPoses.uniform(cubature_poses(mean[None], covariance[None]))


def cubature_poses(means: Floats, covariances: Floats) -> Floats:
    """(6 C, 3), the cubature points of one Gaussian after the other: means (C, 3), covariances (C, 3, 3)."""
    values, vectors = np.linalg.eigh(covariances)
    roots = vectors * np.sqrt(3.0 * np.maximum(values, 0.0))[:, None]  # columns: the points' deviations
    roots[:, 2] *= np.sqrt(0.999 * ANY_HEADING / np.maximum(covariances[:, 2, 2], 0.999 * ANY_HEADING))[:, None]
    deviations = roots.swapaxes(1, 2)
    poses = (means[:, None] + np.concatenate([deviations, -deviations], axis=1)).reshape(-1, 3)
    poses[:, 2] = wrap(poses[:, 2])
    return np.asarray(poses)
