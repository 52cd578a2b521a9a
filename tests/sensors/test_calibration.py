"""How a sensor's distances become match and log-likelihood: sensors/calibration.py and sensors/neighbourhood.py."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sensors import calibration
from sensors.calibration import (
    Queries,
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
from sensors.neighbourhood import NeighbourConfig, Neighbourhood
from topoloc.geometry import Floats
from topoloc.topo_map import Camera, Node, TopoMap
from topoloc.types import Evidence

START = Scale(3.0, 0.0, 1.0, 10.0, -1.0)


def apart_of(poses: Floats) -> Floats:
    return np.asarray(np.linalg.norm(poses[:, None, :2] - poses[None, :, :2], axis=2))


def grid_poses(columns: int = 8, rows: int = 5, headings: int = 12, spacing: float = 0.5) -> Floats:
    x, y, theta = np.meshgrid(
        spacing * np.arange(columns),
        spacing * np.arange(rows),
        np.arange(headings) * 2 * np.pi / headings,
        indexing="ij",
    )
    return np.column_stack([x.ravel(), y.ravel(), theta.ravel()])


def grid_map(poses: Floats) -> TopoMap:
    places = np.unique(poses[:, :2], axis=0)
    return TopoMap(
        "grid",
        Camera(),
        tuple(Node(str(i), str(i), float(place[0]), float(place[1])) for i, place in enumerate(places)),
    )


def descriptors(poses: Floats, rng: np.random.Generator, noise: float) -> Floats:
    """Something that changes with place and heading, as views do."""
    x, y, theta = poses.T
    return np.column_stack([x, y, 2 * np.cos(theta), 2 * np.sin(theta)]) + noise * rng.normal(size=(len(poses), 4))


def test_half_is_what_95_percent_of_wrong_places_stay_below() -> None:
    rng = np.random.default_rng(0)
    distances, nodes = rng.uniform(1.0, 2.0, (40, 40)), np.arange(40)
    wrong = wrong_distance(distances, 5.0 * (1.0 - np.eye(40)), nodes)
    others = distances[~np.eye(40, dtype=bool)]
    assert np.mean(match_of(others, wrong) < 0.5) == pytest.approx(0.95, abs=0.01)
    assert match_of(np.zeros(1), wrong)[0] == 1.0


def test_what_stands_near_is_no_wrong_place() -> None:
    """A map whose nodes lie 0.5 m apart: its neighbours look alike, and rightly so."""
    poses = np.column_stack([0.5 * np.arange(20), np.zeros(20), np.zeros(20)])
    apart = apart_of(poses)
    distances = np.where(apart < 0.9, 0.01, 1.0) * (1.0 - np.eye(20))
    assert wrong_distance(distances, apart, np.arange(20)) == 1.0
    tiny = 0.1 * apart  # nothing is a metre away: then all other nodes are wrong
    assert wrong_distance(distances, tiny, np.arange(20)) == pytest.approx(0.01)
    alone = np.array([[0.0, 3.0], [3.0, 0.0]])
    assert wrong_distance(alone, np.zeros((2, 2)), np.zeros(2, dtype=np.int64)) == 3.0


@given(st.lists(st.floats(0.0, 50.0), min_size=2, max_size=9))
def test_match_falls_with_the_distance(distances: list[float]) -> None:
    match = match_of(np.sort(distances), 1.3)
    assert (np.diff(match) <= 0).all()
    assert ((match >= 0.0) & (match <= 1.0)).all()


def test_density_is_counted_in_parts_as_in_one() -> None:
    poses = grid_poses(headings=12)
    assert len(poses) > 256
    squared = apart_of(poses) ** 2
    turned = np.cos(poses[:, None, 2] - poses[None, :, 2]) - 1.0
    plain = np.log(np.exp(-squared / (2.0 * 0.4**2) + 9.0 * turned).sum(axis=1))
    np.testing.assert_allclose(log_density(poses, 0.4, 9.0), plain)


@pytest.mark.parametrize(("sigma", "kappa"), [(0.4, 9.0), (0.4, 0.0), (0.05, 400.0), (30.0, 0.5)])
@pytest.mark.parametrize("off", [0.0, 5e6])
def test_density_of_many_views_is_counted_in_reach_alone(
    sigma: float, kappa: float, off: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As over all pairs: on a wide grid, with copies, with stragglers, at coordinates as surveyors have them."""
    rng = np.random.default_rng(0)
    poses = np.concatenate([grid_poses(20, 15, 3), np.repeat(grid_poses(1, 1, 1), 200, axis=0)])
    poses = poses + rng.normal(size=poses.shape) * [0.1, 0.1, 0.3]
    poses[:5, :2] += 1e4
    poses[:, :2] += off
    plain = log_density(poses, sigma, kappa)
    monkeypatch.setattr(calibration, "ALL_PAIRS", 10)
    np.testing.assert_allclose(log_density(poses, sigma, kappa), plain, rtol=0.0, atol=1e-11)


