"""The values that pass between a camera, a sensor model, an estimator and its user.

Poses are x [m], y [m], theta [rad, -pi <= theta < pi] in the map frame, counter-clockwise, float64.
Values are immutable: their arrays are set read-only on construction.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from topoloc.geometry import Floats, compose, inverse, wrap
from topoloc.mixture import Mixture

Image = NDArray[np.uint8]
Depth = NDArray[np.uint16]
Pixels = NDArray[Any]
"""An ``Image`` or, of the kind ``depth``, a ``Depth``: the kind tells which, so it is not asked again at each use."""
DEPTH_UNITS_PER_M = 5000
"""What 1 m is in a ``Depth``, as in the TUM RGB-D recordings; 0 is unknown."""
Ints = NDArray[np.int64]


def _frozen(values: ArrayLike, shape: tuple[int | None, ...], name: str) -> Floats:
    """A read-only float64 copy of ``values``; ``None`` in ``shape`` stands for any length."""
    array = np.array(values, dtype=np.float64)
    if array.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name} has shape {array.shape}; expected {shape}")
    array.setflags(write=False)
    return array


def _first_of_each(values: Ints) -> NDArray[np.bool_]:
    """(M,) which of sorted values (M,) are not the same as the one before."""
    return np.asarray(np.concatenate([[True], values[1:] != values[:-1]]))


@dataclass(frozen=True)
class WeightedPoses:
    """A distribution over poses: a belief, a prior, a cloud of particles, the cells of a grid.

    Attributes:
        poses: (N, 3), N >= 1.
        log_weights: (N,), up to a common constant; -inf is weight zero.
        spread: (3,) variance [m^2, m^2, rad^2] of the kernel around every pose: the size of a cell, 0 for a point.
    """

    poses: Floats
    log_weights: Floats
    spread: Floats = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", _frozen(self.poses, (None, 3), "poses"))
        object.__setattr__(self, "log_weights", _frozen(self.log_weights, (len(self.poses),), "log_weights"))
        object.__setattr__(self, "spread", _frozen(self.spread, (3,), "spread"))
        if not np.isfinite(self.poses).all():
            raise ValueError("poses must be finite")
        if not np.isfinite(self.log_weights.max(initial=-np.inf)):
            raise ValueError("at least one log weight must be finite, and none may be NaN or +inf")
        if not (np.isfinite(self.spread) & (self.spread >= 0.0)).all():
            raise ValueError("a spread is a variance: it must be finite and not negative")

    @classmethod
    def uniform(cls, poses: ArrayLike, spread: ArrayLike = (0.0, 0.0, 0.0)) -> WeightedPoses:
        """Equal weights for ``poses`` (N, 3)."""
        array = np.asarray(poses, dtype=np.float64)
        return cls(array, np.zeros(len(array)), np.asarray(spread, dtype=np.float64))

    @property
    def weights(self) -> Floats:
        """(N,) probabilities that sum to one."""
        weights = np.exp(self.log_weights - self.log_weights.max())
        return np.asarray(weights / weights.sum())


@dataclass(frozen=True)
class Motion:
    """What the odometry says of one step.

    Attributes:
        delta: (3,) relative pose, in the robot's frame before the step [m, m, rad].
        covariance: (3, 3) of ``delta`` [m, m, rad]; symmetric, may be singular.
    """

    delta: Floats
    covariance: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "delta", _frozen(self.delta, (3,), "delta"))
        object.__setattr__(self, "covariance", _frozen(self.covariance, (3, 3), "covariance"))
        if not (np.isfinite(self.delta).all() and np.isfinite(self.covariance).all()):
            raise ValueError("a motion must be finite")


@dataclass(frozen=True)
class Frame:
    """What the robot has at one moment.

    Attributes:
        timestamp: [s].
        odometry: (3,) raw pose of the odometer, or None where there is none.
        camera: (3,) pose of the camera on the robot, pan included; heading = optical axis.
        images: by kind. ``rgb``, ``right``, ``omni``: uint8 (rows, cols[, 3]), RGB order. ``depth``: uint16
            (rows, cols), distance along the optical axis, 5000 units a metre, 0 = unknown.
            The mapping may read lazily: it raises ``topoloc.errors.UnreadableImage`` for a file that does not decode.
    """

    timestamp: float
    odometry: Floats | None
    camera: Floats
    images: Mapping[str, Pixels]

    def __post_init__(self) -> None:
        if self.odometry is not None:
            object.__setattr__(self, "odometry", _frozen(self.odometry, (3,), "odometry"))
        object.__setattr__(self, "camera", _frozen(self.camera, (3,), "camera"))


@dataclass(frozen=True)
class Evidence:
    """What one frame says of where the camera (or, once converted, the robot) is: M weighted hypotheses.

    M = 0 is a blind frame (flat, covered, unreadable): its log-likelihood is 0 everywhere.

    Attributes:
        poses: (M, 3) hypotheses.
        nodes: (M,) index into ``topo_map.nodes`` of the node that each hypothesis belongs to.
        match: (M,) in [0, 1]; 1 is an identical image.
        distance: (M,) the sensor's own distance, scaled in ``fit``.
        log_likelihoods: (M,) how much likelier the frame is around the hypothesis than anywhere (log).
        sigma: (M,) [m], how far around a hypothesis it holds.
        kappa: (M,) von Mises concentration of the heading; 0: the heading is unknown.
        log_floor: log of the likelihood ratio that remains far from every hypothesis.
    """

    poses: Floats
    nodes: Ints
    match: Floats
    distance: Floats
    log_likelihoods: Floats
    sigma: Floats
    kappa: Floats
    log_floor: float = -4.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "poses", _frozen(self.poses, (None, 3), "poses"))
        count = len(self.poses)
        nodes = np.array(self.nodes, dtype=np.int64).reshape(-1)
        if nodes.shape != (count,):
            raise ValueError(f"nodes has shape {nodes.shape}; expected {(count,)}")
        nodes.setflags(write=False)
        object.__setattr__(self, "nodes", nodes)
        for name in ("match", "distance", "log_likelihoods", "sigma", "kappa"):
            object.__setattr__(self, name, _frozen(getattr(self, name), (count,), name))
        if not np.isfinite(self.poses).all():
            raise ValueError("evidence must have finite poses")
        if not (self.log_likelihoods < np.inf).all() or not self.log_floor < np.inf:
            raise ValueError("a log-likelihood must be a number below infinity")
        if not (np.isfinite(self.sigma) & (self.sigma > 0.0)).all():
            raise ValueError("sigma must be positive and finite")
        if not (np.isfinite(self.kappa) & (self.kappa >= 0.0)).all():
            raise ValueError("kappa must be finite and not negative")

    @classmethod
    def blind(cls) -> Evidence:
        """The evidence of a frame that says nothing."""
        none = np.zeros(0)
        return cls(np.zeros((0, 3)), np.zeros(0, dtype=np.int64), none, none, none, none, none)

    @property
    def is_blind(self) -> bool:
        """True where there is no hypothesis."""
        return len(self.poses) == 0

    def best_per_node(self) -> Ints:
        """Indices (L,) of the best-matching hypothesis of each node that has one, by node."""
        if self.is_blind:
            return np.zeros(0, dtype=np.int64)
        by_node = np.argsort(self.nodes, kind="stable")
        starts = np.flatnonzero(_first_of_each(self.nodes[by_node]))
        match, counts = self.match[by_node], np.diff(starts, append=len(by_node))
        best = by_node[~(match < np.repeat(np.maximum.reduceat(match, starts), counts))]
        if len(best) > len(starts):  # decide between equal matches, so that the order of hypotheses does not matter
            x, y, heading = self.poses[best].T
            best = best[np.lexsort((heading, y, x, -self.match[best], self.nodes[best]))]
            best = best[_first_of_each(self.nodes[best])]
        return np.asarray(best, dtype=np.int64)

    def of_robot(self, camera: ArrayLike) -> Evidence:
        """The same evidence about the robot, for a camera mounted at pose ``camera`` (3,) on it.

        Where the heading is unknown the mount's offset cannot be placed: the position stays the camera's.
        """
        mount = np.asarray(camera, dtype=np.float64)
        moved = compose(self.poses, inverse(mount))
        turned = np.column_stack([self.poses[:, :2], wrap(self.poses[:, 2] - mount[2])])
        poses = np.where((self.kappa > 0.0)[:, None], moved, turned)
        return Evidence(
            poses,
            self.nodes,
            self.match,
            self.distance,
            self.log_likelihoods,
            self.sigma,
            self.kappa,
            self.log_floor,
        )

    def log_likelihood(self, positions: ArrayLike, headings: ArrayLike) -> Floats:
        """Log-likelihood ratio of the frame at poses (EQUATIONS.md, 4; ours).

        ``log(floor + sum_m w_m K(|p - p_m|) h(theta - theta_m))``: K <= 1 a Gaussian of width sigma, h a von Mises
        with mean 1 over the circle.

        Args:
            positions: (P, 2) [m].
            headings: (P, H), or (1, H) shared by all positions [rad].

        Returns:
            (P, H).
        """
        place, heading = np.asarray(positions, dtype=np.float64), np.asarray(headings, dtype=np.float64)
        shape = (len(place), heading.shape[1])
        if self.is_blind:
            return np.zeros(shape)
        if len(heading) == 1:
            return self._mixture.at_every_heading(place, heading[0])
        return self._mixture.at_poses(np.repeat(place, shape[1], axis=0), heading.reshape(-1)).reshape(shape)

    def log_likelihood_on_grid(self, xs: ArrayLike, ys: ArrayLike, heading: float) -> Floats:
        """``log_likelihood`` at the crossings of a regular grid, all with one heading; much faster than one by one.

        Args:
            xs: (X,) [m].
            ys: (Y,) [m].
            heading: [rad].

        Returns:
            (X, Y).
        """
        x, y = np.asarray(xs, dtype=np.float64), np.asarray(ys, dtype=np.float64)
        return np.zeros((len(x), len(y))) if self.is_blind else self._mixture.on_grid(x, y, heading)

    @cached_property
    def _mixture(self) -> Mixture:
        return Mixture(self.poses, self.log_likelihoods, self.sigma, self.kappa, self.log_floor)

    @cached_property
    def log_mass(self) -> float:
        """Log of the mixture (without the floor) integrated over the plane, heading averaged [m^2]; -inf if empty."""
        peak = float(self._log_masses.max(initial=-np.inf))
        return peak + float(np.log(np.exp(self._log_masses - peak).sum())) if peak > -np.inf else peak

    @cached_property
    def _log_masses(self) -> Floats:
        """(M,) of each hypothesis."""
        return np.asarray(self.log_likelihoods + np.log(2.0 * np.pi * self.sigma**2))

    def sample(self, n: int, rng: np.random.Generator) -> Floats:
        """Draw n poses (n, 3) from the mixture, the floor left out; for recovery.

        Raises:
            ValueError: there is nothing to draw from: ``log_mass`` is -inf, as for a blind frame.
        """
        if not np.isfinite(self.log_mass):
            raise ValueError("there is no hypothesis of any weight to sample from; look at log_mass first")
        weights = np.exp(self._log_masses - self.log_mass)
        chosen = rng.choice(len(weights), size=n, p=weights / weights.sum())
        position = self.poses[chosen, :2] + rng.normal(size=(n, 2)) * self.sigma[chosen, None]
        heading = wrap(rng.vonmises(self.poses[chosen, 2], self.kappa[chosen]))
        return np.column_stack([position, heading])


class Status(Enum):
    """How far an estimate can be trusted."""

    LOCALIZED = "LOCALIZED"
    AMBIGUOUS = "AMBIGUOUS"
    LOST = "LOST"


@dataclass(frozen=True)
class Estimate:
    """Where the robot is, as a user reads it.

    Attributes:
        pose: (3,) of the robot, of the belief's leading mode.
        covariance: (3, 3) of that mode [m, m, rad].
        node: index into ``topo_map.nodes``, or None while there is none to name.
        probability: that ``node`` is right.
        status: LOCALIZED, AMBIGUOUS or LOST.
    """

    pose: Floats
    covariance: Floats
    node: int | None
    probability: float
    status: Status
