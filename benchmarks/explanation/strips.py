"""The frame and the panoramas of an explanation, with the slots that IMA found on them.

Opacity goes with a slot's value, from 0.5, no correlation, to 1; those that count are outlined.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from benchmarks import replay
from topoloc.topo_map import Camera, Node
from topoloc.types import Pixels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

FILL, COUNTED, LEFT_OUT = "#F0E442", "#D55E00", "#FFFFFF"
"""Colours that colour-blind readers tell apart (Okabe and Ito)."""
MOST_OPAQUE, INSET = 0.45, 0.07
"""Of the fill at a value of 1; and how far an outline lies inside its slot, so that neighbours' are told apart."""
DRAWN_COLUMNS = 1600
"""Wider panoramas are drawn with fewer pixels; the figure has no more."""


def draw_frame(axes: Axes, picture: Pixels | None, slot_edges: list[float]) -> None:
    """The frame as the camera gave it.

    Args:
        axes: to draw into.
        picture: (rows, cols[, 3]); None where it could not be read.
        slot_edges: left edges of the slots and the right edge of the last, shares of the frame's width; or none.
    """
    axes.set(xticks=[], yticks=[])
    axes.set_title("what the camera sees", fontsize=9, loc="left")
    if picture is None:
        axes.text(0.5, 0.5, "no picture that can be read", ha="center", va="center", transform=axes.transAxes)
        return
    axes.imshow(picture, cmap="gray")
    width, height = picture.shape[1] - 0.5, picture.shape[0]
    for number, (left, right) in enumerate(pairwise(slot_edges), start=1):
        axes.axvline(right * width, color=FILL, linewidth=0.8)
        axes.text((left + right) / 2.0 * width, 0.05 * height, str(number), **_label(9))


def draw_strip(axes: Axes, node: Node, slots: replay.Slots | None, window: tuple[float, float] | None) -> None:
    """A node's panorama over its whole circle, degrees clockwise from its first column.

    Args:
        axes: to draw into.
        node: one with a panorama.
        slots: on it, or None.
        window: left edge and width of where the frame was found, shares of the circle; None: not known, or slots tell.
    """
    _draw_panorama(axes, node)
    axes.set(xlim=(0.0, 360.0), xticks=np.arange(0, 361, 45), yticks=[])
    axes.tick_params(labelsize=7)
    if slots is not None:
        _draw_slots(axes, slots, 6)
    elif window is not None:
        _draw_window(axes, *window)


def draw_cut(axes: Axes, node: Node, slots: replay.Slots | None, window: tuple[float, float] | None) -> None:
    """The part of a node's panorama where the frame was found, as large as the frame; arguments as ``draw_strip``."""
    _draw_panorama(axes, node)
    if slots is not None:
        _draw_slots(axes, slots, 8, values=True)
        window = (slots.left[0] - slots.width / 2.0, (len(slots.left) + 1) * slots.width)
    assert window is not None  # or there would be nothing to cut
    left = 360.0 * (window[0] % 1.0)
    axes.set(xlim=(left, left + 360.0 * window[1]), xticks=[], yticks=[])


def view_window(node: Node, heading: float, camera: Camera) -> tuple[float, float]:
    """Left edge and width of a camera's view on a node's panorama, shares of the circle: (2.2) the other way round.

    Args:
        node: of the panorama.
        heading: of the optical axis [rad].
        camera: of the map.
    """
    width = camera.hfov_deg / 360.0
    return float(((node.heading - heading) / (2.0 * np.pi) - width / 2.0) % 1.0), width


def mark_heading(axes: Axes, node: Node, heading: float, colour: str) -> None:
    """A triangle above a panorama where an optical axis with this heading [rad] points."""
    axes.plot(
        [np.rad2deg(node.heading - heading) % 360.0],
        [1.0],
        marker="v",
        color=colour,
        markersize=7,
        clip_on=False,
        transform=axes.get_xaxis_transform(),
        zorder=9,
    )


def _draw_panorama(axes: Axes, node: Node) -> None:
    """Twice, side by side, so that a window across its ends is whole."""
    assert node.panorama is not None  # or nobody would have asked for it
    step = max(1, node.panorama.shape[1] // DRAWN_COLUMNS)
    picture = node.panorama[::step, ::step]
    height = 360.0 * node.panorama.shape[0] / node.panorama.shape[1]
    for turn in (0.0, 360.0):
        axes.imshow(picture, extent=(turn, turn + 360.0, height, 0.0), cmap="gray")
    axes.set(ylim=(height, 0.0))


def _draw_slots(axes: Axes, slots: replay.Slots, size: float, values: bool = False) -> None:
    """Each slot, and again a turn further, with its number and, if asked for, its value."""
    from matplotlib.patches import Rectangle

    height = axes.get_ylim()[0]
    for number, (share, value, counted) in enumerate(zip(slots.left, slots.value, slots.counted, strict=True), start=1):
        opacity = MOST_OPAQUE * max(2.0 * value - 1.0, 0.0)
        edge, width = (COUNTED, size / 5.0) if counted else (LEFT_OUT, 0.5)
        for left in (360.0 * share - 360.0, 360.0 * share, 360.0 * share + 360.0):
            extent, inset = 360.0 * slots.width, 360.0 * slots.width * INSET
            axes.add_patch(Rectangle((left, 0.0), extent, height, facecolor=FILL, alpha=opacity, edgecolor="none"))
            inner = (left + inset, inset), extent - 2.0 * inset, height - 2.0 * inset
            axes.add_patch(Rectangle(*inner, fill=False, edgecolor=edge, linewidth=width))
            middle = left + extent / 2.0
            axes.text(middle, 0.1 * height, str(number), clip_on=True, **_label(size))
            if values:
                axes.text(middle, 0.9 * height, f"{value:.2f}".lstrip("0"), clip_on=True, **_label(size - 1))


def _draw_window(axes: Axes, left: float, width: float) -> None:
    from matplotlib.patches import Rectangle

    height = axes.get_ylim()[0]
    for start in (360.0 * left, 360.0 * left - 360.0):
        axes.add_patch(Rectangle((start, 0.0), 360.0 * width, height, fill=False, edgecolor=COUNTED, linewidth=2.0))


def _label(size: float) -> dict[str, Any]:
    """How numbers are written on a picture, so that they are read on light and on dark."""
    from matplotlib.patheffects import withStroke

    halo = [withStroke(linewidth=2.0, foreground="black")]
    return {"ha": "center", "va": "center", "fontsize": size, "color": "white", "path_effects": halo}
