"""Fits what sensors and estimators claim to what is so, on calibration worlds: ``python -m benchmarks.calibration``.

Printed are the sensors' scale from match to log-likelihood, and the estimators' rule from belief to probability;
both stand as defaults where they are used. No benchmark uses these seeds. A hypothesis counts as right when the
robot's true pose lies near it, a node as in the benchmark. Simulated worlds: a real building will differ.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import minimize
from scipy.special import i0e

from benchmarks.worlds import LabWorld, Simulation, WorldSettings
from sensors.calibration import Queries, likeliest_scale, log_density_of_cuts, spacing_of
from sensors.calibration import Scale as ViewScale
from sensors.ima import IMAConfig
from sensors.images import views_of
from topoloc import plugins
from topoloc.estimate import EstimateRule, agreement, node_masses, sureness
from topoloc.geometry import Floats, wrap
from topoloc.localizer import Localizer
from topoloc.metrics import RIGHT_WITHIN_M
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame

SEEDS = (1000, 1001, 1002, 1003)
"""Far from the benchmark's, which count from 0."""
NEAR_M, NEAR_DEG = 0.5, 25.0
"""A hypothesis is right within this distance of the truth [m]; its heading is, within this turn [degrees]."""
NEAR_ZOOMED_M = 0.8
"""The same for the node of a hypothesis that zoom may place off it [m]."""
VIEW_SENSORS = ("histogram", "pca", "local", "descriptor")
"""That compare with views cut from panoramas, where a map has no others."""
VIEWS_START = ViewScale(slope=5.0, level=0.0, sigma_m=0.6, kappa=20.0, log_floor=-1.5)
"""Where the fit begins. Width and sharpness are kept: fitted to single looks they are narrower (0.37 m and 60), and
then filters, for which looks are independent, are right less often (0.74 of the nodes in place of 0.80)."""
RULE_SENSORS = ("ima", "histogram")
"""Whose drives the estimators' rules are fitted on: one that matches panoramas and one that matches views."""
WORLDS = (
    WorldSettings(laps=2.0),
    WorldSettings(laps=2.0, people=0.35),
    WorldSettings(laps=2.0, age=1.0),
    WorldSettings(laps=2.0, kidnap_at=24),
)


@dataclass(frozen=True)
class Scale:
    """log-likelihood ratio = slope * (match - base - margin); ``base`` is the sensor's own zero."""

    slope: float
    margin: float
    right_share: float
    heading_sd_deg: float


@dataclass(frozen=True)
class Drive:
    """A drive with what a sensor, fitted to its map, saw on it."""

    world: WorldSettings
    simulation: Simulation
    evidence: dict[float, Evidence]
    sensor: Any


def watched(name: str, world: WorldSettings, seed: int) -> Drive:
    """A drive through the laboratory with what a sensor saw."""
    simulation = LabWorld(world).simulate(seed)
    sensor = plugins.make(plugins.SENSORS, name)
    sensor.fit(simulation.topo_map)
    seen = {frame.timestamp: sensor.observe(frame) for frame in simulation.frames}
    return Drive(world, simulation, seen, sensor)


def fit_scale(seen: Sequence[Drive]) -> Scale:
    """Logistic regression of a hypothesis being right on its match, the share of right ones taken out."""
    above, right, headings = [], [], []
    for drive in seen:
        for frame, pose in zip(drive.simulation.frames, drive.simulation.truth, strict=True):
            evidence = drive.evidence[frame.timestamp].of_robot(frame.camera)
            distance = np.linalg.norm(evidence.poses[:, :2] - pose[:2], axis=1)
            turn = np.rad2deg(wrap(evidence.poses[:, 2] - pose[2]))
            near = distance <= NEAR_M  # of the place: the likelihood has the heading averaged out
            above.append(evidence.match - drive.sensor.base_match)
            right.append(near)
            headings.append(turn[near & (np.abs(turn) <= NEAR_DEG)])
    match, hit = np.concatenate(above), np.concatenate(right)
    slope, intercept = logistic(np.column_stack([match, np.ones_like(match)]), hit)
    share = float(hit.mean())
    margin = (np.log(share / (1.0 - share)) - intercept) / slope
    return Scale(float(slope), float(margin), share, float(np.std(np.concatenate(headings))))


