"""Local features: keypoints of a frame found again on panoramas or views, and the heading that they vote for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sensors.images import camera_on_nodes, cut_views, grey
from sensors.keypoints import Detector, Keypoints, Kind, References, agreed
from sensors.neighbourhood import BASE_MATCH, NeighbourConfig, Neighbourhood
from topoloc.errors import UserError
from topoloc.geometry import Floats
from topoloc.topo_map import Node, TopoMap
from topoloc.types import Evidence, Frame, Image, Ints

CALIBRATION_CUTS = 24
"""About so many cuts from panoramas are looked for on all others in ``fit``, where the map has no views."""
QUERIES = 64
"""So many training views are looked for on all others in ``fit``."""


@dataclass(frozen=True)
class LocalFeaturesConfig(NeighbourConfig):
    """Settings of local features.

    Attributes:
        features: ``sift`` or ``orb``.
        keypoints: of a frame, at most, those of the strongest response.
        fewest: keypoints of a frame below which it says nothing.
        ratio: how near the nearest keypoint of a picture must be beside the second nearest (Lowe's ratio test).
        vote_deg: matches that agree on the heading to within this are counted [degrees].
        heading_votes: matches that have to agree for a heading to be known.
        blind_deviation: a picture whose grey levels deviate less says nothing: a covered lens [grey levels].
    """

    slope: float = 9.2
    margin: float = -0.164
    kappa: float = 50.0
    features: Kind = "sift"
    keypoints: int = 600
    fewest: int = 5
    ratio: float = 0.85
    vote_deg: float = 10.0
    heading_votes: int = 4
    blind_deviation: float = 6.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.features not in ("sift", "orb"):
            raise ValueError(f"features is {self.features!r}; it must be sift or orb")
        for name in ("keypoints", "fewest", "heading_votes"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        if not 0.0 < self.ratio <= 1.0:
            raise ValueError(f"ratio is {self.ratio}; it must be above 0 and at most 1")
        if not 0.0 < self.vote_deg <= 120.0:
            raise ValueError(f"vote_deg is {self.vote_deg}; it must be above 0 and at most 120")


class LocalFeatures:
    """Keypoints matched one by one, by a ratio test; the pictures on which most matches agree are the hypotheses.

    Each match votes for the heading at which the frame's keypoint would be seen where the map's picture has it. The
    distance of a frame with N keypoints from a picture on which n matches agree is log((N + 1) / (n + 1)) (ours): 0
    for the picture itself.

    Against training views a hypothesis stands where the view was taken, against panoramas on the node, with the
    agreed heading; panoramas are searched whole, not by cuts.
    """

    Config = LocalFeaturesConfig
    needs = frozenset({"rgb"})
    base_match = BASE_MATCH

    def __init__(self, config: LocalFeaturesConfig | None = None) -> None:
        self.config = config or LocalFeaturesConfig()
        self._detector = Detector(self.config.features, self.config.keypoints)
        self._references: References | None = None

    def fit(self, topo_map: TopoMap) -> None:
        """Keypoints of the map's views, or of its panoramas, and the scale of their distances.

        Raises:
            UserError: the map has neither.
        """
        self._hfov_deg = topo_map.camera.hfov_deg
        if topo_map.views:
            self._fit_views(topo_map)
            return
        nodes = [(node, node.panorama) for node in topo_map.nodes if node.panorama is not None]
        if not nodes:
            raise UserError(f"map {topo_map.name!r}: local needs training views or panoramas; add either")
        self._fit_panoramas(topo_map, nodes)

    def observe(self, frame: Frame) -> Evidence:
        """The pictures on which most matches agree; blind for a flat picture or one of too few keypoints."""
        if self._references is None:
            raise RuntimeError("LocalFeatures knows no map yet: call fit(topo_map) before observe(frame)")
        image = frame.images["rgb"]
        if float(grey(image).std()) < self.config.blind_deviation:
            return Evidence.blind()
        seen = self._detector.of_frame(image, self._hfov_deg)
        if len(seen) < self.config.fewest:
            return Evidence.blind()
        heading, votes = self._found(seen)
        distance = _distance(votes, len(seen))
        best = self._neighbourhood.nearest(distance)
        known = votes[best] >= self.config.heading_votes
        poses = self._camera_poses(best, np.where(known, heading[best], self._poses[best, 2]), frame.camera)
        evidence = self._neighbourhood.evidence(best * self._cuts, distance[best], poses)
        return replace(evidence, kappa=np.where(known, evidence.kappa, 0.0))

    def _fit_views(self, topo_map: TopoMap) -> None:
        seen = [self._detector.of_frame(view.image, self._hfov_deg) for view in topo_map.views]
        self._poses, self._cuts = np.array([view.pose for view in topo_map.views]), 1
        self._on_nodes = False
        self._references = self._prepared(seen, self._poses[:, 2])
        self._neighbourhood = Neighbourhood(
            topo_map,
            self._poses,
            lambda rows: self._distances([seen[row] for row in rows]),
            self.config,
            most_queries=QUERIES,
        )

    def _fit_panoramas(self, topo_map: TopoMap, nodes: Sequence[tuple[Node, Image]]) -> None:
        """Each panorama stands in the neighbourhood as some cuts, which are as far from a frame as the panorama is."""
        circles = [self._detector.of_circle(panorama, self._hfov_deg) for _, panorama in nodes]
        self._poses = np.array([(node.x, node.y, node.heading) for node, _ in nodes])
        self._on_nodes = True
        self._references = self._prepared(circles, self._poses[:, 2])
        cuts = [cut_views(panorama, node.heading, topo_map.camera) for node, panorama in nodes]
        step = max(1, len(cuts[0]) * len(nodes) // CALIBRATION_CUTS)
        self._cuts = len(cuts[0][::step])
        chosen = [cut for of_node in cuts for cut in of_node[::step]]
        poses = np.column_stack([np.repeat(self._poses[:, :2], self._cuts, axis=0), [axis for _, axis in chosen]])

        def between(rows: Ints) -> Floats:
            seen = [self._detector.of_frame(chosen[row][0], self._hfov_deg) for row in rows]
            return np.repeat(self._distances(seen), self._cuts, axis=1)

        self._neighbourhood = Neighbourhood(topo_map, poses, between, self.config, held_out_works=False)

    def _prepared(self, pictures: Sequence[Keypoints], headings: Floats) -> References:
        return References(pictures, headings, self.config.features, self.config.ratio)

    def _found(self, seen: Keypoints) -> tuple[Floats, Floats]:
        """The heading (V,) that most matches with each picture agree on [rad], and how many do (V,)."""
        assert self._references is not None
        return agreed(*self._references.matches(seen), np.deg2rad(self.config.vote_deg))

    def _distances(self, frames: Sequence[Keypoints]) -> Floats:
        """(Q, V) of frames from the map's pictures."""
        return np.stack([_distance(self._found(seen)[1], len(seen)) for seen in frames])

    def _camera_poses(self, chosen: Ints, headings: Floats, mount: Floats) -> Floats:
        positions = self._poses[chosen, :2]
        if self._on_nodes:  # the robot turned there for the panoramas, so that its axis stood on the node
            return camera_on_nodes(positions, headings, mount)
        return np.column_stack([positions, headings])


def _distance(votes: Floats, keypoints: int) -> Floats:
    """(V,) of a frame with so many keypoints from pictures on which ``votes`` (V,) of its matches agree."""
    return np.asarray(np.log((keypoints + 1.0) / (votes + 1.0)))
