"""Whether a map was built of the very recording that it is to be tried on (ours)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from topoloc.errors import InputError
from topoloc.geometry import Floats, between, compose, wrap
from topoloc.mapping.building.pasting import beginning
from topoloc.recording import Recording, Track
from topoloc.topo_map import Node, TopoMap, View
from topoloc.types import Image

MOST_VIEWS = 20
"""So many views, or panoramas, of a map are looked for, evenly picked."""
CANDIDATES = 2
"""A picture of the map is held against so many frames, those with the nearest poses."""
SAME_LEVELS = 0.5
"""Pictures are the same one where they differ by less than this on average: scaled pictures may be rounded [levels]."""
METRES_PER_RADIAN = 1.0
"""Weight of headings beside positions where the nearest pose is looked for."""
ITS_OWN = 0.1
"""A map of whose pictures a larger share are a recording's own was built of it; one may be alike by chance."""


def from_this_recording(topo_map: TopoMap, recording: Recording) -> float:
    """The share of the map's views, of some evenly picked, that are frames of a recording.

    A view is held against the frames with the nearest poses by truth and by odometry, scaled to its size. Where the
    map has no views, its panoramas are held against unwrapped ``omni`` pictures. Nothing is found where neither poses
    lead from one to the other, as in a map of ``--poses line``, nor where a map's only pictures are panoramas that
    were put together of frames.

    Args:
        topo_map: the map.
        recording: with truth or odometry; a picture that cannot be read is no view's.

    Returns:
        In [0, 1]; 0 where there is nothing to compare. Above ``ITS_OWN`` the map was built of the recording.

    Raises:
        InputError: a picture of the map cannot be read.
    """
    tracks = _tracks(recording)
    nodes = [node for node in topo_map.nodes if node.has_panorama]
    if topo_map.views and "rgb" in recording.pictures:
        some = [topo_map.views[i] for i in _evenly(len(topo_map.views))]
        found = [_is_frame(view, recording, tracks) for view in some]
    elif nodes and recording.panorama and "omni" in recording.pictures:
        found = [_is_omni(nodes[i], recording, tracks) for i in _evenly(len(nodes))]
    else:
        return 0.0
    return float(np.mean(found))


def _evenly(count: int) -> list[int]:
    """Indices of ``MOST_VIEWS`` of so many, or of all."""
    picked: list[int] = np.unique(np.linspace(0, count - 1, MOST_VIEWS).round().astype(int)).tolist()
    return picked


def _tracks(recording: Recording) -> list[tuple[Floats, Floats]]:
    """Poses (N, 3) of the robot and of its camera at each picture: by truth; by odometry, as it is, and from 0 on."""
    pictures = recording.pictures[recording.kind]
    mounts = np.array([recording.frame(picture).camera for picture in pictures])

    def poses(track: Track) -> Floats:
        return np.array([track.at(picture.time) for picture in pictures])

    robots = [] if recording.truth is None else [poses(recording.truth)]
    if recording.odometry is not None:
        told = poses(recording.odometry)
        robots += [told, between(told[0], told)]
    return [(robot, compose(robot, mounts)) for robot in robots]


def _is_frame(view: View, recording: Recording, tracks: list[tuple[Floats, Floats]]) -> bool:
    """Whether a view is one of the frames that were taken about where it was."""
    for _, cameras in tracks:
        turned = wrap(cameras[:, 2] - view.pose[2]) * METRES_PER_RADIAN
        apart = np.hypot(np.linalg.norm(cameras[:, :2] - view.pose[:2], axis=1), turned)
        if any(_same(view.image, image) for _, image in _nearest(recording, "rgb", apart)):
            return True
    return False


def _is_omni(node: Node, recording: Recording, tracks: list[tuple[Floats, Floats]]) -> bool:
    """Whether a node's panorama is one of the pictures that were taken about there, turned as a map's are."""
    assert node.panorama is not None  # or it would not have been picked
    columns = node.panorama.shape[1]
    for robots, cameras in tracks:
        apart = np.linalg.norm(robots[:, :2] - [node.x, node.y], axis=1)
        for frame, image in _nearest(recording, "omni", apart):
            shift, _ = beginning(columns, float(cameras[frame, 2]))
            if _same(np.roll(node.panorama, shift, axis=1), image):
                return True
    return False


def _nearest(recording: Recording, kind: str, apart: Floats) -> Iterator[tuple[int, Image]]:
    """Frames least apart, and their pictures; those that cannot be read are passed over."""
    pictures = recording.pictures[recording.kind]
    for frame in np.argsort(apart, kind="stable")[:CANDIDATES].tolist():
        try:
            image = recording.frame(pictures[frame]).images.get(kind)
        except InputError:
            continue
        if image is not None:
            yield frame, np.asarray(image)


def _same(ours: Image, theirs: Image) -> bool:
    """Whether two pictures are one, the second scaled to the first as map building scales."""
    import cv2

    if theirs.shape[:2] != ours.shape[:2]:
        theirs = np.asarray(cv2.resize(theirs, ours.shape[1::-1], interpolation=cv2.INTER_AREA))
    if theirs.shape != ours.shape:
        return False
    return bool(np.abs(theirs.astype(np.int16) - ours).mean() < SAME_LEVELS)
