"""Pictures made ready for matching: grey, contrast, scale, zoom, and views cut from panoramas."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import cv2
import numpy as np

from sensors.lazy import Lazy
from topoloc.geometry import Floats, compose, wrap
from topoloc.pictures import held_in
from topoloc.topo_map import Camera, Node, TopoMap, View
from topoloc.types import Image, Ints

MOST_COLUMNS = 2048
"""That a sensor scales pictures to; more would fill memory, and tell nothing more of places."""
VIEW_STEP_DEG = 15.0
CUTS = round(360.0 / VIEW_STEP_DEG)
"""Where a map has no training views, so many are cut from each panorama, one every ``VIEW_STEP_DEG`` degrees."""


def grey(image: Image) -> Image:
    """Grey picture (rows, cols) of an RGB (rows, cols, 3) or grey one."""
    if image.ndim == 2:
        return image
    return _image(cv2.cvtColor(image, cv2.COLOR_RGB2GRAY))


def deviation(image: Image) -> float:
    """Standard deviation of a picture's grey levels: a covered lens has hardly any."""
    return float(cv2.meanStdDev(grey(image))[1].item())  # a fifth of the time of numpy's


def clahe(image: Image, clip_limit: float, tiles: int, hfov_deg: float | None = None) -> Image:
    """CLAHE (thesis 2.2.2) on a grey picture at full size.

    Args:
        image: (rows, cols).
        clip_limit: OpenCV's.
        tiles: along each side of a frame.
        hfov_deg: of a frame, when the picture is a full circle: its tiles then are as large as a frame's, and the
            circle is filtered without a seam.
    """
    if hfov_deg is None:
        return _image(cv2.createCLAHE(clip_limit, (tiles, tiles)).apply(image))
    columns = image.shape[1]
    margin = round(columns * hfov_deg / 360.0)
    circle = np.concatenate([image[:, -margin:], image, image[:, :margin]], axis=1)
    across = max(1, round(tiles * circle.shape[1] / margin))
    filtered = cv2.createCLAHE(clip_limit, (across, tiles)).apply(np.ascontiguousarray(circle))
    return _image(filtered[:, margin : margin + columns])


def equalised(image: Image) -> Image:
    """Histogram equalisation of a grey picture (second seed, 5)."""
    return _image(cv2.equalizeHist(image))


def gradient(image: Image) -> Image:
    """Size of the grey-level gradient (second seed, 6.2: "a gradient-based filter", which is not named; rebuilt).

    Sobel's operator of 3 x 3 pixels; a step from black to white gives 255.
    """
    across, down = (cv2.Sobel(image, cv2.CV_32F, *order, ksize=3, scale=0.25) for order in ((1, 0), (0, 1)))
    size = np.sqrt(across * across + down * down)  # exact, which cv2.magnitude is not: it differs by the array's place
    return _image(np.minimum(size, 255.0).round())


PREPROCESSING: dict[str, Callable[[Image], Image]] = {
    "plain": lambda image: image,
    "equalised": equalised,
    "gradient": gradient,
    "clahe": lambda image: clahe(image, 2.0, 8),
}
"""What may be done to a grey picture against changes of the light, by name."""


def resize(image: Image, columns: int, rows: int) -> Image:
    """Scale by averaging areas, which does not alias."""
    return _image(cv2.resize(image, (columns, rows), interpolation=cv2.INTER_AREA))


def crop_centre(image: Image, width_share: float, height_share: float) -> Image:
    """The middle of a picture: these shares of its columns and rows, the same whole pixels off either side."""
    rows, columns = image.shape[:2]
    left = round(columns * (1.0 - width_share) / 2.0)
    top = round(rows * (1.0 - height_share) / 2.0)
    return image[top : rows - top, left : columns - left]


