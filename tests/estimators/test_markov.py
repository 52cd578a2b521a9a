from __future__ import annotations

import math
import tracemalloc
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from estimators import markov, shifting, windows
from estimators.free_area import FreeArea
from estimators.likelihood_field import LikelihoodField
from estimators.markov import MarkovGrid
from topoloc.estimate import mean_and_covariance, node_masses
from topoloc.geometry import compose, rotate
from topoloc.testing import evidence_for, toy_map
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence, Motion, WeightedPoses

HALL = TopoMap(
    "hall", Camera(), (Node("0", "middle", 0.0, 0.0),), free=(np.array([[-4, -4], [4, -4], [4, 4], [-4, 4.0]]),)
)
EXACT = np.zeros((3, 3))


def grid_at(pose: tuple[float, float, float], topo_map: TopoMap = HALL, **settings: Any) -> MarkovGrid:
    grid = MarkovGrid(MarkovGrid.Config(**settings))
    grid.reset(topo_map, np.random.default_rng(0), WeightedPoses.uniform([pose]))
    return grid


def moments(grid: MarkovGrid) -> tuple[np.ndarray, np.ndarray]:
    """Mean and covariance of the belief, without the size of a cell."""
    return mean_and_covariance(grid.belief.poses, grid.belief.weights, np.zeros(3))


@pytest.mark.parametrize("heading_deg", [0.0, 90.0, 37.0, -141.0])
def test_many_small_motions_add_up(heading_deg: float) -> None:
    grid = grid_at((0.0, 0.0, np.deg2rad(heading_deg)))
    for _ in range(20):
        grid.predict(Motion(np.array([0.1, 0.0, 0.0]), EXACT))
    mean, _ = moments(grid)
    assert np.linalg.norm(mean[:2] - rotate([2.0, 0.0], np.deg2rad(heading_deg))) < 0.1


def test_motion_without_noise_does_not_blur() -> None:
    grid = grid_at((0.125, 0.125, 0.0))  # the middle of a cell
    for _ in range(20):
        grid.predict(Motion(np.array([0.09, 0.0, 0.31]), EXACT))
    pose = np.array([0.125, 0.125, 0.0])
    for _ in range(20):
        pose = compose(pose, [0.09, 0.0, 0.31])
    assert len(grid.belief.poses) == 1
    np.testing.assert_allclose(grid.belief.poses[0], pose, atol=1e-9)


def test_many_small_turns_add_up() -> None:
    grid = grid_at((0.0, 0.0, 0.0))
    for _ in range(20):
        grid.predict(Motion(np.array([0.0, 0.0, 0.05]), np.diag([0.0, 0.0, 0.01**2])))
    mean, covariance = moments(grid)
    assert abs(mean[2] - 1.0) < 0.05
    assert covariance[2, 2] == pytest.approx(20 * 0.01**2, rel=0.05)


@pytest.mark.parametrize("std", [0.02, 0.1, 0.17, 0.18, 0.3, 0.6])
def test_blur_has_the_variance_of_the_motion(std: float) -> None:
    grid = grid_at((0.125, 0.125, 0.0))
    grid.predict(Motion(np.zeros(3), np.diag([std**2, std**2, std**2])))
    _, covariance = moments(grid)
    np.testing.assert_allclose(covariance[:2, :2], np.diag([std**2, std**2]), rtol=0.03, atol=1e-9)
    # near the sampling limit of half a cell^2 the Gaussian's taps lack 0.5 %, and the circle a little at 0.6 rad
    assert covariance[2, 2] == pytest.approx(std**2, rel=0.03)


def test_blur_turns_with_the_robot() -> None:
    grid = grid_at((0.125, 0.125, np.pi / 2.0))
    grid.predict(Motion(np.zeros(3), np.diag([0.09, 0.01, 0.0])))
    _, covariance = moments(grid)
    np.testing.assert_allclose(covariance[:2, :2], np.diag([0.01, 0.09]), rtol=0.03, atol=1e-9)


