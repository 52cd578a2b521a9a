"""``topoloc panorama``: a panorama from a folder of snapshots."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

if TYPE_CHECKING:
    from collections.abc import Sequence

    from topoloc.types import Image


def panorama(
    snapshots: Annotated[Path, Parameter(help="Folder of snapshots, in file order, turning clockwise.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Picture to write; FILE.csv goes beside it.")],
    method: Annotated[str, Parameter(help="See 'topoloc list panoramas'.")] = "circle",
    slots: Annotated[int | None, Parameter(help="Slots of IMA, for the method 'thesis'; by default 15.")] = None,
    clahe: Annotated[bool, Parameter(help="Filter the snapshots; the panorama then is grey.")] = True,
    hfov_deg: Annotated[float, Parameter(help="Horizontal field of view of a snapshot, degrees.")] = 40.0,
    step_deg: Annotated[
        float | None,
        Parameter(help="Nominal turn between snapshots, degrees, for 'circle'; by default 360 / their number."),
    ] = None,
    start_deg: Annotated[float, Parameter(help="Heading of the first snapshot, degrees counter-clockwise.")] = 0.0,
    debug: Annotated[Path | None, Parameter(help="Folder to make: a picture of each insertion.")] = None,
    overwrite: Annotated[bool, Parameter(help="Replace the output if it exists.", negative="")] = False,
) -> None:
    """Make a panorama from a folder of snapshots taken on one spot, turning clockwise.

    Writes the picture and, beside it, FILE.csv: the left column and the heading of each snapshot. The pictures of
    ``--debug`` show why each snapshot stands where it does; they are written even where the panorama is refused.

    Example: ``topoloc panorama snapshots/ -o lab.png --hfov-deg 40 --step-deg 30 --debug why/``
    """
    from rich.console import Console

    from topoloc import plugins
    from topoloc.errors import UserError
    from topoloc.files import refuse_to_overwrite

    for place in (output, output.with_suffix(".csv"), *((debug,) if debug else ())):
        refuse_to_overwrite(place, overwrite)
    settings: dict[str, Any] = {"clahe": clahe, "hfov_deg": hfov_deg, "start_deg": start_deg}
    asked = {"slots": slots, "step_deg": step_deg}
    settings |= {name: value for name, value in asked.items() if value is not None}
    maker = plugins.make(plugins.PANORAMAS, method, settings)
    files, pictures = _read_snapshots(snapshots)
    names = [file.name for file in files]
    console = Console(stderr=True)
    with console.status("aligning snapshots") as status:
        try:
            made = maker.reconstruct(
                pictures,
                lambda done: status.update(f"aligning snapshots: {done} of {len(files)}"),
                names,
            )
        except UserError as error:
            if debug is not None and hasattr(error, "panorama"):
                _explain(debug, overwrite, maker.explain(pictures, error.panorama, names))
            raise
        if debug is not None:
            _explain(debug, overwrite, maker.explain(pictures, made, names))
    _write(output, made, names)
    _report(output, made, names)


def _explain(folder: Path, overwrite: bool, pictures: Any) -> None:
    """Write the pictures of ``--debug``: pairs of name and bytes."""
    from topoloc.files import new_folder, write_bytes

    with new_folder(folder, overwrite) as place:
        for name, data in pictures:
            write_bytes(place / name, data)


def _write(output: Path, made: Any, names: Sequence[str]) -> None:
    import numpy as np

    from topoloc.files import write_csv, write_image

    write_image(output, made.image)
    degrees = np.rad2deg(made.headings)
    rows = [(name, int(c), f"{d:.3f}") for name, c, d in zip(names, made.columns, degrees, strict=True)]
    write_csv(output.with_suffix(".csv"), ("file", "column", "heading_deg"), rows)


def _report(output: Path, made: Any, names: Sequence[str]) -> None:
    """Print what was made, and on the error stream what the user should know of it."""
    import sys

    import numpy as np

    height, width = made.image.shape[:2]
    print(f"{output}: {width} x {height}, heading {np.rad2deg(made.heading):.2f} degrees")
    print(f"from {len(names)} snapshots, {names[0]} to {names[-1]}")
    print(f"{output.with_suffix('.csv')}: column and heading of each snapshot")
    for note in made.notes:
        print(f"warning: {note}", file=sys.stderr)


def _read_snapshots(folder: Path) -> tuple[list[Path], list[Image]]:
    """The pictures of a folder in file order, all of one size; anything else is a mistake that names the file."""
    from topoloc.errors import InputError
    from topoloc.files import pictures_in, read_image

    if not folder.is_dir():
        raise InputError(folder, "no such folder", "name a folder of pictures")
    files = pictures_in(folder)
    if len(files) < 2:
        raise InputError(folder, f"holds {len(files)} pictures", "a panorama needs two or more that overlap")
    pictures = [read_image(path) for path in files]
    sizes = [f"{picture.shape[1]}x{picture.shape[0]}" for picture in pictures]
    for path, size in zip(files, sizes, strict=True):
        if size != sizes[0]:
            problem = f"sizes differ: {files[0].name} is {sizes[0]}, {path.name} is {size}"
            raise InputError(folder, problem, "scale them to one size")
    return files, pictures
