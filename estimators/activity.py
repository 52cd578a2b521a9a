"""The thesis's estimator: few hypotheses at nodes, their activity updated by Code 3.1 together with section 4.1.5."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import ClassVar, Literal, get_args

import numpy as np

from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats, circular_mean, rotate, wrap
from topoloc.thesis import THESIS
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses

PLACE_SD_M, HEADING_SD_DEG = 0.3, 8.0
"""A topological position is an area, not a point (3.7): the robot drives some 30 cm off the node (5.2.3), and the
heading that IMA gives there errs by about so much."""
ROUNDING = 1e-9
"""A largest deviation below this is rounding: zero, as the thesis's formula does not provide for."""
LEAST_RESULTANT = 0.2
"""Headings whose mean unit vector is shorter than this have no direction in common."""
UNKNOWN_HEADINGS = np.deg2rad([-180.0, -90.0, 0.0, 90.0])
"""A hypothesis without a heading stands in the belief four times, so that its mean heading is nowhere."""
Deviation = Literal["largest", "fixed"]
"""What the sigmas of the action model are: the step's own largest deviations, or settings."""
Reset = Literal["node", "offset"]
"""Where the odometry is reset to: the winner's node, or the place off it that match and odometry agree on."""


@dataclass(frozen=True)
class ActivityTrackerConfig:
    """Thresholds of the thesis (4.1.1, 5.2), and the action model: the thesis's, or one with fixed sigmas (ours).

    Attributes:
        match_threshold: eps_M; a destination's match must exceed it, and the virtual destination has just this.
        head_threshold: eps_phi >= eps_M; the winner's match must exceed it for the heading to be corrected.
        deviation: sigmas of the action model: ``largest``, the step's own largest deviation (3.16), (3.17), by which
            no hypothesis, however far off, loses more than a factor of 1.65 each; or ``fixed``.
        sigma_m: of the distance, where fixed [m].
        sigma_deg: of the heading, where fixed [deg].
        outlier_floor: share of the action model, where fixed, that any move has, since odometry may err and the robot
            may be carried off; it adds up over the updates since a match last won: 1 - (1 - outlier_floor)^(1 + n). At
            0 a tracker that has gone wrong stays so for long.
        match_power: power of the match in the update; 1 is the thesis's (3.23). Fixed sigmas do best with 3 to 4: a
            move counts for more there, and so must the difference between a match of 0.7 and one of 0.5.
        reset: where the odometry is reset to: ``node``, the thesis's (3.7), which its author found to make most of the
            errors (5.2.3); or ``offset``: each hypothesis keeps where it stands off its node, from the odometry and
            the place that the match tells, each by its variance.
        parallax_m: distance of what is seen, by which a heading matched beside the node is corrected under
            ``offset``; 0 takes it as it is [m].
    """

    match_threshold: float = THESIS.match_threshold
    head_threshold: float = THESIS.head_threshold
    deviation: Deviation = "largest"
    sigma_m: float = 0.8
    sigma_deg: float = 40.0
    outlier_floor: float = 0.20
    match_power: float = 1.0
    reset: Reset = "node"
    parallax_m: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.match_threshold <= self.head_threshold <= 1.0:
            raise ValueError("0 <= match_threshold <= head_threshold <= 1 must hold (thesis 3.8)")
        if self.deviation not in get_args(Deviation):
            raise ValueError(f"deviation is {self.deviation!r}; use one of: {', '.join(get_args(Deviation))}")
        if not (0.0 < self.sigma_m < np.inf and 0.0 < self.sigma_deg < np.inf):
            raise ValueError(f"sigma_m is {self.sigma_m}, sigma_deg {self.sigma_deg}; both must be positive and finite")
        if not 0.0 <= self.outlier_floor < 1.0:
            raise ValueError(f"outlier_floor is {self.outlier_floor}; it must lie in [0, 1)")
        if not 0.0 < self.match_power < np.inf:
            raise ValueError(f"match_power is {self.match_power}; it must be positive and finite")
        if self.reset not in get_args(Reset):
            raise ValueError(f"reset is {self.reset!r}; use one of: {', '.join(get_args(Reset))}")
        if not 0.0 <= self.parallax_m < np.inf:
            raise ValueError(f"parallax_m is {self.parallax_m}; it must be finite and not negative")


