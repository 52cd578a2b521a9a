"""Second seed, 6.1: a standing robot turns its camera until it knows where it is (Figures 3 and 4)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from benchmarks.experiments.experiment import SECOND_SEED, Experiment, Measured, Quantity
from benchmarks.experiments.picture import OTHER, OURS, THESIS
from benchmarks.experiments.selections import ByLot, InTurn
from benchmarks.looks import SharedLooks
from benchmarks.worlds.office import CLEAR_M, OfficeSettings, OfficeWorld, clearance
from benchmarks.worlds.standing_robot import StandingRobot
from estimators.action import LeastEntropy
from estimators.auxiliary import AuxiliaryParticleFilter, AuxiliaryParticleFilterConfig
from sensors.pca import PCAMap, PCAMapConfig
from topoloc.active import Action, ActionSelection, ActiveLocalizer, pans, view_evidence
from topoloc.geometry import Floats
from topoloc.localizer import Localizer
from topoloc.odometry import OdometryNoise
from topoloc.topo_map import TopoMap

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

RUNS, POSITIONS = 10, 2
"""Published (6.1)."""


@dataclass(frozen=True)
class Method:
    """How the robot localizes.

    Attributes:
        sensor: settings of the appearance map.
        particles: of the auxiliary filter.
        noise: of a movement of the camera. With too little of it the few different particles that survive a look would
            stay where they are.
    """

    sensor: PCAMapConfig
    particles: int
    noise: OdometryNoise


AS_IN_THE_SEED = Method(
    PCAMapConfig(
        features=5,
        neighbours=10,
        weighting="rank",
        calibrated=False,
        sigma_m=OfficeWorld.plan.spacing_m / 2.0,
        kappa=15.0,
        log_floor=-3.0,
    ),
    particles=150,
    noise=OdometryNoise(base_distance=0.2, base_heading=0.15),
)
"""Features, neighbours and particles are published; kernels (half of the spacing wide), floor and noise are ours, of
seeds 1000 to 1002: with kernels as wide as the calibrated ones the robot is right less often."""
MORE = Method(
    replace(AS_IN_THE_SEED.sensor, features=20, weighting="match"),
    particles=2000,
    noise=OdometryNoise(base_distance=0.05, base_heading=0.04),
)
"""More of everything, and neighbours weighed by their match; chosen on the same seeds."""
LOOKS = 8
"""The first, and those after each of seven movements of the camera."""
MOVEMENTS = 3
"""After which the robot should know where it is."""
NEAR_M, OFF_THE_MAP_M = 0.5, 0.15
"""A test position is at most so far from one of the map, and at least so far from all of them."""
BY_ENTROPY, BY_LOT, IN_TURN = "least entropy", "by lot", "in turn"
IMPROVED = "least entropy, improved"
WAYS = {BY_ENTROPY: AS_IN_THE_SEED, BY_LOT: AS_IN_THE_SEED, IN_TURN: AS_IN_THE_SEED, IMPROVED: MORE}
"""To choose the next look, with the method."""
CONDITIONS = {"as mapped": OfficeSettings(), "two days old": OfficeSettings(age=1.0)}
CLUSTER_M = 1.0
"""Particles that are nearer than this to each other stand around one hypothesis."""


@dataclass(frozen=True)
class Looked:
    """What came of one run.

    Attributes:
        errors: (LOOKS,) distance of the estimate from the true position [m].
        right: (LOOKS,) whether the training point nearest to the estimate is that nearest to the truth.
        clouds: the particles (N, 2) after each look [m].
    """

    errors: Floats
    right: Floats
    clouds: list[Floats]


def measure(seed: int) -> Measured:
    """Ten runs from each of two positions, under each condition, for each way to choose the next look."""
    result: dict[str, dict[str, Any]] = {way: {} for way in WAYS}
    topo_map = OfficeWorld(OfficeSettings()).topo_map(seed)
    poses = hidden_poses(topo_map, seed)
    for condition, settings in CONDITIONS.items():
        world = OfficeWorld(settings)
        for way, method in WAYS.items():
            sensor = PCAMap(method.sensor)
            looks = SharedLooks(sensor, topo_map)
            entropy = LeastEntropy(view_evidence(topo_map, sensor, world.mount))
            selections: dict[str, ActionSelection] = {BY_ENTROPY: entropy, IMPROVED: entropy, IN_TURN: InTurn()}
            runs = []
            for number, pose in enumerate(poses):
                for run in range(RUNS):
                    chance = [seed, number, run]
                    selection = selections.get(way) or ByLot(np.random.default_rng([*chance, 1]))
                    robot = StandingRobot(world, seed, number, pose)
                    localizer = localizer_of(method, topo_map, looks, np.random.default_rng(chance))
                    runs.append(look_around(robot, localizer, selection))
            result[way] |= {f"{key} {condition}": value for key, value in _summary(runs).items()}
            if way == BY_ENTROPY and condition == "as mapped":
                result[way] |= _example(runs[0], poses[0], topo_map)
    return result


def hidden_poses(topo_map: TopoMap, seed: int) -> Floats:
    """True poses (POSITIONS, 3): near the map's positions, on none of them and clear of furniture, with any heading."""
    rng = np.random.default_rng([seed, 2])
    low, high = topo_map.positions.min(axis=0), topo_map.positions.max(axis=0)
    places = rng.uniform(low, high, (1000, 2))
    free = topo_map.is_free(places, NEAR_M) & (topo_map.distance_to_nearest(places) >= OFF_THE_MAP_M)
    free &= clearance(OfficeWorld.plan, places) >= CLEAR_M
    return np.column_stack([places[free][:POSITIONS], rng.uniform(-np.pi, np.pi, POSITIONS)])


