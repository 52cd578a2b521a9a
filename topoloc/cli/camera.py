"""``topoloc camera``: field of view, yaw on the robot and lens, measured from recordings."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from cyclopts import App, Parameter

if TYPE_CHECKING:
    from topoloc.camera.chessboard import ChessboardLens
    from topoloc.camera.field_of_view import FieldOfView
    from topoloc.recording import Recording

MOST_OF_RECORDING = 60
"""Of a recording so many pictures are looked through for boards."""
Write = Annotated[bool, Parameter(help="Put it into RECORDING/camera.toml, beside what is there.", negative="")]
Output = Annotated[
    Path | None, Parameter(name=["--output", "-o"], help="Put it into this camera.toml, beside what is there.")
]


class CameraCommands(App):
    """Measure a camera: its field of view, its yaw on the robot, its lens. ``camera.toml`` holds them."""


camera = CameraCommands(help=CameraCommands.__doc__)


@camera.command
def turn(
    recording: Annotated[Path, Parameter(help="Recording in which the robot turns on the spot.")],
    *,
    scene_m: Annotated[
        float, Parameter(help="Usual distance of what is seen, metres; matters where the mount is off the axis.")
    ] = 3.0,
    picture: Annotated[Path | None, Parameter(help="PNG to make: how far what was seen twice is off.")] = None,
    write: Write = False,
    output: Output = None,
    overwrite: Annotated[bool, Parameter(help="Replace the picture if it exists.", negative="")] = False,
) -> None:
    """Measure the horizontal field of view where a robot turns on the spot.

    Full circles are the measure where they close, else the odometer's turns; without odometry the recording must
    be one turn of a full circle. A camera off the axis of rotation needs its place, ``x`` and ``y`` of ``[mount]`` in
    ``camera.toml``, to be known.

    Example: ``topoloc camera turn lab/turning --picture off.png --write``
    """
    from topoloc.camera.field_of_view import estimate_field_of_view
    from topoloc.files import refuse_to_overwrite
    from topoloc.recording import Recording

    if picture is not None:
        refuse_to_overwrite(picture, overwrite)
    read = Recording.load(recording)
    target = _target(recording, write, output)
    if target is not None:
        _refuse_lens(target)
    found = estimate_field_of_view(read, scene_m, _track)
    _tell_turn(read, found)
    if picture is not None:
        _draw(picture, found)
    width, height = found.size
    if read.lens is None:
        _put(target, recording, {"hfov_deg": round(found.hfov_deg, 2), "width": width, "height": height})


@camera.command
def yaw(
    recording: Annotated[Path, Parameter(help="Recording in which the robot drives straight, with odometry.")],
    *,
    write: Write = False,
    output: Output = None,
) -> None:
    """Measure the yaw of the camera on the robot where it drives straight, ahead or back.

    90 looks to the left, 180 back. The field of view must be known: ``topoloc camera turn`` measures it.

    Example: ``topoloc camera yaw lab/driving --write``
    """
    from topoloc.camera.mount_yaw import estimate_mount_yaw
    from topoloc.recording import Recording

    read = Recording.load(recording)
    found = estimate_mount_yaw(read, _track)
    print(f"yaw of the camera on the robot: {found.yaw_deg:.1f} degrees (standard deviation {found.sd_deg:.1f})")
    print(f"from {found.pairs} pairs of frames, {found.driven_m:.1f} m driven; {100.0 * found.away:.0f} % agree")
    print("a false turn of the odometer of 1 degree a metre makes it wrong by about 2 degrees; told is only chance")
    _put(_target(recording, write, output), recording, {"mount": {"yaw_deg": round(found.yaw_deg, 1)}})


@camera.command
def chessboard(
    folder: Annotated[Path, Parameter(help="Folder of pictures of a chessboard, or a recording of one.")],
    *,
    board: Annotated[str, Parameter(help="Inner corners, columns x rows: 8 x 8 squares have 7x7.")] = "9x6",
    model: Annotated[Literal["pinhole", "fisheye"], Parameter(help="Of the lens; see docs/formats.md.")] = "pinhole",
    write: Annotated[
        bool, Parameter(help="Put it into FOLDER/camera.toml, beside what is there.", negative="")
    ] = False,
    output: Output = None,
) -> None:
    """Find the lens, focal lengths and distortion, from pictures of a flat chessboard.

    Pictures of a recording with this lens in its ``camera.toml`` are straightened whenever they are read.

    Example: ``topoloc camera chessboard boards/ --board 9x6 -o lab/recording/camera.toml``
    """
    from dataclasses import asdict

    from topoloc.camera.chessboard import lens_from_chessboards

    found = lens_from_chessboards(_pictures(folder), _board(board), model, _track)
    _tell_lens(found)
    lens = {**asdict(found.lens), "coefficients": list(found.lens.coefficients)}
    _put(_target(folder, write, output), folder, {**asdict(found.camera), "lens": lens})


def _target(folder: Path, write: bool, output: Path | None) -> Path | None:
    """The ``camera.toml`` to write; None: none."""
    if output is not None and output.is_dir():
        from topoloc.errors import InputError

        raise InputError(output, "is a folder", f"name the file: {output / 'camera.toml'}")
    return output if output is not None else folder / "camera.toml" if write else None


def _refuse_lens(target: Path) -> None:
    """Where a lens is told, its focal length tells the field of view: raise ``InputError``."""
    from topoloc.errors import InputError
    from topoloc.rig_file import read_rig

    if read_rig(target).lens is not None:
        raise InputError(target, "has a [lens], which tells the field of view", "measure without --write and compare")


def _put(target: Path | None, source: Path, found: Mapping[str, Any]) -> None:
    """Write what was found into a ``camera.toml``, all else in it as it was, or say what to write there.

    Args:
        target: the file; None: only say it.
        source: the folder that it was found in.
        found: as ``camera.toml`` has it, tables in it as tables.
    """
    import tomli_w

    from topoloc.files import write_text
    from topoloc.rig_file import read_rig
    from topoloc.settings import read_toml

    if target is None:
        print(f"\n{tomli_w.dumps(dict(found))}")
        print(f"next: add --write, which puts this into {source / 'camera.toml'}, or write it there yourself")
        return
    read_rig(target)  # what cannot be read is not replaced
    table = read_toml(target, "restore it") if target.exists() else {}
    for name, before, after in _changes(table, found):
        print(f"{target}: {name} = {after} (before: {'not told' if before is None else before})")
    merged = {name: {**table.get(name, {}), **value} if name == "mount" else value for name, value in found.items()}
    write_text(target, tomli_w.dumps({**table, **merged}))
    print(f"next: topoloc check {target.parent}")


def _changes(table: Mapping[str, Any], found: Mapping[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Name, old value (None: not told) and new value of everything that was found."""
    for name, value in found.items():
        if isinstance(value, dict):
            yield from ((f"{name}.{key}", old, new) for key, old, new in _changes(table.get(name, {}), value))
        else:
            yield name, table.get(name), value