def fit_views(seen: Sequence[Drive]) -> ViewScale:
    """The scale of a sensor that compares with views cut from panoramas, as ``sensors/calibration.py`` fits it.

    The cuts stand equally dense around all nodes, and are taken to be so.
    """
    rows = []
    for drive in seen:
        for frame, pose in zip(drive.simulation.frames, drive.simulation.truth, strict=True):
            evidence = drive.evidence[frame.timestamp].of_robot(frame.camera)
            if not evidence.is_blind:
                apart = np.linalg.norm(evidence.poses[:, :2] - pose[:2], axis=1)
                rows.append((evidence.match - drive.sensor.base_match, apart, evidence.poses[:, 2] - pose[2]))
    topo_map = seen[0].simulation.topo_map
    score, apart, turn = (np.array(part) for part in zip(*rows, strict=True))
    density = log_density_of_cuts(views_of(topo_map).poses, VIEWS_START.sigma_m, VIEWS_START.kappa).mean()
    area = len(topo_map.nodes) * spacing_of(topo_map.positions) ** 2
    queries = Queries(score, np.full(score.shape, density), apart, turn)
    return likeliest_scale(queries, area, VIEWS_START, ("slope",))


def fit_heading(seen: Sequence[Drive], most: float) -> tuple[float, float]:
    """By maximum likelihood, how the heading's concentration falls with the match of hypotheses near the truth.

    kappa = most * exp(fall * min(match - base - margin, 0)).

    Returns:
        The fall and the margin.
    """
    above, turns = [], []
    for drive in seen:
        for frame, pose in zip(drive.simulation.frames, drive.simulation.truth, strict=True):
            evidence = drive.evidence[frame.timestamp].of_robot(frame.camera)
            near = np.linalg.norm(evidence.poses[:, :2] - pose[:2], axis=1) <= NEAR_M
            above.append(evidence.match[near] - drive.sensor.base_match)
            turns.append(evidence.poses[near, 2] - pose[2])
    match, turned = np.concatenate(above), np.cos(np.concatenate(turns)) - 1.0

    def loss(parameters: Floats) -> float:
        kappa = most * np.exp(parameters[0] * np.minimum(match - parameters[1], 0.0))
        return float(np.mean(np.log(i0e(kappa)) - kappa * turned))

    fall, margin = minimize(loss, np.array([10.0, 0.1]), method="Nelder-Mead").x
    return float(fall), float(margin)


@dataclass(frozen=True)
class PlaceScale:
    """How well the zoom that matches best tells the place: of hypotheses whose node and heading are right.

    Attributes:
        scene_factor: what ``scene_m`` is to be multiplied by, so that the places are right in the mean.
        along_sd_m, across_sd_m: of the places along and across the heading, about the truth, with that factor.
        parallax_deg_per_m: what a metre to the left of the node turns the matched heading, counter-clockwise.
    """

    scene_factor: float
    along_sd_m: float
    across_sd_m: float
    parallax_deg_per_m: float


def fit_place(seen: Sequence[Drive]) -> PlaceScale:
    """Least squares of the true displacement from the node along the heading on the one that the sensor tells."""
    told, along, across, turned = [], [], [], []
    for drive in seen:
        nodes = drive.simulation.topo_map.positions
        for frame, pose in zip(drive.simulation.frames, drive.simulation.truth, strict=True):
            evidence = drive.evidence[frame.timestamp].of_robot(frame.camera)
            off = pose[:2] - nodes[evidence.nodes]
            turn = np.rad2deg(wrap(evidence.poses[:, 2] - pose[2]))
            near = (np.linalg.norm(off, axis=1) <= NEAR_ZOOMED_M) & (np.abs(turn) <= NEAR_DEG)
            ahead, left = np.array([np.cos(pose[2]), np.sin(pose[2])]), np.array([-np.sin(pose[2]), np.cos(pose[2])])
            told.append((evidence.poses[near, :2] - nodes[evidence.nodes[near]]) @ ahead)
            along.append(off[near] @ ahead)
            across.append(off[near] @ left)
            turned.append(turn[near])
    said, is_along, is_across, turn = (np.concatenate(parts) for parts in (told, along, across, turned))
    factor = float(said @ is_along / max(float(said @ said), 1e-9))
    rest = is_along - factor * said
    parallax = float(is_across @ turn / (is_across @ is_across))
    return PlaceScale(factor, float(rest.std()), float(np.sqrt(np.mean(is_across**2))), parallax)


