"""Every sensor with every estimator, over the registry, in simulated worlds; and the contract of each."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np
import pytest

from benchmarks.worlds import LabWorld, Simulation, World, WorldSettings
from benchmarks.worlds.image_grid import ImageGridSettings, ImageGridWorld
from benchmarks.worlds.office import OfficeSettings, OfficeWorld
from topoloc import plugins
from topoloc.estimate import node_masses
from topoloc.localizer import Localizer
from topoloc.metrics import Run, evaluate
from topoloc.testing import check_estimator, check_headings, check_sensor, evidence_for, toy_map
from topoloc.types import Evidence, Frame, Motion

SENSORS, ESTIMATORS = plugins.names(plugins.SENSORS), plugins.names(plugins.ESTIMATORS)
UPDATES = 25


EVENTS: Any = {"updates": UPDATES, "covered": (8,)}
WORLDS: dict[frozenset[str], Callable[[], World]] = {
    frozenset({"rgb"}): lambda: LabWorld(WorldSettings(**EVENTS)),
    frozenset({"rgb", "right"}): lambda: OfficeWorld(OfficeSettings(**EVENTS, stereo_baseline_m=0.12)),
    frozenset({"omni"}): lambda: ImageGridWorld(ImageGridSettings(**EVENTS, grid="5x10")),
}
"""A world for each set of images that a sensor may need."""


@cache
def drive(needs: frozenset[str] = frozenset({"rgb"})) -> Simulation:
    return WORLDS[needs]().simulate(seed=5)


def drive_for(sensor: str) -> Simulation:
    return drive(plugins.make_sensor(sensor).needs)


class Remembering:
    """A sensor that looks at each frame once, so that the pairs share what it saw."""

    def __init__(self, name: str) -> None:
        self._sensor = plugins.make_sensor(name)
        self._sensor.fit(drive_for(name).topo_map)
        self._seen: dict[float, Evidence] = {}

    @property
    def needs(self) -> frozenset[str]:
        return self._sensor.needs

    def fit(self, topo_map: object) -> None:
        """Done already."""

    def observe(self, frame: Frame) -> Evidence:
        if frame.timestamp not in self._seen:
            self._seen[frame.timestamp] = self._sensor.observe(frame)
        return self._seen[frame.timestamp]


@cache
def shared(name: str) -> Remembering:
    return Remembering(name)


@pytest.mark.parametrize("estimator", ESTIMATORS)
@pytest.mark.parametrize("sensor", SENSORS)
def test_every_sensor_with_every_estimator(sensor: str, estimator: str) -> None:
    simulation = drive_for(sensor)
    localizer = Localizer(simulation.topo_map, shared(sensor), plugins.make_estimator(estimator), rng=1)
    steps = []
    for frame in simulation.frames:
        estimate = localizer.step(frame)
        assert np.isfinite(estimate.pose).all()
        assert np.linalg.eigvalsh(estimate.covariance).min() >= -1e-9
        assert 0.0 <= estimate.probability <= 1.0
        assert localizer.last is not None
        assert estimate is localizer.last.estimate
        steps.append(localizer.last)
    assert steps[8].kind == "blind"
    kinds = {step.kind for step in steps}
    assert {"update", "blind"} <= kinds <= {"update", "blind", "gated"}
    found = evaluate(Run.of(simulation.topo_map, steps, simulation.truth))
    accuracy = found["node_accuracy"]
    assert accuracy is not None
    if estimator != "dead-reckoning":  # which never recovers from a wrong start, so that nothing can be asked of it
        assert accuracy > 2.0 / len(simulation.topo_map.nodes), "no better than guessing"
    if sensor == "ima" and estimator in ("activity", "grid", "particle"):
        assert accuracy > 0.7


@pytest.mark.parametrize("name", ESTIMATORS)
def test_an_estimator_goes_to_another_process_as_it_is(name: str) -> None:
    topo_map = toy_map()
    estimator = plugins.make_estimator(name)
    estimator.reset(topo_map, np.random.default_rng(0))
    motion = Motion(np.array([0.3, 0.0, 0.1]), np.diag([0.05, 0.05, 0.05]) ** 2)
    estimator.update(evidence_for(topo_map, np.zeros(3)))
    estimator.predict(motion)
    there = pickle.loads(pickle.dumps(estimator))
    for one in (estimator, there):
        one.predict(motion)
        one.update(evidence_for(topo_map, np.array([0.6, 0.0, 0.2])))
    np.testing.assert_array_equal(there.belief.poses, estimator.belief.poses)
    np.testing.assert_array_equal(there.belief.weights, estimator.belief.weights)


@pytest.mark.parametrize("name", ESTIMATORS)
def test_estimators_keep_their_contract(name: str) -> None:
    check_estimator(lambda: plugins.make_estimator(name))


@pytest.mark.parametrize("name", SENSORS)
def test_sensors_keep_their_contract(name: str) -> None:
    simulation = drive_for(name)
    check_sensor(plugins.make_sensor(name), simulation.topo_map, simulation.frames[:3])
    check_headings(plugins.make_sensor(name), simulation.topo_map, simulation.frames[:8], simulation.truth[:8])


def test_the_same_seed_gives_the_same_run() -> None:
    traces = []
    for _ in range(2):
        localizer = Localizer(drive().topo_map, shared("ima"), plugins.make_estimator("particle"), rng=3)
        traces.append([localizer.step(frame).pose for frame in drive().frames])
    np.testing.assert_array_equal(traces[0], traces[1])


def test_grid_and_particles_say_the_same_of_a_real_sensor() -> None:
    """Two ways to hold one posterior: wherever both are sure they name the same node, and mostly they are."""
    nodes, sure = [], []
    for name in ("grid", "particle"):
        localizer = Localizer(drive().topo_map, shared("ima"), plugins.make_estimator(name), rng=2)
        named, certain = [], []
        for frame in drive().frames:
            named.append(localizer.step(frame).node)
            certain.append(node_masses(localizer.estimator.belief, drive().topo_map).max() > 0.8)
        nodes.append(named)
        sure.append(certain)
    both = np.array(sure[0]) & np.array(sure[1])
    assert both.mean() > 0.5
    assert (np.array(nodes[0])[both] == np.array(nodes[1])[both]).all()


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_without_a_map_says_what_to_call(name: str) -> None:
    with pytest.raises(RuntimeError, match="fit"):
        plugins.make_sensor(name).observe(drive_for(name).frames[0])
