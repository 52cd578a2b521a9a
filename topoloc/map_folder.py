"""A map as a folder: ``map.toml``, ``nodes.csv``, optional ``edges.csv``, ``views.csv``, and the pictures they name."""

from __future__ import annotations

import csv
import io
import math
import re
import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from topoloc.errors import InputError, UnreadableImage
from topoloc.file_stamp import FileStamp
from topoloc.files import RESTORE, new_folder, read_text, reason, write_csv, write_image, write_text
from topoloc.geometry import Floats, wrap
from topoloc.picture_header import size_of
from topoloc.picture_index import STORE_FOLDER, PictureIndex
from topoloc.pictures import Held, PictureFile, Recent, Shelf, as_image, follow, held_in
from topoloc.settings import build, convert, optional_length, read_toml, refuse_unknown
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Image, Ints

MAP_FILE, NODES_FILE, EDGES_FILE, VIEWS_FILE = "map.toml", "nodes.csv", "edges.csv", "views.csv"
NODE_COLUMNS = ("id", "name", "x", "y", "heading", "panorama")
EDGE_COLUMNS = ("a", "b")
VIEW_COLUMNS = ("x", "y", "heading", "image")
RIGHT_COLUMN = "right"
FARTHEST_M = 1e6
"""A node farther from the origin than this is a mistake in its units [m]."""


def load_map(folder: Path) -> TopoMap:
    """Read a map folder, or the thesis's text map where the path is a file: see ``topoloc.thesis_map``.

    Raises:
        InputError: naming file, line and remedy for whatever cannot be used.
    """
    if folder.is_file():
        return _load_text_map(folder)
    if not folder.is_dir():
        raise InputError(folder, "no such folder", "name the folder that holds map.toml and nodes.csv")
    path = folder / MAP_FILE
    table = read_toml(path, "a map folder needs it; see 'topoloc simulate lab' for an example")
    refuse_unknown(table, {"name", "camera", "free", "panoramas_filtered", "baseline_m"}, path)
    camera = build(Camera, table.get("camera", {}), f"{path} [camera]")
    pictures = OpenPictures(folder)
    nodes = _read_nodes(folder, camera, pictures)
    return TopoMap(
        name=str(table.get("name", folder.name)),
        camera=camera,
        nodes=nodes,
        edges=_read_edges(folder / EDGES_FILE, nodes),
        free=_read_free(table.get("free", []), path),
        views=_read_views(folder, camera, pictures),
        filtered=convert(table.get("panoramas_filtered", False), bool, f"{path}: panoramas_filtered"),
        baseline_m=optional_length(table, "baseline_m", path),
    )


def _load_text_map(path: Path) -> TopoMap:
    from topoloc.thesis_map import load_thesis_map  # here, because it builds on this module

    if path.name in (MAP_FILE, NODES_FILE, EDGES_FILE, VIEWS_FILE):
        raise InputError(path, "is a part of a map folder", f"name the folder itself, {path.parent}")
    return load_thesis_map(path)


def rows_of(path: Path, columns: Sequence[str], remedy: str) -> Iterator[tuple[int, dict[str, str]]]:
    """Lines of a CSV file whose header names at least ``columns``: (1-based line, value by column)."""
    reader = _csv_rows(path, remedy)
    _, header = next(reader, (1, []))
    missing = [column for column in columns if column not in header]
    if missing:
        raise InputError(path, f"the header lacks {', '.join(missing)}", f"start it with {','.join(columns)}", line=1)
    for line, row in reader:
        if not any(row):
            continue
        if len(row) != len(header):
            problem = f"{len(row)} values under {len(header)} columns"
            raise InputError(path, problem, "give each column one value", line=line)
        yield line, dict(zip(header, row, strict=True))


def _csv_rows(path: Path, remedy: str) -> Iterator[tuple[int, list[str]]]:
    """Stripped cells of each row of a CSV file, with the 1-based line that it ends on."""
    reader = csv.reader(io.StringIO(read_text(path, remedy), newline=""))
    try:
        for row in reader:
            yield reader.line_num, [word.strip() for word in row]
    except csv.Error as error:
        raise InputError(path, f"is not CSV ({error})", "look for a stray quote", line=reader.line_num) from None


