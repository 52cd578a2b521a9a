"""``topoloc panorama``: a panorama from a folder of snapshots."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

if TYPE_CHECKING:
    from topoloc.types import Image

PICTURE_ENDINGS = (".jpg", ".jpeg", ".png", ".bmp", ".tif", ".tiff", ".ppm")


def panorama(
    snapshots: Annotated[Path, Parameter(help="Folder of snapshots, in file order, turning clockwise.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Picture to write; FILE.csv goes beside it.")],
    method: Annotated[str, Parameter(help="See 'topoloc list panoramas'.")] = "thesis",
    slots: Annotated[int, Parameter(help="Slots of IMA.")] = 15,
    clahe: Annotated[bool, Parameter(help="Filter the snapshots; the panorama then is grey.")] = True,
    hfov_deg: Annotated[float, Parameter(help="Horizontal field of view of a snapshot, degrees.")] = 40.0,
    start_deg: Annotated[float, Parameter(help="Heading of the first snapshot, degrees counter-clockwise.")] = 0.0,
    overwrite: Annotated[bool, Parameter(help="Replace the output if it exists.", negative="")] = False,
) -> None:
    """Make a panorama from a folder of snapshots taken on one spot, turning clockwise.

    Writes the picture and, beside it, FILE.csv: the left column and the heading of each snapshot.

    Example: ``topoloc panorama snapshots/ -o lab.png --hfov-deg 40``
    """
    import sys

    import numpy as np
    from rich.console import Console

    from topoloc import plugins
    from topoloc.files import refuse_to_overwrite, write_csv, write_image

    table = output.with_suffix(".csv")
    refuse_to_overwrite(output, overwrite)
    refuse_to_overwrite(table, overwrite)
    settings = {"slots": slots, "clahe": clahe, "hfov_deg": hfov_deg, "start_deg": start_deg}
    maker = plugins.make(plugins.PANORAMAS, method, settings)
    files, pictures = _read_snapshots(snapshots)
    console = Console(stderr=True)
    with console.status("aligning snapshots") as status:
        made = maker.reconstruct(
            pictures,
            lambda done: status.update(f"aligning snapshots: {done} of {len(files)}"),
        )
    write_image(output, made.image)
    degrees = np.rad2deg(made.headings)
    rows = [(f.name, int(c), f"{d:.3f}") for f, c, d in zip(files, made.columns, degrees, strict=True)]
    write_csv(table, ("file", "column", "heading_deg"), rows)
    height, width = made.image.shape[:2]
    print(f"{output}: {width} x {height}, heading {np.rad2deg(made.heading):.2f} degrees")
    print(f"from {len(files)} snapshots, {files[0].name} to {files[-1].name}")
    print(f"{table}: column and heading of each snapshot")
    if made.filled < 1.0:
        gap = (1.0 - made.filled) * 360.0
        print(
            f"warning: {gap:.0f} degrees of the circle stay empty: the snapshots do not close it, or method {method!r} "
            f"placed some wrongly; look at the picture",
            file=sys.stderr,
        )


def _in_order(path: Path) -> list[tuple[int, str]]:
    """Sorts 2.jpg before 10.jpg, as cameras number them."""
    return [(int(word), "") if word.isdecimal() else (-1, word) for word in re.split(r"(\d+)", path.name)]


def _read_snapshots(folder: Path) -> tuple[list[Path], list[Image]]:
    """The pictures of a folder in file order, all of one size; anything else is a mistake that names the file."""
    from topoloc.errors import InputError
    from topoloc.files import read_image

    if not folder.is_dir():
        raise InputError(folder, "no such folder", "name a folder of pictures")
    files = sorted((p for p in folder.iterdir() if p.suffix.lower() in PICTURE_ENDINGS), key=_in_order)
    if len(files) < 2:
        raise InputError(folder, f"holds {len(files)} pictures", "a panorama needs two or more that overlap")
    pictures = [read_image(path) for path in files]
    sizes = [f"{picture.shape[1]}x{picture.shape[0]}" for picture in pictures]
    for path, size in zip(files, sizes, strict=True):
        if size != sizes[0]:
            problem = f"sizes differ: {files[0].name} is {sizes[0]}, {path.name} is {size}"
            raise InputError(folder, problem, "scale them to one size")
    return files, pictures
