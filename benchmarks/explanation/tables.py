"""An explanation as tables on the terminal; Table 5.7 of the thesis for its tracker."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Literal

import numpy as np
from rich import box
from rich.console import Console
from rich.table import Table

from benchmarks import replay
from benchmarks.explanation.explanation import SHOWN_SHARES, Explanation

MOST_LINES, MOST_ORIGINS = 10, 4
"""Of origins and destinations so many are shown, of the origins beside deviations so many, which
80 columns can hold: the most active."""
KINDS = {
    "normal": "A matched destination won.",
    "virtual": "The virtual destination won: the odometry is believed more than any match (3.2.1).",
    "supposed": "No node matches well enough: the answer is the place supposed from the odometry (3.8).",
    "none": "No node matches well enough, and nothing was matched before: no answer yet.",
}
LOOKS = {
    "blind": "The frame says nothing: covered, flat, or without contrast.",
    "unreadable": "The picture could not be used: {problem}.",
}


def print_explanation(told: Explanation, console: Console | None = None) -> None:
    """Print it: the answer, the look, IMA's slots, the tracker's Table 5.7, and the belief by node."""
    out = console or Console(markup=False, emoji=False, highlight=False)
    for part in _parts(told):
        out.print(part, soft_wrap=isinstance(part, str))


def _parts(told: Explanation) -> Iterator[str | Table]:
    """Sentences and tables, one below the other."""
    yield told.title
    yield _answer(told)
    if told.look is None:
        yield "The motion gate stayed closed: no look was taken, the answer rides on the odometry."
        yield f"The last update was frame {told.last_update}; explain that one for its reasons."
        return
    if told.answer.kind in LOOKS:
        yield LOOKS[told.answer.kind].format(problem=told.look.problem)
    else:
        yield "What the sensor saw, best matches:"
        yield _look(told, told.look)
    if told.look.slots:
        slots = told.look.slots[0]
        yield f"The frame's slots on the panorama of node {told.node_name(slots.node)}, match {slots.match:.3f}:"
        yield _slots(slots)
    if told.answer.account is not None:
        yield from _account(told, told.answer.account)
    yield f"The belief by nearest node, at most {SHOWN_SHARES}:"
    yield _belief(told)


def _account(told: Explanation, account: replay.Account) -> Iterator[str | Table]:
    """Table 5.7, the deviations behind it, and what came of it."""
    yield "Activities, as in Table 5.7 of the thesis (v: virtual, *: the winner):"
    yield _activities(told, account)
    yield from _left_out("origins", account.origins, MOST_LINES)
    yield from _left_out("destinations", account.destinations, MOST_LINES)
    if account.destinations:
        yield "Deviations of destinations from where origins lead, (3.14) and (3.15):"
        yield _deviations(told, account)
        yield from _left_out("origins", account.origins, MOST_ORIGINS)
    yield KINDS[account.kind]
    if account.winner is not None and account.destinations[account.winner].node != told.answer.node:
        yield "The answer names another node: it goes by the belief, where all that is nearest to a node adds up."


def _left_out(what: str, lines: Sequence[replay.Line], most: int) -> Iterator[str]:
    if len(lines) > most:
        yield f"Less active {what} left out: {len(lines) - most}."


def _table(*columns: str, words: int = 1) -> Table:
    """A table whose columns after the first ``words`` are numbers."""
    table = Table(box=box.SIMPLE, padding=(0, 1, 0, 0))
    for number, name in enumerate(columns):
        side: Literal["left", "right"] = "left" if number < words else "right"
        table.add_column(name, justify=side, no_wrap=True)
    return table


def _answer(told: Explanation) -> Table:
    answer = told.answer
    table = _table("", "node", "x [m]", "y [m]", "heading", "probability", "status")
    table.add_row(
        "answered",
        told.node_name(answer.node),
        f"{answer.x:.2f}",
        f"{answer.y:.2f}",
        _degrees(answer.heading_deg),
        f"{answer.probability:.2f}",
        answer.status,
    )
    x, y, heading = told.truth
    table.add_row("true", told.node_name(told.true_node), f"{x:.2f}", f"{y:.2f}", _degrees(heading))
    table.add_row("error", told.verdict, f"{told.error_m:.2f} m", "", _degrees(told.error_deg))
    return table


def _look(told: Explanation, look: replay.Look) -> Table:
    table = _table("node", "", "match", "log-likelihood", "heading", words=2)
    for one in look.hypotheses:
        numbers = (f"{one.match:.3f}", f"{one.log_likelihood:+.2f}", _degrees(one.heading_deg))
        table.add_row(told.node_name(one.node), roles(told, one.node), *numbers)
    return table


def roles(told: Explanation, node: int) -> str:
    """What a node is in an explanation: named, best match, true; all that hold."""
    best = told.look.hypotheses[0].node if told.look is not None and told.look.hypotheses else None
    found = {"named": told.answer.node, "best match": best, "true": told.true_node}
    return ", ".join(role for role, one in found.items() if one == node)


def _slots(slots: replay.Slots) -> Table:
    """Slot by slot, left to right; left edges in degrees clockwise from the panorama's first column."""
    table = _table("slot", "left edge", "value", "counts")
    for number, (left, value, counted) in enumerate(zip(slots.left, slots.value, slots.counted, strict=True), start=1):
        table.add_row(str(number), _degrees(360.0 * left), f"{value:.3f}", "yes" if counted else "no")
    return table


