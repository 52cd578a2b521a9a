"""The views of a map as a sensor's neighbours: the nearest ones of a frame become hypotheses of its pose."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.spatial.distance import cdist

from sensors.calibration import (
    FEWEST_POSITIONS,
    MOST_QUERIES,
    Free,
    Scale,
    held_out,
    kappa_of,
    likeliest_scale,
    log_density,
    log_density_of_cuts,
    match_of,
    spacing_of,
    spread_out,
    wrong_distance,
)
from topoloc.errors import UserError
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
        count: J, views that become hypotheses.
        wrong: distance of a match of 0.5.
        scale: from score to log-likelihood.

    Raises:
        UserError: all views look the same.
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
        self.count = min(config.neighbours or len(poses), len(poses))
        rows = spread_out(len(poses), most_queries)
        between = distances(rows)
        if len(poses) > 1 and not between.any():
            raise UserError(f"map {topo_map.name!r}: all {len(poses)} views look the same to the sensor; check them")
        self.wrong = wrong_distance(between, cdist(poses[rows, :2], poses[:, :2]), self.nodes)
        fitted = self._fitted(topo_map, poses, (rows, between), with_heading) if held_out_works else None
        if fitted is None:
            density = log_density if held_out_works else log_density_of_cuts
            kappa = config.kappa if with_heading else 0.0
            fitted = self._plain(), density(poses, config.sigma_m, kappa)
        self.scale, self._log_density = fitted

    def _plain(self) -> Scale:
        """As the settings have it."""
        config = self.config
        slope, margin = (1.0, 0.0) if config.weighting == "rank" else (config.slope, config.margin)
        return Scale(slope, -slope * margin, config.sigma_m, config.kappa, config.log_floor)

    def _fitted(
        self, topo_map: TopoMap, poses: Floats, looks: tuple[Ints, Floats], with_heading: bool
    ) -> tuple[Scale, Floats] | None:
        """The scale from held-out views, and the log density (V,) that goes with it; None where that cannot be.

        Args:
            topo_map: theirs.
            poses: (V, 3) of the views.
            looks: indices (Q,) of views, and distances (Q, V) of their descriptors.
            with_heading: whether a view tells a heading.
        """
        places = np.unique(self.nodes)
        spacing = spacing_of(topo_map.positions[places])
        if not self.config.calibrated or len(places) < FEWEST_POSITIONS:
            return None
        held = held_out(poses, *looks, self._score, self.config.neighbours, spacing)
        if held is None:
            return None
        nearest, queries = held
        step = kappa_of(poses[:, 2], self.nodes) if with_heading else None
        kappa = step or self.config.kappa
        density = log_density(poses, spacing, kappa if with_heading else 0.0)
        free: list[Free] = ["sigma_m"]
        free += [] if self.config.weighting == "rank" else ["slope"]
        free += [] if step is None else ["kappa"]
        queries = replace(queries, log_density=density[nearest], turn=queries.turn if with_heading else None)
        start = replace(self._plain(), sigma_m=spacing, kappa=kappa)
        return likeliest_scale(queries, len(places) * spacing**2, start, free), density

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
            distance=distance / self.wrong,
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