def number(text: str, name: str, path: Path, line: int) -> float:
    """A finite number, or an ``InputError`` that names column, file and line."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(path, f"{name} is {text!r}, not a finite number", "write a decimal number", line=line)
    return value


class OpenPictures:
    """The pictures that the files of a map name: looked at when the map is opened, decoded later.

    Args:
        folder: that their paths start from.
        is_map_folder: see ``Shelf``.
    """

    def __init__(self, folder: Path, is_map_folder: bool = True) -> None:
        self._shelf = Shelf(folder.absolute(), Recent(), is_map_folder)
        self._index = PictureIndex.read(self._shelf.folder)

    def open(self, name: str, path: Path, line: int) -> PictureFile:
        """A picture that a line of a file names; ``InputError`` names the line and the picture."""
        file = self._shelf.folder / name
        try:
            stamp, size = self._looked_at(file)
        except InputError as error:
            problem = f"the picture {file.name} {error.problem.removeprefix('is ')}"
            raise InputError(path, problem, error.remedy, line=line) from None
        return PictureFile(file, size, stamp, path, line, self._shelf)

    def _looked_at(self, file: Path) -> tuple[FileStamp, tuple[int, int]]:
        """Stamp and size of a picture; the size of one that did not change since it was last read is remembered."""
        try:
            stamp = FileStamp.of(file)
        except (OSError, ValueError) as error:
            raise UnreadableImage(file, f"cannot be read ({reason(error)})", RESTORE) from None
        known = self._index.known(file, stamp)
        return stamp, size_of(file) if known is None else known.size


def _read_nodes(folder: Path, camera: Camera, pictures: OpenPictures) -> tuple[Node, ...]:
    path = folder / NODES_FILE
    nodes: list[Node] = []
    seen: dict[str, int] = {}
    for line, row in rows_of(path, NODE_COLUMNS, "a map folder needs it: one line a node"):
        x, y, heading = (number(row[key], key, path, line) for key in ("x", "y", "heading"))
        if max(abs(x), abs(y)) > FARTHEST_M:
            problem = f"the node lies {max(abs(x), abs(y)):.3g} m from the origin"
            raise InputError(path, problem, "write metres, from an origin near the map", line=line)
        identity = row["id"]
        if not identity:
            raise InputError(path, "the id is empty", "give the node an id", line=line)
        if identity in seen:
            problem = f"id {identity!r} stands already on line {seen[identity]}"
            raise InputError(path, problem, "give each node an id of its own", line=line)
        seen[identity] = line
        panorama = _panorama(pictures.open(row["panorama"], path, line), camera) if row["panorama"] else None
        nodes.append(Node(identity, row["name"], x, y, float(wrap(np.deg2rad(heading))), panorama))
    if not nodes:
        raise InputError(path, "the map has no nodes", "add a line for each node below the header")
    return tuple(nodes)


def _panorama(picture: PictureFile, camera: Camera) -> Image:
    """A panorama, which holds 360 / hfov frames side by side at the scale of its own height."""
    if not camera.fits_panorama(picture):
        rows, columns = picture.size
        expected = camera.panorama_columns() * rows / camera.height
        raise InputError(
            picture.source,
            f"the panorama has {columns} columns by {rows} rows, but a camera of {camera.width}x{camera.height} pixels"
            f" and {camera.hfov_deg:g} degrees gives {expected:.0f} columns",
            "correct [camera] in map.toml or make the panorama again",
            line=picture.line,
        )
    return as_image(picture)


def _read_edges(path: Path, nodes: tuple[Node, ...]) -> Ints | None:
    if not path.exists():
        return None
    index = {node.id: i for i, node in enumerate(nodes)}
    edges = []
    for line, row in rows_of(path, EDGE_COLUMNS, "restore it"):
        for key in EDGE_COLUMNS:
            if row[key] not in index:
                raise InputError(path, f"no node has the id {row[key]!r}", "use ids of nodes.csv", line=line)
        if row["a"] == row["b"]:
            raise InputError(path, f"joins {row['a']!r} to itself", "delete the line", line=line)
        edges.append((index[row["a"]], index[row["b"]]))
    return np.array(edges, dtype=np.int64).reshape(-1, 2)


def _read_free(polygons: Any, path: Path) -> tuple[Floats, ...]:
    try:
        free = tuple(np.array(polygon, dtype=np.float64) for polygon in polygons)
    except (TypeError, ValueError):
        free = (np.zeros(0),)
    for polygon in free:
        if polygon.ndim != 2 or polygon.shape[1] != 2 or len(polygon) < 3 or not np.isfinite(polygon).all():
            raise InputError(path, "free is not a list of polygons", "write free = [[[x, y], [x, y], [x, y]], ...]")
    return free


def _read_views(folder: Path, camera: Camera, pictures: OpenPictures) -> tuple[View, ...]:
    path = folder / VIEWS_FILE
    if not path.exists():
        return ()
    views = []
    for line, row in rows_of(path, VIEW_COLUMNS, "restore it"):
        x, y, heading = (number(row[key], key, path, line) for key in ("x", "y", "heading"))
        image = _view_picture(pictures.open(row["image"], path, line), camera)
        other = row.get(RIGHT_COLUMN)
        right = _view_picture(pictures.open(other, path, line), camera) if other else None
        views.append(View(np.array([x, y, float(wrap(np.deg2rad(heading)))]), image, right))
    return tuple(views)


def _view_picture(picture: PictureFile, camera: Camera) -> Image:
    """A picture of a view, which has the aspect ratio of the map's camera."""
    if not camera.fits(picture):
        rows, columns = picture.size
        problem = f"{picture.path.name} is {columns}x{rows}, but map.toml says {camera.width}x{camera.height}"
        remedy = "use images of one aspect ratio, or correct [camera]"
        raise InputError(picture.source, problem, remedy, line=picture.line)
    return as_image(picture)


