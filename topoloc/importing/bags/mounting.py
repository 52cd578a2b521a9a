"""Where the transforms put the camera on the robot."""

from __future__ import annotations

import numpy as np

from topoloc.errors import UserError
from topoloc.geometry import wrap
from topoloc.importing.bags.poses import LEVEL
from topoloc.importing.bags.transforms import Transforms
from topoloc.rig_file import Mount

TILTED_DEG = 10.0
"""A camera that looks farther up or down is told [degrees]."""
PANNED_DEG = 1.0
"""A camera that turned farther on the robot is told [degrees]."""


def mounting(transforms: Transforms, base: str, camera: str, times: tuple[float, float]) -> tuple[Mount, list[str]]:
    """How a camera sits on the robot, and what is strange about it.

    Args:
        transforms: of the bag.
        base: frame of the robot.
        camera: frame of the pictures: an optical frame (z ahead, y down), or one like the robot's (x ahead, z up), as
            simulators send it; which, is told by what points down, and by its name.
        times: of the first and the last picture [s].

    Raises:
        UserError: nothing leads from one to the other, or the camera looks neither way.
    """
    positions, turns = transforms.at(base, camera, np.array(times))
    axes = turns.as_matrix()
    down, up = -axes[0, 2, 1], axes[0, 2, 2]
    optical = abs(down) >= LEVEL
    if not optical and (up < LEVEL or "optical" in camera):
        raise UserError(f"{camera} looks up or down, or lies on its side; write [mount] into camera.toml")
    ahead = axes[:, :, 2] if optical else axes[:, :, 0]
    yaws = np.arctan2(ahead[:, 1], ahead[:, 0])
    notes = []
    if down <= -LEVEL:
        notes.append(
            f"{camera} hangs upside down: so are its pictures; turn them, and those of the map, by 180 degrees"
        )
    tilt = float(np.rad2deg(np.arcsin(np.clip(ahead[0, 2], -1.0, 1.0))))
    if abs(tilt) > TILTED_DEG:
        notes.append(
            f"{camera} looks {abs(tilt):.0f} degrees {'up' if tilt > 0 else 'down'}: panoramas take it for level"
        )
    panned = float(np.rad2deg(wrap(yaws[1] - yaws[0])))
    if abs(panned) > PANNED_DEG:
        notes.append(f"{camera} turned on the robot by {panned:.0f} degrees from first to last picture: write pan.txt")
    x, y = (round(float(value), 6) for value in positions[0, :2])
    return Mount(x, y, round(float(np.rad2deg(yaws[0])), 6)), notes
