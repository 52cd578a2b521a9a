"""What the README says of the simulated laboratory, over ten seeds: slow, and with tolerances that are stated."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from benchmarks.worlds import LabWorld, Simulation, WorldSettings
from estimators import ActivityTracker
from sensors import IMA
from topoloc import plugins
from topoloc.geometry import wrap
from topoloc.localizer import Localizer, Step
from topoloc.metrics import Run, evaluate

pytestmark = pytest.mark.slow
SEEDS = range(10)
KIDNAPPED_AT = 30


@cache
def drives(kidnapped: bool = False) -> list[tuple[Simulation, IMA]]:
    made = []
    for seed in SEEDS:
        drive = LabWorld(WorldSettings(updates=60, kidnap_at=KIDNAPPED_AT if kidnapped else -1)).simulate(seed)
        sensor = IMA()
        sensor.fit(drive.topo_map)
        made.append((drive, sensor))
    return made


def steps_of(drive: Simulation, sensor: IMA, estimator: str, seed: int) -> list[Step]:
    localizer = Localizer(drive.topo_map, sensor, plugins.make_estimator(estimator), rng=seed)
    steps = []
    for frame in drive.frames:
        localizer.step(frame)
        assert localizer.last is not None
        steps.append(localizer.last)
    return steps


@pytest.mark.parametrize("estimator", ["grid", "particle"])
def test_filters_are_right_in_97_percent_of_updates(estimator: str) -> None:
    rates = []
    for seed, (drive, sensor) in enumerate(drives()):
        run = Run.of(drive.topo_map, steps_of(drive, sensor, estimator, seed), drive.truth)
        accuracy = evaluate(run)["node_accuracy"]
        assert accuracy is not None
        rates.append(accuracy)
    assert np.mean(rates) > 0.97
    assert min(rates) > 0.9


@pytest.mark.parametrize("estimator", ["grid", "particle", "activity"])
def test_recovery_from_kidnapping_within_four_updates(estimator: str) -> None:
    """Counted from the first frame that is looked at: the covered ones do not open the gate. Nine seeds of ten."""
    recovered = 0
    for seed, (drive, sensor) in enumerate(drives(kidnapped=True)):
        steps = steps_of(drive, sensor, estimator, seed)
        run = Run.of(drive.topo_map, steps, drive.truth, (KIDNAPPED_AT,))
        needed = evaluate(run)["recovery_steps"]
        recovered += needed is not None and needed <= 4
    assert recovered >= 9


def test_winning_matches_are_near_the_published_mean() -> None:
    """Thesis 5.2.3: 0.733 with fresh panoramas; within 0.05."""
    winners = []
    for drive, sensor in drives():
        tracker = ActivityTracker()
        localizer = Localizer(drive.topo_map, sensor, tracker)
        for frame in drive.frames:
            localizer.step(frame)
            step = tracker.last
            assert step is not None
            if step.kind == "normal" and step.winner is not None:
                winners.append(step.destinations.match[step.winner])
    assert np.mean(winners) == pytest.approx(0.733, abs=0.05)


def test_headings_off_the_node_err_by_parallax_and_no_more() -> None:
    """Of the true node's panorama, 25 to 40 cm off it: 10 degrees in 85 %, 20 in 95 % (sketch 91 and 98)."""
    errors = []
    for drive, sensor in drives():
        for frame, pose in zip(drive.frames, drive.truth, strict=True):
            evidence = sensor.observe(frame)
            node = int(drive.topo_map.nearest_node(pose[None, :2])[0])
            errors.append(np.rad2deg(abs(float(wrap(evidence.poses[node, 2] - pose[2])))))
    assert np.mean(np.array(errors) < 10.0) > 0.85
    assert np.mean(np.array(errors) < 20.0) > 0.95
