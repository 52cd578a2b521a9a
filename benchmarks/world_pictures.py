"""Draws a picture of every simulated world for docs/worlds.md: plans, and four frames under each change."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from joblib import Parallel, delayed
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure, SubFigure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from threadpoolctl import threadpool_limits

from benchmarks.worlds.effects import SensorEffects
from benchmarks.worlds.world import World
from topoloc import plugins
from topoloc.files import write_bytes
from topoloc.plan import ODOMETRY, TRUTH, dead_reckoning
from topoloc.types import Frame, Pixels

FOLDER = Path(__file__).parents[1] / "docs" / "pictures"
SEED, FRAMES = 2, 60
SHOWN = (5, 20, 35, 50)
WIDTH_IN = 8.6
STACKED = 2.5
"""A world this many times as wide as it is high has its plans one above the other."""
AROUND_M = 4.5
"""How much of the world is shown around its nodes [m]."""
CHANGES: Mapping[str, Mapping[str, Any]] = {
    "as one finds it": {},
    "doors open": {"doors": 1.0},
    "two days later": {"age": 1.0},
    "people": {"people": 1.0},
    "bulbs": {"bulbs": 1.0},
    "daylight": {"daylight": 1.0},
    "camera covered now and then": {"covered_share": 0.5},
    "a worse camera": {
        "effects": SensorEffects(exposure_sd=0.15, noise_grey=9.0, glare=0.4, motion_blur_px=8.0, jpeg_quality=25)
    },
    "much at once": {"age": 1.0, "people": 0.6, "bulbs": 0.3, "daylight": 0.4, "doors": 0.95, "covered_share": 0.15},
}
"""What is shown of every world, by the name that stands beside it."""


def picture(name: str) -> Figure:
    """Plans and frames of the world of that name."""
    usual = plugins.load(plugins.WORLDS, name)
    start = usual.Config(updates=FRAMES)
    rows, columns = _main_picture(usual(start).film(SEED)[0][0]).shape[:2]
    changes = {name: words for name, words in CHANGES.items() if name != "doors open" or start.doors == 0.0}
    span = np.ptp(usual(start).positions, axis=0) + 2.0 * AROUND_M
    stacked = span[0] > STACKED * span[1]
    plans = 3.0 * (WIDTH_IN * span[1] / span[0] + 0.5) if stacked else WIDTH_IN / 3.0 * span[1] / span[0] + 0.6
    heights = (plans, len(changes) * (WIDTH_IN / len(SHOWN) * rows / columns + 0.22))
    figure = Figure((WIDTH_IN, sum(heights)), layout=ConstrainedLayoutEngine(w_pad=0.01, h_pad=0.01))
    parts = figure.add_gridspec(2, 1, height_ratios=heights)
    above, below = figure.add_subfigure(parts[0]), figure.add_subfigure(parts[1])
    _plans(above, usual, start, stacked)
    shown = _shown(usual, start)
    grid = below.subplots(len(changes), len(SHOWN))
    for axes, (change, settings) in zip(grid, changes.items(), strict=True):
        frames, _ = usual(replace(start, **settings)).film(SEED)
        _row(axes, change, [_main_picture(frames[number]) for number in shown])
    above.suptitle(f"{usual(start).title} (simulated): {len(usual(start).places)} nodes", fontsize=10)
    return figure


def _main_picture(frame: Frame) -> Pixels:
    return next(iter(frame.images.values()))


def _shown(usual: type[World], start: Any) -> list[int]:
    """Which frames are shown: one of them sees a door, where doors may be closed."""
    if start.doors > 0.0:
        return list(SHOWN)
    closed, opened = (usual(replace(start, doors=doors)).film(SEED)[0] for doors in (0.0, 1.0))
    change = [
        np.abs(_main_picture(a).astype(int) - _main_picture(b)).mean() for a, b in zip(closed, opened, strict=True)
    ]
    return sorted({*SHOWN[1:], int(np.argmax(change))})[: len(SHOWN)]


def _plans(figure: SubFigure, usual: type[World], start: Any, stacked: bool) -> None:
    """The tour, a random route, and a drive with a kidnapping and a turn by hand, side by side or stacked."""
    drives = {
        "the tour": replace(start, route=replace(start.route, random=False)),
        "a random route": replace(start, route=replace(start.route, random=True)),
        "carried on at o, turned by hand at x": replace(start, kidnap_at=FRAMES // 3, turned_at=2 * FRAMES // 3),
    }
    shape = (len(drives), 1) if stacked else (1, len(drives))
    for axes, (title, config) in zip(np.ravel(figure.subplots(*shape)), drives.items(), strict=True):
        _plan(axes, usual(config), title)


def _plan(axes: Axes, world: World, title: str) -> None:
    """Walls and furniture, nodes and edges, the path and what the odometer says of it."""
    layout, faces = world.layout(), world.scene(SEED, world.config.now()).faces
    upright = (faces.heights[:, 1] - faces.heights[:, 0] > 0.3) & (np.abs(faces.heights).max(axis=1) < 5.0)
    axes.add_collection(LineCollection(faces.ends[upright].reshape(-1, 2, 2), colors="#88AACC", linewidths=0.5))
    odometry, truth = world.drive(SEED)
    for a, b in np.asarray(layout.edges):
        axes.plot(*layout.positions[[a, b]].T, color="#DDDDDD", linewidth=0.8, zorder=1)
    many = len(layout.nodes) > 40
    axes.plot(*layout.positions.T, "s", markersize=2 if many else 7, color="#F0E442", zorder=2)
    for node in () if many else layout.nodes:
        axes.annotate(node.id, (node.x, node.y), ha="center", va="center", fontsize=5.5, zorder=5)
    axes.plot(*dead_reckoning(odometry, truth[0])[:, :2].T, ":", color=ODOMETRY, linewidth=1.0, label="dead reckoning")
    carried = world.config.kidnap_at
    for piece in np.split(truth, [carried] if carried > 0 else []):
        axes.plot(*piece[:, :2].T, color=TRUTH, linewidth=0.8)
    for event, mark in ((carried, "o"), (world.config.turned_at, "x")):
        if event > 0:
            axes.plot(*truth[event, :2], mark, color="#D55E00", markersize=5, zorder=6)
    axes.plot([], [], color=TRUTH, linewidth=0.8, label="path")
    axes.set_title(title, fontsize=8)
    axes.tick_params(labelsize=6)
    low, high = layout.positions.min(axis=0) - AROUND_M, layout.positions.max(axis=0) + AROUND_M
    axes.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    axes.legend(fontsize=5, loc="lower right")


def _row(axes: Sequence[Axes], change: str, images: Sequence[Pixels]) -> None:
    for place, image in zip(axes, images, strict=True):
        place.imshow(image)
        place.set(xticks=[], yticks=[])
    axes[0].set_title(change, fontsize=7, loc="left", pad=2)


def draw(name: str) -> None:
    """Write the picture of one world."""
    buffer = io.BytesIO()
    with threadpool_limits(1):
        picture(name).savefig(buffer, format="jpeg", dpi=90, pil_kwargs={"quality": 72})
    write_bytes(FOLDER / f"world_{name}.jpg", buffer.getvalue())


def main() -> None:
    """Draw every world."""
    Parallel(n_jobs=-1)(delayed(draw)(name) for name in plugins.names(plugins.WORLDS))


if __name__ == "__main__":
    main()
