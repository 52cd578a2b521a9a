"""Simulated worlds: an own renderer, and the buildings of the seeds and two of our own drawn with it.

A world's class makes a map, frames and the truth: ``LabWorld(WorldSettings(people=0.35)).simulate(seed)``. Pictures are
simulated; nothing here was recorded.
"""

from __future__ import annotations

from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.lab import LabWorld, lab_scene
from benchmarks.worlds.lab_corridor import LabCorridorWorld
from benchmarks.worlds.moment import Moment
from benchmarks.worlds.renderer import Scene, Shake, render_cylinder, render_depth, render_frame
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.snapshots import Scan, panorama_of
from benchmarks.worlds.world import Simulation, World

__all__ = [
    "LabCorridorWorld",
    "LabWorld",
    "Moment",
    "Scan",
    "Scene",
    "SensorEffects",
    "Shake",
    "Simulation",
    "World",
    "WorldSettings",
    "lab_scene",
    "panorama_of",
    "render_cylinder",
    "render_depth",
    "render_frame",
    "sense",
]