@dataclass(frozen=True)
class Hypotheses:
    """Origins O or destinations D of thesis 3.2, row by row.

    Attributes:
        nodes: (L,) index into ``topo_map.nodes``.
        headings: (L,) [rad]; NaN where unknown.
        match: (L,) MATCH(d); eps_M for a virtual one, NaN for the origins of the start.
        activity: (L,) Act, sums to one.
        virtual: (L,) whether it is the virtual one d0 of 3.2.1.
        offsets: (L, 2) from the node [m], or (1, 2) for all; zero in the thesis.
        variances: (L,) of where it stands, along and across alike [m^2], or (1,) for all.
    """

    nodes: Ints
    headings: Floats
    match: Floats
    activity: Floats
    virtual: np.ndarray
    offsets: Floats = field(default_factory=lambda: np.zeros((1, 2)))
    variances: Floats = field(default_factory=lambda: np.full(1, PLACE_SD_M**2))

    def __len__(self) -> int:
        return len(self.nodes)


@dataclass(frozen=True)
class TrackerStep:
    """One execution of Code 3.1, for golden tests, ``reproduce`` and ``explain``.

    Attributes:
        kind: ``normal`` or ``virtual`` destination won, ``supposed`` place, or ``none``: nothing known yet.
        node: the answer d* or d0, index into ``topo_map.nodes``, or the node nearest to where d* stands off its own;
            None while nothing is known.
        origins: before the step.
        destinations: of the step; empty when none was generated.
        winner: row of d* in ``destinations``; None where there is none.
        delta_l: (D, O) [m], (3.14).
        delta_phi: (D, O) [rad], absolute, (3.15); NaN where a heading is unknown.
    """

    kind: str
    node: int | None
    origins: Hypotheses
    destinations: Hypotheses
    winner: int | None
    delta_l: Floats
    delta_phi: Floats


