"""Contract checks that anybody can run on a sensor or an estimator of their own.

Each check raises ``AssertionError`` with a sentence that says which promise of ``topoloc.interfaces`` was broken.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from topoloc.estimate import estimate_from
from topoloc.geometry import Floats, compose, wrap
from topoloc.interfaces import Estimator, Sensor
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Frame, Image, Motion, Pixels, WeightedPoses

_CALM = Motion(np.array([0.5, 0.0, 0.1]), np.diag([0.01, 0.01, 0.004]))


def toy_map(columns: int = 3, rows: int = 2) -> TopoMap:
    """A grid of nodes one metre apart, without pictures."""
    nodes = [Node(f"{x}-{y}", f"node {x}-{y}", float(x), float(y)) for x in range(columns) for y in range(rows)]
    return TopoMap("toy", Camera(), tuple(nodes))


def evidence_for(
    topo_map: TopoMap,
    pose: Floats | Sequence[float],
    heading_known: bool = True,
    log_floor: float = -4.0,
) -> Evidence:
    """Evidence as a good sensor model would give it at a robot pose (3,): the nearer a node, the better its match."""
    robot = np.asarray(pose, dtype=np.float64)
    distance = np.linalg.norm(topo_map.positions - robot[:2], axis=1)
    count = len(topo_map.nodes)
    match = 0.4 + 0.5 * np.exp(-(distance**2) / 0.5)
    return Evidence(
        poses=np.column_stack([topo_map.positions, np.full(count, robot[2])]),
        nodes=np.arange(count),
        match=match,
        distance=1.0 - match,
        log_likelihoods=12.0 * (match - 0.6),
        sigma=np.full(count, 0.4),
        kappa=np.full(count, 20.0 if heading_known else 0.0),
        log_floor=log_floor,
    )


def check_estimator(make: Callable[[], Estimator], topo_map: TopoMap | None = None, seed: int = 0) -> None:
    """Run an estimator through what real runs bring.

    Args:
        make: builds a fresh estimator, the same each time.
        topo_map: the map to use; the toy map by default.
        seed: of the random numbers handed in.
    """
    the_map = topo_map or toy_map()
    estimator = make()
    lacking = [name for name in ("reset", "predict", "update", "belief") if not hasattr(type(estimator), name)]
    assert not lacking, f"the class lacks {', '.join(lacking)}"
    estimator.reset(the_map, np.random.default_rng(seed))
    _check_belief(estimator, the_map, "after reset")
    _check_blindness(estimator, the_map)
    _check_extremes(make, the_map, seed)
    _check_prior(make, the_map, seed)
    used = make()
    first, second = (_trace(used, the_map, seed) for _ in range(2))
    assert np.array_equal(first, second), "reset must forget everything, and the same seed give the same belief"
    permuted = _trace(make(), the_map, seed, order=-1)
    assert np.abs(permuted - first)[:, :2].max() < 0.35, "the order of hypotheses must not matter"
    _check_sense(make, the_map, seed)


def _check_sense(make: Callable[[], Estimator], topo_map: TopoMap, seed: int) -> None:
    """That it listens: to a prior, to a motion unless it has no memory, to evidence, and not to a blind frame."""
    corner = np.array([*topo_map.positions[-1], 1.0])
    estimator = make()
    estimator.reset(topo_map, np.random.default_rng(seed), WeightedPoses.uniform(corner[None]))
    start = estimate_from(estimator.belief, topo_map).pose
    assert np.linalg.norm(start[:2] - corner[:2]) < 0.35, "a prior of one pose must put the belief there"
    estimator.predict(Motion(np.array([-0.6, 0.0, 0.0]), np.diag([1e-4, 1e-4, 1e-4])))
    moved = estimate_from(estimator.belief, topo_map).pose
    away = min(np.linalg.norm(moved - goal) for goal in (start, compose(start, (-0.6, 0.0, 0.0))))
    assert away < 0.35, "predict must move the belief along its heading by the motion, or leave it where it is"
    estimator.update(Evidence.blind())
    after = estimate_from(estimator.belief, topo_map).pose
    assert np.linalg.norm(after - moved) < 0.2, "a blind frame must not move the belief"
    estimator.reset(topo_map, np.random.default_rng(seed))
    for _ in range(2):
        estimator.update(evidence_for(topo_map, corner))
    told = estimate_from(estimator.belief, topo_map)
    assert told.node == len(topo_map.nodes) - 1, "evidence for a node must make that node lead"


def _check_belief(estimator: Estimator, topo_map: TopoMap, when: str) -> None:
    belief = estimator.belief
    assert isinstance(belief, WeightedPoses), f"belief must be WeightedPoses {when}"
    assert np.isclose(belief.weights.sum(), 1.0), f"the belief must sum to one {when}"
    headings = belief.poses[:, 2]
    assert ((headings >= -np.pi) & (headings < np.pi)).all(), f"headings must lie in [-pi, pi) {when}"
    estimate = estimate_from(belief, topo_map)
    assert np.isfinite(estimate.pose).all() and np.isfinite(estimate.covariance).all(), f"no finite estimate {when}"


def _check_blindness(estimator: Estimator, topo_map: TopoMap) -> None:
    for _ in range(100):
        estimator.predict(_CALM)
        assert estimator.update(Evidence.blind()) is None, "update must return None for a blind frame"
    _check_belief(estimator, topo_map, "after a hundred blind steps")
    estimator.predict(Motion(np.zeros(3), np.zeros((3, 3))))
    _check_belief(estimator, topo_map, "after a motion without noise")


def _check_extremes(make: Callable[[], Estimator], topo_map: TopoMap, seed: int) -> None:
    good = evidence_for(topo_map, (0.0, 0.0, 0.5))
    far = replace(good, poses=good.poses + np.array([1e4, 0.0, 0.0]), log_floor=-np.inf)
    impossible = replace(good, log_likelihoods=np.full(len(good.poses), -np.inf), log_floor=-np.inf)
    cases = {
        "huge log-likelihoods": replace(good, log_likelihoods=good.log_likelihoods + 1e5),
        "tiny log-likelihoods": replace(good, log_likelihoods=good.log_likelihoods - 1e5),
        "hypotheses ten kilometres away": far,
        "a likelihood of zero everywhere": impossible,
        "an unknown heading": evidence_for(topo_map, (0.0, 0.0, 0.5), heading_known=False),
        "a heading known to a hair": replace(good, kappa=np.full(len(good.kappa), 1e6)),
    }
    for what, evidence in cases.items():
        estimator = make()
        estimator.reset(topo_map, np.random.default_rng(seed))
        for _ in range(3):
            estimator.predict(_CALM)
            log_evidence = estimator.update(evidence)
            assert log_evidence is None or not np.isnan(log_evidence), f"update returned NaN after {what}"
        _check_belief(estimator, topo_map, f"after {what}")


def _check_prior(make: Callable[[], Estimator], topo_map: TopoMap, seed: int) -> None:
    estimator = make()
    pose = np.array([*topo_map.positions[-1], 1.0])
    estimator.reset(topo_map, np.random.default_rng(seed), WeightedPoses.uniform(pose[None]))
    _check_belief(estimator, topo_map, "after reset with a prior")


def _trace(estimator: Estimator, topo_map: TopoMap, seed: int, order: int = 1) -> Floats:
    """Estimates along a short drive; ``order`` -1 hands the hypotheses over backwards."""
    estimator.reset(topo_map, np.random.default_rng(seed))
    poses = []
    for step in range(4):
        evidence = evidence_for(topo_map, (0.5 * step + 0.1, 0.0, 0.1 * step))
        estimator.update(_reordered(evidence, order))
        poses.append(estimate_from(estimator.belief, topo_map).pose)
        estimator.predict(_CALM)
    return np.array(poses)


def _reordered(evidence: Evidence, order: int) -> Evidence:
    names = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
    return replace(evidence, **{name: getattr(evidence, name)[::order] for name in names})


def check_sensor(sensor: Sensor, topo_map: TopoMap, frames: Sequence[Frame]) -> None:
    """Run a sensor over a map it can use and a few of its frames."""
    lacking = [name for name in ("needs", "fit", "observe") if not hasattr(type(sensor), name)]
    assert not lacking, f"the class lacks {', '.join(lacking)}"
    assert isinstance(sensor.needs, frozenset), "needs must be a frozenset of image kinds"
    assert len(frames) > 1, "hand in two frames or more that see something"
    sensor.fit(topo_map)
    seen = []
    for frame in frames:
        evidence, again = sensor.observe(frame), sensor.observe(frame)
        _check_evidence(evidence, topo_map)
        for part in ("poses", "nodes", "match", "log_likelihoods"):
            same = np.array_equal(getattr(evidence, part), getattr(again, part))
            assert same, f"the same frame must give the same evidence; {part} differ"
        seen.append(evidence)
    assert not any(evidence.is_blind for evidence in seen), "frames that see something must not be blind"
    different = any(not np.array_equal(seen[0].match, other.match) for other in seen[1:])
    assert different, "different frames must give different evidence"
    for colour in ((127, 127, 127), (200, 60, 40)):
        flat = {kind: _flat(image, colour) for kind, image in frames[0].images.items()}
        assert sensor.observe(replace(frames[0], images=flat)).is_blind, f"a flat picture of {colour} must be blind"
    if "rgb" in sensor.needs:
        grey: Image = np.ascontiguousarray(frames[0].images["rgb"].mean(axis=-1).astype(np.uint8))
        _check_evidence(sensor.observe(replace(frames[0], images={**frames[0].images, "rgb": grey})), topo_map)


def check_headings(sensor: Sensor, topo_map: TopoMap, frames: Sequence[Frame], truth: Floats) -> None:
    """That most frames' best match names the robot's heading, for a sensor that claims to know it.

    Args:
        sensor: any.
        topo_map: a map that it can use.
        frames: at least three, taken near the nodes.
        truth: (N, 3) poses of the robot.
    """
    sensor.fit(topo_map)
    errors = []
    for frame, pose in zip(frames, truth, strict=True):
        evidence = sensor.observe(frame).of_robot(frame.camera)
        best = int(evidence.match.argmax())
        if evidence.kappa[best] > 0.0:
            errors.append(abs(float(wrap(evidence.poses[best, 2] - pose[2]))))
    assert not errors or np.median(errors) < np.deg2rad(30.0), "headings are optical axes, counter-clockwise, map frame"


def _flat(image: Pixels, colour: tuple[int, int, int]) -> Pixels:
    plain = np.empty_like(image)
    plain[...] = colour if image.ndim == 3 else colour[0]
    return plain


def _check_evidence(evidence: Evidence, topo_map: TopoMap) -> None:
    if evidence.is_blind:
        return
    assert ((evidence.match >= 0.0) & (evidence.match <= 1.0)).all(), "match must lie in [0, 1]"
    assert ((evidence.nodes >= 0) & (evidence.nodes < len(topo_map.nodes))).all(), "nodes must index topo_map.nodes"
    assert (evidence.sigma > 0.0).all() and (evidence.kappa >= 0.0).all(), "sigma must be positive, kappa not negative"
    assert (evidence.distance >= 0.0).all(), "a distance must not be negative"
    values = evidence.log_likelihood(topo_map.positions, np.zeros((1, 1)))
    assert np.isfinite(values).all(), "the log-likelihood must be finite at every node"
