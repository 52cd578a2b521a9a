"""What is to be told of one frame of a run: the values that tables, picture and ``--json`` are made of."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from benchmarks import replay
from benchmarks.explanation.rerun import Rerun
from estimators.activity import ActivityTracker
from topoloc.geometry import wrap
from topoloc.interfaces import Estimator
from topoloc.metrics import Run
from topoloc.types import WeightedPoses

SHOWN_NODES = 3
"""So many nodes are looked at closely: the named one, the best match, the true one, else the next best matches."""
SHOWN_SHARES = 10
"""So many nodes are told of a belief."""


@dataclass(frozen=True)
class Share:
    """How much of a belief lies nearest to a node, by index."""

    node: int
    share: float


@dataclass(frozen=True)
class Explanation:
    """Why a localizer answered what it did at one frame; nodes are indices, angles degrees, lengths metres.

    Attributes:
        scenario, sensor, estimator, seed: the run.
        recorded: the drive is a recording; else it is simulated.
        frame: its number, from 0, as the rows of ``steps.csv`` have it.
        frames: how many the drive has.
        last_update: number of the last frame up to this one that was looked at.
        nodes: ids of the map's nodes.
        answer: what was answered and believed; its belief and account are of the last update.
        truth: x, y, heading.
        true_node: nearest to the true place.
        error_m, error_deg: of place and heading.
        verdict: on the named node, as ``docs/metrics.md`` has it: ``right``, ``adjacent``, ``wrong``; empty where the
            gate stayed closed: no look was taken, and no metric counts the answer.
        look: what the sensor saw, and for IMA and what fuses it the slots on ``shown``; None where gated.
        shown: nodes that are looked at closely, the named one first.
        shares: of the belief by node, largest first.
        led: for the tracker of the thesis, share of each destination before the match counts: (3.22), normalised.
    """

    scenario: str
    sensor: str
    estimator: str
    seed: int
    recorded: bool
    frame: int
    frames: int
    last_update: int
    nodes: list[str]
    answer: replay.Answer
    truth: replay.Pose
    true_node: int
    error_m: float
    error_deg: float
    verdict: str
    look: replay.Look | None
    shown: list[int]
    shares: list[Share]
    led: list[float]

    def node_name(self, node: int | None) -> str:
        """Id of a node, by index."""
        return "none" if node is None else self.nodes[node]

    @property
    def title(self) -> str:
        """Which run, and which frame of it."""
        kind = "recorded" if self.recorded else "simulated"
        frame = f"frame {self.frame} of 0 to {self.frames - 1}"
        return f"{self.scenario} ({kind}), {self.sensor} with {self.estimator}, seed {self.seed}: {frame}"


def explain(again: Rerun) -> Explanation:
    """What is to be told of the last step of a run."""
    topo_map, step, number = again.case.topo_map, again.steps[-1], again.number
    pose, truth, gated = step.estimate.pose, again.case.truth[number], step.kind == "gated"
    account, belief = replay.account_of(again.estimator), again.estimator.belief
    verdict, cells = ("", []) if gated else (_verdict(again), replay.cells_of(belief))
    look = None if gated else replay.look_of(number, again.case.frames[number], step, again.sensor)
    true_node = int(topo_map.nearest_node(truth[None, :2])[0])
    shown = [] if look is None else _shown(step.estimate.node, look, true_node)
    if look is not None:
        look = replace(look, slots=_slots(again, shown) if look.hypotheses else [])
    return Explanation(
        *again.key,
        recorded=again.recorded,
        frame=number,
        frames=len(again.case.frames),
        last_update=max(index for index, one in enumerate(again.steps) if one.kind != "gated"),
        nodes=[node.id for node in topo_map.nodes],
        answer=replay.answer_of(step, verdict == "right", cells, account),
        truth=(round(float(truth[0]), 3), round(float(truth[1]), 3), round(float(np.rad2deg(truth[2])), 1)),
        true_node=true_node,
        error_m=round(float(np.linalg.norm(pose[:2] - truth[:2])), 3),
        error_deg=round(float(np.rad2deg(abs(wrap(pose[2] - truth[2])))), 1),
        verdict=verdict,
        look=look,
        shown=shown,
        shares=shares_of(belief, topo_map.nearest_node(belief.poses[:, :2])),
        led=[] if account is None else led_to(account, _match_power(again.estimator)),
    )


def _match_power(estimator: Estimator) -> float:
    """Of the tracker's update; 1 for one of somebody else's that does not say."""
    return estimator.config.match_power if isinstance(estimator, ActivityTracker) else 1.0


def _verdict(again: Rerun) -> str:
    run = Run.of(again.case.topo_map, again.steps, again.case.truth[: len(again.steps)])
    return "right" if run.right[-1] else "adjacent" if run.adjacent[-1] else "wrong"


def _shown(named: int | None, look: replay.Look, true_node: int) -> list[int]:
    best = [hypothesis.node for hypothesis in look.hypotheses]
    wanted = [named, *best[:1], true_node, *best[1:]]
    return list(dict.fromkeys(node for node in wanted if node is not None))[:SHOWN_NODES]


def _slots(again: Rerun, nodes: Sequence[int]) -> list[replay.Slots]:
    sensor = replay.ima_in(again.sensor)
    return [] if sensor is None else replay.slots_of(sensor, again.case.frames[again.number].images["rgb"], nodes)


def shares_of(belief: WeightedPoses, nearest: np.ndarray) -> list[Share]:
    """How a belief is shared out among nodes, the largest shares only.

    Args:
        belief: N poses.
        nearest: (N,) index of the node nearest to each.
    """
    shares = np.bincount(nearest, belief.weights)
    order = np.argsort(-shares, kind="stable")[:SHOWN_SHARES]
    return [Share(int(node), round(float(shares[node]), 4)) for node in order if shares[node] > 0.0]


def led_to(account: replay.Account, match_power: float) -> list[float]:
    """Where origins and odometry alone lead: prediction (3.22) of each destination, their sum made 1.

    The tracker keeps activities after the update only: (3.23) is divided out again.

    Args:
        account: of a step.
        match_power: of the tracker; 1 in the thesis.
    """
    match = np.array([line.match for line in account.destinations], dtype=np.float64)
    activity = np.array([line.activity for line in account.destinations])
    led = np.divide(activity, match**match_power, out=np.zeros(len(match)), where=match > 0.0)  # 0: eps_M may be
    return [] if len(led) == 0 else np.round(led / led.sum(), 4).tolist()