def localizer_of(method: Method, topo_map: TopoMap, looks: SharedLooks, rng: np.random.Generator) -> Localizer:
    """A localizer that knows nothing yet, and goes on looking when it is sure."""
    estimator = AuxiliaryParticleFilter(AuxiliaryParticleFilterConfig(particles=method.particles))
    localizer = Localizer(topo_map, looks, estimator, rng=rng, noise=method.noise)
    localizer.rule = replace(localizer.rule, localized_above=np.inf)
    return localizer


def look_around(robot: StandingRobot, localizer: Localizer, selection: ActionSelection) -> Looked:
    """One run: the first look straight ahead, the others where the selection says, each direction once."""
    topo_map = localizer.topo_map
    active = ActiveLocalizer(localizer, selection, pans(camera=robot.mount))
    closest = topo_map.nearest_node(robot.truth[None, :2])
    errors, right, clouds, action = [], [], [], Action(np.zeros(3), robot.mount)
    for _ in range(LOOKS):
        place = active.step(robot.look(action)).pose[None, :2]
        errors.append(float(np.linalg.norm(place - robot.truth[:2])))
        right.append(bool((topo_map.nearest_node(place) == closest)[0]))
        clouds.append(localizer.estimator.belief.poses[:, :2])
        action = active.next_action() or action
    return Looked(np.array(errors), np.array(right), clouds)


def hypotheses(cloud: Floats) -> int:
    """How many groups of particles (N, 2) there are that stand farther than ``CLUSTER_M`` from each other.

    Groups of fewer than one in fifty are left out.
    """
    labels = fcluster(linkage(cloud, "single"), CLUSTER_M, "distance")
    return int(np.sum(np.bincount(labels) >= 0.02 * len(cloud)))


def _summary(runs: Sequence[Looked]) -> dict[str, Any]:
    """Means over the runs of a seed, by look."""
    errors, right = np.array([run.errors for run in runs]), np.array([run.right for run in runs])
    groups = np.array([[hypotheses(cloud) for cloud in run.clouds] for run in runs])
    found: dict[str, Any] = {"errors": errors.mean(axis=0).tolist(), "deviations": errors.std(axis=0).tolist()}
    for look in range(LOOKS):
        found |= {f"error {look}": float(errors[:, look].mean()), f"right {look}": float(right[:, look].mean())}
        found[f"near {look}"] = float(np.mean(errors[:, look] < OfficeWorld.plan.spacing_m))
        found[f"hypotheses {look}"] = float(groups[:, look].mean())
    return found


def _example(run: Looked, pose: Floats, topo_map: TopoMap) -> dict[str, Any]:
    """What the picture of a run shows."""
    clouds = [cloud.round(3).tolist() for cloud in run.clouds]
    return {"clouds": clouds, "truth": pose.round(3).tolist(), "points": topo_map.positions.round(3).tolist()}


def draw(measured: Sequence[Measured], figure: Figure) -> None:
    """Figure 3 above: error against movements; Figure 4 below: particles of one run after the first and later looks."""
    rows = figure.add_gridspec(2, 1, height_ratios=(1.3, 1.0))
    above, below = figure.add_subfigure(rows[0]), figure.add_subfigure(rows[1])
    for axes, condition in zip(above.subplots(1, len(CONDITIONS), sharey=True), CONDITIONS, strict=True):
        _draw_errors(axes, measured, condition)
    example = measured[0][BY_ENTROPY]
    for axes, look in zip(below.subplots(1, 2), (0, MOVEMENTS), strict=True):
        _draw_cloud(axes, example, look)