def save_map(topo_map: TopoMap, folder: Path, overwrite: bool = False) -> None:
    """Write a map folder, whole or not at all; ``load_map`` reads it back. Pictures become PNG files.

    A map may be saved onto the folder that it was read from: from then on its pictures are those written there. What
    was worked out from a map that is overwritten goes.

    Raises:
        OutputExists: the folder holds something and ``overwrite`` is not set.
    """
    import tomli_w

    with new_folder(folder, overwrite) as target:
        camera = topo_map.camera
        table: dict[str, Any] = {
            "name": topo_map.name,
            "free": [polygon.tolist() for polygon in topo_map.free],
            "panoramas_filtered": topo_map.filtered,
            "camera": {"hfov_deg": camera.hfov_deg, "width": camera.width, "height": camera.height},
        }
        if topo_map.baseline_m is not None:
            table["baseline_m"] = topo_map.baseline_m
        write_text(target / MAP_FILE, tomli_w.dumps(table))
        pairs = [(topo_map.nodes[a].id, topo_map.nodes[b].id) for a, b in np.asarray(topo_map.edges)]
        write_csv(target / EDGES_FILE, EDGE_COLUMNS, pairs)
        written = _save_nodes(topo_map, target) + _save_views(topo_map.views, target)
    shutil.rmtree(folder / STORE_FOLDER, ignore_errors=True)
    follow(written, folder)


def _save_nodes(topo_map: TopoMap, target: Path) -> list[tuple[Held, str]]:
    """Write ``nodes.csv`` and its pictures."""
    rows, written = [], []
    for node, stem in zip(topo_map.nodes, _file_stems(topo_map), strict=True):
        name = f"panoramas/{stem}.png" if node.has_panorama else ""
        if node.panorama is not None:
            write_image(target / name, node.panorama)
            written.append((held_in(node, "panorama"), name))
        rows.append((node.id, node.name, repr(float(node.x)), repr(float(node.y)), _degrees(node.heading), name))
    write_csv(target / NODES_FILE, NODE_COLUMNS, rows)
    return written


def _file_stems(topo_map: TopoMap) -> list[str]:
    """A file name for each node: its id, or its number where the id holds what no file name should."""
    ids = [node.id for node in topo_map.nodes]
    lower = [name.lower() for name in ids]  # some file systems do not tell A from a
    plain = re.compile(r"[A-Za-z0-9-][A-Za-z0-9_-]{0,60}")
    return [name if plain.fullmatch(name) and lower.count(name.lower()) == 1 else f"_{i}" for i, name in enumerate(ids)]


def _save_views(views: Sequence[View], target: Path) -> list[tuple[Held, str]]:
    """Write ``views.csv`` and its pictures; the column ``right`` only where there is a stereo pair."""
    rows, written = [], []
    for i, view in enumerate(views):
        names = {"image": f"views/{i:05d}.png", "right": f"views/{i:05d}_right.png" if view.has_right else ""}
        write_image(target / names["image"], view.image)
        if view.right is not None:
            write_image(target / names["right"], view.right)
        written += [(held_in(view, key), name) for key, name in names.items() if name]
        x, y, heading = view.pose
        rows.append((repr(float(x)), repr(float(y)), _degrees(heading), *names.values()))
    if any(view.has_right for view in views):
        write_csv(target / VIEWS_FILE, (*VIEW_COLUMNS, RIGHT_COLUMN), rows)
    elif views:
        write_csv(target / VIEWS_FILE, VIEW_COLUMNS, [row[: len(VIEW_COLUMNS)] for row in rows])
    return written


def _degrees(angle: float) -> str:
    """An angle [rad] in degrees, to a digit less than it has, so that 20 stays 20."""
    return f"{np.rad2deg(angle):.14g}"
