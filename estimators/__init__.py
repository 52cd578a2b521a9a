"""Estimators: evidence + motion -> belief. numpy and scipy only; each usable alone."""

from estimators.activity import ActivityTracker
from estimators.baselines import BestMatch, DeadReckoning
from estimators.markov import MarkovGrid
from estimators.particle import ParticleFilter

__all__ = ["ActivityTracker", "BestMatch", "DeadReckoning", "MarkovGrid", "ParticleFilter"]