@dataclass(frozen=True)
class Views:
    """What a view sensor trains on.

    Attributes:
        poses: (V, 3) where each was taken, heading = optical axis; the camera's for training views, and for cuts the
            node's position, on which the robot's axis stood.
        images: V of them, which come from the disk when they are asked for where the map's pictures do.
        on_nodes: they are cuts from panoramas.
    """

    poses: Floats
    images: Sequence[Image]
    on_nodes: bool

    def and_more(self, views: Sequence[View]) -> Views:
        """These and further training views."""
        poses = np.concatenate([self.poses, *(view.pose[None] for view in views)])
        images = Lazy(len(poses), partial(_image_of_either, self.images, views))
        return Views(poses, images, self.on_nodes)

    def camera_poses(self, chosen: Ints, mount: Floats) -> Floats:
        """Poses (N, 3) of the camera for the chosen views, of a camera at ``mount`` (3,) on the robot."""
        poses = self.poses[chosen]
        return camera_on_nodes(poses[:, :2], poses[:, 2], mount) if self.on_nodes else poses


def camera_on_nodes(positions: Floats, headings: Floats, mount: Floats) -> Floats:
    """Poses (N, 3) of a camera on a robot whose axis stands on nodes, as when it turned there for the panoramas.

    Args:
        positions: (N, 2) of the nodes [m].
        headings: (N,) of the optical axis [rad].
        mount: (3,) pose of the camera on the robot, pan included.
    """
    robot = np.column_stack([positions, wrap(headings - mount[2])])
    return compose(robot, mount)


def views_of(topo_map: TopoMap) -> Views:
    """The map's training views; where it has none, views cut from its panoramas every ``VIEW_STEP_DEG``.

    A cut is a window of the panorama as it stands, one frame wide; its columns are linear in angle, a frame's are not.
    """
    if topo_map.views:
        poses = np.array([view.pose for view in topo_map.views])
        return Views(poses, Lazy(len(poses), partial(_image_of_either, (), topo_map.views)), on_nodes=False)
    nodes = [node for node in topo_map.nodes if node.has_panorama]
    cuts = [(node.x, node.y, axis) for node in nodes for axis in _axes_on(node, topo_map.camera)]
    images = Lazy(len(cuts), partial(_cut_of, nodes, topo_map.camera))
    return Views(np.array(cuts).reshape(-1, 3), images, on_nodes=True)


def _image_of_either(known: Sequence[Image], views: Sequence[View], index: int) -> Image:
    """The picture of an index, counted through both."""
    return known[index] if index < len(known) else views[index - len(known)].image


def _axes_on(node: Node, camera: Camera) -> list[float]:
    """Headings of the cuts from a node's panorama, which is not decoded [rad]."""
    panorama = held_in(node, "panorama")
    assert panorama is not None  # such nodes were left out
    return [_axis(panorama.shape[1], node.heading, camera, step) for step in range(CUTS)]


def _cut_of(nodes: Sequence[Node], camera: Camera, index: int) -> Image:
    """The cut of an index, counted through all nodes."""
    return _cut(nodes[index // CUTS].panorama, camera, index % CUTS)


def cut_views(panorama: Image, heading: float, camera: Camera) -> list[tuple[Image, float]]:
    """Windows of a panorama, one frame wide, every ``VIEW_STEP_DEG``, with the heading of their middle [rad]."""
    axes = (_axis(panorama.shape[1], heading, camera, step) for step in range(CUTS))
    return [(_cut(panorama, camera, step), axis) for step, axis in enumerate(axes)]


def _cut(panorama: Any, camera: Camera, step: int) -> Image:
    """The window of a step."""
    left, width = _window(panorama.shape[1], camera, step)
    return _image(np.ascontiguousarray(panorama[:, np.arange(left, left + width) % panorama.shape[1]]))


def _axis(columns: int, heading: float, camera: Camera, step: int) -> float:
    """Heading of the middle of the window of a step, in a panorama of so many columns [rad]."""
    left, width = _window(columns, camera, step)
    return float(wrap(heading - (left + width / 2.0) * 2.0 * np.pi / columns))


def _window(columns: int, camera: Camera, step: int) -> tuple[int, int]:
    """First column and width of the window of a step, in a panorama of so many columns."""
    return round(step * VIEW_STEP_DEG / 360.0 * columns), round(columns * camera.hfov_deg / 360.0)


def _image(array: Any) -> Image:
    return np.asarray(array, dtype=np.uint8)
