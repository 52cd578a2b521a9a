"""What ``topoloc import oxford`` is given: a traversal of the RobotCar, or pictures named by their UTM positions."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from topoloc.importing.public.origin import Origin, write_origin
from topoloc.importing.public.robotcar import RobotCarConfig, read_robotcar
from topoloc.importing.public.sequence import Drive
from topoloc.importing.public.utm_names import holds_utm_names, read_utm_names


def read_oxford(folder: Path, config: RobotCarConfig, origin: Origin | None = None) -> tuple[Drive, Origin]:
    """A drive of either kind, and the origin of its positions. Raises ``InputError`` where it is neither."""
    if folder.is_dir() and not (folder / "stereo").is_dir() and holds_utm_names(folder):
        return read_utm_names(folder, origin)
    return read_robotcar(folder, config, origin)


@dataclass
class OneFrame:
    """Reads drives into one frame: positions count from the origin, or from where the first drive began.

    Attributes:
        config: of traversals.
        origin: None until the first drive is read.
        hfov_deg: horizontal field of view of pictures of which none is documented [degrees].
    """

    config: RobotCarConfig
    origin: Origin | None = None
    hfov_deg: float | None = None

    def read(self, folder: Path) -> Drive:
        """A drive of either kind. Raises ``InputError`` where it is neither."""
        drive, self.origin = read_oxford(folder, self.config, self.origin)
        return drive.with_field_of_view(self.hfov_deg)

    def write(self, folder: Path) -> None:
        """Write ``origin.toml`` into a folder."""
        if self.origin is not None:
            write_origin(folder, self.origin)