def _draw_errors(axes: Axes, measured: Sequence[Measured], condition: str) -> None:
    for way, colour in zip(WAYS, (OURS, THESIS, OTHER, "black"), strict=True):
        errors, deviations = (
            np.mean([one[way][f"{key} {condition}"] for one in measured], axis=0) for key in ("errors", "deviations")
        )
        if way == BY_ENTROPY:
            axes.fill_between(range(LOOKS), np.maximum(errors - deviations, 0.0), errors + deviations, color="0.9")
        axes.plot(range(LOOKS), errors, "o-", color=colour, ms=3, label=way)
    axes.set(xlabel="movements of the camera", ylim=(0, None))
    axes.set_title(condition, fontsize=9)
    if condition == next(iter(CONDITIONS)):
        axes.set_ylabel("error [m]")
        axes.legend(frameon=False, fontsize=8)


def _draw_cloud(axes: Axes, example: Mapping[str, Any], look: int) -> None:
    points, cloud = np.array(example["points"]), np.array(example["clouds"][look])
    axes.plot(*points.T, ".", color="0.8", ms=4)
    axes.plot(*cloud.T, ".", color=OURS, ms=3, alpha=0.5)
    axes.plot(*example["truth"][:2], "^", color="black", ms=7)
    (left, low), (right, high) = points.min(axis=0) - 0.75, points.max(axis=0) + 0.75
    axes.set(aspect="equal", xticks=[], yticks=[], xlim=(left, right), ylim=(low, high))
    axes.set_title(f"particles after {look} movements" if look else "particles after the first look", fontsize=9)


def _rows(condition: str) -> tuple[Quantity, ...]:
    where, mapped = "6.1, Figure 3", condition == "as mapped"
    errors = tuple(
        Quantity(f"error {look} {condition}", f"error after {look} movements, m, {condition}", "falls fast", where)
        for look in (0, 1, 2, 3, 5, 7)
    )
    published = "over 95 %" if mapped else "-"
    rights = tuple(
        Quantity(
            f"right {look} {condition}",
            f"right closest training point after {look} movements, {condition}",
            published if look == MOVEMENTS else "-",
            "6.1" if look == MOVEMENTS else "ours",
            2,
            True,
        )
        for look in (0, 1, 2, MOVEMENTS, 7)
    )
    groups = tuple(
        Quantity(
            f"hypotheses {look} {condition}",
            f"groups of particles after {look} movements, {condition}",
            ("several" if look == 0 else "one") if mapped else "-",
            "Figure 4" if mapped else "ours",
            1,
        )
        for look in (0, MOVEMENTS)
    )
    near = tuple(
        Quantity(
            f"near {look} {condition}",
            f"error below one spacing after {look} movements, {condition}",
            "-",
            "ours",
            2,
            True,
        )
        for look in (0, MOVEMENTS, 7)
    )
    return errors + rights + near + groups


EXPERIMENT = Experiment(
    name="active-vision",
    title="Active localization: where to look next",
    source="6.1, Figures 3 and 4",
    document=SECOND_SEED,
    about=(
        "A robot stands in the simulated office of 8 m x 2.5 m, mapped every 75 cm and 15 degrees (396 views), and "
        "turns its camera among 22 directions, each at most once: by the least expected entropy, by lot, or by 16 "
        "degrees on. As published: 5 features, 10 neighbours weighed by rank, 150 particles, ten runs from each of "
        "two hidden positions; here in ten worlds, as mapped and two days old. Ours: equalised pictures, the width "
        "of the neighbours' kernels (half the spacing), and noise of 0.2 m and 9 degrees a movement, without which "
        "few different particles survive a look. Improved: 20 features, neighbours weighed by their match, 2000 "
        "particles. The error is that of the leading mode; deviations in the picture are those of single runs. "
        "Error and number of hypotheses fall as published. As mapped the choice by entropy pays at the first "
        "movements, by a third of the error at the second beside any other direction, and more beside small turns; "
        "where things have moved it hardly does. That the nearest training point is the right one over 95 % of the "
        "time does not come out, with more of everything neither: with hidden positions anywhere between points 75 "
        "cm apart an error of 0.3 m misses it as often as not. The error is below one spacing in four of five "
        "runs."
    ),
    measure=measure,
    quantities=tuple(row for condition in CONDITIONS for row in _rows(condition)),
    draw=draw,
)
