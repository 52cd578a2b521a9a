"""The benchmark's own scenarios: drives through simulated worlds, made anew from a seed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any

from benchmarks.scenarios.case import Case, Scenario
from topoloc.plugins import WORLDS, make
from topoloc.settings import refuse_unknown

if TYPE_CHECKING:
    from benchmarks.worlds import World


@dataclass(frozen=True)
class _Kind:
    """One of the suite's scenarios before it is made.

    Attributes:
        description: one sentence for people.
        settings: of its world, beside the number of frames.
        kidnapped: halfway the robot is carried to another place.
        world: name of the world.
        kinds: of image that its frames hold.
    """

    description: str
    settings: Mapping[str, Any] = field(default_factory=dict)
    kidnapped: bool = False
    world: str = "lab"
    kinds: frozenset[str] = frozenset({"rgb"})


EVENING = {"bulbs": 0.5, "daylight": 0.5}
"""The tubes are off: half of the light comes from bulbs, half through the windows. These are the two lights that the
second seed changes to (6.2, Table 1); there each has a drive of its own, here one drive has both."""

_SUITE = {
    "lab-fresh": _Kind("The laboratory as it was when its map was made."),
    "lab-old": _Kind("Two days later: the sun elsewhere, chairs and small things moved, other people.", {"age": 1.0}),
    "lab-people": _Kind("People stand before the camera in 35 % of the frames.", {"people": 0.35}),
    "lab-lights": _Kind("The map was made under tubes; now bulbs and daylight give half of the light each.", EVENING),
    "lab-kidnapped": _Kind("Halfway the robot is carried to another place.", kidnapped=True),
    "twins": _Kind("Two rooms at the ends of a corridor look alike: only history tells which is which.", world="twins"),
    "building": _Kind(
        "A floor of rooms on both sides of a corridor, many of them alike, driven through at random.",
        {"rooms": 10},
        world="building",
    ),
    "office-stereo": _Kind(
        "An office of training views, seen by a stereo camera whose head turns.",
        {"stereo_baseline_m": 0.12},
        world="office",
        kinds=frozenset({"rgb", "right"}),
    ),
    "hall-omni": _Kind(
        "A hall of 50 panoramas, a metre apart, seen by an omnidirectional camera.",
        {"grid": "5x10"},
        world="image_grid",
        kinds=frozenset({"omni"}),
    ),
}
SIMULATED = tuple(_SUITE)
"""Names of the benchmark's own scenarios, in the order in which they are told."""


def simulated(name: str, updates: int, settings: Mapping[str, Any]) -> Scenario:
    """One of ``SIMULATED``.

    Args:
        name: of the scenario.
        updates: frames of a drive.
        settings: of its world, in place of the scenario's own.

    Raises:
        UserError: a setting that the world does not have, or refuses.
    """
    kind = _SUITE[name]
    carried = {"kidnap_at": updates // 2} if kind.kidnapped else {}
    refuse_unknown({key: 0 for key in settings if key == "updates"}, set(), f"settings of {name}")
    world: World = make(WORLDS, kind.world, {**kind.settings, "updates": updates, **carried, **settings})
    site = "" if settings else kind.world
    return Scenario(name, kind.description, partial(_driven, world), asdict(world.config), kind.kinds, site)


def _driven(world: World, seed: int) -> Case:
    drive, kidnap_at = world.simulate(seed), world.config.kidnap_at
    return Case(drive.topo_map, drive.frames, drive.truth, (kidnap_at,) if kidnap_at > 0 else ())
