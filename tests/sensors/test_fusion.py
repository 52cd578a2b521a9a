"""The product (7) and the weighted sum (8) of what several sensors say (second seed, section 5)."""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import i0e

from benchmarks.cli.bench import bench
from benchmarks.cli.simulate import simulate
from benchmarks.results import read_results
from benchmarks.worlds import LabWorld, Simulation, WorldSettings
from estimators.markov import MarkovGrid
from sensors.fusion import Mix, MixConfig, Product, ProductConfig, mixture_of, product_of
from sensors.histogram import ColorHistogram
from sensors.ima import IMA
from topoloc.cli.main import run
from topoloc.errors import UserError
from topoloc.localizer import Localizer
from topoloc.testing import check_sensor, toy_map
from topoloc.topo_map import TopoMap
from topoloc.types import Evidence, Frame

MAP = toy_map(6, 5)
EXACT = ProductConfig(tolerance=0.0, most=10**6)
SMALL = settings(max_examples=40, deadline=None)


def drawn(seed: int, count: int = 6, log_floor: float | None = None) -> Evidence:
    """Evidence on ``MAP`` with hypotheses of every kind: known, unknown and all but certain headings."""
    rng = np.random.default_rng(seed)
    poses = np.column_stack([rng.uniform(-1, 6, count), rng.uniform(-1, 5, count), rng.uniform(-np.pi, np.pi, count)])
    return Evidence(
        poses=poses,
        nodes=MAP.nearest_node(poses[:, :2]),
        match=rng.uniform(0.0, 1.0, count),
        distance=rng.uniform(0.0, 3.0, count),
        log_likelihoods=rng.normal(0.0, 2.0, count),
        sigma=rng.uniform(0.1, 1.5, count),
        kappa=rng.choice([0.0, 0.5, 20.0, 400.0], count),
        log_floor=rng.uniform(-6.0, -1.0) if log_floor is None else log_floor,
    )


def at(evidence: Evidence, seed: int = 0) -> np.ndarray:
    """Log-likelihoods at poses all over the map, and at the hypotheses."""
    rng = np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(-3, 8, 60), rng.uniform(-3, 7, 60)])
    return evidence.log_likelihood(places, rng.uniform(-np.pi, np.pi, (60, 4)))


def product(parts: Sequence[Evidence], config: ProductConfig = EXACT) -> Evidence:
    return product_of(parts, MAP.nearest_node, config)


@SMALL
@given(st.integers(0, 10**6), st.integers(1, 7), st.integers(1, 7))
def test_log_likelihoods_of_a_product_add_up(seed: int, one: int, other: int) -> None:
    a, b = drawn(seed, one), drawn(seed + 1, other)
    both = product([a, b])
    assert len(both.poses) == one + other + one * other
    assert both.log_floor == a.log_floor + b.log_floor
    np.testing.assert_allclose(at(both), at(a) + at(b), atol=1e-9)
    np.testing.assert_array_equal(both.nodes, [*a.nodes, *b.nodes, *MAP.nearest_node(both.poses[one + other :, :2])])


@SMALL
@given(st.integers(0, 10**6), st.floats(0.05, 0.95))
def test_the_mix_is_the_weighted_sum(seed: int, share: float) -> None:
    a, b = drawn(seed), drawn(seed + 1)
    expected = np.log(share * np.exp(at(a)) + (1.0 - share) * np.exp(at(b)))
    np.testing.assert_allclose(at(mixture_of([a, b], (share, 1.0 - share))), expected, atol=1e-9)
    np.testing.assert_allclose(at(mixture_of([a, b], (3.0 * share, 3.0 - 3.0 * share))), expected, atol=1e-9)


def sorted_rows(evidence: Evidence) -> np.ndarray:
    """All that the hypotheses are, in an order of its own."""
    names = ("log_likelihoods", "sigma", "kappa", "nodes", "match", "distance")
    rows = np.column_stack([evidence.poses, *(getattr(evidence, name) for name in names)])
    return rows[np.lexsort(np.round(rows, 6).T)]


