"""Drives made by hand, update by update."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from benchmarks.experiments.tracking import Tracked
from benchmarks.worlds.lab import LabWorld
from estimators.activity import Hypotheses, TrackerStep
from topoloc.types import Evidence

Destination = tuple[int, float, bool]
"""Node, match, virtual."""


def step_of(kind: str, said: int, destinations: Sequence[Destination]) -> TrackerStep:
    nodes, match, virtual = (np.array(part) for part in zip(*destinations, strict=True)) if destinations else ([],) * 3
    none = np.zeros((len(destinations), 0))
    empty = Hypotheses(np.zeros(0, int), np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0, bool))
    rows = Hypotheses(
        np.array(nodes, dtype=int),
        np.zeros(len(destinations)),
        np.array(match, dtype=float),
        np.full(len(destinations), 0.5),
        np.array(virtual, dtype=bool),
    )
    return TrackerStep(kind, said, empty, rows, 0 if destinations else None, none, none)


@pytest.fixture
def by_hand() -> Callable[..., Tracked]:
    """(kind, node said, true place by its index, destinations) an update -> the drive in the laboratory."""

    def made(*updates: tuple[str, int, int, Sequence[Destination]]) -> Tracked:
        kinds, said, at, destinations = zip(*updates, strict=True)
        count, positions = len(updates), LabWorld().positions
        winners = [given[0][1] if given else np.nan for given in destinations]
        truth = np.column_stack([positions[list(at)], np.zeros(count)])
        return Tracked(
            kind=np.array(kinds),
            said=np.array(said),
            nearest=np.array(at),
            best=np.array(at),
            right=np.array(said) == np.array(at),
            match=np.array(winners),
            activity=np.where(np.isnan(winners), np.nan, 0.5),
            heading_error=np.zeros(count),
            heading=np.zeros(count),
            poses=truth,
            truth=truth,
            frames=np.arange(count),
            steps=tuple(step_of(kind, node, given) for kind, node, _, given in updates),
            evidence=tuple(Evidence.blind() for _ in updates),
        )

    return made
