"""The thesis's text map (4.1.3, Figure 4.1): the folder of the panoramas, then name, x and y of each place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from topoloc.errors import InputError, OutputExists, UserError
from topoloc.files import PICTURE_ENDINGS, new_folder, read_text, write_image, write_text
from topoloc.geometry import wrap
from topoloc.map_folder import FARTHEST_M, OpenPictures, number
from topoloc.pictures import PictureFile, as_image, follow, held_in
from topoloc.topo_map import Camera, Node, TopoMap

MM_PER_M = 1000.0
LAYOUT = "write the folder of the panoramas on line 1, and 'name x y' in millimetres on a line for each place"
HEADINGS_AGREE_RAD = 1e-6
"""Headings of first columns that differ by less are the same [rad]."""


@dataclass(frozen=True)
class ThesisMapSettings:
    """What a text map does not tell, and a reader of it must know.

    Attributes:
        hfov_deg: horizontal field of view of the camera, degrees; the thesis has about 40 (5.1.2).
        reference_deg: heading of the reference snapshot's optical axis, the first of each panorama (2.3), degrees
            counter-clockwise in the text map's frame.
        filtered: whether the snapshots had gone through CLAHE before they became panoramas, true or false.
    """

    hfov_deg: float = Camera.hfov_deg
    reference_deg: float = 0.0
    filtered: bool = False

    def __post_init__(self) -> None:
        if not 0.0 < self.hfov_deg < 180.0:
            raise ValueError(f"hfov_deg is {self.hfov_deg}; it must lie between 0 and 180")
        if not np.isfinite(self.reference_deg):
            raise ValueError(f"reference_deg is {self.reference_deg}; it must be finite")

    @property
    def first_column(self) -> float:
        """Heading of the left edge of a panorama's first column [rad]: half a view to the left of the reference."""
        return float(wrap(np.deg2rad(self.reference_deg + self.hfov_deg / 2.0)))


class ThesisPlace(NamedTuple):
    """A line of a text map: name, x, y [mm], and its 1-based number in the file."""

    name: str
    x_mm: float
    y_mm: float
    line: int


@dataclass(frozen=True)
class ThesisMap:
    """What a text map says, its pictures left aside.

    Attributes:
        folder: of the panoramas; one that is written as relative is relative to the text file.
        folder_line: 1-based line that names it.
        places: in the file's order.
    """

    folder: Path
    folder_line: int
    places: tuple[ThesisPlace, ...]


def read_thesis_map(path: Path) -> ThesisMap:
    """Read a text map without looking at its pictures.

    Raises:
        InputError: naming file, line and remedy.
    """
    lines = [(number_, text.strip()) for number_, text in enumerate(read_text(path, LAYOUT).splitlines(), start=1)]
    lines = [(number_, text) for number_, text in lines if text]
    if not lines:
        raise InputError(path, "holds nothing: no text map, and no such folder", LAYOUT)
    folder_line, folder = lines[0]
    places: list[ThesisPlace] = []
    seen: dict[str, int] = {}
    for line, text in lines[1:]:
        place = _read_place(text, path, line)
        if place.name in seen:
            problem = f"the name {place.name!r} stands already on line {seen[place.name]}"
            raise InputError(path, problem, "give each place a name of its own", line=line)
        seen[place.name] = line
        places.append(place)
    if not places:
        raise InputError(path, "names no places below the folder of the panoramas", LAYOUT)
    return ThesisMap(path.parent / folder, folder_line, tuple(places))


def _read_place(text: str, path: Path, line: int) -> ThesisPlace:
    words = text.split()
    if len(words) != 3:
        problem = f"{text!r} has {len(words)} words"
        raise InputError(path, problem, "write 'name x y', a name without blanks and two numbers", line=line)
    x, y = (number(word, key, path, line) for word, key in zip(words[1:], "xy", strict=True))
    if max(abs(x), abs(y)) > FARTHEST_M * MM_PER_M:
        problem = f"the place lies {max(abs(x), abs(y)) / MM_PER_M:.3g} m from the origin"
        raise InputError(path, problem, "write millimetres, from an origin near the map", line=line)
    return ThesisPlace(words[0], x, y, line)


def load_thesis_map(path: Path, settings: ThesisMapSettings | None = None) -> TopoMap:
    """Read a text map with its panoramas: of each place the picture ``<name>.*`` in the folder of the first line.

    The camera's size is that of the panoramas: their rows, and the share of their columns that ``hfov_deg`` is of a
    circle, (2.1). Every node's heading is ``ThesisMapSettings.first_column``: the thesis's panoramas have a common
    angle of reference (2.3).

    Args:
        path: of the text file.
        settings: what it does not tell.

    Raises:
        InputError: naming file, line and remedy.
    """
    known, said = settings or ThesisMapSettings(), read_thesis_map(path)
    pictures, opened = _pictures_in(said, path), OpenPictures(said.folder, is_map_folder=False)
    nodes: list[Node] = []
    camera: Camera | None = None
    first = (0, 0)
    for place in said.places:
        file = _picture_of(place, pictures, said.folder, path)
        panorama = opened.open(file.name, path, place.line)
        if camera is None:
            camera, first = _camera_of(panorama, known.hfov_deg), panorama.size
        elif not camera.fits_panorama(panorama) and panorama.size != first:
            (rows, columns), (high, wide) = panorama.size, first
            problem = f"{file.name} is {columns}x{rows}: not {wide}x{high} in shape, as the first"
            raise InputError(path, problem, "make all panoramas with one camera, full circles", line=place.line)
        x, y = place.x_mm / MM_PER_M, place.y_mm / MM_PER_M
        nodes.append(Node(place.name, place.name, x, y, known.first_column, as_image(panorama)))
    assert camera is not None  # there is a place
    return TopoMap(path.stem, camera, tuple(nodes), filtered=known.filtered)


