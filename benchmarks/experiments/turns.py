"""Turns on the spot for a panorama: snapshots with the truth, and how far off a reconstruction places them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from benchmarks.worlds.chance import Stream, generator
from benchmarks.worlds.snapshots import Scan, snapshots_of
from benchmarks.worlds.world import World
from sensors.images import grey
from sensors.panorama import GapTooWide, Panorama
from topoloc import plugins
from topoloc.geometry import Floats, wrap
from topoloc.types import Image

SHOWN_ROWS = 30
"""Rows of the panoramas that are kept for pictures."""


@dataclass(frozen=True)
class Turn:
    """The snapshots of one turn.

    Attributes:
        snapshots: (S,) RGB, in their order.
        turned: (S,) how far the robot had turned clockwise since the first [rad].
    """

    snapshots: Sequence[Image]
    turned: Floats


def turn_at(world: World, place: int, seed: int, scan: Scan, stream: int) -> Turn:
    """One turn on a place of a world as it was when its map was made; ``stream`` is the experiment's own number."""
    rng = generator(seed, Stream.MEASUREMENT, stream, place)
    scene = world.scene(seed, world.mapped_at(place))
    taken = snapshots_of(scene, world.positions[place], world.camera, rng, world.mount, scan, world.config.effects)
    turned, snapshots = zip(*taken, strict=True)
    return Turn(snapshots, np.array(turned))


def reconstructed(method: str, settings: Mapping[str, Any], turn: Turn) -> Panorama:
    """The panorama that a method (a name of ``topoloc.panoramas``) makes of a turn, gaps or not."""
    try:
        made: Panorama = plugins.make(plugins.PANORAMAS, method, settings).reconstruct(turn.snapshots)
    except GapTooWide as error:
        made = error.panorama
    return made


def placement_errors(made: Panorama, turn: Turn) -> Floats:
    """(S - 1,) how far each snapshot but the first, which cannot be wrong, is placed from where it was [degrees]."""
    return np.asarray(np.abs(np.rad2deg(wrap(made.headings - made.headings[0] + turn.turned)))[1:])


def shown(image: Image) -> list[list[int]]:
    """A small grey copy for pictures, of lists."""
    columns = round(image.shape[1] * SHOWN_ROWS / image.shape[0])
    small: list[list[int]] = cv2.resize(grey(image), (columns, SHOWN_ROWS), interpolation=cv2.INTER_AREA).tolist()
    return small
