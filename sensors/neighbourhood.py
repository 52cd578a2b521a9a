"""The views of a map as a sensor's neighbours: the nearest ones of a frame become hypotheses of its pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from sensors.calibration import (
    MOST_QUERIES,
    Scale,
    held_out,
    kappa_of,
    likeliest_scale,
    log_density,
    match_of,
    spacing_of,
    spread_out,
    wrong_distance,
)
from topoloc.geometry import Floats
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Ints

Weighting = Literal["match", "rank"]
"""How neighbours are weighed: by their match, or by their rank alone, as in the second seed."""
BASE_MATCH = 0.5


@dataclass(frozen=True)
class NeighbourConfig:
    """Settings of sensors that compare a frame with the views of a map.

    Attributes:
        neighbours: J, views that become hypotheses, those of the smallest distance; 0: all.
        weighting: ``match``: the likelihood of a hypothesis goes with its match; ``rank``: with its rank among the
            neighbours, as in the second seed, however good the match.
        calibrated: whether the next five are fitted to the map's own views, true or false; a map of panoramas only,
            or of few views, takes them as they stand.
        slope: log-likelihood ratio per unit of match; this and the next from ``benchmarks/calibration.py``.
        margin: match above 0.5 at which the ratio is 1.
        sigma_m: how far around a view a match holds [m].
        kappa: concentration of the heading around a view's.
        log_floor: log-likelihood ratio that remains far from every hypothesis.
    """

    neighbours: int = 10
    weighting: Weighting = "match"
    calibrated: bool = True
    slope: float = 5.0
    margin: float = 0.0
    sigma_m: float = 0.6
    kappa: float = 20.0
    log_floor: float = -1.5

    def __post_init__(self) -> None:
        if self.neighbours < 0:
            raise ValueError(f"neighbours is {self.neighbours}; it must be at least 1, or 0 for all")
        if self.sigma_m <= 0.0 or self.kappa < 0.0:
            raise ValueError("sigma_m must be positive, and kappa not negative")


class Neighbourhood:
    """Views of a map, and what distances to their descriptors say of the pose.

    Args:
        topo_map: theirs.
        poses: (V, 3) where they were taken, V >= 1.
        distances: indices (Q,) of views -> distances (Q, V) of their descriptors to those of all.
        config: settings.
        held_out_works: views stand for themselves, so that they can be held out: no cuts from panoramas.
        with_heading: whether a hypothesis tells a heading; else kappa is that of the config, for what the sensor finds.
        most_queries: views that are compared with all others in order to find the scale; fewer where that is slow.

    Attributes:
        nodes: (V,) node of each view.
        wrong: distance of a match of 0.5.
        scale: from score to log-likelihood.
    """

    def __init__(
        self,
        topo_map: TopoMap,
        poses: Floats,
        distances: Callable[[Ints], Floats],
        config: NeighbourConfig,
        held_out_works: bool = True,
        with_heading: bool = True,
        most_queries: int = MOST_QUERIES,
    ) -> None:
        self.config = config
        self.nodes = topo_map.nearest_node(poses[:, :2])
        rows = spread_out(len(poses), most_queries)
        between = distances(rows)
        apart = np.linalg.norm(poses[rows, None, :2] - poses[None, :, :2], axis=2)
        self.wrong = wrong_distance(between, apart, self.nodes)
        self.scale = self._scale(poses, rows, between, held_out_works, with_heading)
        self._log_density = log_density(poses, self.scale.sigma_m, self.scale.kappa if with_heading else 0.0)

    def _scale(self, poses: Floats, rows: Ints, between: Floats, held_out_works: bool, with_heading: bool) -> Scale:
        """Fitted to the map where that works, else from the config."""
        config, by_rank = self.config, self.config.weighting == "rank"
        plain = Scale(
            1.0 if by_rank else config.slope,
            0.0 if by_rank else -config.slope * config.margin,
            config.sigma_m,
            config.kappa,
            config.log_floor,
        )
        queries = None
        if config.calibrated and held_out_works:
            queries = held_out(poses, rows, between, self._score, config.neighbours)
        if queries is None:
            return plain
        spacing = spacing_of(poses[:, :2])
        area = len(np.unique(np.round(poses[:, :2], 6), axis=0)) * spacing**2
        kappa = kappa_of(poses) if with_heading else config.kappa
        start = Scale(plain.slope, 0.0, spacing, kappa, config.log_floor)
        return likeliest_scale(queries, area, start, not by_rank, with_heading)

    def nearest(self, distance: Floats) -> Ints:
        """Indices (J,) of the views of the smallest distances (V,), nearest first."""
        count = self.config.neighbours or len(distance)
        if count < len(distance):
            some = np.argpartition(distance, count - 1)[:count]
            return np.asarray(some[np.lexsort((some, distance[some]))])
        return np.argsort(distance, kind="stable")

    def evidence(self, chosen: Ints, distance: Floats, poses: Floats, heading_known: bool = True) -> Evidence:
        """What the nearest views say.

        Args:
            chosen: (J,) indices of the views, nearest first.
            distance: (J,) of their descriptors.
            poses: (J, 3) of the camera as each of them has it.
            heading_known: whether they tell the heading.
        """
        count = len(chosen)
        ratio = self.scale.log_ratio(self._score(distance[None])[0])
        return Evidence(
            poses=poses,
            nodes=self.nodes[chosen],
            match=match_of(distance, self.wrong),
            distance=distance / max(self.wrong, np.finfo(float).tiny),
            log_likelihoods=ratio - self._log_density[chosen],
            sigma=np.full(count, self.scale.sigma_m),
            kappa=np.full(count, self.scale.kappa if heading_known else 0.0),
            log_floor=self.scale.log_floor,
        )

    def _score(self, distance: Floats) -> Floats:
        """(Q, J) of distances (Q, J), nearest first: the match above its base, or log lambda_j J of the second seed.

        lambda_j = 2 (J - j + 1) / (J^2 + J), falling weights that sum to one (EQUATIONS.md, 2; rebuilt).
        """
        if self.config.weighting == "match":
            return match_of(distance, self.wrong) - BASE_MATCH
        count = distance.shape[1]
        return np.broadcast_to(np.log(2.0 * np.arange(count, 0, -1) / (count + 1.0)), distance.shape)