class ActivityTracker:
    """Multi-hypothesis tracking of the thesis (chapter 3, Code 3.1, section 4.1.5).

    The motions since the last winning destination add up to one displacement in the map frame, common to all
    origins; each origin keeps its own heading. The tracker alone owns the offset between odometer and map heading.
    """

    Config: ClassVar[type[ActivityTrackerConfig]] = ActivityTrackerConfig
    estimate_rule = EstimateRule(bias=-0.09, gain=0.15, agreement_gain=0.36)  # benchmarks/calibration.py

    def __init__(self, config: ActivityTrackerConfig | None = None) -> None:
        self.config = config or ActivityTrackerConfig()
        self.last: TrackerStep | None = None
        self._displacement: Floats  # (2,) since the last winning destination [m]
        self._turned: float  # since then [rad]
        self._drift: Floats  # (3,) variances of both [m^2, m^2, rad^2]; along and across are taken alike

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Every node an origin of activity 1/K with unknown heading (5.2.2), or the origins and heading of a prior.

        Where a prior knows no heading at its heaviest node, the direction of motions is unknown until the first win.
        """
        del rng  # nothing here is drawn
        self._positions, self._nearest_node = topo_map.positions, topo_map.nearest_node
        self.last = None
        if prior is None:
            self.restore(_origins_anywhere(len(topo_map.nodes)), None, 0.0)
        else:
            origins = _origins_of(prior, topo_map, self.config.reset)
            best = int(np.argmax(origins.activity))
            known = bool(np.isfinite(origins.headings[best]))
            self.restore(origins, best if known else None, float(origins.headings[best]) if known else 0.0)

    def restore(self, origins: Hypotheses, best_origin: int | None, heading: float) -> None:
        """Go on from known origins: those of a saved run, or of a table of the thesis.

        Args:
            origins: O, what the last destinations were.
            best_origin: row of o*, the last winner; None where nothing has won yet.
            heading: the corrected odometer heading there [rad].
        """
        self._origins, self._best_origin = origins, best_origin
        self._unmatched = 0  # updates since a match last won
        self._heading_known = best_origin is not None
        self._odometer_heading = 0.0  # integrated from the motions that follow
        self._offset = heading  # of the map's heading against the odometer's
        self._reset_odometry()

    @property
    def heading(self) -> float:
        """The corrected odometer heading [rad]."""
        return float(wrap(self._odometer_heading + self._offset))

    def predict(self, motion: Motion) -> None:
        """Add a motion to the displacement, along the corrected heading (4.1.5).

        Before the first win its direction is unknown, so that only the odometer's own heading is kept. Where offsets
        are kept, it stays unknown until a heading was matched: only how far the robot may be by now is known.
        """
        if self._best_origin is not None and not self._heading_known and self.config.reset == "offset":
            self._drift = self._drift + np.array([0.5, 0.5, 0.0]) * float(motion.delta[:2] @ motion.delta[:2])
        elif self._best_origin is not None:
            self._displacement = self._displacement + rotate(motion.delta[:2], self.heading)
            self._turned = float(wrap(self._turned + motion.delta[2]))
            along, across, turned = np.diag(motion.covariance)
            self._drift = self._drift + np.array([(along + across) / 2.0, (along + across) / 2.0, turned])
        self._odometer_heading = float(wrap(self._odometer_heading + motion.delta[2]))

    def update(self, evidence: Evidence) -> None:
        """Code 3.1. There is no p(evidence | past) here: activities are normalised among the destinations only."""
        supposed = self._supposed_place()
        destinations = self._destinations(evidence, supposed)
        if len(destinations) == 0:
            kind, node = ("none", None) if supposed is None else ("supposed", self._node_at(supposed))
            nothing = np.zeros((0, len(self._origins)))
            self._unmatched += 1
            self.last = TrackerStep(kind, node, self._origins, destinations, None, nothing, nothing)
            return
        delta_l, delta_phi = self._deviations(destinations)
        fits = self._action_model(delta_l, delta_phi)
        reached = fits @ self._origins.activity  # prediction (3.22)
        likelihood = (destinations.match / destinations.match.max()) ** self.config.match_power
        activity = likelihood * reached  # update (3.23)
        if not activity.any():  # fixed sigmas without a floor may underflow everywhere: the motion then tells nothing
            activity = likelihood
        activity = activity / activity.sum()  # normalisation (3.24)
        winner = int(np.argmax(activity))
        done = replace(destinations, activity=activity)
        node = int(done.nodes[winner])
        if self.config.reset == "offset":
            done = self._settled(done, fits, reached)
            node = self._node_at(self._places(done)[winner])
        kind = "virtual" if done.virtual[winner] else "normal"
        self.last = TrackerStep(kind, node, self._origins, done, winner, delta_l, delta_phi)
        self._unmatched = self._unmatched + 1 if done.virtual[winner] else 0
        self._reset_to(done, winner)

    @property
    def belief(self) -> WeightedPoses:
        """The origins, moved by the displacement since they were destinations; as uncertain as that is, and a node."""
        origins = self._origins
        positions = self._places(origins) + self._displacement
        headings = wrap(origins.headings + self._turned)
        known = np.isfinite(headings)
        rows = np.concatenate([np.flatnonzero(known), np.repeat(np.flatnonzero(~known), len(UNKNOWN_HEADINGS))])
        fill = np.tile(UNKNOWN_HEADINGS, int((~known).sum()))
        poses = np.column_stack([positions[rows], np.concatenate([headings[known], fill])])
        share = np.where(known[rows], 1.0, 1.0 / len(UNKNOWN_HEADINGS))
        with np.errstate(divide="ignore"):  # an activity may have underflowed to zero
            return WeightedPoses(poses, np.log(origins.activity[rows] * share), self._spread())

    def _spread(self) -> Floats:
        """(3,) variances around each hypothesis [m^2, m^2, rad^2]."""
        origins = self._origins
        place = float(np.sum(origins.activity * origins.variances))
        return np.array([place, place, np.deg2rad(HEADING_SD_DEG) ** 2]) + self._drift

    def _places(self, hypotheses: Hypotheses) -> Floats:
        """(L, 2) where hypotheses stand [m]."""
        return np.asarray(self._positions[hypotheses.nodes] + hypotheses.offsets)

    def _node_at(self, place: Floats) -> int:
        return int(self._nearest_node(place[None])[0])

    def _supposed_place(self) -> Floats | None:
        """(2,) o* plus the odometry displacement [m]; None before the first win. The node nearest to it is d0."""
        if self._best_origin is None:
            return None
        return np.asarray(self._places(self._origins)[self._best_origin] + self._displacement)

    def _destinations(self, evidence: Evidence, supposed: Floats | None) -> Hypotheses:
        """Nodes with a match above eps_M, and the virtual destination (3.2.1); empty when there is no such node."""
        best = evidence.best_per_node()
        chosen = best[evidence.match[best] > self.config.match_threshold]
        nodes, match, places = evidence.nodes[chosen], evidence.match[chosen], evidence.poses[chosen, :2]
        headings = np.where(evidence.kappa[chosen] > 0.0, evidence.poses[chosen, 2], np.nan)
        virtual, variances = np.zeros(len(chosen), dtype=bool), evidence.sigma[chosen] ** 2
        if len(chosen) and supposed is not None:
            assert self._best_origin is not None  # or nothing would be supposed
            known = np.broadcast_to(self._origins.variances, len(self._origins))[self._best_origin]
            nodes, match = np.append(nodes, self._node_at(supposed)), np.append(match, self.config.match_threshold)
            headings, virtual = np.append(headings, self.heading), np.append(virtual, True)
            places, variances = np.vstack([places, supposed]), np.append(variances, known + self._drift[0])
        found = Hypotheses(nodes, headings, match, np.zeros(len(nodes)), virtual)
        if self.config.reset == "node":
            return found
        return replace(found, offsets=places - self._positions[nodes], variances=variances)

    def _deviations(self, destinations: Hypotheses) -> tuple[Floats, Floats]:
        """Delta-l (3.14) and delta-phi (3.15), each (D, O): one displacement, but each origin's own heading.

        Footnote 10 has delta-phi = 0 from a virtual origin to the virtual destination. That holds here until a win
        corrects the odometer's heading: the virtual origin keeps the heading that it was a destination with.
        """
        reached = self._places(self._origins) + self._displacement
        delta_l = np.linalg.norm(self._places(destinations)[:, None] - reached[None], axis=2)
        turned = self._origins.headings + self._turned
        return delta_l, np.abs(wrap(destinations.headings[:, None] - turned[None]))

    def _action_model(self, delta_l: Floats, delta_phi: Floats) -> Floats:
        config = self.config
        if config.deviation == "largest":
            return action_model(delta_l, delta_phi)
        return fixed_action_model(delta_l, delta_phi, config.sigma_m, np.deg2rad(config.sigma_deg), self._floor)

    @property
    def _floor(self) -> float:
        """Share of the action model that any move has now."""
        if self.config.deviation == "largest":
            return 0.0
        return float(1.0 - (1.0 - self.config.outlier_floor) ** (1 + self._unmatched))

    def _settled(self, destinations: Hypotheses, fits: Floats, reached: Floats) -> Hypotheses:
        """Destinations where match and odometry together put them (ours), their headings freed from parallax.

        From each origin that may have led here, as far as the move was no outlier, the place matched is drawn to where
        the odometry led, by their variances as in a Kalman filter; the virtual destination stays where that led. The
        variance is the mean of theirs: with the scatter between the places that are mixed it would be honest, but the
        tracker erred twice as often with people about.

        Args:
            destinations: D, where they were matched.
            fits: (D, O) action model.
            reached: (D,) predictions (3.22).
        """
        origins = self._origins
        matched, led = self._places(destinations), self._places(origins) + self._displacement
        share = np.divide(
            (fits - self._floor) * origins.activity, reached[:, None], where=reached[:, None] > 0.0, out=fits * 0
        )
        before, measured = origins.variances + self._drift[0], destinations.variances[:, None]
        share = np.where(destinations.virtual[:, None], 0.0, share)
        gain = share * measured / (measured + before)
        places = matched + gain @ led - gain.sum(axis=1, keepdims=True) * matched
        variances = destinations.variances * (1.0 - gain.sum(axis=1))
        settled = replace(destinations, offsets=places - self._positions[destinations.nodes], variances=variances)
        return replace(
            settled, headings=np.where(destinations.virtual, settled.headings, self._without_parallax(settled))
        )

    def _without_parallax(self, destinations: Hypotheses) -> Floats:
        """(D,) headings, less what a place to the left of the node turns a matched one counter-clockwise."""
        if self.config.parallax_m == 0.0:
            return destinations.headings
        leftwards = np.column_stack([-np.sin(destinations.headings), np.cos(destinations.headings)])
        left = np.sum(destinations.offsets * leftwards, axis=1)
        return wrap(destinations.headings - left / self.config.parallax_m)

    def _reset_to(self, destinations: Hypotheses, winner: int) -> None:
        """The end of Code 3.1: reset the odometry to d*, correct the heading if the match allows it, O <- D."""
        first = self.config.reset == "offset" and not self._heading_known  # any heading is better than none
        sure = destinations.match[winner] > self.config.head_threshold
        if (sure or first) and np.isfinite(destinations.headings[winner]):
            self._offset = float(wrap(destinations.headings[winner] - self._odometer_heading))
            self._heading_known = True
        self._reset_odometry()
        self._origins, self._best_origin = destinations, winner

    def _reset_odometry(self) -> None:
        self._displacement, self._turned, self._drift = np.zeros(2), 0.0, np.zeros(3)


def action_model(delta_l: Floats, delta_phi: Floats) -> Floats:
    """P(d | o, a) of (3.19) up to its constant factor, which the normalisation (3.24) cancels.

    The width of each Gaussian (3.16), (3.17) is the step's own largest deviation; where every deviation is zero the
    formula would divide by zero: all pairs then fit alike. A pair with an unknown heading (NaN) has the factor 1.
    """
    return _gaussian(delta_l, _largest(delta_l)) * _gaussian(delta_phi, _largest(delta_phi))


def fixed_action_model(
    delta_l: Floats,
    delta_phi: Floats,
    sigma_l: float,
    sigma_phi: float,
    floor: float,
) -> Floats:
    """The same with fixed sigmas and an outlier floor (ours): (1 - floor) times the two Gaussians, plus floor.

    Args:
        delta_l: (D, O) [m].
        delta_phi: (D, O) [rad]; NaN where a heading is unknown.
        sigma_l: standard deviation of ``delta_l`` [m].
        sigma_phi: standard deviation of ``delta_phi`` [rad].
        floor: what remains for any pair, however far off.
    """
    return (1.0 - floor) * _gaussian(delta_l, sigma_l) * _gaussian(delta_phi, sigma_phi) + floor


def _largest(deviation: Floats) -> float:
    return float(deviation[np.isfinite(deviation)].max(initial=0.0))


def _gaussian(deviation: Floats, sigma: float) -> Floats:
    """Gaussian with the value 1 at 0; 1 where the deviation is unknown (NaN), or sigma zero but for rounding."""
    if sigma < ROUNDING:
        return np.ones_like(deviation)
    return np.exp(-0.5 * (np.nan_to_num(deviation) / sigma) ** 2)


def _origins_anywhere(count: int) -> Hypotheses:
    nodes = np.arange(count)
    unknown = np.full(count, np.nan)
    return Hypotheses(nodes, unknown, unknown, np.full(count, 1.0 / count), np.zeros(count, dtype=bool))


def _origins_of(prior: WeightedPoses, topo_map: TopoMap, reset: Reset) -> Hypotheses:
    """A prior's mass and mean heading at each node that it reaches; and, where offsets are kept, its mean place."""
    weights, nearest = prior.weights, topo_map.nearest_node(prior.poses[:, :2])
    nodes = np.unique(nearest[weights > 0.0])
    activity = np.array([weights[nearest == node].sum() for node in nodes])
    headings = np.array([_common_heading(prior.poses[nearest == node, 2], weights[nearest == node]) for node in nodes])
    unknown = np.full(len(nodes), np.nan)
    found = Hypotheses(nodes, headings, unknown, activity / activity.sum(), np.zeros(len(nodes), dtype=bool))
    if reset == "node":
        return found
    shares = [weights[nearest == node] / weights[nearest == node].sum() for node in nodes]
    places = [prior.poses[nearest == node, :2] for node in nodes]
    means = np.array([share @ place for share, place in zip(shares, places, strict=True)])
    around = np.array(
        [
            share @ ((place - mean) ** 2).sum(axis=1) / 2.0
            for share, place, mean in zip(shares, places, means, strict=True)
        ]
    )
    return replace(found, offsets=means - topo_map.positions[nodes], variances=around + prior.spread[:2].mean())


def _common_heading(headings: Floats, weights: Floats) -> float:
    """Mean heading [rad], NaN where there is no direction in common."""
    resultant = np.abs(np.sum(weights * np.exp(1j * headings))) / weights.sum()
    return circular_mean(headings, weights) if resultant > LEAST_RESULTANT else np.nan
