"""Draws the pictures of the README: ``make pictures``. All worlds are simulated."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from benchmarks.worlds import LabWorld, Simulation, WorldSettings
from sensors.ima import IMA
from topoloc.files import write_bytes
from topoloc.geometry import Floats, wrap
from topoloc.localizer import Localizer, Step
from topoloc.plan import ESTIMATE, WRONG, dead_reckoning, draw_paths
from topoloc.plugins import make_estimator
from topoloc.types import Image

FOLDER = Path(__file__).parents[1] / "docs" / "pictures"
SEED, UPDATES, SHOWN = 0, 49, 35
"""The frame shown has a match about as good as the mean: neither a failure nor a lucky one."""


def first_run() -> Figure:
    """A frame, the panorama of the node it was matched to with the matched columns, and the plan of the drive."""
    drive = LabWorld(WorldSettings(updates=UPDATES)).simulate(SEED)
    sensor = IMA()
    localizer = Localizer(drive.topo_map, sensor, make_estimator("particle"), rng=SEED)
    steps = []
    for frame in drive.frames:
        localizer.step(frame)
        assert localizer.last is not None
        steps.append(localizer.last)
    figure = Figure(figsize=(9.0, 6.6), layout="constrained")
    grid = figure.add_gridspec(2, 2, height_ratios=(1.0, 3.2), width_ratios=(1.0, 1.25))
    _panorama(figure.add_subplot(grid[0, :]), drive, steps[SHOWN])
    _frame(figure.add_subplot(grid[1, 0]), drive.frames[SHOWN].images["rgb"], steps[SHOWN], drive)
    _plan(figure.add_subplot(grid[1, 1]), drive, steps)
    return figure


def _panorama(axes: Axes, drive: Simulation, step: Step) -> None:
    assert step.evidence is not None
    best = int(step.evidence.match.argmax())
    node = drive.topo_map.nodes[int(step.evidence.nodes[best])]
    assert node.panorama is not None
    height, width = node.panorama.shape[:2]
    axes.imshow(node.panorama[::2, ::2], extent=(0, width, height, 0))
    view = drive.topo_map.camera.width
    middle = (node.heading - step.evidence.poses[best, 2]) / (2.0 * np.pi) * width
    left = float(middle - view / 2.0) % width
    for start in (left, left - width):
        axes.add_patch(Rectangle((start, 0), view, height, fill=False, edgecolor=WRONG, linewidth=2.5))
    axes.set(xlim=(0, width), xticks=[], yticks=[])
    axes.set_title(f"panorama of node {node.id} in the map, and where the frame below fits best", fontsize=10)


def _frame(axes: Axes, image: Image, step: Step, drive: Simulation) -> None:
    axes.imshow(image)
    axes.set(xticks=[], yticks=[])
    for spine in axes.spines.values():
        spine.set(edgecolor=WRONG, linewidth=2.5)
    assert step.evidence is not None
    error = np.rad2deg(wrap(step.estimate.pose[2] - drive.truth[SHOWN, 2]))
    lines = [
        "what the camera sees",
        f"match {step.evidence.match.max():.2f}, heading {np.rad2deg(step.estimate.pose[2]):.0f}° ({error:+.0f}°)",
        f"{step.estimate.status.value}, node {drive.topo_map.nodes[step.estimate.node or 0].id}, "
        f"probability {step.estimate.probability:.2f}",
    ]
    axes.set_title("\n".join(lines), fontsize=10)


def _plan(axes: Axes, drive: Simulation, steps: list[Step]) -> None:
    raw = np.array([frame.odometry for frame in drive.frames])
    poses: Floats = np.array([step.estimate.pose for step in steps])
    draw_paths(axes, drive.topo_map, poses, drive.truth, dead_reckoning(raw, drive.truth[0]))
    axes.plot(*poses[SHOWN, :2], marker="o", markersize=12, markerfacecolor="none", markeredgecolor=ESTIMATE)
    axes.set_title("two laps of the simulated laboratory: IMA with particles", fontsize=10)


def main() -> None:
    """Draw every picture."""
    buffer = io.BytesIO()
    first_run().savefig(buffer, format="jpeg", dpi=100, pil_kwargs={"quality": 82})
    write_bytes(FOLDER / "first_run.jpg", buffer.getvalue())


if __name__ == "__main__":
    main()