def test_default_odometry_noise_gives_the_moments_of_a_simulation() -> None:
    # position and heading together: 15 steps of 0.2 m and 4 deg; both moments against 20,000 simulated drives
    motion = Motion(np.array([0.2, 0.0, 0.07]), np.diag([0.0008, 0.0008, 0.0004]))
    grid, rng = grid_at((-2.125, -1.125, 0.0)), np.random.default_rng(5)
    poses = np.tile([-2.125, -1.125, 0.0], (20_000, 1))
    for _ in range(15):
        grid.predict(motion)
        poses = compose(poses, motion.delta + rng.multivariate_normal(np.zeros(3), motion.covariance, len(poses)))
    mean, covariance = moments(grid)
    true_mean, true_covariance = mean_and_covariance(poses, np.ones(len(poses)), np.zeros(3))
    assert np.abs(mean - true_mean).max() < 0.03
    # mass that changes layers keeps its cell, which costs about a tenth of the variance here
    np.testing.assert_allclose(np.diag(covariance), np.diag(true_covariance), rtol=0.15)


def taps(variance: float) -> dict[int, float]:
    """Shares by lag: three with the variance below half a cell^2, else a sampled Gaussian up to four deviations."""
    if variance < 0.5:
        return {-1: variance / 2.0, 0: 1.0 - variance, 1: variance / 2.0}
    reach = math.ceil(4.0 * math.sqrt(variance))
    gauss = {lag: math.exp(-(lag**2) / (2.0 * variance)) for lag in range(-reach, reach + 1)}
    return {lag: share / sum(gauss.values()) for lag, share in gauss.items()}


def cell_by_cell(grid: MarkovGrid, motion: Motion) -> np.ndarray:
    """The mass (H, X, Y) that ``predict`` should give, each cell's carried on its own: shift, x, y, heading."""
    area, size, layers = grid._area, grid.config.resolution_m, len(grid._mass)
    turns = taps(motion.covariance[2, 2] / (2.0 * np.pi / layers) ** 2)
    mass = np.zeros_like(grid._mass)
    for layer, (heading, offset) in enumerate(zip(grid._headings, grid._offsets, strict=True)):
        turn = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
        shift = np.rint((offset + turn @ motion.delta[:2]) / size).astype(int)
        variances = np.diag(turn @ motion.covariance[:2, :2] @ turn.T) / size**2
        along_x, along_y = map(taps, variances)
        steps = [
            {(int(shift[0]), int(shift[1])): 1.0},
            {(lag, 0): share for lag, share in along_x.items()},
            {(0, lag): share for lag, share in along_y.items()},
        ]
        moved = {(i, j): float(grid._mass[layer, i, j]) for i, j in np.argwhere(grid._mass[layer])}
        for step in steps:
            moved = carried(area, moved, step)
        for (i, j), value in moved.items():
            for lag, share in turns.items():
                mass[(layer + lag) % layers, i, j] += share * value * area.free[i, j]
    return np.asarray(mass / mass.sum())


def carried(
    area: FreeArea, mass: dict[tuple[int, int], float], shares: dict[tuple[int, int], float]
) -> dict[tuple[int, int], float]:
    """Masses by cell after steps by shares; those that leave the grid or cross a wall are lost."""
    arrived: dict[tuple[int, int], float] = {}
    for (i, j), value in mass.items():
        for (columns, rows), share in shares.items():
            end = (i + columns, j + rows)
            inside = 0 <= end[0] < len(area.xs) and 0 <= end[1] < len(area.ys)
            if inside and (not area.has_walls or area.passage(columns, rows)[end]):
                arrived[end] = arrived.get(end, 0.0) + share * value
    return arrived


BACK_TO_BACK = TopoMap(
    "two corridors back to back, joined at one end",
    Camera(),
    tuple(Node(str(k), "", x, y) for k, (x, y) in enumerate([(0, 0.4), (2, 0.4), (0, -0.4), (2, -0.4), (4.5, 0)])),
    np.array([[0, 1], [2, 3], [1, 4], [3, 4]]),
)


@pytest.mark.parametrize("topo_map", [toy_map(), BACK_TO_BACK], ids=lambda topo_map: topo_map.name)
@pytest.mark.parametrize("noise", [(0.0, 0.0, 0.0), (0.1, 0.05, 0.1), (0.45, 0.45, 0.6)])
def test_predict_carries_each_cell_on_its_own(topo_map: TopoMap, noise: tuple[float, float, float]) -> None:
    grid = MarkovGrid(MarkovGrid.Config(headings=8))
    start = WeightedPoses(np.array([[0.1, 0.4, 0.3], [1.9, -0.3, -2.0]]), np.log([0.3, 0.7]), np.array([0.1, 0.1, 0.5]))
    grid.reset(topo_map, np.random.default_rng(0), start)
    for delta in ([0.31, 0.02, 0.2], [-0.4, 0.3, -1.0], [0.0, -0.1, 3.0]):
        motion = Motion(np.array(delta), np.diag(np.square(noise)))
        expected = cell_by_cell(grid, motion)
        grid.predict(motion)
        np.testing.assert_allclose(grid._mass, expected, atol=1e-15)