def _track(numbers: Sequence[int], what: str) -> Iterator[int]:
    from topoloc.cli.progress import track

    return track(numbers, what)


def _tell_turn(recording: Recording, found: FieldOfView) -> None:
    """Print what a turn told, and what it rests on."""
    print(f"field of view: {found.hfov_deg:.2f} degrees across (standard deviation {found.sd_deg:.2f})")
    agree = f"{100.0 * found.agreeing:.0f} % of what was seen twice agrees"
    print(f"from {found.pairs} pairs of frames, {found.turned_deg:.0f} degrees turned; {agree}")
    if found.circles > 0:
        print(f"full circles followed from picture to picture: {found.circles}; they are the measure")
    if found.odometer_scale is not None:
        print(f"a full circle closed: true turns are {found.odometer_scale:.3f} times the odometer's")
    elif not found.closed:
        print("no full circle closed: the odometer's turns are taken for true, and its error is not told above")
    if recording.lens is not None and recording.camera is not None:
        print(
            f"{recording.folder / 'camera.toml'} has a lens, taken out; with it {recording.camera.hfov_deg:.2f} is told"
        )
    elif not found.place_told:
        print(
            "the camera is taken to sit on the axis of rotation: ahead of it, the field of view comes out too narrow,"
        )
        print("in a room by about 3 % for each 0.1 m. The standard deviation allows for 0.2 m: write x (ahead) and y")
        print("(left) of [mount], 0 where it is on the axis, and measure again")


def _draw(picture: Path, found: FieldOfView) -> None:
    from topoloc.camera.residual_picture import draw_residuals
    from topoloc.files import write_bytes
    from topoloc.plan import as_png

    write_bytes(picture, as_png(draw_residuals(found)))
    print(f"{picture}: how far what was seen twice is off")


def _tell_lens(found: ChessboardLens) -> None:
    """Print how good a lens is, and what it has not seen."""
    across, down = (100.0 * share for share in found.seen)
    print(
        f"{found.lens.model} lens from {found.boards} of {found.pictures} pictures; corners off by {found.rms_px:.2f}"
    )
    print(f"pixels (root mean square); boards reach over {across:.0f} % of the width and {down:.0f} % of the height")
    sd = f"(standard deviation {found.hfov_sd_deg:.2f})"
    print(f"field of view of straightened pictures: {found.camera.hfov_deg:.2f} degrees across {sd}")


def _pictures(folder: Path) -> list[Path]:
    """The pictures of a folder, or some of those that a recording lists, as they were recorded."""
    from topoloc.errors import InputError
    from topoloc.files import pictures_in
    from topoloc.recording import Recording

    if not folder.is_dir():
        raise InputError(folder, "no such folder", "name a folder of pictures of a chessboard")
    if (folder / "rgb.txt").exists():
        listed = [picture.path for picture in Recording.load(folder).pictures["rgb"]]
        return listed[:: -(-len(listed) // MOST_OF_RECORDING)]
    return pictures_in(folder)


def _board(word: str) -> tuple[int, int]:
    """Columns and rows of inner corners. Raises ``UserError`` for what is not like 9x6."""
    from topoloc.errors import UserError

    read = re.fullmatch(r"(\d{1,3})x(\d{1,3})", word)
    if read is None:
        raise UserError(f"--board is {word!r}; write inner corners as columns x rows, as in 9x6")
    return int(read[1]), int(read[2])
