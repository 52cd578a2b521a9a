"""An explanation as a picture: the frame, where it was found in the map, and the belief on the plan."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from benchmarks import replay
from benchmarks.explanation.explanation import Explanation
from benchmarks.explanation.plan import draw_plan_of
from benchmarks.explanation.rerun import Rerun
from benchmarks.explanation.strips import draw_cut, draw_frame, draw_strip, mark_heading, view_window
from benchmarks.explanation.tables import roles
from topoloc.errors import UserError
from topoloc.geometry import Floats, compose, wrap
from topoloc.plan import ESTIMATE, TRUTH
from topoloc.topo_map import View
from topoloc.types import Pixels

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure

WIDTH, TOP, TOP_WITHOUT_CUT, VIEWS, TITLE, CAPTION = 11.0, 5.4, 4.2, 3.0, 0.45, 0.3
"""Width of the figure, and heights: of its upper half, with what the frame was found on and without, of a row of
training views, of what is written above a panorama, and below all of them [inches]."""

PANORAMA_CAPTION = (
    "degrees clockwise from the panorama's first column; triangles: where the camera looks (black), "
    "and where this node's match has it look (blue)"
)


def draw_explanation(again: Rerun, told: Explanation) -> Figure:
    """The frame, the plan, and the panoramas, or training views, of the nodes that are looked at closely."""
    from matplotlib.figure import Figure

    nodes = [again.case.topo_map.nodes[node] for node in told.shown]
    circles = [node.panorama for node in nodes if node.panorama is not None]
    panoramas = len(circles) == len(nodes)
    heights = [TITLE + (WIDTH - 0.5) * circle.shape[0] / circle.shape[1] for circle in circles]
    above = TOP if circles and "rgb" in again.case.frames[again.number].images else TOP_WITHOUT_CUT
    below = (sum(heights) + CAPTION if panoramas else VIEWS) if nodes else 0.0
    figure = Figure(figsize=(WIDTH, above + below), layout="constrained")
    figure.suptitle(f"{told.title}\n{_summary(told)}", fontsize=11)
    if not nodes:
        _draw_top(figure, again, told)
        return figure
    top, bottom = figure.subfigures(2, 1, squeeze=False, height_ratios=(above, below))[:, 0]
    _draw_top(top, again, told)
    bottom.supxlabel(PANORAMA_CAPTION if panoramas else "", fontsize=8)
    draw, shape = (_draw_node, (len(nodes), 1)) if panoramas else (_draw_view, (1, len(nodes)))
    ratios = heights if panoramas else [VIEWS]
    for axes, node in zip(bottom.subplots(*shape, squeeze=False, height_ratios=ratios).flat, told.shown, strict=True):
        draw(axes, again, told, node)
    return figure


def _summary(told: Explanation) -> str:
    answer = told.answer
    named = f"names node {told.node_name(answer.node)}" if answer.node is not None else "names no node"
    verdict = told.verdict or "no look was taken"
    return (
        f"{named} (true: {told.node_name(told.true_node)}; {verdict}), "
        f"probability {answer.probability:.2f}, {answer.status}, {told.error_m:.2f} m and {told.error_deg:.0f}° off"
    )


def _draw_top(figure: Figure | SubFigure, again: Rerun, told: Explanation) -> None:
    """The frame, below it what of the map it was found on, and the plan beside them."""
    grid = figure.add_gridspec(2, 2, width_ratios=(1.0, 1.2))
    first = told.shown[0] if told.shown else None
    slots, window = (_slots_on(told, first), _window(again, told, first)) if first is not None else (None, None)
    cut = slots is not None or window is not None
    draw_frame(figure.add_subplot(grid[0, 0] if cut else grid[:, 0]), _picture(again), _slot_edges(again, slots))
    if first is not None and cut:
        below = figure.add_subplot(grid[1, 0])
        draw_cut(below, again.case.topo_map.nodes[first], slots, window)
        outlined = "; outlined slots count" if slots is not None else ""
        below.set_title(f"found on the panorama of node {told.nodes[first]}{outlined}", fontsize=9, loc="left")
    draw_plan_of(figure.add_subplot(grid[:, 1]), again, told.answer.belief)


def _picture(again: Rerun) -> Pixels | None:
    """The frame's main picture; None where it has none, or where that cannot be read."""
    images = again.case.frames[again.number].images
    kind = next((kind for kind in ("rgb", "omni") if kind in images), None)
    try:
        return None if kind is None else images[kind]
    except UserError:  # the localizer met it, too, and the table says so
        return None


