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
from scipy.special import i0e, logsumexp

from topoloc.geometry import Floats, compose, cos_sin, inverse, wrap

Image = NDArray[np.uint8]
Depth = NDArray[np.uint16]
Pixels = NDArray[Any]
"""An ``Image`` or, of the kind ``depth``, a ``Depth``: the kind tells which, so it is not asked again at each use."""
DEPTH_UNITS_PER_M = 5000
"""What 1 m is in a ``Depth``, as in the TUM RGB-D recordings; 0 is unknown."""
Ints = NDArray[np.int64]
TRUSTED = 1e-280
"""Sums of terms up to one that are at least this large have lost nothing to underflow, which starts at 1e-308."""
MULTIPLIED_OUT = 1e8
"""Squares may be multiplied out as long as their parts are no larger: what rounding loses is then below 1e-7."""
CACHED = 2**16
"""Terms that are worked on at a time: as many as stay in a core's cache."""


def _frozen(values: ArrayLike, shape: tuple[int | None, ...], name: str) -> Floats:
    """A read-only float64 copy of ``values``; ``None`` in ``shape`` stands for any length."""
    array = np.array(values, dtype=np.float64)
    if array.ndim != len(shape) or any(want not in (None, got) for want, got in zip(shape, array.shape, strict=True)):
        raise ValueError(f"{name} has shape {array.shape}; expected {shape}")
    array.setflags(write=False)
    return array


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
class _Mixture:
    """The sum of ``Evidence.log_likelihood`` as products of matrices; the attributes are the evidence's, M > 0.

    The weights are scaled so that no term exceeds one. So nothing overflows, and what a sum loses to underflow tells
    only where the sum itself is tiny: no floor, or one far below the best hypothesis. There ``_exactly`` is asked.
    """

    poses: Floats
    log_likelihoods: Floats
    sigma: Floats
    kappa: Floats
    log_floor: float

    def at_poses(self, places: Floats, headings: Floats) -> Floats:
        """(N,) at places (N, 2), each with its own of the headings (N,): one matrix product gives all exponents."""
        if np.abs(self._coefficients).max() > MULTIPLIED_OUT:
            return self._exactly(places, headings)
        sums = np.empty(len(places))
        for block in self._blocks(len(places)):
            exponents = self._coefficients @ self._features(places[block], headings[block])
            sums[block] = self._weights @ np.exp(exponents, out=exponents)
        values, (lost,) = self._logs(sums)
        values[lost] = self._exactly(places[lost], headings[lost])
        return values

    def at_every_heading(self, places: Floats, headings: Floats) -> Floats:
        """(P, H) at places (P, 2) with each of the headings (H,): position and heading apart, then their product."""
        sums = np.empty((len(places), len(headings)))
        around = self._weights[:, None] * self._around(headings)
        for block in self._blocks(len(places)):
            np.matmul(np.exp(self._log_positions(places[block])), around, out=sums[block])
        values, (place, heading) = self._logs(sums)
        values[place, heading] = self._exactly(places[place], headings[heading])
        return values

    def on_grid(self, xs: Floats, ys: Floats, heading: float) -> Floats:
        """(X, Y) at xs (X,) crossed with ys (Y,): x, y and heading apart, then their product."""
        along_x, along_y = (
            np.exp(-((line[:, None] - middle) ** 2) * self._narrowness)
            for line, middle in ((xs, self.poses[:, 0]), (ys, self.poses[:, 1]))
        )
        weights = self._weights * self._around(np.array([heading]))[:, 0]
        values, (column, row) = self._logs((along_x * weights) @ along_y.T)
        values[column, row] = self._exactly(np.column_stack([xs[column], ys[row]]), np.full(len(column), heading))
        return values

    def _blocks(self, count: int) -> list[slice]:
        """Parts of ``count`` poses that are small enough for the cache, and for memory where hypotheses are many."""
        step = max(1, CACHED // len(self.poses))
        return [slice(first, first + step) for first in range(0, count, step)]

    def _logs(self, sums: Floats) -> tuple[Floats, tuple[Ints, ...]]:
        """Log of floor + sums, of any shape, at their true scale, in place; indices of those that are not trusted."""
        sums += np.exp(self.log_floor - self._scale)
        lost = np.unravel_index(np.flatnonzero(~(sums >= TRUSTED)), sums.shape)  # NaN, too
        sums[lost] = 1.0
        np.log(sums, out=sums)
        sums += self._scale
        return sums, lost

    def _exactly(self, places: Floats, headings: Floats) -> Floats:
        """(N,) at places (N, 2) with headings (N,), each sum scaled by its own largest term."""
        values = np.empty(len(places))
        for block in self._blocks(len(places)):
            turned = np.cos(headings[block, None] - self.poses[:, 2])
            terms = self._log_peaks + self._log_positions(places[block]) + self.kappa * (turned - 1.0)  # (N, M)
            values[block] = np.logaddexp(self.log_floor, logsumexp(terms, axis=1))
        return values

    def _log_positions(self, places: Floats) -> Floats:
        """(N, M) log K at places (N, 2)."""
        squared = (places[:, :1] - self.poses[:, 0]) ** 2 + (places[:, 1:] - self.poses[:, 1]) ** 2
        return np.asarray(-squared * self._narrowness)

    def _around(self, headings: Floats) -> Floats:
        """(M, H) von Mises factors at headings (H,), scaled to one at their peak."""
        turned = np.cos(headings - self.poses[:, 2:])
        return np.asarray(np.exp(self.kappa[:, None] * (turned - 1.0)))

    def _features(self, places: Floats, headings: Floats) -> Floats:
        """(6, N) of places (N, 2) with headings (N,); ``_coefficients`` @ them are the exponents of all terms."""
        x, y = places[:, 0] - self._centre[0], places[:, 1] - self._centre[1]
        return np.stack([x * x + y * y, x, y, *cos_sin(headings), np.ones(len(x))])

    @cached_property
    def _coefficients(self) -> Floats:
        """(M, 6): -|p - p_m|^2 / (2 sigma^2) + kappa (cos(theta - theta_m) - 1), multiplied out."""
        (x, y), narrowness = (self.poses[:, :2] - self._centre).T, self._narrowness
        cos, sin = np.cos(self.poses[:, 2]), np.sin(self.poses[:, 2])
        constant = -narrowness * (x * x + y * y) - self.kappa
        return np.column_stack(
            [-narrowness, 2.0 * narrowness * x, 2.0 * narrowness * y, self.kappa * cos, self.kappa * sin, constant]
        )

    @cached_property
    def _centre(self) -> Floats:
        """(2,) of the hypotheses: squares of map coordinates would be large beside their differences."""
        return np.asarray(self.poses[:, :2].mean(axis=0))

    @cached_property
    def _narrowness(self) -> Floats:
        """(M,) 1 / (2 sigma^2)."""
        return 0.5 / self.sigma**2

    @cached_property
    def _log_peaks(self) -> Floats:
        """(M,) log of w_m times the peak of h."""
        return np.asarray(self.log_likelihoods - np.log(i0e(self.kappa)))

    @cached_property
    def _scale(self) -> float:
        """Log of the largest that a term can be; 0 where all are zero."""
        largest = max(float(self._log_peaks.max()), self.log_floor)
        return largest if largest > -np.inf else 0.0

    @cached_property
    def _weights(self) -> Floats:
        """(M,) at most one."""
        return np.asarray(np.exp(self._log_peaks - self._scale))


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
        x, y, heading = self.poses.T  # decide between equal matches, so that the order of hypotheses does not matter
        order = np.lexsort((heading, y, x, -self.match, self.nodes))
        first = np.ones(len(order), dtype=bool)
        first[1:] = self.nodes[order][1:] != self.nodes[order][:-1]
        return np.asarray(order[first], dtype=np.int64)

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
    def _mixture(self) -> _Mixture:
        return _Mixture(self.poses, self.log_likelihoods, self.sigma, self.kappa, self.log_floor)

    @property
    def log_mass(self) -> float:
        """Log of the mixture (without the floor) integrated over the plane, heading averaged [m^2]; -inf if empty."""
        if self.is_blind:
            return -np.inf
        return float(logsumexp(self.log_likelihoods + np.log(2.0 * np.pi * self.sigma**2)))

    def sample(self, n: int, rng: np.random.Generator) -> Floats:
        """Draw n poses (n, 3) from the mixture, the floor left out; for recovery.

        Raises:
            ValueError: there is nothing to draw from: ``log_mass`` is -inf, as for a blind frame.
        """
        if not np.isfinite(self.log_mass):
            raise ValueError("there is no hypothesis of any weight to sample from; look at log_mass first")
        log_weights = self.log_likelihoods + 2.0 * np.log(self.sigma)
        weights = np.exp(log_weights - logsumexp(log_weights))
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
