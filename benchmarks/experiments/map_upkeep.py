"""5.2.3, 6.2: panoramas two days old, refreshed by the robot itself or left as they are (the upkeep is ours)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks.experiments.bars import draw_bars
from benchmarks.experiments.experiment import Experiment, Measured, Quantity
from benchmarks.experiments.methods import METHODS, Method
from benchmarks.experiments.picture import OURS, THESIS
from benchmarks.experiments.tracking import right_nodes
from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.people import crowd
from benchmarks.worlds.renderer import Faces
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import Simulation
from sensors.upkeep import Change, PanoramaUpkeep
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.localizer import Localizer
from topoloc.metrics import Bools

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LAPS = 10.0
WITHOUT, WITH = "without upkeep", "with upkeep"
CONDITIONS: Mapping[str, WorldSettings] = {
    "old": WorldSettings(age=1.0),
    "people": WorldSettings(age=1.0, people=0.35),
}
HALVES = {"first": "laps 1 to 5", "last": "laps 6 to 10"}
HALF_SLOT = 1.0 / 16.0
"""Half of one of IMA's eight slots, as a share of a frame's width."""
LEAST_AHEAD_M = 0.05
"""What lies nearer ahead of the camera than this is not projected [m]."""


def measure(seed: int) -> Measured:
    """Ten rounds with a map two days old: the usual way, and the same with people about."""
    return measured(seed, LAPS, CONDITIONS)


def measured(seed: int, laps: float, conditions: Mapping[str, WorldSettings]) -> dict[str, dict[str, Any]]:
    """The same for drives of so many rounds under other conditions."""
    result: dict[str, dict[str, Any]] = {WITHOUT: {}, WITH: {}}
    for name, settings in conditions.items():
        world = LabWorld(replace(settings, laps=laps))
        drive = world.simulate(seed)
        for column, method in METHODS.items():
            result[WITHOUT] |= _named(driven(drive, method, upkept=False)[0], name, column)
            counts, changes = driven(drive, method, upkept=True)
            pasted = [change for change in changes if not change.restored]
            counts["pasted"] = float(sum(len(change.slots) for change in pasted))
            counts["restored"] = float(len(changes) - len(pasted))
            counts["somebody"] = somebody_pasted(world, seed, drive, pasted)
            result[WITH] |= _named(counts, name, column)
    return result


def _named(counts: Mapping[str, float], condition: str, column: str) -> dict[str, float]:
    return {f"{key}, {condition}, {column}": value for key, value in counts.items()}


def driven(drive: Simulation, method: Method, upkept: bool) -> tuple[dict[str, float], list[Change]]:
    """What a method makes of either half of a drive, and what was changed on the map."""
    sensor, tracker = method.make()
    upkeep = PanoramaUpkeep(drive.topo_map, sensor) if upkept else None
    localizer = Localizer(drive.topo_map, sensor, tracker, upkeep=upkeep)
    right, rows = right_nodes(drive.topo_map, drive.truth), []
    for index, frame in enumerate(drive.frames):
        localizer.step(frame)
        if localizer.last is None or localizer.last.evidence is None:
            continue
        assert tracker.last is not None  # the gate was open
        step, match, off = tracker.last, np.nan, np.nan
        if step.winner is not None and step.kind == "normal":
            match = float(step.destinations.match[step.winner])
            off = abs(float(wrap(step.destinations.headings[step.winner] - drive.truth[index, 2])))
        named = step.node is not None and bool(right[index, step.node])
        rows.append((2 * index >= len(drive.frames), match, step.winner is None, not named, np.rad2deg(off)))
    table = np.array(rows, dtype=float)
    counts = {}
    for half, later in zip(HALVES, (0.0, 1.0), strict=True):
        of_half = table[table[:, 0] == later, 1:]
        for number, key in enumerate(("match", "none", "errors", "heading")):
            known = of_half[np.isfinite(of_half[:, number]), number]
            counts[f"{key} {half}"] = float(known.mean()) if len(known) else float("nan")
    return counts, [] if upkeep is None else upkeep.log


def somebody_pasted(world: LabWorld, seed: int, drive: Simulation, pasted: Sequence[Change]) -> float:
    """Share of the pasted slots that somebody stood in; NaN where nothing was pasted, or nobody is about."""
    if not pasted or world.config.people == 0.0:
        return float("nan")
    cameras = compose(drive.truth, np.stack([frame.camera for frame in drive.frames]))
    scene, chance = world.scene(seed, world.config.now()), generator(seed, Stream.PEOPLE)
    stand = crowd(world.config.people, cameras, scene, world.view_rad / 2.0, seed, chance)
    index = {frame.timestamp: number for number, frame in enumerate(drive.frames)}
    shown = []
    for change in pasted:
        at = index[change.timestamp]
        shown.append(covered_by(stand[at], cameras[at], change.middles, world.view_rad))
    return float(np.concatenate(shown).mean())


def covered_by(people: Sequence[Faces], camera: Floats, middles: Floats, view_rad: float) -> Bools:
    """Which slots (S,) of a frame, by the place of their middles on it, somebody stands in.

    Args:
        people: who stands before the camera.
        camera: (3,) its pose [m, m, rad].
        middles: (S,) shares of the frame's width, from the left.
        view_rad: how wide it sees [rad].
    """
    covered = np.zeros(len(middles), dtype=bool)
    for person in people:
        ends = np.concatenate([person.ends.reshape(-1, 2), np.zeros((2 * len(person.ends), 1))], axis=1)
        ahead, left = between(camera, ends)[:, :2].T
        seen = ahead > LEAST_AHEAD_M
        if seen.any():
            place = 0.5 - left[seen] / ahead[seen] / (2.0 * np.tan(view_rad / 2.0))
            covered |= (middles + HALF_SLOT > place.min()) & (middles - HALF_SLOT < place.max())
    return covered


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Matches and errors of the last five rounds, with and without upkeep."""
    upper, lower = figure.subplots(2, 1, sharex=True)
    for axes, key, label in ((upper, "match last", "mean match"), (lower, "errors last", "errors, share of updates")):
        keys = {f"{name}\n{column}": f"{key}, {name}, {column}" for name in CONDITIONS for column in METHODS}
        draw_bars(axes, measured, keys, {WITHOUT: THESIS, WITH: OURS})
        axes.set_ylabel(label)
    upper.legend(frameon=False)


