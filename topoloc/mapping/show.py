"""The picture of a map: its plan to scale, and below it panoramas with map headings along their tops."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from topoloc.errors import UnknownName
from topoloc.geometry import Floats
from topoloc.plan import ESTIMATE, WRONG
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Image, Ints

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH_IN, LOWEST_IN, HIGHEST_IN, TALLEST_IN = 9.0, 2.6, 7.0, 1.3
"""Width of the picture, range of the plan's height, and largest height of a panorama [inches]."""
DPI = 110
LABELLED = 80
"""Of more nodes than this, only those whose panoramas are shown have their ids on the plan."""
INSIDE = 3
"""Ids of so many letters fit into the mark of their node."""
ARROWS = 3000
"""Of more training views than this, so many are drawn."""
TICK_DEG = 45
"""Between the headings above a panorama [degrees]."""
MARK_SHARE, ARROW_SHARE = 0.3, 0.16
"""Lengths of the mark of a panorama's first column and of a view, as shares of the median distance of near nodes."""


def shown_nodes(topo_map: TopoMap, ids: Sequence[str], most: int) -> Ints:
    """Indices of the nodes whose panoramas are shown: those asked for, or the first ``most`` that have one.

    Raises:
        UnknownName: the map has no node of an id.
    """
    index = {node.id: i for i, node in enumerate(topo_map.nodes)}
    for wanted in ids:
        if wanted not in index:
            few = [node.id for node in topo_map.nodes[:12]]
            raise UnknownName("node of the map", wanted, few + ["..."] * (len(index) > len(few)))
    if ids:
        return np.array([index[wanted] for wanted in ids], dtype=np.int64)
    having = [i for i, node in enumerate(topo_map.nodes) if node.has_panorama]
    return np.array(having[:most], dtype=np.int64)


def draw_map(topo_map: TopoMap, shown: Ints) -> Figure:
    """The plan of a map, and the panoramas of the nodes at these indices, where they have one.

    Raises:
        InputError: a panorama that is shown cannot be read.
    """
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    circles = [(node, node.panorama) for node in (topo_map.nodes[i] for i in shown.tolist())]
    pictures = [(node, shrunk(panorama)) for node, panorama in circles if panorama is not None]
    strips = [min(0.86 * WIDTH_IN * image.shape[0] / image.shape[1], TALLEST_IN) + 0.34 for _, image in pictures]
    plan = _plan_height(topo_map)
    height = plan + sum(strips) + 0.3
    figure = Figure(figsize=(WIDTH_IN, height), layout=ConstrainedLayoutEngine(w_pad=0.12))
    grid = figure.add_gridspec(1 + len(strips), 1, height_ratios=[plan, *strips])
    draw_map_plan(figure.add_subplot(grid[0]), topo_map, shown)
    for row, (node, image) in enumerate(pictures, start=1):
        _draw_panorama(figure.add_subplot(grid[row]), node, image)
    return figure