def test_spacing_and_steps_of_a_grid() -> None:
    poses = grid_poses(spacing=0.75, headings=24)
    nodes = grid_map(poses).nearest_node(poses[:, :2])
    assert spacing_of(poses[:, :2]) == pytest.approx(0.75)
    assert kappa_of(poses[:, 2], nodes) == pytest.approx(1.0 / np.deg2rad(15.0) ** 2)
    assert spacing_of(poses[:1, :2]) == 0.0
    np.testing.assert_array_equal(spread_out(3), [0, 1, 2])
    assert len(spread_out(5000)) == 256
    assert len(spread_out(400_000)) == 10, "4 million pairs at most"


def test_steps_of_headings_go_round_the_circle_and_copies_are_none() -> None:
    def kappa(*degrees: float, nodes: tuple[int, ...] | None = None) -> float | None:
        places = np.zeros(len(degrees), dtype=np.int64) if nodes is None else np.array(nodes)
        return kappa_of(np.deg2rad(degrees), places)

    assert kappa(-5.0, 5.0, 15.0, 25.0) == pytest.approx(1.0 / np.deg2rad(10.0) ** 2), "whatever the rest of the circle"
    assert kappa(0.0, 90.0, 180.0, 270.0) == pytest.approx(0.5), "1 / 90 degrees squared is below the least"
    fifteen = tuple(np.arange(0.0, 360.0, 15.0))
    assert kappa(*fifteen) == pytest.approx(14.6, rel=0.05)
    assert kappa(0.5, *fifteen) == pytest.approx(14.6, rel=0.05)
    assert kappa(10.0) is None
    assert kappa(10.0, 40.0, nodes=(0, 1)) is None, "one heading a place tells nothing"


def test_cuts_are_counted_by_places_and_headings() -> None:
    poses = grid_poses(4, 3, 24, 1.0)
    np.testing.assert_allclose(log_density_of_cuts(poses, 0.6, 20.0), log_density(poses, 0.6, 20.0))


def test_a_held_out_position_is_not_among_its_own_neighbours() -> None:
    poses = grid_poses()
    rows = spread_out(len(poses), 50)
    made = descriptors(poses, np.random.default_rng(1), 0.0)
    distances = np.linalg.norm(made[rows, None] - made[None], axis=2)
    shaken = poses + np.array([0.02, 0.02, 0.0]) * np.random.default_rng(2).uniform(-1.0, 1.0, poses.shape)
    for views in (poses, shaken):
        held = held_out(views, rows, distances, lambda distance: -distance, 10, 0.5)
        assert held is not None
        nearest, queries = held
        assert queries.distance_m.min() > 0.4
        assert queries.score.shape == nearest.shape == (50, 10)
        assert (np.diff(queries.score, axis=1) <= 0.0).all()
        np.testing.assert_allclose(
            queries.distance_m[:, 0], np.linalg.norm((views[nearest[:, 0]] - views[rows])[:, :2], axis=1)
        )
    alone = poses[:12]
    assert held_out(alone, np.arange(3), distances[:3, :12], lambda distance: -distance, 10, 0.5) is None


def neighbourhood_of(poses: Floats, topo_map: TopoMap, noise: float = 0.5) -> tuple[Neighbourhood, Floats]:
    made = descriptors(poses, np.random.default_rng(2), noise)
    between = np.linalg.norm(made[:, None] - made[None], axis=2)
    return Neighbourhood(topo_map, poses, partial(np.take, between, axis=0), NeighbourConfig()), made


