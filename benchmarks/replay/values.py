"""What the report's replay shows of a drive, as the files under ``replay/`` hold it.

Angles are degrees, counter-clockwise, lengths metres.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

Point = tuple[float, float]
Pose = tuple[float, float, float]
Cell = tuple[float, float, float]


@dataclass(frozen=True)
class NodeSeen:
    """A node of the map: its panorama is a data URL, or empty; ``heading_deg`` is that of its first column."""

    id: str
    name: str
    x: float
    y: float
    heading_deg: float
    panorama: str


@dataclass(frozen=True)
class Drive:
    """One drive of a scenario.

    Attributes:
        scenario, seed: which.
        nodes, edges: of the map; edges are pairs of indices into ``nodes``.
        times: of the frames [s].
        truth: x, y, heading of the robot at each frame.
        reckoned: where its odometer alone would put it, from the true start on; empty without an odometer.
        frames: pictures as data URLs; empty where one could not be read, or was left out of a long drive.
        kidnapped_at: indices of the first frames after the robot was carried elsewhere.
    """

    scenario: str
    seed: int
    nodes: list[NodeSeen]
    edges: list[tuple[int, int]]
    times: list[float]
    truth: list[Pose]
    reckoned: list[Point]
    frames: list[str]
    kidnapped_at: list[int]


@dataclass(frozen=True)
class Hypothesis:
    """One of a look's: index of its node, where it puts the robot, heading None where it knows none."""

    node: int
    match: float
    log_likelihood: float
    x: float
    y: float
    heading_deg: float | None


@dataclass(frozen=True)
class Slots:
    """Where IMA found the slots of a frame on a node's panorama; see ``sensors.ima.SlotMatches``."""

    node: int
    match: float
    left: list[float]
    width: float
    value: list[float]
    counted: list[bool]


@dataclass(frozen=True)
class Look:
    """What a sensor saw in one frame: the best hypotheses, and for IMA the slots on each of their nodes."""

    frame: int
    hypotheses: list[Hypothesis]
    slots: list[Slots]
    problem: str


@dataclass(frozen=True)
class Line:
    """An origin or a destination of the tracker of the thesis; ``match`` is None for the origins of the start."""

    node: int
    heading_deg: float | None
    match: float | None
    activity: float
    virtual: bool


@dataclass(frozen=True)
class Account:
    """A Table 5.7: why the tracker answered as it did.

    Attributes:
        kind: ``normal``, ``virtual``, ``supposed`` or ``none``, as ``estimators.activity.TrackerStep`` has it.
        origins, destinations: before the step, and of it.
        winner: index into ``destinations``; None where there is none.
        delta_l: of each destination from each origin, (3.14).
        delta_phi_deg: the same of headings, (3.15); None where one is unknown.
    """

    kind: str
    origins: list[Line]
    destinations: list[Line]
    winner: int | None
    delta_l: list[list[float]]
    delta_phi_deg: list[list[float | None]]


@dataclass(frozen=True)
class Answer:
    """What an estimator answered at one frame, and its belief: cells as x, y of their centre of mass, and share."""

    kind: str
    x: float
    y: float
    heading_deg: float
    node: int | None
    probability: float
    status: str
    right: bool
    belief: list[Cell]
    account: Account | None


def as_json(value: Any) -> str:
    """A dataclass of this file, or a list of them, as a line of JSON."""
    return json.dumps(value, default=vars, separators=(",", ":")) + "\n"
