"""Whether choosing where to look pays: standing robots in simulated worlds, as in the second seed, 6.1.

``python -m pytest -m slow -s tests/benchmarks/test_active.py`` prints the table of docs/active.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
import pytest

from benchmarks.experiments.selections import ByLot, InTurn
from benchmarks.looks import SharedLooks
from benchmarks.worlds import LabWorld, World, WorldSettings
from benchmarks.worlds.office import CLEAR_M, OfficeSettings, OfficeWorld, clearance
from benchmarks.worlds.standing_robot import StandingRobot
from benchmarks.worlds.twins import TwinsSettings, TwinsWorld
from estimators.action import LeastEntropy
from topoloc.active import (
    ORIENTATIONS,
    Action,
    ActionSelection,
    ActiveLocalizer,
    orientations,
    pans,
    turns,
    view_evidence,
)
from topoloc.geometry import Floats
from topoloc.localizer import Localizer
from topoloc.plugins import make_estimator, make_sensor
from topoloc.topo_map import TopoMap

pytestmark = pytest.mark.slow
SEEDS, STANDS, LOOKS = range(4), 10, 5
OFF_THE_MAP_M, NEAR_M = 0.15, 0.5
"""A robot stands at least this far from every point of the map, and at most so far from a node or an edge."""


@dataclass(frozen=True)
class Trial:
    """What is tried: a world, how the camera is turned in it, and a sensor.

    Attributes:
        world: made from its settings.
        sensor: by name.
        actions: of the robot, for a camera at a pose on it.
        where: which positions (N, 2) a robot may stand at besides; None: any.
    """

    world: Callable[[], World]
    sensor: str
    actions: Callable[..., list[Action]]
    where: Callable[[Floats], np.ndarray] | None = None


def in_the_clear(positions: Floats) -> np.ndarray:
    return clearance(OfficeWorld.plan, positions) >= CLEAR_M - 0.05


def in_the_rooms(positions: Floats) -> np.ndarray:
    return positions[:, 1] > 0.3


TRIALS = {
    "office": Trial(lambda: OfficeWorld(OfficeSettings()), "histogram", pans, in_the_clear),
    "office, changed": Trial(lambda: OfficeWorld(OfficeSettings(age=1.0)), "histogram", pans, in_the_clear),
    "lab": Trial(lambda: LabWorld(WorldSettings()), "ima", turns),
    "lab, changed": Trial(lambda: LabWorld(WorldSettings(age=1.0)), "ima", turns),
    "lab, histogram": Trial(lambda: LabWorld(WorldSettings()), "histogram", turns),
    "twin rooms": Trial(lambda: TwinsWorld(TwinsSettings()), "ima", turns, in_the_rooms),
}
BY_LOT, BY_ENTROPY = "by lot", "least entropy"
STRIDES = {"16 degrees on": 1, "82 degrees on": 5, BY_LOT: 1, BY_ENTROPY: 1}
"""Ways to choose, and how many orientations on the next action is that is listed: 5 makes looks that hardly overlap,
and is prime to 22, so that all are looked at in turn."""


def stands(trial: Trial, topo_map: TopoMap, seed: int) -> Floats:
    """True poses (STANDS, 3): near the map's nodes and edges, on none of its points, with any heading."""
    rng = np.random.default_rng([seed, 2])
    low, high = topo_map.positions.min(axis=0) - NEAR_M, topo_map.positions.max(axis=0) + NEAR_M
    places = rng.uniform(low, high, (100 * STANDS, 2))
    free = topo_map.is_free(places, NEAR_M) & (topo_map.distance_to_nearest(places) >= OFF_THE_MAP_M)
    if trial.where is not None:
        free &= trial.where(places)
    return np.column_stack([places[free][:STANDS], rng.uniform(-np.pi, np.pi, STANDS)])


