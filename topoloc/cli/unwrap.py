"""``topoloc unwrap``: panoramas from the pictures of an omnidirectional camera."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from topoloc import plugins

if TYPE_CHECKING:
    from topoloc.interfaces import Unwrapper
    from topoloc.types import Image


def unwrap(
    pictures: Annotated[tuple[Path, ...], Parameter(help="Pictures of one omnidirectional camera.", negative="")],
    *,
    camera: Annotated[Path, Parameter(help="camera.toml: [omni], and hfov_deg, width, height of the map's camera.")],
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Folder to make; for one picture also a FILE.")],
    heading_deg: Annotated[
        float, Parameter(help="Heading of the panorama's left edge, degrees counter-clockwise from the camera's.")
    ] = 0.0,
    overwrite: Annotated[bool, Parameter(help="Replace the output if it exists.", negative="")] = False,
) -> None:
    """Unwrap pictures of an omnidirectional camera into panoramas of the map's camera.

    Each keeps its name and becomes a PNG: columns run clockwise, linear in angle; what the picture does not show is
    black. For a recording, list them in omni.txt and write panorama = true instead of [omni].

    Example: ``topoloc unwrap omni/*.png --camera camera.toml -o panoramas``
    """
    from topoloc.cli.progress import track
    from topoloc.errors import UserError
    from topoloc.files import new_folder, read_image, refuse_to_overwrite, write_image

    refuse_to_overwrite(output, overwrite)
    if not isfinite(heading_deg):
        raise UserError(f"--heading-deg is {heading_deg}; give degrees")
    if len({path.stem for path in pictures}) < len(pictures):
        raise UserError("two pictures have the same name; unwrap them one by one")
    first = read_image(pictures[0])
    unwrapper = _unwrapper(camera, first, heading_deg)
    if len(pictures) == 1 and output.suffix:
        write_image(output, unwrapper.unwrap(first))
    else:
        with new_folder(output, overwrite) as folder:
            for path in track(list(pictures), "unwrapping"):
                write_image(folder / f"{path.stem}.png", _unwrapped(unwrapper, read_image(path), path))
    rows, columns = unwrapper.seen.shape
    print(f"{output}: {len(pictures)} x {columns}x{rows}, left edge {heading_deg:g} degrees from the camera's heading")
    if unwrapper.seen_share < 1.0:
        print(f"{1.0 - unwrapper.seen_share:.1%} of a panorama are black: the picture does not show them")


def _unwrapper(path: Path, picture: Image, heading_deg: float) -> Unwrapper:
    """For pictures of the size of one; all that is told about them stands in one file."""
    import numpy as np

    from topoloc.errors import InputError
    from topoloc.rig_file import read_rig

    if not path.is_file():
        raise InputError(path, "no such file", "write one: docs/formats.md, camera.toml")
    rig = read_rig(path)
    if rig.omni is None:
        raise InputError(path, "has no table [omni]", "write below it what docs/omni.md says of your camera")
    if rig.camera is None:
        raise InputError(path, "tells no field of view", "add hfov_deg, width and height of the map's camera")
    height, width = picture.shape[:2]
    make = plugins.load(plugins.UNWRAPPERS, "omni")
    try:
        made: Unwrapper = make(rig.omni, f"{path} [omni]", rig.camera, width, height, float(np.deg2rad(heading_deg)))
        return made
    except ValueError as error:
        problem, _, remedy = str(error).partition("; ")
        raise InputError(path, problem, remedy) from None


def _unwrapped(unwrapper: Unwrapper, picture: Image, path: Path) -> Image:
    from topoloc.errors import InputError

    try:
        return unwrapper.unwrap(picture)
    except ValueError as error:
        raise InputError(path, str(error), "unwrap pictures of another size by themselves") from None
