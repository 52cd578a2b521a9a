"""Looks and answers of the replay in few bytes: lists in place of objects, whole numbers in place of fractions.

Lengths are centimetres, angles degrees, shares thousandths. ``replay.js`` and its neighbours read by position what is
listed here; the fields are those of ``benchmarks.replay``.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from benchmarks.report.replay_files import whole

KINDS = ("update", "blind", "unreadable", "gated")
STATES = ("LOCALIZED", "AMBIGUOUS", "LOST")
VERDICTS = ("right", "adjacent", "wrong")
"""On the named node, as docs/metrics.md has them."""
ACCOUNTS = ("normal", "virtual", "supposed", "none")
MOST_CELLS = 24
"""Of a belief, the largest ones."""

Found = Mapping[str, Any]
Compact = list[Any]


def looks_of(found: Sequence[Found]) -> Compact:
    """What a sensor saw: frame, hypotheses, slots, problem of each look."""
    return [
        [
            int(look["frame"]),
            [_hypothesis(one) for one in look["hypotheses"]],
            [_slots(one) for one in look["slots"]],
            str(look["problem"]),
        ]
        for look in found
    ]


def answers_of(found: Sequence[Found], near: Sequence[Collection[int]]) -> Compact:
    """What an estimator answered: a list for each frame.

    Kind, x, y, heading, node, probability, status, verdict, belief (x, y, share, x, y, share, ...), account. Where the
    gate stayed closed there is no verdict (-1), and belief and account are those of the frame before and left out.

    Args:
        found: the answers.
        near: at each frame, the nodes that are adjacent if they are not right.
    """
    return [_answer(one, nodes) for one, nodes in zip(found, near, strict=False)]


def _hypothesis(one: Found) -> Compact:
    """Node, match, log-likelihood in hundredths, x, y, heading."""
    return [
        int(one["node"]),
        whole(one["match"], 1000),
        whole(one["log_likelihood"], 100),
        whole(one["x"], 100),
        whole(one["y"], 100),
        _angle(one["heading_deg"]),
    ]


def _slots(one: Found) -> Compact:
    """Node, match, width in tenths of thousandths, left edges likewise, values, whether each counts."""
    return [
        int(one["node"]),
        whole(one["match"], 1000),
        whole(one["width"], 10000),
        [whole(left, 10000) for left in one["left"]],
        [whole(value, 1000) for value in one["value"]],
        [int(bool(counted)) for counted in one["counted"]],
    ]


def _answer(one: Found, near: Collection[int]) -> Compact:
    kind = KINDS.index(one["kind"])
    gated = KINDS[kind] == "gated"
    verdict = "right" if one["right"] else "adjacent" if one["node"] in near else "wrong"
    return [
        kind,
        whole(one["x"], 100),
        whole(one["y"], 100),
        whole(one["heading_deg"]),
        -1 if one["node"] is None else int(one["node"]),
        whole(one["probability"], 1000),
        STATES.index(one["status"]),
        -1 if gated else VERDICTS.index(verdict),
        [] if gated else _belief(one["belief"]),
        0 if gated or one["account"] is None else _account(one["account"]),
    ]


def _belief(cells: Sequence[Sequence[float]]) -> list[int]:
    return [
        number for x, y, share in cells[:MOST_CELLS] for number in (whole(x, 100), whole(y, 100), whole(share, 1000))
    ]


def _account(one: Found) -> Compact:
    """Kind, origins, destinations, winner, and rows of deviations of each destination from each origin."""
    return [
        ACCOUNTS.index(one["kind"]),
        [_line(line) for line in one["origins"]],
        [_line(line) for line in one["destinations"]],
        -1 if one["winner"] is None else int(one["winner"]),
        [[whole(value, 100) for value in row] for row in one["delta_l"]],
        [[_angle(value) for value in row] for row in one["delta_phi_deg"]],
    ]


def _line(one: Found) -> Compact:
    """Node, heading, match, activity, whether it is a virtual one."""
    match = one["match"]
    return [
        int(one["node"]),
        _angle(one["heading_deg"]),
        None if match is None else whole(match, 1000),
        whole(one["activity"], 1000),
        int(bool(one["virtual"])),
    ]


def _angle(degrees: float | None) -> int | None:
    return None if degrees is None else whole(degrees)
