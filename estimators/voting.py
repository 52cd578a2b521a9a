"""What a vote of the nearest neighbours knows, without any memory."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from estimators.gaussian import ANY_HEADING, anywhere
from topoloc.estimate import EstimateRule
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints, Motion, WeightedPoses


@dataclass(frozen=True)
class VotingConfig:
    """Settings of the vote.

    Attributes:
        neighbours: J, how many hypotheses vote: those of the highest match.
    """

    neighbours: int = 5

    def __post_init__(self) -> None:
        if self.neighbours < 1:
            raise ValueError(f"neighbours is {self.neighbours}; it must be at least 1")


class Voting:
    """The J nearest neighbours vote for their nodes, each with lambda_j times its likelihood; the past says nothing.

    lambda_j falls with the rank of the match, as in the second seed's sensor model (section 3; rebuilt, EQUATIONS.md,
    2). Rank alone would say nothing of doubt, and often tie: the first of three neighbours weighs as much as the other
    two. So each vote counts by its likelihood as well (ours).
    Evidence of single views can have several hypotheses at one node, whose votes add up. Evidence of panoramas has one
    a node: then the best match leads whatever J is (where the likelihood rises with the match), and J only says how
    many rivals make it doubtful. J = 1 is the best match alone.

    A blind frame, or one in which no voter has any likelihood, leaves the last answer. Before the first one: the
    prior, or any node with any heading.
    """

    Config = VotingConfig
    estimate_rule = EstimateRule(bias=-0.95, gain=0.68, agreement_gain=0.45)  # benchmarks/calibration.py

    def __init__(self, config: VotingConfig | None = None) -> None:
        self.config = config or VotingConfig()
        self._belief: WeightedPoses

    def reset(self, topo_map: TopoMap, rng: np.random.Generator, prior: WeightedPoses | None = None) -> None:
        """Forget the last answer. Draws nothing."""
        self._belief = anywhere(topo_map) if prior is None else prior

    def predict(self, motion: Motion) -> None:
        """Nothing: a vote knows no motion."""

    def update(self, evidence: Evidence) -> None:
        """Take a vote.

        Always None: log p(evidence | past) asks what the past foretold, and here it foretells nothing.
        """
        if evidence.is_blind:
            return
        voters = ranked(evidence, self.config.neighbours)
        log_votes = np.log(rank_weights(len(voters))) + evidence.log_likelihoods[voters]
        if np.isfinite(log_votes.max()):
            self._belief = WeightedPoses(evidence.poses[voters], log_votes, _spread(evidence, voters, log_votes))

    @property
    def belief(self) -> WeightedPoses:
        """The hypotheses that voted, weighed by their votes; as wide as they are in the mean."""
        return self._belief


def rank_weights(count: int) -> Floats:
    """lambda_j = 2 (J - j + 1) / (J^2 + J) of J neighbours, nearest first: (J,), sums to one (EQUATIONS.md, 2)."""
    return np.arange(count, 0, -1) * 2.0 / (count**2 + count)


def ranked(evidence: Evidence, count: int | None = None) -> Ints:
    """Indices by falling match, (M,) or the first (count,); of equal ones the lowest nodes, then the lowest poses."""
    match = evidence.match
    first = np.arange(len(match))
    if count is not None and count < len(match):
        first = np.flatnonzero(match >= -np.partition(-match, count - 1)[count - 1])  # equal ones, too
    x, y, heading = evidence.poses[first].T
    return first[np.lexsort((heading, y, x, evidence.nodes[first], -match[first]))[:count]]


def _spread(evidence: Evidence, voters: Ints, log_votes: Floats) -> Floats:
    """(3,) mean variances [m^2, m^2, rad^2] around the voters; no heading is less known than any heading."""
    votes = np.exp(log_votes - log_votes.max())
    position = evidence.sigma[voters] ** 2
    heading = 1.0 / np.maximum(evidence.kappa[voters], 1.0 / ANY_HEADING)
    return np.asarray((votes / votes.sum()) @ np.column_stack([position, position, heading]))
