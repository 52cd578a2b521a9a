"""A recording becomes a map: nodes along its way, panoramas where it turned, edges that it drove, views everywhere."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from topoloc.errors import UnreadableImage, UserError
from topoloc.geometry import Floats
from topoloc.mapping.building.camera import camera_of
from topoloc.mapping.building.circles import Circle, circle_of, is_flat
from topoloc.mapping.building.config import BuildConfig
from topoloc.mapping.building.frame_picture import FramePictures
from topoloc.mapping.building.notes import notes_on, pictures_of
from topoloc.mapping.building.omni import has_panoramas, panorama_at
from topoloc.mapping.building.places import edges_along, frames_between, turns_apart, views_apart
from topoloc.mapping.building.turns import Turn, turns_on_the_spot
from topoloc.mapping.building.way import Source, way_of
from topoloc.pictures import as_image
from topoloc.recording import Recording
from topoloc.topo_map import Node, TopoMap, View

Progress = Callable[[str, int, int], None]
"""What is being done, how many are done, of how many."""


@dataclass(frozen=True)
class Built:
    """A map, and what is to be told of how it came about.

    Attributes:
        topo_map: its pictures are read from the recording when they are asked for.
        source: of the poses.
        frames: that were used.
        length_m: of the way [m].
        turns: on the spot that were found, where panoramas are made of them.
        notes: on turns, a sentence each, or one where the same is wrong at most.
        left_out: frames that were not used, by reason.
        jumps: steps between frames too long to tell an edge.
    """

    topo_map: TopoMap
    source: Source
    frames: int
    length_m: float
    turns: int
    notes: tuple[str, ...]
    left_out: dict[str, int]
    jumps: int


@dataclass(frozen=True)
class _Place:
    """A node to be: the first frame there, where the robot stands (2,) [m], and a panorama."""

    frame: int
    position: Floats
    circle: Circle | None = None


def build_map(
    recording: Recording, config: BuildConfig | None = None, name: str = "map", progress: Progress | None = None
) -> Built:
    """Build a map from a recorded drive.

    Nodes stand where the robot turned on the spot and saw its circle, and else a spacing apart along the way; a place
    that is passed again is the same node if its poses say so. Odometry begins at the origin, and drifts: nothing is
    done about that.

    Args:
        recording: with ``rgb`` pictures or unwrapped ``omni`` ones.
        config: how.
        name: of the map.
        progress: is told how far it is.

    Raises:
        UserError: poses, the field of view or frames are missing, or do not suit each other.
    """
    return Builder(recording, config or BuildConfig(), progress or (lambda what, done, total: None)).build(name)


class Builder:
    """The steps of ``build_map``, whose arguments it has."""

    def __init__(self, recording: Recording, config: BuildConfig, progress: Progress) -> None:
        self._is_omni = has_panoramas(recording)
        self._config, self._progress = config, progress
        self._left_out: Counter[str] = Counter()
        self._way = way_of(recording, config.poses, config.speed_m_s, self._left_out)
        self._camera = camera_of(self._way, config)
        self._pictures = FramePictures(recording)
        self._looked: list[tuple[Turn, Circle | str]] = []

    def build(self, name: str) -> Built:
        """All steps, one after the other."""
        way, spacing = self._way, self._config.spacing_m
        nodes, found = self._nodes()
        positions = way.robot[:, :2]
        views = self._views()
        bare = TopoMap(name, self._camera, nodes, np.zeros((0, 2), dtype=np.int64))
        edges, jumps = edges_along(positions, bare.nearest_node(positions), spacing)
        baseline = way.recording.baseline_m if any(view.has_right for view in views) else None
        topo_map = TopoMap(name, self._camera, nodes, edges, (), views, baseline_m=baseline)
        notes = notes_on(self._looked, way, topo_map, spacing)
        left_out = {reason: count for reason, count in self._left_out.items() if count}
        return Built(topo_map, way.source, len(way.pictures), way.length_m, found, notes, left_out, jumps)

    def _nodes(self) -> tuple[tuple[Node, ...], int]:
        """The nodes in the order that the way comes to them, and how many turns there were."""
        turns = [] if self._is_omni else turns_on_the_spot(self._way.robot, self._way.cameras[:, 2], self._hfov)
        circles = self._circles(turns)
        taken = np.array([turn.position for turn, _ in circles]).reshape(-1, 2)
        places = [_Place(turn.first, turn.position, circle) for turn, circle in circles]
        if self._config.nodes == "all" or self._is_omni:
            between = frames_between(self._way.robot[:, :2], taken, self._config.spacing_m)
            places += [_Place(frame, self._way.robot[frame, :2]) for frame in between.tolist()]
        if not places:
            failed = [f"; {pictures_of(turn, self._way)}: {why}" for turn, why in self._looked if isinstance(why, str)]
            why = failed[0] if failed else ""
            raise UserError(
                f"{self._way.recording.folder}: no place has a panorama{why}; let the robot turn full circle at the "
                "nodes, or take --nodes all"
            )
        places.sort(key=lambda place: place.frame)
        return tuple(self._node(number, place) for number, place in enumerate(places)), len(turns)

    def _node(self, number: int, place: _Place) -> Node:
        circle, frame = place.circle, place.frame
        panorama, heading = (None, 0.0) if circle is None else (circle.image, circle.heading)
        if self._is_omni:
            scaled = self._config.view_size is not None
            panorama, heading = panorama_at(self._way, frame, self._camera, self._pictures, scaled)
        name = self._way.pictures[frame].path.stem
        return Node(f"N{number}", name, float(place.position[0]), float(place.position[1]), heading, panorama)

    @property
    def _hfov(self) -> float:
        return float(np.deg2rad(self._camera.hfov_deg))

    def _circles(self, turns: list[Turn]) -> list[tuple[Turn, Circle]]:
        """The turns that make a panorama, with it."""
        by = self._config.panoramas
        if by == "auto":
            by = "headings" if self._way.source == "truth" else "circle"
        made = []
        apart = turns_apart(turns, self._config.spacing_m)
        for done, turn in enumerate(apart, start=1):
            circle = circle_of(turn, self._way, self._camera, self._pictures, by)
            self._progress("making panoramas", done, len(apart))
            self._looked.append((turn, circle))
            if isinstance(circle, Circle):
                made.append((turn, circle))
        return made

    def _views(self) -> tuple[View, ...]:
        """Training views from frames that show something."""
        if self._way.recording.kind != "rgb":
            return ()
        config, total = self._config, len(self._way.pictures)

        def fits(frame: int) -> bool:
            self._progress("choosing views", frame + 1, total)
            return self._shows_something(frame)

        turn = float(np.deg2rad(config.view_turn_deg))
        chosen = views_apart(self._way.cameras, config.view_spacing_m, turn, fits)
        return tuple(self._view(frame) for frame in chosen.tolist())

    def _shows_something(self, frame: int) -> bool:
        try:
            flat = is_flat(self._pictures.read(self._way.pictures[frame], "rgb"))
        except UnreadableImage:
            self._left_out["the picture cannot be read"] += 1
            return False
        if flat:
            self._left_out["the picture is of one colour: a covered lens"] += 1
        return not flat

    def _view(self, frame: int) -> View:
        picture, size = self._way.pictures[frame], (self._camera.height, self._camera.width)
        has_right = "right" in self._way.recording.frame(picture).images and self._way.recording.baseline_m is not None
        kinds = ("rgb", "right") if has_right else ("rgb",)
        readers = [partial(self._pictures.read, picture, kind, size) for kind in kinds]
        lazy = [self._pictures.lazy(picture, kind, size, read) for kind, read in zip(kinds, readers, strict=True)]
        return View(self._way.cameras[frame], *map(as_image, lazy))