@cache
def looks(trial: str, estimator: str) -> dict[str, Floats]:
    """Of each way to choose, (seeds, stands, looks, 3): error [m], nearest node right, LOCALIZED."""
    found: dict[str, list[list[Floats]]] = {way: [] for way in STRIDES}
    one, world = TRIALS[trial], TRIALS[trial].world()
    for seed in SEEDS:
        topo_map, sensor = world.topo_map(seed), make_sensor(one.sensor)
        shared = SharedLooks(sensor, topo_map)
        entropy = LeastEntropy(view_evidence(topo_map, sensor, world.mount))
        for way, stride in STRIDES.items():
            actions = one.actions(orientations()[np.arange(ORIENTATIONS) * stride % ORIENTATIONS], world.mount)
            by_lot = ByLot(np.random.default_rng([seed, 3]))
            chosen: dict[str, ActionSelection] = {BY_LOT: by_lot, BY_ENTROPY: entropy}
            selection = chosen.get(way, InTurn())
            rows = []
            for number, pose in enumerate(stands(one, topo_map, seed)):
                localizer = Localizer(topo_map, shared, make_estimator(estimator), rng=100 * seed + number)
                robot = StandingRobot(world, seed, number, pose)
                rows.append(look_around(ActiveLocalizer(localizer, selection, actions), robot))
            found[way].append(rows)
    return {way: np.array(rows) for way, rows in found.items()}


def look_around(active: ActiveLocalizer, robot: StandingRobot) -> Floats:
    """(looks, 3): error [m], nearest node right, LOCALIZED; the robot goes on looking when it is."""
    localizer, truth = active.localizer, robot.truth[None, :2]
    localized_above = localizer.rule.localized_above
    localizer.rule = replace(localizer.rule, localized_above=np.inf)
    right = localizer.topo_map.nearest_node(truth)
    rows, action = [], Action(np.zeros(3), robot.mount)
    for _ in range(LOOKS):
        estimate = active.step(robot.look(action))
        place = estimate.pose[None, :2]
        error = float(np.linalg.norm(place - truth))
        is_right = bool((localizer.topo_map.nearest_node(place) == right)[0])
        rows.append((error, is_right, estimate.probability >= localized_above))
        chosen = active.next_action()
        assert chosen is not None  # there are more orientations than looks
        action = chosen
    return np.array(rows, dtype=np.float64)


def table(trial: str, estimator: str) -> str:
    """Rows of docs/active.md."""
    lines = []
    for way, found in looks(trial, estimator).items():
        errors = " / ".join(f"{value:.2f}" for value in found[..., 0].mean(axis=(0, 1)))
        by_seed = found.mean(axis=1)  # (seeds, looks, 3)
        spread = f"{by_seed[:, 2, 0].std():.2f}"
        right = f"{by_seed[:, 3, 1].mean():.2f} ± {by_seed[:, 3, 1].std():.2f}"
        done = found[..., 2].argmax(axis=2)[..., None]  # the first look that is LOCALIZED; the first of all if none is
        ended = found[..., 2].max(axis=2) > 0.0
        looked = done[..., 0][ended].mean() + 1.0 if ended.any() else np.nan
        then = np.take_along_axis(found[..., 1], done, axis=2)[..., 0][ended].mean() if ended.any() else np.nan
        start = f"| {trial} | `{TRIALS[trial].sensor}` | `{estimator}` | {way} |"
        lines.append(f"{start} {errors} | {spread} | {right} | {looked:.1f} ({ended.mean():.0%}), {then:.2f} |")
    return "\n".join(lines)


def gain(trial: str, estimator: str, way: str, other: str, look: int, what: int) -> tuple[float, float]:
    """Mean difference over all stands after so many looks, and its standard error; pairs share stand and first look."""
    found = looks(trial, estimator)
    difference = (found[way] - found[other])[:, :, look - 1, what].reshape(-1)
    return float(difference.mean()), float(difference.std() / np.sqrt(len(difference)))


@pytest.mark.parametrize("trial", ["office", "office, changed"])
def test_the_second_look_tells_more_where_it_was_chosen(trial: str) -> None:
    """Beside small turns one after the other; large ones, that hardly overlap, do as well: docs/active.md."""
    print("\n" + table(trial, "particle"))
    error, deviation = gain(trial, "particle", BY_ENTROPY, "16 degrees on", 2, 0)
    assert error < -deviation
    error, deviation = gain(trial, "particle", BY_ENTROPY, "82 degrees on", 4, 0)
    assert error < 0.1 + deviation


@pytest.mark.parametrize("trial", sorted(set(TRIALS) - {"office", "office, changed"}))
def test_choosing_does_no_harm(trial: str) -> None:
    print("\n" + table(trial, "particle"))
    error, deviation = gain(trial, "particle", BY_ENTROPY, BY_LOT, 4, 0)
    assert error < 0.1 + 2.0 * deviation
