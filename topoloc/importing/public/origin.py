"""Where positions on the earth begin to be counted, so that two drives of one town share a frame."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from topoloc.errors import UserError
from topoloc.files import write_text
from topoloc.geometry import Floats, wrap
from topoloc.settings import build, read_toml

ORIGIN_FILE = "origin.toml"


@dataclass(frozen=True)
class Origin:
    """A point in UTM.

    Attributes:
        easting: [m].
        northing: [m].
    """

    easting: float
    northing: float


def read_origin(words: str) -> Origin:
    """An origin from ``E,N``, from an ``origin.toml``, or from the folder of a recording that has one.

    Raises:
        UserError: it is none of these.
    """
    path = Path(words)
    if path.is_dir():
        path /= ORIGIN_FILE
    if path.exists():
        return build(Origin, read_toml(path, "restore it"), str(path))
    try:
        easting, northing = (float(word) for word in words.split(","))
    except ValueError:
        easting = northing = np.nan
    if not np.isfinite([easting, northing]).all():
        raise UserError(
            f"--origin is {words!r}; give an origin.toml, the folder it lies in, or EASTING,NORTHING in metres"
        )
    return Origin(easting, northing)


def write_origin(folder: Path, origin: Origin) -> None:
    """Write an ``origin.toml`` into a folder."""
    import tomli_w

    write_text(folder / ORIGIN_FILE, tomli_w.dumps(asdict(origin)))


def poses_from_utm(easting: Floats, northing: Floats, clockwise: Floats, origin: Origin) -> Floats:
    """(N, 3) poses: x east, y north of the origin [m], heading counter-clockwise from east [rad].

    Args:
        easting: (N,) [m].
        northing: (N,) [m].
        clockwise: (N,) heading clockwise from north, as a compass and the frame north-east-down have it [rad].
        origin: of x and y.
    """
    return np.column_stack(
        [easting - origin.easting, northing - origin.northing, wrap(0.5 * np.pi - np.asarray(clockwise))]
    )
