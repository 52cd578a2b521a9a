"""A map and a recording looked over together: whether one suits the other."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from topoloc.checks.distances import median_spacing
from topoloc.checks.field_of_view import Look, frame_findings, placed_on
from topoloc.checks.finding import Finding, Report
from topoloc.checks.of_recording import frames_apart
from topoloc.checks.poses_of_frames import pose_findings
from topoloc.checks.same_drive import ITS_OWN, from_this_recording
from topoloc.errors import InputError
from topoloc.geometry import compose
from topoloc.going_through import Track, in_silence
from topoloc.recording import Recording
from topoloc.topo_map import TopoMap

MOST_FRAMES = 30
"""So many frames of a recording are held against the map."""
FAR_FACTOR = 3.0
"""A robot is off the map where the nearest node is so many spacings of nodes away."""


def check_pair(topo_map: TopoMap, recording: Recording, track: Track = in_silence) -> Report:
    """Look whether a recording suits a map: its camera, the way round of its pictures, its truth's frame.

    Args:
        topo_map: the map.
        recording: whose lists were read.
        track: goes through numbers and may show how far it is.
    """
    summary = f"together: {min(MOST_FRAMES, len(recording))} frames held against the map"
    try:
        looks = _looks(topo_map, recording.on(topo_map.camera))
    except InputError as error:
        return Report(summary, (Finding(str(error.path), error.problem, error.remedy, "serious"),))
    where = str(recording.folder / f"{recording.kind}.txt")
    found = [*_off_the_map(topo_map, recording), *_its_own(topo_map, recording)]
    if recording.kind == "rgb":
        placed = placed_on(topo_map, looks, track)
        found += frame_findings(topo_map, placed, where)
        upright = [one for one in placed if one.way == "same"]
        found += pose_findings(topo_map, upright, str(recording.folder / "groundtruth.txt"))
    return Report(summary, tuple(found))


def _its_own(topo_map: TopoMap, recording: Recording) -> Iterator[Finding]:
    """A recording that the map was built of: its pictures are found perfectly, and tell nothing of others."""
    share = from_this_recording(topo_map, recording)
    if share > ITS_OWN:
        what = f"the map was built of this recording: {100.0 * share:.0f} % of its pictures looked at are frames of it"
        yield Finding(str(recording.folder), what, "localize another drive: figures of this one are too good", "note")


def _looks(topo_map: TopoMap, recording: Recording) -> list[Look]:
    """Some frames, with the poses of the camera where the truth is known."""
    looks = []
    for picture in frames_apart(recording, MOST_FRAMES):
        frame = recording.frame(picture)
        pose = None if recording.truth is None else compose(recording.truth.at(picture.time), frame.camera)
        looks.append(Look(np.asarray(frame.images[recording.kind]), pose))
    return looks


def _off_the_map(topo_map: TopoMap, recording: Recording) -> Iterator[Finding]:
    """A truth that lies beside the map: its frame is another one."""
    if recording.truth is None or len(topo_map.nodes) < 2:
        return
    poses = np.array([recording.truth.at(picture.time) for picture in recording.pictures[recording.kind]])
    spacing = median_spacing(topo_map)
    distance = float(np.median(topo_map.distance_to_nearest(poses[:, :2])))
    if distance > FAR_FACTOR * spacing:
        what = f"half of the true poses lie {distance:.1f} m or more from any node; nodes are {spacing:.1f} m apart"
        remedy = "bring truth and map into one frame: same origin, same x axis, metres"
        yield Finding(str(recording.folder / "groundtruth.txt"), what, remedy, "serious")
