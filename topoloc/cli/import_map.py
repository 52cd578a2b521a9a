"""``topoloc import map``: a map folder of the thesis's text map."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def import_map(
    file: Annotated[Path, Parameter(help="Text map: folder of the panoramas, then 'name x y' in millimetres.")],
    *,
    output: Annotated[Path, Parameter(name=["--output", "-o"], help="Map folder to make.")],
    hfov_deg: Annotated[float, Parameter(help="Horizontal field of view of the camera, degrees.")] = 40.0,
    reference_deg: Annotated[
        float, Parameter(help="Heading of the first snapshot of each panorama, degrees counter-clockwise.")
    ] = 0.0,
    filtered: Annotated[bool, Parameter(help="The snapshots had gone through CLAHE.", negative="")] = False,
    overwrite: Annotated[bool, Parameter(help="Replace the output if it exists.", negative="")] = False,
) -> None:
    """Make a map folder of a text map as the thesis has it (4.1.3), and of the panoramas that it names.

    A text map knows neither camera nor headings: options tell them. The frame stays the text map's.

    Example: ``topoloc import map lab.txt -o lab/map --reference-deg 90``
    """
    import numpy as np

    from topoloc.cli.next_step import next_step
    from topoloc.files import refuse_to_overwrite
    from topoloc.settings import build
    from topoloc.thesis_map import ThesisMapSettings, load_thesis_map

    refuse_to_overwrite(output, overwrite)
    told = {"hfov_deg": hfov_deg, "reference_deg": reference_deg, "filtered": filtered}
    topo_map = load_thesis_map(file, build(ThesisMapSettings, told, "topoloc import map"))
    topo_map.save(output, overwrite)
    camera = topo_map.camera
    print(f"{output}: {len(topo_map.nodes)} nodes with panoramas, {len(np.asarray(topo_map.edges))} edges")
    print(f"camera {camera.width}x{camera.height}, {camera.hfov_deg:g} degrees; reference {reference_deg:g} degrees")
    print(next_step("check", output))