@SMALL
@given(st.integers(0, 10**6))
def test_the_order_of_sensors_does_not_matter(seed: int) -> None:
    a, b, c = (drawn(seed + k, 4) for k in range(3))
    np.testing.assert_allclose(sorted_rows(product([a, b])), sorted_rows(product([b, a])), atol=1e-9)
    np.testing.assert_allclose(
        sorted_rows(mixture_of([a, b], (2.0, 1.0))), sorted_rows(mixture_of([b, a], (1.0, 2.0))), atol=1e-9
    )
    np.testing.assert_allclose(at(product([a, b, c])), at(product([c, a, b])), atol=1e-9)


@SMALL
@given(st.integers(0, 10**6))
def test_how_sensors_are_bracketed_does_not_matter(seed: int) -> None:
    a, b, c = (drawn(seed + k, 4) for k in range(3))
    for nested in (product([product([a, b]), c]), product([a, product([b, c])])):
        np.testing.assert_allclose(at(nested), at(product([a, b, c])), atol=1e-9)
    halves = mixture_of([mixture_of([a, b], (0.5, 0.5)), c], (0.5, 0.5))
    np.testing.assert_allclose(at(halves), at(mixture_of([a, b, c], (1.0, 1.0, 2.0))), atol=1e-9)


def test_of_two_von_mises_comes_one_however_narrow() -> None:
    """Concentrations whose Bessel functions overflow; numbers by hand."""
    first = replace(drawn(0, 1), kappa=np.array([1e6]), sigma=np.array([0.3]))
    second = replace(
        first, kappa=np.array([2e6]), poses=first.poses + np.array([0.0, 0.4, 1e-3]), sigma=np.array([0.4])
    )
    pair = product([first, second])
    assert pair.kappa[2] == pytest.approx(np.hypot(1e6 + 2e6 * np.cos(1e-3), 2e6 * np.sin(1e-3)))
    assert pair.sigma[2] == pytest.approx(0.24)
    np.testing.assert_allclose(pair.poses[2] - first.poses[0], [0.0, 0.4 * 0.09 / 0.25, 2e-3 / 3.0], atol=1e-8)
    constant = -0.16 / 0.5 - (3e6 - pair.kappa[2]) + np.log(i0e(pair.kappa[2]) / (i0e(1e6) * i0e(2e6)))
    together = first.log_likelihoods[0] + second.log_likelihoods[0] + constant
    assert pair.log_likelihoods[2] == pytest.approx(together, abs=1e-6)
    opposed = replace(first, kappa=np.array([3.0]))
    other = replace(opposed, poses=opposed.poses + np.array([0.0, 0.0, np.pi]))
    assert product([opposed, other]).kappa[2] == pytest.approx(0.0, abs=1e-9)
    np.testing.assert_allclose(at(product([opposed, other])), at(opposed) + at(other), atol=1e-9)


@pytest.mark.parametrize("tolerance", [1e-1, 1e-3, 1e-6])
def test_pruning_changes_the_log_likelihood_by_less_than_it_says(tolerance: float) -> None:
    a, b, c = drawn(1, 40, -3.0), drawn(2, 40, -4.0), drawn(3, 10, -2.0)
    whole, pruned = product([a, b, c]), product([a, b, c], ProductConfig(tolerance, 10**6))
    assert len(pruned.poses) < 0.8 * len(whole.poses)
    change = at(whole) - at(pruned)
    assert change.min() > -1e-9
    assert change.max() < tolerance
    on_hypotheses = [
        one.log_likelihood(whole.poses[::50, :2], whole.poses[::50, 2:]).ravel() for one in (whole, pruned)
    ]
    assert np.abs(on_hypotheses[0] - on_hypotheses[1]).max() < tolerance