def _rows(condition: str, column: str) -> list[Quantity]:
    where, published = f"{condition}, {column}", condition == "old" and column == next(iter(METHODS))
    rows = []
    for half, laps in HALVES.items():
        text = f"{where}, {laps}"
        rows += [
            Quantity(f"match {half}, {where}", f"mean match of normal destinations, {text}",
                     "0.6448; fresh 0.73275" if published else "-", "5.2.3" if published else "ours", 3),
            Quantity(f"none {half}, {where}", f"updates without destination, {text}",
                     "24 %" if published else "-", "Table 5.3" if published else "ours", 3, percent=True),
            Quantity(f"errors {half}, {where}", f"errors, share of updates, {text}",
                     "4.7 %" if published else "-", "Table 5.4" if published else "ours", 3, percent=True),
            Quantity(f"heading {half}, {where}", f"mean heading error of the same, degrees, {text}", "-", "ours"),
        ]  # fmt: skip
    rows += [
        Quantity(f"pasted, {where}", f"slots pasted, {where}", "-", "ours", 0),
        Quantity(f"restored, {where}", f"panoramas that came back, {where}", "-", "ours", 1),
    ]
    if CONDITIONS[condition].people:
        rows.append(
            Quantity(f"somebody, {where}", f"slots pasted that somebody stood in, {where}", "-", "ours", percent=True)
        )
    return rows


EXPERIMENT = Experiment(
    name="map-upkeep",
    title="A map that the robot keeps up to date",
    source="5.2.3, 6.2",
    about=(
        "The thesis expects much of a robot that keeps its panoramas up to date, and did not try it. Ten rounds of the "
        "laboratory with a map two days old: along the tour, and the same with somebody in view in 35 % of the frames. "
        "With upkeep (ours), slots of a panorama are replaced while the robot drives, from frames that the "
        "localizer is sure of, once two visits have shown the same. A node is an error if it is more than 0.25 m "
        "farther from the robot than the nearest one."
    ),
    measure=measure,
    quantities=tuple(row for condition in CONDITIONS for column in METHODS for row in _rows(condition, column)),
    draw=draw,
)
