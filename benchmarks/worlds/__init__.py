"""Simulated worlds: an own renderer, and the thesis's laboratory drawn with it.

``LabSettings`` and ``simulate`` give a map, frames and the truth; ``lab_scene``, ``render_frame``, ``render_cylinder``
and ``panorama_of`` are the parts. Pictures are simulated; nothing here was recorded.
"""

from __future__ import annotations

from benchmarks.worlds.effects import SensorEffects, sense
from benchmarks.worlds.lab import NODES, lab_scene
from benchmarks.worlds.renderer import Scene, Shake, render_cylinder, render_frame
from benchmarks.worlds.simulate import LabSettings, Simulation, simulate
from benchmarks.worlds.snapshots import panorama_of

__all__ = [
    "NODES",
    "LabSettings",
    "Scene",
    "SensorEffects",
    "Shake",
    "Simulation",
    "lab_scene",
    "panorama_of",
    "render_cylinder",
    "render_frame",
    "sense",
    "simulate",
]