def test_many_hypotheses_are_never_all_multiplied() -> None:
    """4000 by 4000 would be 16 million, of gigabytes; what holds most probability stays."""
    a, b = drawn(4, 4000, -3.0), drawn(5, 4000, -3.0)
    both = product([a, b], ProductConfig(most=50))
    assert len(both.poses) == 50
    masses = a.log_likelihoods + 2.0 * np.log(a.sigma)
    least = np.sort(masses)[-50]
    few = product([replace_rows(a, masses >= least), b], ProductConfig(most=50))
    np.testing.assert_array_equal(few.poses, both.poses)
    np.testing.assert_array_equal(few.log_likelihoods, both.log_likelihoods)


def replace_rows(evidence: Evidence, kept: np.ndarray) -> Evidence:
    names = ("poses", "nodes", "match", "distance", "log_likelihoods", "sigma", "kappa")
    return replace(evidence, **{name: getattr(evidence, name)[kept] for name in names})


def test_hypotheses_of_weight_zero_do_not_make_it_blind() -> None:
    nothing = replace(drawn(0, 3), log_likelihoods=np.full(3, -np.inf), log_floor=-np.inf)
    for fused in (product([nothing, nothing]), mixture_of([nothing, nothing], (1.0, 1.0))):
        assert not fused.is_blind
        assert (at(fused) == -np.inf).all()
        assert np.isfinite(fused.match).all() and np.isfinite(fused.distance).all()
    a = drawn(1, 3)
    np.testing.assert_allclose(at(mixture_of([nothing, a], (1.0, 1.0))), at(a) - np.log(2.0), atol=1e-9)


class TestBlindParts:
    def test_a_product_is_what_the_other_says(self) -> None:
        a, blind = drawn(0), Evidence.blind()
        for parts in ([a, blind], [blind, a]):
            np.testing.assert_array_equal(sorted_rows(product(parts)), sorted_rows(a))
        assert product([blind, blind]).is_blind

    def test_in_a_mix_it_says_one(self) -> None:
        a, blind = drawn(0), Evidence.blind()
        np.testing.assert_allclose(at(mixture_of([a, blind], (3.0, 1.0))), np.log(0.75 * np.exp(at(a)) + 0.25))
        assert mixture_of([blind, blind], (1.0, 1.0)).is_blind


def single(node: int, log_likelihood: float, log_floor: float) -> Evidence:
    """One hypothesis, on a node."""
    one = np.ones(1)
    pose = np.array([[*MAP.positions[node], 0.3]])
    return Evidence(
        pose, np.array([node]), 0.8 * one, one, log_likelihood * one, 0.3 * one, 20.0 * one, log_floor=log_floor
    )


class TestOneWrongMatch:
    """The seed: wrong matches make (7) almost null, and (8) takes all hypotheses into account."""

    TRUTH, WRONG = 0, len(MAP.nodes) - 1

    def likelihood(self, evidence: Evidence, node: int) -> float:
        return float(evidence.log_likelihood(MAP.positions[node][None], np.array([[0.3]]))[0, 0])

    def test_it_nulls_the_product_and_not_the_mix(self) -> None:
        """As in the seed, whose models have no floor: nothing remains of the place that one of the two found."""
        right, wrong = single(self.TRUTH, 3.0, -np.inf), single(self.WRONG, 3.0, -np.inf)
        alone = self.likelihood(right, self.TRUTH)
        assert self.likelihood(mixture_of([right, wrong], (1.0, 1.0)), self.TRUTH) == pytest.approx(alone - np.log(2))
        conjunctive = product([right, wrong])
        assert self.likelihood(conjunctive, self.TRUTH) < alone - 200.0
        assert conjunctive.log_mass < min(right.log_mass, wrong.log_mass) - 100.0

    def test_a_floor_leaves_something(self) -> None:
        """With ours the wrong match costs its floor, no more: the truth stays as likely as the wrong place."""
        right, wrong = single(self.TRUTH, 3.0, -4.0), single(self.WRONG, 3.0, -4.0)
        conjunctive = product([right, wrong])
        assert self.likelihood(conjunctive, self.TRUTH) == pytest.approx(self.likelihood(right, self.TRUTH) - 4.0)
        assert self.likelihood(conjunctive, self.TRUTH) == pytest.approx(self.likelihood(conjunctive, self.WRONG))

    def test_where_they_agree_the_product_is_the_surer(self) -> None:
        parts = [single(self.TRUTH, 3.0, -4.0)] * 2
        leads = [
            self.likelihood(fused, self.TRUTH) - self.likelihood(fused, self.WRONG)
            for fused in (product(parts), mixture_of(parts, (1.0, 1.0)))
        ]
        assert leads[0] == pytest.approx(2.0 * leads[1])


