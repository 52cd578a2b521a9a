"""The thesis's conditions in the laboratory: fresh panoramas, panoramas two days old, people about (5.2.3, 5.2.4)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from benchmarks.experiments.methods import Method
from benchmarks.experiments.tracking import Fitted, Tracked, tracked_frames
from benchmarks.worlds.drive import Route
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import Simulation

CONDITIONS: Mapping[str, WorldSettings] = {
    "fresh": WorldSettings(),
    "old": WorldSettings(age=1.0),
    "people": WorldSettings(people=0.35),
}
"""90 of the 253 updates of 5.2.4 had someone in view: 35 %."""


def drives(seed: int, laps: float, route: Route | None = None) -> dict[str, Simulation]:
    """A drive of so many rounds under each condition; of one seed, the map and the way are the same in all."""
    route, topo_map = route or Route(), LabWorld().topo_map(seed)
    worlds = {name: LabWorld(replace(settings, laps=laps, route=route)) for name, settings in CONDITIONS.items()}
    return {name: Simulation(topo_map, *world.film(seed)) for name, world in worlds.items()}


def tracked_drives(driven: Mapping[str, Simulation], methods: Mapping[str, Method]) -> dict[str, dict[str, Tracked]]:
    """What each method makes of drives with one map, by column of the table and name of the drive."""
    topo_map, result = next(iter(driven.values())).topo_map, {}
    for column, method in methods.items():
        fitted = Fitted(method, topo_map)
        result[column] = {
            name: tracked_frames(topo_map, drive.frames, drive.truth, method, fitted) for name, drive in driven.items()
        }
    return result
