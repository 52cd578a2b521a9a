"""Which field of view frames fit best, where they see less than the map says: what ``topoloc check`` tells."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from benchmarks.own_data.own_table import Figures, OwnTable, how_many, mean
from benchmarks.worlds.lab import LabWorld
from benchmarks.worlds.settings import WorldSettings
from benchmarks.worlds.world import World
from topoloc.checks.field_of_view import LEAST_FRAMES, OFF_SHARE, Look, fitted_field, placed_on
from topoloc.going_through import in_silence
from topoloc.topo_map import Camera
from topoloc.types import Image

SHARES = (1.0, 0.9, 0.8, 0.7, 0.5)
"""Of a picture's columns and rows that are left, in its middle, and enlarged again."""


def measure(seed: int, kind: type[World] = LabWorld) -> Iterator[Figures]:
    """One share after the other, of the frames of one lap."""
    made = kind(WorldSettings(laps=1.0)).simulate(seed)
    told = made.topo_map.camera.hfov_deg
    looks = [Look(frame.images["rgb"], pose) for frame, pose in zip(made.frames, made.truth, strict=True)]
    for share in SHARES:
        seen = [Look(enlarged(one.picture, share), one.pose) for one in looks]
        placed = placed_on(made.topo_map, seen, in_silence)
        best = fitted_field(placed) if placed else told
        yield {"fits best": best, "told of": float(len(placed) >= LEAST_FRAMES and abs(best / told - 1.0) > OFF_SHARE)}


def enlarged(picture: Image, share: float) -> Image:
    """The middle of a picture in its size, as a camera of a smaller field of view takes it."""
    import cv2

    rows, columns = picture.shape[:2]
    down, across = (round(size * (1.0 - share) / 2.0) for size in (rows, columns))
    middle = np.ascontiguousarray(picture[down : rows - down, across : columns - across])
    return np.asarray(cv2.resize(middle, (columns, rows)), dtype=np.uint8)


def seen_deg(share: float, camera: Camera) -> float:
    """Field of view of such a picture [degrees]."""
    return float(2.0 * np.rad2deg(np.arctan(share * np.tan(np.deg2rad(camera.hfov_deg) / 2.0))))


CHECK = OwnTable(
    name="check",
    page="check.md",
    about=(
        f"Simulated laboratory, frames of one lap against a map that says {LabWorld.camera.hfov_deg:g} degrees; the "
        "middle of the frames was enlarged so that they see less; on how many seeds the check says so."
    ),
    seeds=(1000, 1001, 1002),
    heads=("frames see",),
    rows=tuple((f"{seen_deg(share, LabWorld.camera):.1f}°",) for share in SHARES),
    columns={"fits best": mean(1, "°"), "told of": how_many},
    measure=measure,
)