class TestMatch:
    """Node 0 is known to both sensors, node 1 to the first, node 2 to the second."""

    def parts(self) -> list[Evidence]:
        sigma, kappa = np.full(2, 0.3), np.full(2, 20.0)
        poses = np.column_stack([MAP.positions[:3], np.zeros(3)])
        a = Evidence(
            poses[[0, 1]], np.array([0, 1]), np.array([0.9, 0.4]), np.array([0.2, 1.4]), np.zeros(2), sigma, kappa
        )
        b = Evidence(
            poses[[0, 2]], np.array([0, 2]), np.array([0.4, 0.6]), np.array([1.0, 0.8]), np.zeros(2), sigma, kappa
        )
        return [a, b]

    def best(self, fused: Evidence) -> tuple[np.ndarray, np.ndarray]:
        chosen = fused.best_per_node()
        least = [fused.distance[fused.nodes == node].min() for node in fused.nodes[chosen]]
        return fused.match[chosen], np.array(least)

    def test_of_a_product_it_is_the_geometric_mean(self) -> None:
        match, distance = self.best(product(self.parts()))
        np.testing.assert_allclose(match, np.sqrt([0.9 * 0.4, 0.4 * 0.4, 0.4 * 0.6]))
        np.testing.assert_allclose(distance, [0.6, (1.4 + 1.0) / 2, (1.4 + 0.8) / 2])

    def test_of_a_mix_it_is_the_best_of_any(self) -> None:
        match, distance = self.best(mixture_of(self.parts(), (0.75, 0.25)))
        np.testing.assert_allclose(match, [0.9, 0.4, 0.6])
        np.testing.assert_allclose(distance, [0.2, 1.0, 0.8])

    def test_a_nodes_best_is_the_heading_that_both_name(self) -> None:
        """One sensor wavers between two headings; the other decides, however it matches."""
        a, b = self.parts()
        poses = np.array([[*MAP.positions[0], 0.0], [*MAP.positions[0], 2.0]])
        wavering = replace(a, poses=poses, nodes=np.zeros(2, dtype=np.int64), match=np.array([0.9, 0.88]))
        sure = replace(b, poses=poses + np.array([[0.0, 0.0, 0.1], [5.0, 4.0, 0.0]]), match=np.array([0.5, 0.2]))
        turned = replace(sure, poses=sure.poses + np.array([0.0, 0.0, 2.0]))
        for expected, decided in ((0.05, sure), (2.05, turned)):
            fused = product([wavering, decided])
            best = fused.best_per_node()[0]
            assert fused.nodes[best] == 0
            assert fused.poses[best, 2] == pytest.approx(expected, abs=1e-6)


class Fixed:
    """A sensor that says what it is told."""

    def __init__(self, evidence: Evidence, needs: frozenset[str] = frozenset({"rgb"})) -> None:
        self.evidence, self.needs, self.fitted = evidence, needs, False

    def fit(self, topo_map: TopoMap) -> None:
        self.fitted = True

    def observe(self, frame: Frame) -> Evidence:
        return self.evidence


FRAME = Frame(0.0, None, np.zeros(3), {"rgb": np.zeros((4, 4, 3), np.uint8)})


@cache
def drive() -> Simulation:
    return LabWorld(WorldSettings(updates=9)).simulate(seed=1001)