@pytest.mark.parametrize("sd_m", [1e-5, 0.02])
def test_positions_need_not_agree_to_the_micrometre(sd_m: float) -> None:
    """Measured poses, or a camera beside the axis that its head turns on."""
    poses = grid_poses()
    topo_map = grid_map(poses)
    exact = neighbourhood_of(poses, topo_map)[0].scale
    shaken = poses.copy()
    shaken[:, :2] += sd_m * np.random.default_rng(3).normal(size=(len(poses), 2))
    scale = neighbourhood_of(shaken, topo_map)[0].scale
    assert scale.sigma_m == pytest.approx(exact.sigma_m, rel=0.2)
    assert scale.kappa == pytest.approx(exact.kappa, rel=0.2)
    assert scale.slope == pytest.approx(exact.slope, rel=0.3)


def drawn(scale: Scale, area: float, rng: np.random.Generator, count: int = 4000) -> Queries:
    """Looks from poses drawn from the likelihood itself: one hypothesis of any score each, over a large square."""
    score = rng.uniform(0.0, 1.0, count)
    mass = np.exp(scale.slope * score) * 2.0 * np.pi * scale.sigma_m**2 / area
    near = rng.random(count) < mass / (mass + np.exp(scale.log_floor))
    side = np.sqrt(area)
    way = np.where(
        near[:, None], scale.sigma_m * rng.normal(size=(count, 2)), rng.uniform(-side / 2, side / 2, (count, 2))
    )
    turn = np.where(near, rng.vonmises(0.0, scale.kappa, count), rng.uniform(-np.pi, np.pi, count))
    return Queries(score[:, None], np.zeros((count, 1)), np.linalg.norm(way, axis=1)[:, None], turn[:, None])


def test_the_scale_that_looks_were_drawn_with_is_found_again() -> None:
    true, area = Scale(4.0, 0.0, 0.5, 15.0, -1.0), 100.0
    found = likeliest_scale(drawn(true, area, np.random.default_rng(5)), area, START, ("slope", "sigma_m", "kappa"))
    assert found.slope == pytest.approx(4.0, rel=0.2)
    assert found.sigma_m == pytest.approx(0.5, rel=0.05)
    assert found.kappa == pytest.approx(15.0, rel=0.1)
    assert found.log_floor - found.level == pytest.approx(-1.0, abs=0.3)


def test_a_rank_keeps_its_slope_and_an_unknown_heading_its_kappa() -> None:
    queries = drawn(Scale(1.0, 0.0, 0.5, 15.0, -1.0), 400.0, np.random.default_rng(6))
    found = likeliest_scale(replace(queries, turn=None), 400.0, START, ("sigma_m",))
    assert (found.slope, found.kappa) == (START.slope, START.kappa)
    assert found.sigma_m == pytest.approx(0.5, rel=0.2)


def test_the_mean_likelihood_over_the_map_is_one() -> None:
    """In the geometric mean over held-out views; so LOST, judged by p(evidence | past), means the same everywhere."""
    poses = grid_poses()
    topo_map = grid_map(poses)
    neighbourhood, made = neighbourhood_of(poses, topo_map)
    logs = []
    for row in spread_out(len(poses)):
        left = np.linalg.norm(poses[:, :2] - poses[row, :2], axis=1) > 0.1
        distance = np.where(left, np.linalg.norm(made - made[row], axis=1), np.inf)
        chosen = neighbourhood.nearest(distance)
        scale = replace(neighbourhood.scale, best=np.inf)
        neighbourhood.scale, capped = scale, neighbourhood.scale
        evidence = neighbourhood.evidence(chosen, distance[chosen], poses[chosen])
        neighbourhood.scale = capped
        logs.append(np.logaddexp(evidence.log_floor, evidence.log_mass - np.log(len(topo_map.nodes) * 0.25)))
    assert np.mean(logs) == pytest.approx(0.0, abs=0.01)


def test_a_match_beyond_all_that_is_known_is_taken_for_no_more() -> None:
    """A frame that is a view of the map: its likelihood is not the exponential of that."""
    poses = grid_poses()
    neighbourhood, made = neighbourhood_of(poses, grid_map(poses))
    distance = np.linalg.norm(made - made[100], axis=1)
    chosen = neighbourhood.nearest(distance)
    evidence = neighbourhood.evidence(chosen, distance[chosen], poses[chosen])
    scale = neighbourhood.scale
    ratios = evidence.log_likelihoods + neighbourhood._log_density[chosen]
    assert ratios.max() == pytest.approx(scale.slope * scale.best + scale.level)
    np.testing.assert_allclose(np.diff(ratios), scale.slope * np.diff(evidence.match))


