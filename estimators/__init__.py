"""Estimators: evidence + motion -> belief. numpy and scipy only; each usable alone."""

from __future__ import annotations

from estimators.activity import ActivityTracker
from estimators.auxiliary import AuxiliaryParticleFilter
from estimators.baselines import BestMatch, DeadReckoning
from estimators.kalman import Kalman, MultiGaussian
from estimators.markov import MarkovGrid
from estimators.offset_tracker import OffsetTracker
from estimators.particle import ParticleFilter
from estimators.sequence import SequenceMatching
from estimators.voting import Voting

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
