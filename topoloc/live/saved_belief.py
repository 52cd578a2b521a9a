"""A belief on the disk, so that a localizer that is started again knows where the robot was."""

from __future__ import annotations

import io
import struct
import zipfile
import zlib
from dataclasses import dataclass
from hashlib import blake2b
from pathlib import Path

import numpy as np

from topoloc.checks.of_recording import JUMP_M_PER_S
from topoloc.errors import InputError
from topoloc.files import reason, write_bytes
from topoloc.geometry import Floats, between, compose
from topoloc.odometry import OdometryNoise
from topoloc.topo_map import TopoMap
from topoloc.types import WeightedPoses

MOST_POSES = 20_000
"""More poses than this are not saved, the lightest left out: a grid's belief has a pose for each cell."""
MOVED_BY_HAND_M = 0.5
"""Standard deviation of a restarted robot's position, where its odometer does not tell the motion meanwhile [m]."""
MOVED_BY_HAND_DEG = 20.0
"""Of its heading [degrees]."""
AT_ITS_ORIGIN = 0.1
"""An odometer that reads less than this has just begun [m, rad]."""
FORMAT = 1
DAMAGED = (zipfile.BadZipFile, zlib.error, struct.error)
REMEDY = "delete it to start without one"


@dataclass(frozen=True)
class SavedBelief:
    """Where a robot was, and what its odometer read then.

    Attributes:
        belief: after the last look.
        odometry: (3,) raw pose of the odometer at that look, or None where there was none.
        time: of that look, as pictures are stamped [s].
    """

    belief: WeightedPoses
    odometry: Floats | None
    time: float

    def prior(self, odometry: Floats | None, time: float, noise: OdometryNoise) -> tuple[WeightedPoses, str]:
        """The belief at a later start.

        It is moved by what the odometer says and widened by its noise, as if nothing had happened. Where the odometer
        cannot have gone on counting (its clock or itself began again, it is not there, or no robot is so fast), the
        belief stays and is widened by ``MOVED_BY_HAND_M`` and ``MOVED_BY_HAND_DEG``. An odometer that began
        again and drove on before the start is not told from one that went on.

        Args:
            odometry: (3,) raw pose at the start, or None.
            time: of the start, as pictures are stamped [s].
            noise: of the odometry.

        Returns:
            The belief, and in words what was done.
        """
        if odometry is None or self.odometry is None or not self._goes_on(odometry, time):
            distance, heading = MOVED_BY_HAND_M, np.deg2rad(MOVED_BY_HAND_DEG)
            return _moved(self.belief, np.zeros(3), np.array([distance, distance, heading]) ** 2), "widened"
        motion = noise.motion(self.odometry, odometry)
        return _moved(self.belief, motion.delta, np.diag(motion.covariance)), "moved by the odometry since"

    def _goes_on(self, odometry: Floats, time: float) -> bool:
        """Whether an odometer can have come from the saved reading to this one."""
        assert self.odometry is not None
        moved = between(self.odometry, odometry)
        began = np.abs(odometry).max() < AT_ITS_ORIGIN < np.abs(self.odometry).max()
        return bool(time >= self.time and not began and np.hypot(*moved[:2]) <= JUMP_M_PER_S * (time - self.time))


def save(path: Path, saved: SavedBelief, topo_map: TopoMap) -> None:
    """Write a belief, whole or not at all, with what the map is known by. Raises ``UserError`` where it cannot be."""
    odometry = np.full(3, np.nan) if saved.odometry is None else saved.odometry
    heaviest = np.argsort(-saved.belief.log_weights, kind="stable")[:MOST_POSES]
    buffer = io.BytesIO()
    np.savez(
        buffer,
        format=np.array(FORMAT),
        map=np.array(map_digest(topo_map)),
        poses=saved.belief.poses[heaviest],
        log_weights=saved.belief.log_weights[heaviest],
        spread=saved.belief.spread,
        odometry=odometry,
        time=np.array(saved.time),
    )
    write_bytes(path, buffer.getvalue())


def load(path: Path, topo_map: TopoMap) -> SavedBelief | None:
    """Read a belief back; None where there is no such file. No pickle is read.

    Raises:
        InputError: the file is damaged, no belief, or of another map.
    """
    try:
        data = path.read_bytes()
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise InputError(
            path, f"cannot be read ({reason(error)})", "name a file that can, or that is not there"
        ) from None
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as table:
            if table.zip is None or table.zip.testzip() is not None or int(table["format"]) != FORMAT:
                raise ValueError
            digest, odometry, time = (
                str(table["map"]),
                np.array(table["odometry"], dtype=np.float64),
                float(table["time"]),
            )
            belief = WeightedPoses(table["poses"], table["log_weights"], table["spread"])
        if odometry.shape != (3,) or not np.isfinite(time):
            raise ValueError
    except (ValueError, TypeError, KeyError, EOFError, OSError, RuntimeError, AttributeError, *DAMAGED):
        raise InputError(path, "is no belief that topoloc saved", REMEDY) from None
    if digest != map_digest(topo_map):
        raise InputError(path, f"is a belief on another map than {topo_map.name!r}", f"name another file, or {REMEDY}")
    return SavedBelief(belief, odometry if np.isfinite(odometry).all() else None, time)


def map_digest(topo_map: TopoMap) -> str:
    """What a belief's map is known by: its name, nodes, edges and free area, not its pictures, which may be renewed."""
    said = (
        topo_map.name,
        [node.id for node in topo_map.nodes],
        topo_map.positions.tolist(),
        np.asarray(topo_map.edges).tolist(),
        [np.asarray(polygon).tolist() for polygon in topo_map.free],
    )
    return blake2b(repr(said).encode(), digest_size=12).hexdigest()


def _moved(belief: WeightedPoses, delta: Floats, variance: Floats) -> WeightedPoses:
    return WeightedPoses(compose(belief.poses, delta), belief.log_weights, belief.spread + variance)