def test_equal_pictures_of_wrong_places_leave_a_scale() -> None:
    same = np.zeros((4, 4))
    apart = 5.0 * (1.0 - np.eye(4))
    assert wrong_distance(same, apart, np.arange(4)) == 1.0
    some = same.copy()
    some[0, 3] = some[3, 0] = 2.0
    assert wrong_distance(some, apart, np.arange(4)) == 2.0


def test_sharper_descriptors_claim_more() -> None:
    poses = grid_poses()
    slopes = []
    for noise in (0.05, 1.5):
        made = descriptors(poses, np.random.default_rng(3), noise)
        between = np.linalg.norm(made[:, None] - made[None], axis=2)
        neighbourhood = Neighbourhood(grid_map(poses), poses, partial(np.take, between, axis=0), NeighbourConfig())
        chosen = neighbourhood.nearest(between[0])
        evidence = neighbourhood.evidence(chosen, between[0, chosen], poses[chosen])
        here = evidence.log_likelihood(poses[:1, :2], poses[:1, 2:])[0, 0]
        slopes.append(here)
    assert slopes[0] > slopes[1] + 0.5


def test_weights_by_rank_are_the_seeds() -> None:
    """lambda_j = 2 (J - j + 1) / (J^2 + J), up to the factor J: EQUATIONS.md, 2."""
    poses = grid_poses()
    made = descriptors(poses, np.random.default_rng(4), 0.1)
    between = np.linalg.norm(made[:, None] - made[None], axis=2)
    config = NeighbourConfig(weighting="rank", neighbours=4, calibrated=False)
    neighbourhood = Neighbourhood(grid_map(poses), poses, lambda rows: between[rows], config)
    chosen = neighbourhood.nearest(between[30])
    evidence = neighbourhood.evidence(chosen, between[30, chosen], poses[chosen])
    weights = np.exp(evidence.log_likelihoods + log_density(poses, config.sigma_m, config.kappa)[chosen])
    np.testing.assert_allclose(weights / weights.sum(), [0.4, 0.3, 0.2, 0.1])


def test_nearest_first_and_all_where_none_is_told() -> None:
    poses = grid_poses(3, 3, 1)
    between = np.arange(9.0)[::-1]
    some = Neighbourhood(grid_map(poses), poses, lambda rows: apart_of(poses)[rows], NeighbourConfig(neighbours=3))
    np.testing.assert_array_equal(some.nearest(between), [8, 7, 6])
    every = Neighbourhood(grid_map(poses), poses, lambda rows: apart_of(poses)[rows], NeighbourConfig(neighbours=0))
    assert len(every.nearest(between)) == 9


def likelihood_of(poses: Floats, places: Floats) -> Floats:
    """Log-likelihood at places (P, 3) of views that all match alike, their density taken out."""
    count = len(poses)
    ones = np.ones(count)
    ratio = 1.5 - log_density(poses, 0.5, 8.0)
    evidence = Evidence(poses, np.zeros(count, dtype=np.int64), ones, ones, ratio, 0.5 * ones, 8.0 * ones)
    return np.array([evidence.log_likelihood(place[None, :2], place[None, 2:])[0, 0] for place in places])


def test_a_corner_photographed_twice_changes_nothing() -> None:
    """EQUATIONS.md, 4. Copies of all views change nothing at all, of some only where others stand close by."""
    rng = np.random.default_rng(1)
    poses = np.column_stack([rng.uniform(0, 4, (20, 2)), rng.uniform(-3, 3, 20)])
    once = likelihood_of(poses, poses)
    np.testing.assert_allclose(likelihood_of(np.concatenate([poses, poses]), poses), once, atol=1e-12)
    part = likelihood_of(np.concatenate([poses, poses[:7]]), poses)
    assert np.abs(part - once).max() < 0.3
    assert np.median(np.abs(part - once)) < 0.02
    ten_times = likelihood_of(np.concatenate([poses] + [poses[:1]] * 9), poses)
    assert ten_times[0] - once[0] < 0.3  # without the density: log 10


def test_settings_that_make_no_sense_are_refused() -> None:
    for bad in ({"neighbours": -1}, {"sigma_m": 0.0}, {"kappa": -1.0}):
        with pytest.raises(ValueError, match="must"):
            replace(NeighbourConfig(), **bad)
