"""Estimators: evidence + motion -> belief. numpy and scipy only, filterpy for Kalman; each usable alone."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from estimators.activity import ActivityTracker
from estimators.auxiliary import AuxiliaryParticleFilter
from estimators.baselines import BestMatch, DeadReckoning
from estimators.markov import MarkovGrid
from estimators.offset_tracker import OffsetTracker
from estimators.particle import ParticleFilter
from estimators.sequence import SequenceMatching
from estimators.voting import Voting

if TYPE_CHECKING:
    from estimators.kalman import Kalman, MultiGaussian

__all__ = [
    "ActivityTracker",
    "AuxiliaryParticleFilter",
    "BestMatch",
    "DeadReckoning",
    "Kalman",
    "MarkovGrid",
    "MultiGaussian",
    "OffsetTracker",
    "ParticleFilter",
    "SequenceMatching",
    "Voting",
]


def __getattr__(name: str) -> Any:
    """The Kalman estimators, whose filterpy loads only when they are asked for."""
    if name in ("Kalman", "MultiGaussian"):
        from estimators import kalman

        return getattr(kalman, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