def _belief(told: Explanation) -> Table:
    table = _table("node", "", "share", words=2)
    for one in told.shares:
        table.add_row(told.node_name(one.node), roles(told, one.node), f"{one.share:.3f}")
    return table


def _activities(told: Explanation, account: replay.Account) -> Table:
    """Table 5.7: origins on the left, destinations on the right."""
    table = _table("origin", "heading", "activity", "destination", "heading", "match", "led here", "activity")
    for origin, index in zip_longest(_most_active(account.origins), _most_active(account.destinations)):
        before = ("", "", "") if origin is None else _origin(told, account.origins[origin])
        after = ("",) * 5 if index is None else _destination(told, account, index)
        table.add_row(*before, *after, style="bold" if index is not None and index == account.winner else "")
    return table


def _most_active(lines: Sequence[replay.Line], most: int = MOST_LINES) -> list[int]:
    """Indices of the most active lines, in their order."""
    return sorted(int(index) for index in np.argsort([-line.activity for line in lines], kind="stable")[:most])


def _origin(told: Explanation, line: replay.Line) -> tuple[str, str, str]:
    return _name(told, line), _degrees(line.heading_deg), f"{line.activity:.4f}"


def _destination(told: Explanation, account: replay.Account, index: int) -> tuple[str, str, str, str, str]:
    line = account.destinations[index]
    name = _name(told, line) + (" *" if index == account.winner else "")
    match = "" if line.match is None else f"{line.match:.4f}"
    return name, _degrees(line.heading_deg), match, f"{told.led[index]:.4f}", f"{line.activity:.4f}"


def _deviations(told: Explanation, account: replay.Account) -> Table:
    """Delta-l (3.14) and delta-phi (3.15): how far each destination is from where each origin leads."""
    origins = _most_active(account.origins, MOST_ORIGINS)
    table = _table("destination", *(f"from {_name(told, account.origins[index])}" for index in origins))
    for index in _most_active(account.destinations):
        cells = (_deviation(account.delta_l[index][one], account.delta_phi_deg[index][one]) for one in origins)
        table.add_row(_destination(told, account, index)[0], *cells)
    return table


def _deviation(metres: float, degrees: float | None) -> str:
    return f"{metres:.2f} m {_degrees(degrees)}".rstrip()


def _name(told: Explanation, line: replay.Line) -> str:
    return told.node_name(line.node) + ("v" if line.virtual else "")


def _degrees(value: float | None) -> str:
    return "" if value is None else f"{value:.1f}°"