def as_picture(figure: Figure, ending: str) -> bytes:
    """The figure as the bytes of a file of this ending (``.png``, ``.jpg``, ``.pdf``, ``.svg``)."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format=ending.removeprefix("."), dpi=DPI)
    return buffer.getvalue()


def draw_map_plan(axes: Axes, topo_map: TopoMap, shown: Ints) -> None:
    """Nodes, edges, free area, views and the first columns of the panoramas, seen from above.

    Args:
        axes: to draw into.
        topo_map: any.
        shown: indices of the nodes that are named even where there are too many names.
    """
    from matplotlib.collections import LineCollection, PolyCollection

    places = topo_map.positions
    if topo_map.free:
        axes.add_collection(PolyCollection([*topo_map.free], facecolor="#F2F2F2", edgecolor="#D8D8D8", zorder=0))
    joined = places[np.asarray(topo_map.edges)]
    label = "edge" if len(joined) else None
    axes.add_collection(LineCollection(list(joined), colors="#B0B0B0", linewidths=1.4, label=label, zorder=1))
    _draw_views(axes, topo_map)
    few = len(places) <= LABELLED
    having = np.array([node.has_panorama for node in topo_map.nodes])
    size = 150.0 if few else float(np.clip(3e4 / len(places), 2.0, 40.0))
    kinds = (having, "#F0E442", "node with a panorama"), (~having, "white", "node without a panorama")
    for chosen, colour, label in kinds:
        if chosen.any():
            x, y = places[chosen].T
            axes.scatter(
                x, y, s=size, c=colour, edgecolors="#444444", linewidths=0.8 if few else 0.2, label=label, zorder=4
            )
    _draw_first_columns(axes, topo_map, having, few)
    for i in range(len(places)) if few else shown.tolist():
        inside = few and len(topo_map.nodes[i].id) <= INSIDE
        at = {"va": "center"} if inside else {"va": "top", "xytext": (0, -7), "textcoords": "offset points"}
        axes.annotate(topo_map.nodes[i].id, places[i], fontsize=7, ha="center", zorder=6, **at)
    axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]", title=_title(topo_map))
    axes.grid(color="#EEEEEE", linewidth=0.6, zorder=-1)
    axes.set_axisbelow(True)
    axes.margins(0.08)
    axes.legend(fontsize=7, loc="upper center", bbox_to_anchor=(0.5, -0.1), ncols=5, frameon=False)


def _draw_views(axes: Axes, topo_map: TopoMap) -> None:
    """An arrow for each training view, or for evenly chosen ones."""
    if not topo_map.views:
        return
    chosen = np.unique(np.linspace(0, len(topo_map.views) - 1, min(ARROWS, len(topo_map.views))).round().astype(int))
    poses = np.array([topo_map.views[i].pose for i in chosen])
    length = ARROW_SHARE * _spacing(topo_map)
    along = length * np.column_stack([np.cos(poses[:, 2]), np.sin(poses[:, 2])])
    axes.quiver(
        *poses[:, :2].T,
        *along.T,
        angles="xy",
        scale_units="xy",
        scale=1.0,
        color=ESTIMATE,
        alpha=0.55,
        width=0.0016,
        zorder=3,
    )
    arrow: Any = {"marker": r"$\rightarrow$", "markersize": 11, "color": ESTIMATE, "linestyle": ""}
    axes.plot([], [], label="training view", **arrow)  # of a quiver the legend would show a box
    axes.update_datalim(poses[:, :2] + along)


def _draw_first_columns(axes: Axes, topo_map: TopoMap, having: np.ndarray, few: bool) -> None:
    """A mark on each node where its panorama begins."""
    from matplotlib.collections import LineCollection

    if not having.any():
        return
    headings = np.array([node.heading for node in topo_map.nodes])[having]
    start = topo_map.positions[having]
    end = start + MARK_SHARE * _spacing(topo_map) * np.column_stack([np.cos(headings), np.sin(headings)])
    lines = list(np.stack([start, end], axis=1))
    label = "left edge of the panorama"
    width = 1.6 if few else 0.5
    axes.add_collection(LineCollection(lines, colors=WRONG, linewidths=width, label=label, zorder=2))


def _draw_panorama(axes: Axes, node: Node, image: Image) -> None:
    """A panorama with its node on the left and map headings above."""
    axes.imshow(image, cmap="gray", vmin=0, vmax=255, aspect="equal", interpolation="antialiased")
    ticks, headings = heading_ticks(node.heading, image.shape[1])
    axes.set_xticks(ticks, [f"{degrees}°" for degrees in headings], fontsize=7)
    axes.set_yticks([])
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=3, pad=1)
    named = node.id if node.name in ("", node.id) else f"{node.id}\n{node.name[:14]}"
    axes.set_ylabel(named, rotation=0, ha="right", va="center", fontsize=8, labelpad=8)
    for side in axes.spines.values():
        side.set_visible(False)


def heading_ticks(heading: float, columns: int) -> tuple[Floats, list[int]]:
    """Where map headings lie along a panorama.

    Args:
        heading: of the left edge of its first column [rad].
        columns: of the panorama.

    Returns:
        Pixel coordinates (T,), whose whole numbers are the middles of columns, ascending, and headings (T,), degrees
        counter-clockwise, above -180 to 180.
    """
    degrees = np.arange(TICK_DEG - 180, 181, TICK_DEG)
    half_a_column = 180.0 / columns  # so that an edge that is hardly past a heading has it on the left, not right
    clockwise = np.mod(np.rad2deg(heading) - degrees + half_a_column, 360.0) - half_a_column
    order = np.argsort(clockwise)
    return clockwise[order] / 360.0 * columns - 0.5, degrees[order].tolist()


def shrunk(panorama: Image) -> Image:
    """A panorama as large as it is drawn."""
    import cv2

    rows, columns = panorama.shape[:2]
    wanted = round(WIDTH_IN * DPI)
    if columns <= wanted:
        return panorama
    scaled: Any = cv2.resize(panorama, (wanted, max(1, round(rows * wanted / columns))), interpolation=cv2.INTER_AREA)
    return np.asarray(scaled)


def _spacing(topo_map: TopoMap) -> float:
    """Median distance of near nodes [m]: what marks on the plan are measured by."""
    if len(topo_map.nodes) < 2:
        return 1.0
    from scipy.spatial import cKDTree

    near = cKDTree(topo_map.positions).query(topo_map.positions, k=2)[0][:, 1]
    return float(np.median(near)) or 1.0


def _plan_height(topo_map: TopoMap) -> float:
    """Of the plan, as its map is wide and high [inches]."""
    points = np.concatenate([topo_map.positions, *topo_map.free])
    width, height = np.maximum(np.ptp(points, axis=0), 0.5)
    return float(np.clip(0.6 * WIDTH_IN * height / width + 0.8, LOWEST_IN, HIGHEST_IN))


def _title(topo_map: TopoMap) -> str:
    panoramas = sum(node.has_panorama for node in topo_map.nodes)
    counts = f"{len(topo_map.nodes)} nodes, {len(np.asarray(topo_map.edges))} edges, {panoramas} panoramas"
    return f"{topo_map.name}: {counts}, {len(topo_map.views)} views"