class Recalled:
    """A sensor that says again what was seen."""

    needs: frozenset[str] = frozenset()

    def __init__(self, drive: Drive) -> None:
        self._drive = drive

    def fit(self, topo_map: TopoMap) -> None:
        """Nothing to prepare."""

    def observe(self, frame: Frame) -> Evidence:
        """Evidence about the camera, as it was seen."""
        return self._drive.evidence[frame.timestamp]


def fit_rule(name: str, drives: Sequence[Drive]) -> EstimateRule:
    """Coefficients of an estimator's ``EstimateRule``: logistic regression of being right, over all drives."""
    features, right = [], []
    for seed, drive in enumerate(drives):
        the_map = drive.simulation.topo_map
        localizer = Localizer(the_map, Recalled(drive), plugins.make_estimator(name), rng=seed)
        for frame, pose in zip(drive.simulation.frames, drive.simulation.truth, strict=True):
            estimate = localizer.step(frame)
            if estimate.node is None:
                continue
            assert localizer.last is not None  # a step was just made
            mass = float(node_masses(localizer.estimator.belief, the_map).max())
            agreed = agreement(localizer.last.evidence, estimate.pose)
            features.append((1.0, sureness(mass), localizer.log_evidence, agreed))
            distance = np.linalg.norm(the_map.positions - pose[:2], axis=1)
            right.append(distance[estimate.node] <= distance.min() + RIGHT_WITHIN_M)
    clues = np.array(features)
    telling = clues.std(axis=0) > 1e-9  # the mass of one pose is always 1, and some estimators tell no evidence
    telling[0] = True
    coefficients = np.zeros(clues.shape[1])
    coefficients[telling] = logistic(clues[:, telling], np.array(right), ridge=1e-3)
    return EstimateRule(*(round(float(c), 2) for c in coefficients))


def logistic(features: Floats, right: np.ndarray, ridge: float = 0.0) -> Floats:
    """Coefficients (F,) of the logistic regression of ``right`` (N,) on features (N, F), slightly drawn to zero."""

    def loss(parameters: Floats) -> float:
        logits = features @ parameters
        return float(np.mean(np.logaddexp(0.0, np.where(right, -logits, logits))) + ridge * parameters @ parameters)

    return np.asarray(minimize(loss, np.zeros(features.shape[1]), method="BFGS").x)


def main() -> None:
    """Print the scale of each sensor, and the rule of each estimator."""
    drives = []
    for name in ("ima", "ima-robust", *VIEW_SENSORS):
        seen = [watched(name, world, seed) for world in WORLDS for seed in SEEDS]
        drives += seen if name in RULE_SENSORS else []
        if name in VIEW_SENSORS:
            views = fit_views(seen)
            print(f"{name}: margin {-views.level / views.slope:.3f}, {views}")
        scale = fit_scale(seen)
        print(
            f"{name}: slope {scale.slope:.1f}, margin {scale.margin:.3f} "
            f"({scale.right_share:.1%} of the hypotheses right, heading sd {scale.heading_sd_deg:.1f} degrees)"
        )
        if name not in VIEW_SENSORS:  # of a view heading and place are its own, whatever the match
            fall, margin = fit_heading(seen, IMAConfig().kappa)
            print(f"{name}: kappa_fall {fall:.1f}, sure_margin {margin:.3f}; {fit_place(seen)}")
    for name in plugins.names(plugins.ESTIMATORS):
        print(f"{name}: {fit_rule(name, drives)}")


if __name__ == "__main__":
    main()