def _slot_edges(again: Rerun, slots: replay.Slots | None) -> list[float]:
    """Of a frame that is not zoomed, shares of its width."""
    sensor = replay.ima_in(again.sensor)
    if slots is None or sensor is None:
        return []
    width = sensor.config.scale_columns // sensor.config.slots
    return [number * width / sensor.config.scale_columns for number in range(sensor.config.slots + 1)]


def _draw_node(axes: Axes, again: Rerun, told: Explanation, index: int) -> None:
    """The panorama of a node, where the frame was found on it, and where the camera looks and is believed to."""
    node, truth = again.case.topo_map.nodes[index], again.case.truth[again.number]
    draw_strip(axes, node, _slots_on(told, index), _window(again, told, index))
    believed = _camera_pose(again, told, index)
    for pose, colour in ((believed, ESTIMATE), (compose(truth, _mount(again)), TRUTH)):
        if pose is not None:
            mark_heading(axes, node, float(pose[2]), colour)
    axes.set_title(_node_title(told, index), fontsize=9, loc="left")


def _node_title(told: Explanation, index: int) -> str:
    hypothesis, slots = _hypothesis(told, index), _slots_on(told, index)
    parts = [f"node {told.nodes[index]}", roles(told, index)]
    parts += [f"match {hypothesis.match:.3f}, log-likelihood {hypothesis.log_likelihood:+.2f}"] if hypothesis else []
    parts += [f"slots that count: {sum(slots.counted)} of {len(slots.counted)}"] if slots else []
    return "; ".join(part for part in parts if part)


def _draw_view(axes: Axes, again: Rerun, told: Explanation, index: int) -> None:
    """The training view nearest to a node's hypothesis; where it has none, to the node with the true heading."""
    pose = _camera_pose(again, told, index)
    axes.set(xticks=[], yticks=[])
    axes.set_title(_node_title(told, index).replace("; ", "\n"), fontsize=9, loc="left")
    if not again.case.topo_map.views:
        axes.text(0.5, 0.5, "the map has no picture here", ha="center", va="center", transform=axes.transAxes)
        return
    if pose is None:
        node, truth = again.case.topo_map.nodes[index], compose(again.case.truth[again.number], _mount(again))
        pose = np.array([node.x, node.y, truth[2]])
    view = _nearest_view(again.case.topo_map.views, pose)
    axes.imshow(view.image, cmap="gray")
    x, y, heading = view.pose
    axes.set_xlabel(f"the map's view from {x:.2f}, {y:.2f} m, {np.rad2deg(heading):.0f}°", fontsize=8)


def _nearest_view(views: Sequence[View], pose: Floats) -> View:
    """The view nearest to a camera's pose (3,): a metre counts as much as a radian."""
    poses = np.array([view.pose for view in views])
    apart = np.column_stack([poses[:, :2] - pose[:2], wrap(poses[:, 2] - pose[2])])
    return views[int(np.linalg.norm(apart, axis=1).argmin())]


def _hypothesis(told: Explanation, node: int) -> replay.Hypothesis | None:
    hypotheses = told.look.hypotheses if told.look is not None else []
    return next((one for one in hypotheses if one.node == node), None)


def _slots_on(told: Explanation, node: int) -> replay.Slots | None:
    return next((one for one in told.look.slots if one.node == node), None) if told.look is not None else None


def _mount(again: Rerun) -> Floats:
    return again.case.frames[again.number].camera


def _camera_pose(again: Rerun, told: Explanation, node: int) -> Floats | None:
    """(3,) where the hypothesis of a node has the camera; None where there is none, or it tells no heading."""
    hypothesis = _hypothesis(told, node)
    if hypothesis is None or hypothesis.heading_deg is None:
        return None
    return compose((hypothesis.x, hypothesis.y, np.deg2rad(hypothesis.heading_deg)), _mount(again))


def _window(again: Rerun, told: Explanation, index: int) -> tuple[float, float] | None:
    """Where a frame lies on a node's panorama; None where that is not known, or the frame is a full circle itself."""
    node, pose = again.case.topo_map.nodes[index], _camera_pose(again, told, index)
    if pose is None or node.panorama is None or "rgb" not in again.case.frames[again.number].images:
        return None
    return view_window(node, float(pose[2]), again.case.topo_map.camera)
