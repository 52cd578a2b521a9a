"""Scenarios: what a robot lives through in a benchmark run, made anew from a seed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Any

from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Frame

if TYPE_CHECKING:
    from benchmarks.worlds import World, WorldSettings


@dataclass(frozen=True)
class Case:
    """One drive through one world.

    Attributes:
        topo_map: what the robot knows beforehand.
        frames: what it sees, in the order of time.
        truth: (N, 3) its true pose at each frame.
        kidnapped_at: indices of the first frames after it was carried elsewhere.
    """

    topo_map: TopoMap
    frames: Sequence[Frame]
    truth: Floats
    kidnapped_at: tuple[int, ...] = ()

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of image that its frames hold."""
        return frozenset[str]().union(*(frame.images for frame in self.frames))


@dataclass(frozen=True)
class Scenario:
    """A kind of drive that sensors and estimators are compared on.

    Attributes:
        name: as ``results.csv`` has it.
        description: one sentence for people.
        make: the drive of a seed; the same seed makes the same drive.
        settings: that it was made with, for ``config.toml``.
        kinds: of image that its frames hold.
    """

    name: str
    description: str
    make: Callable[[int], Case]
    settings: Mapping[str, Any] = field(default_factory=dict)
    kinds: frozenset[str] = frozenset({"rgb"})


def default_scenarios(updates: int = 60) -> tuple[Scenario, ...]:
    """The benchmark's own scenarios, all in the simulated laboratory, ``updates`` frames each."""
    from benchmarks.worlds import WorldSettings  # here: the renderer need not load for --help

    fresh = WorldSettings(updates=updates)
    return (
        _laboratory("lab-fresh", "The laboratory as it was when its map was made.", fresh),
        _laboratory("lab-people", "People stand before the camera in 35 % of the frames.", replace(fresh, people=0.35)),
        _laboratory(
            "lab-kidnapped", "Halfway the robot is carried to another place.", replace(fresh, kidnap_at=updates // 2)
        ),
    )


def further_scenarios(updates: int = 60) -> tuple[Scenario, ...]:
    """Scenarios for sensors that the laboratory cannot feed, ``updates`` frames each; run where they are named."""
    from benchmarks.worlds.image_grid import ImageGridSettings, ImageGridWorld
    from benchmarks.worlds.office import OfficeSettings, OfficeWorld

    stereo = OfficeSettings(updates=updates, stereo_baseline_m=0.12)
    circles = ImageGridSettings(updates=updates, grid="5x10")
    return (
        Scenario(
            "office-stereo",
            "An office of training views, seen by a stereo camera whose head turns.",
            partial(_simulated, OfficeWorld, stereo),
            asdict(stereo),
            frozenset({"rgb", "right"}),
        ),
        Scenario(
            "hall-omni",
            "A hall of 50 panoramas, a metre apart, seen by an omnidirectional camera.",
            partial(_simulated, ImageGridWorld, circles),
            asdict(circles),
            frozenset({"omni"}),
        ),
    )


def _laboratory(name: str, description: str, settings: WorldSettings) -> Scenario:
    from benchmarks.worlds import LabWorld

    return Scenario(name, description, partial(_simulated, LabWorld, settings), asdict(settings))


def _simulated(world: type[World], settings: WorldSettings, seed: int) -> Case:
    drive = world(settings).simulate(seed)
    kidnapped_at = (settings.kidnap_at,) if settings.kidnap_at >= 0 else ()
    return Case(drive.topo_map, drive.frames, drive.truth, kidnapped_at)
