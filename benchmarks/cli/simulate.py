"""``topoloc simulate``: a simulated world as a map folder and a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

if TYPE_CHECKING:
    from benchmarks.worlds.world import Simulation
    from topoloc.topo_map import TopoMap


def simulate(
    world: Annotated[str, Parameter(help="See 'topoloc list worlds'.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Folder to make: DIR/map and DIR/recording.")],
    seed: Annotated[int, Parameter(help="Of the room, the panoramas and the drive.", validator=Number(gte=0))] = 0,
    settings: Annotated[
        tuple[str, ...], Parameter(name="--set", help="KEY=VALUE, as 'topoloc list worlds' names them.")
    ] = (),
    overwrite: Annotated[bool, Parameter(help="Replace the output if it exists.", negative="")] = False,
) -> None:
    """Write a simulated world to disk: a map and the recording of a drive with ground truth.

    Example: ``topoloc simulate lab -o lab --seed 3 --set laps=1 --set people=0.35``
    """
    from topoloc import plugins
    from topoloc.cli.next_step import next_step
    from topoloc.cli.progress import track
    from topoloc.files import new_folder, refuse_to_overwrite
    from topoloc.recording import LazyImages
    from topoloc.recording_folder import RecordingWriter
    from topoloc.settings import parse_words

    refuse_to_overwrite(output, overwrite)
    maker = plugins.make(plugins.WORLDS, world, parse_words(settings))
    with new_folder(output, overwrite) as folder:
        made = maker.simulate(seed)
        made.topo_map.save(folder / "map")
        baseline = getattr(maker.config, "stereo_baseline_m", 0.0) or None
        panorama = "omni" in made.frames[0].images
        writer = RecordingWriter(folder / "recording", made.topo_map.camera, baseline_m=baseline, panorama=panorama)
        for frame, pose in track(list(zip(made.frames, made.truth, strict=True)), "rendering frames"):
            writer.add(frame, pose)
            if isinstance(frame.images, LazyImages):
                frame.images.forget()  # or a long recording would fill memory
        writer.close()
    print(f"{output / 'map'}: {_contents(made.topo_map)} (simulated)")
    print(f"{output / 'recording'}: {len(made.frames)} frames with odometry and ground truth (simulated)")
    parts = (output / "map", output / "recording")
    print(next_step("localize", *parts, *_sensor_for(made), "-o", output / "run"))


def _sensor_for(made: Simulation) -> tuple[str, ...]:
    """The option that names a sensor, where the default one cannot use the map or the frames."""
    if "omni" in made.frames[0].images:
        return "--sensor", "fourier"
    return () if made.topo_map.nodes[0].panorama is not None else ("--sensor", "pca")


def _contents(topo_map: TopoMap) -> str:
    """What a map holds, in words."""
    panoramas = sum(node.panorama is not None for node in topo_map.nodes)
    held = [f"{panoramas} panoramas"] * (panoramas > 0) + [f"{len(topo_map.views)} views"] * bool(topo_map.views)
    return f"{len(topo_map.nodes)} nodes with {' and '.join(held)}"
