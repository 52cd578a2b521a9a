"""The benchmark's own scenarios: drives through simulated worlds, made anew from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

from benchmarks.scenarios.case import Case, Scenario
from topoloc.errors import UserError
from topoloc.plugins import SCENARIOS, WORLDS, load, make
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from benchmarks.worlds import World, WorldSettings


@dataclass(frozen=True)
class SimulatedScenario:
    """A scenario of the benchmark before it is made.

    Attributes:
        description: one sentence for people.
        settings: of its world, beside the number of frames.
        world: name of the world.
        kinds: of image that its frames hold.
        kidnapped: halfway the robot is carried to another place.
        stretch: so many times as many frames as asked for, where the way is longer.
    """

    description: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    world: str = "lab"
    kinds: frozenset[str] = frozenset({"rgb"})
    kidnapped: bool = False
    stretch: int = 1


LAB_FRESH = SimulatedScenario("The laboratory as it was when its map was made.")
LAB_OLD = SimulatedScenario(
    "Two days later: the sun elsewhere, chairs and small things moved, other people.", {"age": 1.0}
)
LAB_PEOPLE = SimulatedScenario("People stand before the camera in 35 % of the frames.", {"people": 0.35})
LAB_LIGHTS = SimulatedScenario(
    "The map was made under tubes; now bulbs and daylight give half of the light each.",
    {"bulbs": 0.5, "daylight": 0.5},  # the two lights of the second seed (6.2, Table 1), both at once
)
LAB_KIDNAPPED = SimulatedScenario("Halfway the robot is carried to another place.", kidnapped=True)
TWINS = SimulatedScenario(
    "Two rooms at the ends of a corridor look alike: only history tells which is which.",
    world="twins",
    stretch=2,  # a round of 122 frames leads through both rooms
)
BUILDING = SimulatedScenario(
    "A floor of rooms on both sides of a corridor, many of them alike, driven through at random.",
    {"rooms": 10},
    world="building",
)
OFFICE_STEREO = SimulatedScenario(
    "An office of training views, seen by a stereo camera whose head turns.",
    {"stereo_baseline_m": 0.12},
    world="office",
    kinds=frozenset({"rgb", "right"}),
)
HALL_OMNI = SimulatedScenario(
    "A hall of 50 panoramas, a metre apart, seen by an omnidirectional camera.",
    {"grid": "5x10"},
    world="image_grid",
    kinds=frozenset({"omni"}),
)
SUITE = (
    "lab-fresh",
    "lab-old",
    "lab-people",
    "lab-lights",
    "lab-kidnapped",
    "twins",
    "building",
    "office-stereo",
    "hall-omni",
)
"""Names of the benchmark's own scenarios, in the order in which they are told."""
AS_MAPPED = {
    "updates": 1,
    "age": 0.0,
    "people": 0.0,
    "bulbs": 0.0,
    "daylight": 0.0,
    "covered": (),
    "covered_share": 0.0,
    "kidnap_at": -1,
    "turned_at": -1,
}
"""What happens on a drive and leaves the map, which was made before, as it is."""


def simulated(name: str, updates: int, settings: Mapping[str, Any]) -> Scenario:
    """A scenario of the group ``topoloc.scenarios``.

    Args:
        name: of the scenario.
        updates: frames of a drive.
        settings: of its world, in place of the scenario's own.

    Raises:
        UserError: a setting that the world does not have, or refuses.
    """
    kind: SimulatedScenario = load(SCENARIOS, name)
    if "updates" in settings:
        raise UserError(f"settings of {name}: the frames of all drives are set by --updates; take updates out here")
    frames = kind.stretch * updates
    carried = {"kidnap_at": frames // 2} if kind.kidnapped else {}
    world: World = make(WORLDS, kind.world, {**kind.settings, "updates": frames, **carried, **settings})
    return Scenario(name, kind.description, partial(_driven, world), asdict(world.config), kind.kinds, kind.world)


def _driven(world: World, seed: int) -> Case:
    frames, truth = world.film(seed)
    kidnap_at = world.config.kidnap_at
    topo_map = map_of(type(world), replace(world.config, **AS_MAPPED), seed)
    return Case(topo_map, frames, truth, (kidnap_at,) if kidnap_at > 0 else ())


@lru_cache(maxsize=1)
def map_of(kind: type[World], config: WorldSettings, seed: int) -> TopoMap:
    """The map of a world: one and the same for all drives that differ in ``AS_MAPPED`` only."""
    return kind(config).topo_map(seed)
