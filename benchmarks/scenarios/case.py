"""What a scenario is, and one drive of it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Frame


@dataclass(frozen=True)
class Case:
    """One drive.

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
        site: scenarios of one site are likely to have one map where their seeds are the same, and are run together;
            empty: it stands alone.
        recorded: there is one drive only, and a seed is the estimator's alone.
    """

    name: str
    description: str
    make: Callable[[int], Case]
    settings: Mapping[str, Any] = field(default_factory=dict)
    kinds: frozenset[str] = frozenset({"rgb"})
    site: str = ""
    recorded: bool = False
