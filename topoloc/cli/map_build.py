"""``topoloc map build``: a map from the recording of a drive."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

if TYPE_CHECKING:
    from topoloc.mapping.building import BuildConfig, Built
    from topoloc.recording import Recording

OUTPUTS = ("edges.csv", "views.csv", "map.png", "show.png")
"""Files of an earlier map that must not stay beside a new one without them."""
PANORAMAS_DRAWN = 8
SHOWN_NAMES = 5


def build(
    recording: Annotated[Path, Parameter(help="Recording folder, TUM RGB-D layout, of a drive.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Map folder to make.")],
    spacing_m: Annotated[float, Parameter(help="Between nodes along the path, metres.")] = 1.0,
    nodes: Annotated[
        Literal["all", "panoramas"],
        Parameter(help="'panoramas' leaves out nodes without one: ima needs one at each."),
    ] = "all",
    panoramas: Annotated[
        Literal["auto", "headings", "circle"],
        Parameter(
            help="Frames of a turn are placed by their poses, or by what they show; auto: by truth, else circle."
        ),
    ] = "auto",
    view_spacing_m: Annotated[float, Parameter(help="Between training views, metres,")] = 0.3,
    view_turn_deg: Annotated[float, Parameter(help="or turned so far against those nearer, degrees.")] = 15.0,
    view_size: Annotated[str | None, Parameter(help="Scale pictures down to WxH, as 320x240.")] = None,
    poses: Annotated[
        Literal["auto", "truth", "odometry", "line"],
        Parameter(help="groundtruth.txt, odometry.txt (it drifts), or straight on; auto: the first there is."),
    ] = "auto",
    speed_m_s: Annotated[float | None, Parameter(help="For --poses line: speed, metres a second.")] = None,
    hfov_deg: Annotated[
        float | None, Parameter(help="Horizontal field of view, where camera.toml does not tell it, degrees.")
    ] = None,
    name: Annotated[str | None, Parameter(help="Of the map, for people; default: the folder's.")] = None,
    overwrite: Annotated[bool, Parameter(help="Replace the map if it exists.", negative="")] = False,
) -> None:
    """Build a map from a recorded drive.

    Nodes stand where the robot turned full circle on the spot, and otherwise every ``--spacing-m`` along the path;
    panoramas are made of the turns, or taken from unwrapped omni pictures; edges join nodes that the path led between;
    frames all along become training views. Draws ``map.png`` into the map.

    Odometry drifts, and nothing is done about that: drive one lap, not several.

    Example: ``topoloc map build lab/recording -o lab/built --spacing-m 1``
    """
    from topoloc.errors import UserError
    from topoloc.files import new_folder, refuse_to_overwrite, write_bytes
    from topoloc.mapping.building import BuildConfig
    from topoloc.mapping.show import as_picture, draw_map, shown_nodes
    from topoloc.recording import Recording

    refuse_to_overwrite(output, overwrite)
    try:
        config = BuildConfig(
            spacing_m=spacing_m,
            nodes=nodes,
            panoramas=panoramas,
            view_spacing_m=view_spacing_m,
            view_turn_deg=view_turn_deg,
            view_size=_size(view_size),
            poses=poses,
            speed_m_s=speed_m_s,
            hfov_deg=hfov_deg,
        )
    except ValueError as error:
        raise UserError(str(error)) from None
    drive = Recording.load(recording)
    with new_folder(output, overwrite, owned=OUTPUTS) as folder:
        built = _built(drive, config, name or output.resolve().name, folder)
        shown = shown_nodes(built.topo_map, (), PANORAMAS_DRAWN)
        write_bytes(folder / "map.png", as_picture(draw_map(built.topo_map, shown), ".png"))
    _report(output, built)


def _size(words: str | None) -> tuple[int, int] | None:
    """Columns and rows of ``320x240``."""
    from topoloc.errors import UserError

    if words is None:
        return None
    found = re.fullmatch(r"(\d{1,5})x(\d{1,5})", words.strip().lower())
    if not found:
        raise UserError(f"--view-size is {words!r}; write columns x rows, as 320x240")
    return int(found[1]), int(found[2])


def _built(drive: Recording, config: BuildConfig, name: str, folder: Path) -> Built:
    """The map, made and saved into a folder, with a bar of how far it is."""
    from topoloc.cli.progress import bar
    from topoloc.mapping.building import build_map

    with bar() as progress:
        task = progress.add_task("reading the recording", total=None)

        def tell(what: str, done: int, total: int) -> None:
            progress.update(task, description=what, completed=done, total=total)

        built = build_map(drive, config, name, tell)
        progress.update(task, description="writing the map", total=None)
        built.topo_map.save(folder)
    return built


def _report(output: Path, built: Built) -> None:
    """Print what was made, what was left out and why, what the user should know, and what to do next."""
    import sys

    import numpy as np

    from topoloc.cli.next_step import next_step

    the_map, frames = built.topo_map, built.frames
    bare = [node.id for node in the_map.nodes if not node.has_panorama]
    having = len(the_map.nodes) - len(bare)
    edges = len(np.asarray(the_map.edges))
    print(
        f"{output}: {len(the_map.nodes)} nodes, {having} with panoramas, {edges} edges, {len(the_map.views)} views; "
        "map.png shows it"
    )
    sources = {"truth": "ground truth", "odometry": "odometry", "line": "a straight line at constant speed"}
    print(f"from {frames} frames along {built.length_m:.1f} m; poses: {sources[built.source]}")
    camera = the_map.camera
    print(f"camera: {camera.width}x{camera.height}, {camera.hfov_deg:g} degrees wide")
    for reason, count in built.left_out.items():
        print(f"left out: {count} frames: {reason}")
    for note in (*built.notes, *_warnings(built, bare)):
        print(f"warning: {note}", file=sys.stderr)
    if built.source == "odometry":
        print(
            "the map's frame is the odometry's: metrics of recordings with ground truth in another frame mean nothing "
            "(topoloc check MAP RECORDING tells)"
        )
    print(next_step("map", "show", output))
    print(next_step("check", output, lead="then"))
    print(next_step("localize", output, "ANOTHER_RECORDING", *_sensor(built, bare), "-o", "run", lead="then"))


def _warnings(built: Built, bare: list[str]) -> list[str]:
    """What is poor about a map, and what would mend it."""
    found = []
    if built.source == "odometry":
        found.append(
            "odometry drifts: positions and headings are the odometer's, and a place that is passed again after a lap "
            "may stand on the map twice; compare the ends of the path in map.png, and map one lap only"
        )
    if bare and built.topo_map.views:
        names = ", ".join(bare[:SHOWN_NAMES])
        if len(bare) > SHOWN_NAMES:
            names += f" and {len(bare) - SHOWN_NAMES} more"
        mend = ", or keep the others only, with --nodes panoramas" if len(bare) < len(built.topo_map.nodes) else ""
        found.append(
            f"ima needs a panorama at every node, and {names} have none: let the robot turn full circle on the spot "
            f"there (topoloc.behaviours VideoScan does){mend}"
        )
    if built.jumps:
        found.append(f"{built.jumps} steps between frames are too long to tell that a way leads there: no edges")
    return found


def _sensor(built: Built, bare: list[str]) -> list[str]:
    """The options that name a sensor and an estimator which suit the map; no sensor for the default one, ima."""
    if not built.topo_map.views:
        return ["--sensor", "fourier"]
    return [*(["--sensor", "local"] if bare else []), "--estimator", "particle"]