def _pictures_in(said: ThesisMap, path: Path) -> dict[str, list[Path]]:
    """The pictures of the panoramas' folder by name without ending, each list sorted."""
    found: dict[str, list[Path]] = {}
    try:
        files = sorted(said.folder.iterdir())
    except (OSError, ValueError) as error:  # a ValueError is what a NUL in a name raises
        problem = f"the folder {said.folder} cannot be read ({getattr(error, 'strerror', None) or error})"
        raise InputError(path, problem, LAYOUT, line=said.folder_line) from None
    for file in files:
        if file.suffix.lower() in PICTURE_ENDINGS:
            found.setdefault(file.stem, []).append(file)
    return found


def _picture_of(place: ThesisPlace, pictures: dict[str, list[Path]], folder: Path, path: Path) -> Path:
    """The one picture of a place."""
    files = pictures.get(place.name, [])
    if not files:
        endings = ", ".join(PICTURE_ENDINGS)
        problem = f"{folder} holds no picture of {place.name!r}"
        raise InputError(path, problem, f"put its panorama there, with one of {endings}", line=place.line)
    if len(files) > 1:
        problem = f"{place.name!r} has two pictures, {files[0].name} and {files[1].name}"
        raise InputError(path, problem, "keep one of them", line=place.line)
    return files[0]


def _camera_of(panorama: PictureFile, hfov_deg: float) -> Camera:
    rows, columns = panorama.size
    return Camera(hfov_deg, max(1, round(columns * hfov_deg / 360.0)), rows)


def save_thesis_map(topo_map: TopoMap, path: Path, overwrite: bool = False) -> ThesisMapSettings:
    """Write a text map, and its panoramas as PNG into the folder ``<stem of path>_panoramas`` beside it.

    Positions are rounded to whole millimetres. The folder is written whole or not at all, then the file.

    Args:
        topo_map: one that a text map can hold.
        path: of the text file.
        overwrite: replace file and panoramas.

    Returns:
        What a reader must know besides: ``load_thesis_map`` needs it.

    Raises:
        UserError: the map has what a text map cannot hold.
        OutputExists: there is something already, and ``overwrite`` is not set.
    """
    names = _refuse_what_is_lost(topo_map)
    folder = path.with_name(f"{path.stem}_panoramas")
    if path.exists() and not overwrite:
        raise OutputExists(path)
    lines, written = [folder.name], []
    with new_folder(folder, overwrite, owned=_pictures_of(names, folder)) as target:
        for name, node in zip(names, topo_map.nodes, strict=True):
            assert node.panorama is not None  # or it would have been refused
            write_image(target / f"{name}.png", node.panorama)
            written.append((held_in(node, "panorama"), f"{name}.png"))
            lines.append(f"{name} {round(node.x * MM_PER_M)} {round(node.y * MM_PER_M)}")
    follow(written, folder)
    write_text(path, "\n".join(lines) + "\n")
    hfov = topo_map.camera.hfov_deg
    reference = round(float(np.rad2deg(wrap(topo_map.nodes[0].heading - np.deg2rad(hfov) / 2.0))), 9)
    return ThesisMapSettings(hfov, reference, topo_map.filtered)


def _pictures_of(names: Sequence[str], folder: Path) -> list[str]:
    """Pictures of the places that lie there already: one with another ending would be a second picture of a place."""
    if not folder.is_dir():
        return []
    return [file.name for file in folder.iterdir() if file.stem in names and file.suffix.lower() in PICTURE_ENDINGS]


def _refuse_what_is_lost(topo_map: TopoMap) -> list[str]:
    """Names of the nodes; raises ``UserError`` for the first thing that a text map cannot hold."""

    def refuse(problem: str, remedy: str) -> None:
        raise UserError(f"map {topo_map.name!r}: {problem}, which a text map cannot hold; {remedy}")

    names = [node.name or node.id for node in topo_map.nodes]
    first: dict[str, str] = {}
    for name, node in zip(names, topo_map.nodes, strict=True):
        if not name.isprintable() or not name or set(name) & set(" /\\"):
            refuse(f"the name {name!r} has blanks or is no file name", "rename the node")
        if name.casefold() in first:  # some file systems do not tell A from a
            refuse(f"nodes {first[name.casefold()]} and {node.id} are both called {name!r}", "rename one of them")
        first[name.casefold()] = node.id
        if not node.has_panorama:
            refuse(f"node {node.id} has no panorama", "take one, or leave the node out")
        if abs(float(wrap(node.heading - topo_map.nodes[0].heading))) > HEADINGS_AGREE_RAD:
            refuse(f"the panoramas of {names[0]} and {name} begin at different headings", "roll one of them")
    if topo_map.views or topo_map.free:
        refuse("it has training views or free polygons", "save it as a folder")
    if not topo_map.edges_are_guessed:
        refuse("its edges are not those that join near nodes", "save it as a folder")
    return names
