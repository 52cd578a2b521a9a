"""``topoloc map show``: the plan of a map and its panoramas, as a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter
from cyclopts.validators import Number

from topoloc.cli.numbers import Whole

ENDINGS = (".png", ".jpg", ".pdf", ".svg")


def show(
    topo_map: Annotated[Path, Parameter(name="map", help="Map folder, or a text map.")],
    *,
    output: Annotated[
        Path | None,
        Parameter(
            name=["--output", "-o"],
            help="Picture to write (png, jpg, pdf, svg); default: MAP/show.png, or TEXT_MAP.png.",
        ),
    ] = None,
    nodes: Annotated[
        tuple[str, ...],
        Parameter(help="Ids of the nodes whose panoramas are shown, several after one --nodes.", consume_multiple=True),
    ] = (),
    panoramas: Annotated[Whole, Parameter(help="Show so many, of the first nodes.", validator=Number(gte=0))] = 8,
    overwrite: Annotated[bool, Parameter(help="Replace the picture if it exists.", negative="")] = False,
) -> None:
    """Draw a map: nodes, edges, free area and training views to scale, and panoramas with map headings above them.

    A red line on a node points where its panorama begins; columns run clockwise from there.

    Example: ``topoloc map show lab/map -o lab.png --nodes 3 4``
    """
    from rich.console import Console

    from topoloc.cli.next_step import next_step
    from topoloc.errors import InputError, UserError
    from topoloc.files import refuse_to_overwrite, write_bytes
    from topoloc.mapping.show import as_picture, draw_map, shown_nodes
    from topoloc.topo_map import TopoMap

    place = _usual(topo_map) if output is None else output
    if place.suffix.lower() not in ENDINGS:
        raise UserError(f"{place}: no picture is written as {place.suffix!r}; end the name in {', '.join(ENDINGS)}")
    if place.is_dir():
        raise InputError(place, "is a folder", "name a picture to write, with -o")
    refuse_to_overwrite(place, overwrite)
    the_map = TopoMap.load(topo_map)
    shown = shown_nodes(the_map, nodes, panoramas)
    with Console(stderr=True).status("drawing"):
        write_bytes(place, as_picture(draw_map(the_map, shown), place.suffix.lower()))
    having = [node.id for node in the_map.nodes if node.has_panorama]
    drawn = [the_map.nodes[i].id for i in shown.tolist() if the_map.nodes[i].has_panorama]
    bare = [the_map.nodes[i].id for i in shown.tolist() if not the_map.nodes[i].has_panorama]
    print(f"{place}: {len(the_map.nodes)} nodes, {len(drawn)} of {len(having)} panoramas")
    if bare:
        print(f"no panorama: {', '.join(bare)}")
    if len(drawn) < len(having):
        first = next(identity for identity in having if identity not in drawn)
        print(f"the others: --panoramas {len(having)}, or by id, as --nodes {first}")
    print(next_step("check", topo_map))


def _usual(topo_map: Path) -> Path:
    """``lab/map/show.png`` for the folder ``lab/map``, ``lab.png`` for the text map ``lab.txt``.

    Not ``map.png``: ``topoloc map build`` drew that one.
    """
    return topo_map / "show.png" if topo_map.is_dir() else topo_map.with_suffix(".png")
