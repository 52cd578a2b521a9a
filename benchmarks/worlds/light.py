"""How a world is lit: tubes at the ceiling, bulbs, and daylight through the windows, at any moment."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.moment import Moment
from topoloc.geometry import Floats

TUBE_POWER = 0.35
BULB_POWER, BULB_HEIGHT_M = 1.0, 2.1
DAYLIGHT_FACTOR = 3.0
"""Windows under open curtains against those when the map was made."""
AT_ONCE = 4096
"""Points that are lit in one go."""
ON_THE_WALL_M = 0.04
"""What is no farther outside of a room is lit with it; the next room begins behind the wall [m]."""
AMBIENT, AMBIENT_BULBS, AMBIENT_DAYLIGHT = 0.42, 0.3, 0.34
PATCHES_AGED = 0.18
"""Standard deviation of the logarithm of the brightness at the corners of surfaces, once the sun has come round: it
draws patches and shadows on walls and furniture that the soft light of the lamps does not."""
SKY_AGED, SKY_BULBS = 1.25, 0.25
"""Brightness of what the windows look at: the sun has come round; the curtains are drawn."""
Tint = tuple[float, float, float]
WHITE_LIGHT: Tint = (1.0, 1.0, 1.0)
WARM: Tint = (1.12, 1.0, 0.78)
COLD: Tint = (0.97, 1.0, 1.06)
"""Red, green and blue of bulbs and of daylight against those of tubes, after the camera's white balance."""


@dataclass(frozen=True)
class LitRoom:
    """The lamps of a room; they light nothing outside of it.

    Attributes:
        bounds: x0, y0, x1, y1 [m].
        tubes: (x, y, height) of each pair of tubes [m].
        bulbs: (x, y) of each bulb [m].
        windows: (x, y, height, power, power when the sun has come round) of each window.
    """

    bounds: tuple[float, float, float, float]
    tubes: Sequence[tuple[float, float, float]]
    bulbs: Sequence[tuple[float, float]]
    windows: Sequence[tuple[float, float, float, float, float]] = field(default=())


@dataclass(frozen=True)
class Light:
    """Soft light of lamps, each within its room.

    Attributes:
        lamps: (L, 3) positions [m].
        power: (L,) brightness that a lamp adds right before it.
        bounds: (L, 4) of the room that it lights [m].
        ambient: brightness factor everywhere.
        sky: brightness factor of what the windows look at.
        patches: standard deviation of the logarithm of the brightness at the corners of faces.
        seed: of these patches.
    """

    lamps: Floats
    power: Floats
    bounds: Floats
    ambient: float = AMBIENT
    sky: float = 1.0
    patches: float = 0.0
    seed: int = 0

    def at(self, points: Floats, normals: Floats) -> Floats:
        """Brightness factor (N,) of surfaces at points (N, 3) with unit normals (N, 3)."""
        pieces = range(0, len(points), AT_ONCE)  # a floor of many rooms has many lamps: all pairs would fill memory
        lit = [self._at(points[start : start + AT_ONCE], normals[start : start + AT_ONCE]) for start in pieces]
        return np.concatenate(lit)

    def _at(self, points: Floats, normals: Floats) -> Floats:
        """See ``at``."""
        ray = self.lamps - points[:, None, :]
        squared = np.sum(ray**2, axis=2)
        facing = np.sum(ray * normals[:, None, :], axis=2) / np.sqrt(squared + 1e-6)
        soft = np.clip(0.35 + 0.65 * facing, 0.05, 1.0) / (1.0 + squared / 6.0)
        low, high = self.bounds[:, :2] - ON_THE_WALL_M, self.bounds[:, 2:] + ON_THE_WALL_M
        inside = (points[:, None, :2] >= low) & (points[:, None, :2] <= high)
        return np.asarray(np.minimum(self.ambient + (soft * inside.all(axis=2)) @ self.power, 1.25))

    def on_faces(self, ends: Floats, heights: Floats) -> Floats:
        """Brightness (F, 4) at the corners of faces, as ``Faces.shade`` orders them."""
        along = ends[:, 2:] - ends[:, :2]
        outward = np.column_stack([along[:, 1], -along[:, 0], np.zeros(len(ends))])
        normals = outward / np.linalg.norm(outward, axis=1, keepdims=True)
        corners = [
            self.at(np.column_stack([ends[:, 2 * end : 2 * end + 2], heights[:, side]]), normals)
            for side in (1, 0)
            for end in (0, 1)
        ]
        patches = generator(self.seed, Stream.PATCHES).standard_normal((len(ends), 4))
        return np.stack(corners, axis=1) * np.exp(self.patches * patches)


def light_at(rooms: Sequence[LitRoom], moment: Moment, seed: int) -> Light:
    """The light of a moment. Rooms without windows keep their tubes whatever the time of day."""
    rows: list[tuple[float, ...]] = []
    usual = 1.0 - moment.bulbs - moment.daylight
    for room in rooms:
        tube = TUBE_POWER * (usual if room.windows else usual + moment.daylight)
        rows += [(*at, tube, *room.bounds) for at in room.tubes]
        rows += [(*at, BULB_HEIGHT_M, moment.bulbs * BULB_POWER, *room.bounds) for at in room.bulbs]
        for x, y, height, made, later in room.windows:
            window = usual * _between(made, later, moment.age) + moment.daylight * DAYLIGHT_FACTOR * max(made, later)
            rows.append((x, y, height, window, *room.bounds))
    lamps = np.array(rows)
    ambient = usual * AMBIENT + moment.bulbs * AMBIENT_BULBS + moment.daylight * AMBIENT_DAYLIGHT
    sky = _between(_between(1.0, SKY_AGED, moment.age), SKY_BULBS, moment.bulbs)
    return Light(lamps[:, :3], lamps[:, 3], lamps[:, 4:], ambient, sky, PATCHES_AGED * moment.age, seed)


def tint_at(moment: Moment) -> Tint:
    """Red, green and blue of the light of a moment."""
    usual = 1.0 - moment.bulbs - moment.daylight
    red, green, blue = (
        usual + moment.bulbs * warm + moment.daylight * cold for warm, cold in zip(WARM, COLD, strict=True)
    )
    return red, green, blue


def _between(start: float, end: float, share: float) -> float:
    return (1.0 - share) * start + share * end
