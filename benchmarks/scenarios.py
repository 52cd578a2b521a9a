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
    from benchmarks.worlds import WorldSettings


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
    """

    name: str
    description: str
    make: Callable[[int], Case]
    settings: Mapping[str, Any] = field(default_factory=dict)


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


def _laboratory(name: str, description: str, settings: WorldSettings) -> Scenario:
    return Scenario(name, description, partial(_simulated, settings), asdict(settings))


def _simulated(settings: WorldSettings, seed: int) -> Case:
    from benchmarks.worlds import LabWorld

    drive = LabWorld(settings).simulate(seed)
    kidnapped_at = (settings.kidnap_at,) if settings.kidnap_at >= 0 else ()
    return Case(drive.topo_map, drive.frames, drive.truth, kidnapped_at)