@pytest.mark.parametrize("few_cells", [0, 1000], ids=["lines", "products"])
@pytest.mark.parametrize("noise", [(0.0, 0.0, 0.0), (0.1, 0.05, 0.1), (0.45, 0.45, 0.3), (0.6, 0.6, 2.0)])
def test_both_ways_carry_each_cell_on_its_own(
    few_cells: int, noise: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shifting, "FEW_CELLS", few_cells)
    grid = MarkovGrid()
    start = WeightedPoses(np.array([[0.1, 0.4, 0.3], [1.9, -0.3, -2.0]]), np.log([0.3, 0.7]), np.array([0.1, 0.1, 0.1]))
    grid.reset(toy_map(), np.random.default_rng(0), start)
    motion = Motion(np.array([0.8, -0.3, 0.2]), np.diag(np.square(noise)))
    expected = cell_by_cell(grid, motion)
    grid.predict(motion)
    np.testing.assert_allclose(grid._mass, expected, atol=1e-15)


@pytest.mark.parametrize("noise", [(0.1, 0.05, 0.1), (0.45, 0.45, 0.3)])
@pytest.mark.parametrize("topo_map", [toy_map(), BACK_TO_BACK], ids=lambda topo_map: topo_map.name)
def test_tiles_carry_each_cell_on_its_own(
    topo_map: TopoMap, noise: tuple[float, float, float], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(shifting, "FEW_CELLS", 0)
    monkeypatch.setattr(windows, "TILE", 4)
    monkeypatch.setattr(shifting, "reachable", windows.tiles)
    grid = grid_at((0.6, 0.4, 0.3), topo_map, headings=8)
    for delta in ([0.8, -0.3, 0.2], [-0.4, 0.3, -1.0]):
        motion = Motion(np.array(delta), np.diag(np.square(noise)))
        expected = cell_by_cell(grid, motion)
        grid.predict(motion)
        np.testing.assert_allclose(grid._mass, expected, atol=1e-15)


def test_a_step_needs_little_memory_beside_the_belief() -> None:
    grid = grid_at((0.0, 0.0, 0.0), resolution_m=0.05)
    motion = Motion(np.array([0.2, 0.1, 0.1]), np.diag([0.01, 0.01, 0.01]))
    seen = evidence_for(HALL, (0.0, 0.0, 0.0))
    for step in (partial(grid.predict, motion), partial(grid.update, seen)):
        tracemalloc.start()
        step()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 0.5 * grid._mass.nbytes  # a few of its 24 layers


@pytest.mark.parametrize("variance", [25.0, 1e4, 1e8])
def test_enormous_noise_leaves_an_even_belief(variance: float) -> None:
    grid = grid_at((0.0, 0.0, 0.0), toy_map())
    grid.predict(Motion(np.zeros(3), np.diag([variance] * 3)))
    weights = grid.belief.weights
    assert weights.max() / weights.min() < 1.3


def test_mass_that_leaves_is_lost_and_the_rest_renormalised() -> None:
    two = WeightedPoses(np.array([[0.125, 0.125, 0.0], [2.125, 0.125, 0.0]]), np.log([0.3, 0.7]))
    grid = MarkovGrid()
    grid.reset(toy_map(), np.random.default_rng(0), two)
    grid.predict(Motion(np.array([1.5, 0.0, 0.0]), EXACT))
    np.testing.assert_allclose(grid.belief.poses, [[1.625, 0.125, 0.0]], atol=1e-9)
    assert grid.belief.weights.sum() == pytest.approx(1.0)


def test_where_all_mass_has_left_the_robot_may_be_anywhere() -> None:
    grid, fresh = grid_at((0.0, 0.0, 0.0), toy_map()), MarkovGrid()
    grid.predict(Motion(np.array([100.0, 0.0, 0.0]), EXACT))
    fresh.reset(toy_map(), np.random.default_rng(0))
    np.testing.assert_allclose(grid.belief.weights, fresh.belief.weights)


def test_update_is_bayes_rule() -> None:
    grid = grid_at((0.3, 0.2, 0.4), toy_map(), recovery=0.01)
    grid.predict(Motion(np.array([0.1, 0.1, 0.1]), np.diag([0.5, 0.5, 4.0])))
    before, evidence = grid.belief, evidence_for(toy_map(), (1.0, 0.0, 0.5))
    fresh = MarkovGrid()
    fresh.reset(toy_map(), np.random.default_rng(0))
    cells = len(fresh.belief.poses)
    assert len(before.poses) == cells  # every cell has a mass worth naming, so the belief is complete
    likelihood = np.exp(evidence.log_likelihood(before.poses[:, :2], before.poses[:, 2:])[:, 0])
    joint = (0.99 * before.weights + 0.01 / cells) * likelihood
    log_evidence = grid.update(evidence)
    assert log_evidence == pytest.approx(np.log(joint.sum()), abs=1e-9)
    after = grid.belief
    named = (before.poses[:, None] == after.poses).all(axis=2).any(axis=1)
    posterior = joint / joint.sum()
    np.testing.assert_allclose(after.weights, posterior[named] / posterior[named].sum(), atol=1e-12)
    assert posterior[~named].sum() < 1e-3


def joint(grid: MarkovGrid, evidence: Evidence) -> np.ndarray:
    """(H, X, Y) P(v | s) P'(s) of every cell that is free, by (3.11) as it stands, with recovery."""
    area, layers = grid._area, len(grid._mass)
    recovery, products = grid.config.recovery, np.zeros_like(grid._mass)
    for layer, column, row in zip(*np.nonzero(np.broadcast_to(area.free, products.shape)), strict=True):
        place = np.array([[area.xs[column], area.ys[row]]]) + grid._offsets[layer]
        likelihood = np.exp(evidence.log_likelihood(place, [[grid._headings[layer]]]))[0, 0]
        predicted = (1.0 - recovery) * grid._mass[layer, column, row] + recovery / (layers * area.free.sum())
        products[layer, column, row] = likelihood * predicted
    return products


@pytest.mark.parametrize("log_floor", [-4.0, -200.0, -np.inf])
@pytest.mark.parametrize("tile", [3, 1000])
@pytest.mark.parametrize("recovery", [0.0, 0.02])
def test_update_multiplies_cell_by_cell(
    log_floor: float, tile: int, recovery: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(windows, "TILE", tile)
    monkeypatch.setattr(markov, "MANY", 0)
    monkeypatch.setattr(markov, "CACHED", 200)  # some layers at a time
    grid = grid_at((0.3, 0.2, 0.4), toy_map(), headings=8, recovery=recovery)
    grid.predict(Motion(np.array([0.1, 0.1, 0.1]), np.diag([0.5, 0.5, 4.0])))
    evidence = replace(evidence_for(toy_map(), (1.0, 0.0, 0.5), log_floor=log_floor), sigma=np.full(6, 0.05))
    expected = joint(grid, evidence)
    log_evidence = grid.update(evidence)
    assert log_evidence == pytest.approx(np.log(expected.sum()), abs=1e-11)
    np.testing.assert_allclose(grid._mass, expected / expected.sum(), rtol=1e-11, atol=1e-15)


@pytest.mark.parametrize("kappa", [0.0, 4.0, 1e6])
def test_field_is_the_likelihood_of_the_evidence(kappa: float) -> None:
    rng = np.random.default_rng(3)
    poses = rng.uniform([0.0, 0.0, -np.pi], [60.0, 60.0, np.pi], (300, 3))
    some = evidence_for(toy_map(), (0.0, 0.0, 0.0))
    chosen = rng.integers(6, size=300)
    parts = {name: getattr(some, name)[chosen] for name in ("nodes", "match", "distance")}
    evidence = Evidence(
        poses,
        **parts,
        log_likelihoods=rng.normal(0.0, 2.0, 300),
        sigma=rng.uniform(0.2, 1.0, 300),
        kappa=np.full(300, kappa),
        log_floor=-1.5,
    )
    field = LikelihoodField.of(evidence)
    assert field is not None
    xs, ys, heading = np.arange(20.0, 24.0, 0.25), np.arange(30.0, 33.0, 0.25), np.array([0.4])
    near = field.near(xs, ys, 0.0)
    assert 0 < len(near.weights) < 60
    expected = [[evidence.log_likelihood([[x, y]], [heading])[0, 0] for y in ys] for x in xs]
    log_values = np.log(near.at(xs[None], ys[None], heading)[0]) + near.log_unit
    np.testing.assert_allclose(log_values, expected, atol=1e-11)


def test_windows_leave_out_what_cannot_be_reached() -> None:
    side = windows.TILE
    free = np.zeros((3 * side, 2 * side + 5), dtype=bool)
    free[:side, 7] = free[-1, -1] = True
    some = windows.reachable(free)
    assert len(some) == 2
    assert sum(free[window].sum() for window in some) == free.sum()
    full = np.ones_like(free)
    assert windows.reachable(full) == windows.whole(full)
    assert sum(full[window].size for window in windows.tiles(full)) == full.size


def test_impossible_evidence_leaves_the_belief_as_predicted() -> None:
    grid = grid_at((0.3, 0.2, 0.4), toy_map())
    before, good = grid.belief, evidence_for(toy_map(), (1.0, 0.0, 0.5), log_floor=-np.inf)
    assert grid.update(replace(good, log_likelihoods=np.full(len(good.poses), -np.inf))) == -np.inf
    assert np.array_equal(grid.belief.log_weights, before.log_weights)


@pytest.mark.parametrize("shift", [1e6, -1e6])
def test_only_differences_of_log_likelihoods_shape_the_belief(shift: float) -> None:
    plain, shifted = grid_at((0.3, 0.2, 0.4), toy_map()), grid_at((0.3, 0.2, 0.4), toy_map())
    evidence = evidence_for(toy_map(), (1.0, 0.0, 0.5), log_floor=-np.inf)
    log_evidence = plain.update(evidence)
    assert log_evidence is not None
    far = replace(evidence, log_likelihoods=evidence.log_likelihoods + shift)
    assert shifted.update(far) == pytest.approx(log_evidence + shift, abs=1e-6)
    np.testing.assert_allclose(shifted.belief.weights, plain.belief.weights, atol=1e-9)


def test_blind_frame_changes_nothing() -> None:
    grid = grid_at((0.3, 0.2, 0.4), toy_map())
    before = grid.belief
    assert grid.update(Evidence.blind()) is None
    assert np.array_equal(grid.belief.log_weights, before.log_weights)


def test_prior_keeps_its_mean_and_its_spread() -> None:
    grid = MarkovGrid()
    pose = np.array([0.31, -0.42, np.pi - 0.03])
    grid.reset(HALL, np.random.default_rng(0), WeightedPoses.uniform([pose], (0.09, 0.04, 0.03)))
    mean, covariance = moments(grid)
    np.testing.assert_allclose(mean, pose, atol=0.01)
    # sharing among neighbouring cells adds a quarter of a cell^2 at most
    added = np.diag(covariance) - [0.09, 0.04, 0.03]
    assert (added > -0.003).all()
    assert (added < np.array([0.25, 0.25, np.deg2rad(15.0)]) ** 2 / 4.0 + 0.003).all()


@pytest.mark.parametrize("x", [-50.0, 1e300])
def test_prior_off_the_free_area_says_nothing(x: float) -> None:
    grid, fresh = grid_at((x, 0.0, 0.0), toy_map()), MarkovGrid()
    fresh.reset(toy_map(), np.random.default_rng(0))
    np.testing.assert_allclose(grid.belief.weights, fresh.belief.weights)


def test_unknown_start_is_even_over_the_free_cells() -> None:
    grid = MarkovGrid()
    grid.reset(toy_map(), np.random.default_rng(0))
    free = toy_map().free_cells(0.25, 0.75)[2]
    assert len(grid.belief.poses) == 24 * free.sum()
    np.testing.assert_allclose(grid.belief.weights, 1.0 / (24 * free.sum()))
    np.testing.assert_allclose(grid.belief.spread, [0.25**2 / 12, 0.25**2 / 12, np.deg2rad(15.0) ** 2 / 12])


def test_kidnapped_robot_is_found_within_three_updates() -> None:
    the_map, still = toy_map(), Motion(np.zeros(3), np.diag([4e-4, 4e-4, 1e-4]))
    grid = MarkovGrid()
    grid.reset(the_map, np.random.default_rng(0))
    for place in [(0.0, 0.0, 0.5)] * 8 + [(2.0, 1.0, -2.0)] * 3:
        grid.predict(still)
        grid.update(evidence_for(the_map, place))
    assert node_masses(grid.belief, the_map)[5] > 0.9


@pytest.mark.parametrize("wrong", [{"resolution_m": 0.0}, {"reach_m": 0.1}, {"headings": 1}, {"recovery": 1.0}])
def test_settings_that_cannot_work_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="it must"):
        MarkovGrid.Config(**wrong)
