"""Monte Carlo localization with the third seed's particle weights."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np
import pytest
from matplotlib.figure import Figure

from benchmarks.experiments.particle_weights import (
    ASSOCIATIONS,
    BEST,
    EXPERIMENT,
    GLOBAL,
    MAPPED,
    PARTICLES,
    TASKS,
    TRACKING,
    Drive,
    Settings,
    drives,
    localized,
    motions_between,
)
from benchmarks.experiments.signature_distance import FILTERED, PLACES, PLAIN
from estimators.weights import WEIGHTINGS
from topoloc.geometry import compose
from topoloc.testing import evidence_for, toy_map
from topoloc.types import Frame, Motion

SETTINGS = Settings(3, 0.4, 0.1)


@lru_cache(maxsize=1)
def by_hand() -> Drive:
    """A drive past a toy map's nodes, with good evidence and an honest odometer."""
    motion = Motion(np.array([0.3, 0.0, 0.12]), np.diag([1e-3, 1e-3, 4e-4]))
    truth = [np.array([0.1, 0.1, 0.0])]
    for _ in range(9):
        truth.append(compose(truth[-1], motion.delta))
    the_map = toy_map(4, 4)
    return Drive(the_map, 1.0, [evidence_for(the_map, pose) for pose in truth], [motion] * 9, np.array(truth))


def test_lengths_are_in_steps_of_the_grid() -> None:
    on = Settings(7, 0.5, 0.3, 12.0, 1.5).on(0.2)
    assert (on.neighbours, on.descriptor_sd, on.heading_sd_deg) == (7, 0.3, 12.0)
    assert (on.position_sd_m, on.reach_m) == pytest.approx((0.1, 0.3))


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("name", ["pw1", "pw3"])
def test_a_mixture_finds_and_keeps_the_robot(name: str, task: str) -> None:
    found = localized(by_hand(), name, SETTINGS, task, 1000, 0)
    assert found.position_m < 0.5
    assert found.heading_deg < 40.0
    assert found.update_ms > 0.0


def test_who_knows_the_start_errs_less_at_first_and_two_particles_find_nothing() -> None:
    drive = by_hand()
    known, unknown, few = (
        localized(drive, "pw1", SETTINGS, task, count, 0)
        for task, count in ((TRACKING, 1000), (GLOBAL, 1000), (GLOBAL, PARTICLES[0]))
    )
    assert known.position_m < unknown.position_m < few.position_m
    assert known.heading_deg < unknown.heading_deg


def test_a_run_is_the_same_again_and_another_seed_is_another_run() -> None:
    drive = by_hand()
    one, again, other = (localized(drive, "pw2", SETTINGS, GLOBAL, 200, seed).position_m for seed in (4, 4, 5))
    assert one == again != other


def test_motions_are_those_of_the_odometer() -> None:
    readings = [np.array([1.0, 2.0, 0.5]), np.array([1.3, 2.1, 0.6]), np.array([1.3, 2.1, 0.2])]
    motions = motions_between([Frame(float(k), pose, np.zeros(3), {}) for k, pose in enumerate(readings)])
    assert len(motions) == 2
    for motion, before, after in zip(motions, readings[:-1], readings[1:], strict=True):
        np.testing.assert_allclose(compose(before, motion.delta), after, atol=1e-12)


def test_each_weighting_has_settings_that_it_takes() -> None:
    assert set(BEST) == set(WEIGHTINGS)
    assert MAPPED == {"corridor": 50, "laboratory": 150}
    for settings in BEST.values():
        assert settings.on(0.3).neighbours <= min(MAPPED.values())


def test_every_curve_is_drawn() -> None:
    values = {
        f"{place} {task} {kind} {count}": 0.5
        for place in PLACES
        for task in TASKS
        for kind, counts in (("particles", PARTICLES), ("images", ASSOCIATIONS))
        for count in counts
        if kind == "particles" or count <= MAPPED[place]
    }
    figure = Figure()
    EXPERIMENT.draw([dict.fromkeys(WEIGHTINGS, values)], figure)
    assert len(figure.axes) == 2 * len(PLACES) * len(TASKS)
    assert all(len(axes.lines) == len(WEIGHTINGS) for axes in figure.axes)


@pytest.mark.slow
def test_mixtures_gain_by_particles_and_products_lose_by_associations() -> None:
    """The sentences of section 6 that came out, on one seed; the plan of the rows is kept by ``measure``."""
    measured = EXPERIMENT.measure(1003)
    for name in WEIGHTINGS:
        assert {quantity.key for quantity in EXPERIMENT.quantities} <= set(measured[name])
    for place in PLACES:
        for name in ("pw1", "pw3"):
            told = measured[name]
            assert told[f"{place} global particles 8000"] < 0.5 * told[f"{place} global particles 10"]
        for name in ("pw2", "pw4"):
            assert measured[name][f"{place} global worst to best"] > 5.0


@pytest.mark.slow
def test_more_associations_pull_a_product_to_the_middle_of_the_map() -> None:
    drive = drives("corridor", 1003)
    few, all_of_them = (
        localized(drive[FILTERED], "pw2", replace(BEST["pw2"], neighbours=count), GLOBAL, 500, 0) for count in (1, 50)
    )
    assert all_of_them.position_m > 3.0 * few.position_m
    assert set(drive) == {FILTERED, PLAIN}