class TestSensors:
    def test_parts_are_fitted_and_asked(self) -> None:
        parts = [Fixed(drawn(0)), Fixed(drawn(1), frozenset({"rgb", "right"})), Fixed(drawn(2))]
        nested = Mix([parts[0], Product(parts[1:], EXACT)], MixConfig((0.3, 0.7)))
        assert nested.needs == {"rgb", "right"}
        nested.fit(MAP)
        assert all(part.fitted for part in parts)
        first, *others = (part.evidence for part in parts)
        expected = mixture_of([first, product(others)], (0.3, 0.7))
        np.testing.assert_array_equal(at(nested.observe(FRAME)), at(expected))

    def test_weights_are_as_many_as_sensors_and_positive(self) -> None:
        parts = [Fixed(drawn(0)), Fixed(drawn(1))]
        with pytest.raises(ValueError, match="3 values for 2 sensors"):
            Mix(parts, MixConfig((1.0, 1.0, 1.0)))
        with pytest.raises(ValueError, match="positive"):
            MixConfig((1.0, 0.0))
        with pytest.raises(ValueError, match="two or more"):
            Product(parts[:1])
        for wrong in ({"tolerance": -1.0}, {"most": 0}):
            with pytest.raises(ValueError, match=next(iter(wrong))):
                ProductConfig(**wrong)

    def test_a_map_that_one_cannot_use_is_refused(self) -> None:
        with pytest.raises(UserError, match="views or panoramas"):
            Product([Fixed(drawn(0)), ColorHistogram()]).fit(MAP)

    @pytest.mark.parametrize("kind", [Product, Mix])
    def test_real_ones_keep_the_contract_and_find_the_robot(self, kind: type[Product] | type[Mix]) -> None:
        simulation = drive()
        sensor = kind([IMA(), ColorHistogram()])
        check_sensor(sensor, simulation.topo_map, simulation.frames[:3])
        localizer = Localizer(simulation.topo_map, sensor, MarkovGrid())
        named = [localizer.step(frame).node for frame in simulation.frames]
        right = simulation.topo_map.nearest_node(simulation.truth[:, :2])
        assert np.mean(np.array(named[3:]) == right[3:]) > 0.6


class TestCommands:
    def test_a_benchmark_has_a_row_of_each(self, tmp_path: Path) -> None:
        names = ["mix( histogram, ima)", "ima+histogram"]
        bench(
            scenarios=["lab-fresh"],
            sensors=names,
            estimators=["grid"],
            seeds=1,
            updates=3,
            jobs=1,
            out=tmp_path / "run",
        )
        rows = read_results(tmp_path / "run" / "results.csv")
        assert [(row.sensor, row.status) for row in rows] == [("ima+histogram", "ok"), ("mix(histogram,ima)", "ok")]
        config = tomllib.loads((tmp_path / "run" / "config.toml").read_text())
        assert config["run"]["sensors"] == ["mix(histogram,ima)", "ima+histogram"]
        assert "'mix(histogram,ima)' ima+histogram" in config["run"]["command"]
        assert config["sensors"]["ima+histogram"]["most"] == ProductConfig().most
        assert config["sensors"]["mix(histogram,ima)"]["histogram"]["bins"] == 24
        bench(resume=tmp_path / "run", jobs=1)
        with pytest.raises(UserError, match="no sensor is called 'imma'"):
            bench(sensors=["ima+imma"], out=tmp_path / "other")
        assert not (tmp_path / "other").exists()

    def test_a_recording_is_localized_by_two_sensors(self, tmp_path: Path) -> None:
        simulate("lab", output=tmp_path / "lab", settings=("updates=4",))
        words = ["localize", str(tmp_path / "lab" / "map"), str(tmp_path / "lab" / "recording"), "--sensor"]
        words += ["mix(ima,histogram)", "--set", "sensor.weights=0.7,0.3", "--set", "sensor.histogram.bins=12"]
        assert run([*words, "-o", str(tmp_path / "run"), "--estimator", "grid"]) == 0
        assert (tmp_path / "run" / "steps.csv").exists()
        assert run([*words, "--set", "sensor.ima.slits=3", "-o", str(tmp_path / "other")]) == 2
