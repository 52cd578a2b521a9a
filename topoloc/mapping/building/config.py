"""What can be chosen where a map is built from a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

Poses = Literal["auto", "truth", "odometry", "line"]
"""Where the poses of a recording's frames come from."""


@dataclass(frozen=True)
class BuildConfig:
    """How a map is built from a recording.

    Attributes:
        spacing_m: distance between nodes along the path, metres; a place that is passed again gets no other one.
        nodes: ``all``, or ``panoramas`` for those with a panorama only, as ima needs them.
        panoramas: how those of a turn are made: ``headings`` pastes frames where their poses say, ``circle`` finds
            their headings by what they show; ``auto``: headings of the ground truth, circle with odometry.
        view_spacing_m: a frame becomes a training view where it is so far from all others, metres,
        view_turn_deg: or turned so far from all that are nearer, degrees.
        view_size: columns and rows that pictures are scaled down to; none: as they are.
        poses: ``truth``, ``odometry``, or ``line``: straight on at ``speed_m_s``; ``auto``: the first there is of truth
            and odometry.
        speed_m_s: of the line, metres a second.
        hfov_deg: horizontal field of view, where ``camera.toml`` does not tell it, degrees.
    """

    spacing_m: float = 1.0
    nodes: Literal["all", "panoramas"] = "all"
    panoramas: Literal["auto", "headings", "circle"] = "auto"
    view_spacing_m: float = 0.3
    view_turn_deg: float = 15.0
    view_size: tuple[int, int] | None = None
    poses: Poses = "auto"
    speed_m_s: float | None = None
    hfov_deg: float | None = None

    def __post_init__(self) -> None:
        for name in ("spacing_m", "view_spacing_m", "view_turn_deg", "speed_m_s"):
            value = getattr(self, name)
            if value is not None and not 0.0 < value < np.inf:
                raise ValueError(f"{name} is {value}; it must be above 0")
        if self.hfov_deg is not None and not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {self.hfov_deg}; it must lie between 0 and 180")
        if self.view_size is not None and min(self.view_size) < 1:
            raise ValueError(
                f"view_size is {self.view_size[0]}x{self.view_size[1]}; columns and rows must be at least 1"
            )
        if (self.poses == "line") != (self.speed_m_s is not None):
            raise ValueError("poses 'line' and a speed belong together: give both, as --poses line --speed-m-s 0.5")
